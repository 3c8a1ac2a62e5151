//! The shifted LR iteration on a matrix in Hessenberg form.

use std::array::from_fn;

use nalgebra::Complex;

use super::pairs;
use crate::algebra::vectors::two::Two;

/// Sweeps a single eigenvalue may take before the matrix is given up; about three are usual.
const MAX_SWEEPS: usize = 60;

/// A pivot smaller than this beside the largest entry is exchanged, so that multipliers stay below its inverse. To exchange
/// whenever there is a larger entry takes a quarter longer, for a branch that cannot be predicted; at a tenth the eigenvalues
/// err five times as much.
const SMALL_PIVOT: f64 = 0.3;

/// The error of the eigenvalues' sum over the norm, and of the sum of their squares over its square, from which on they are
/// given up; as a rule it is below 1e-13.
const LOST: f64 = 1e-10;

/// Eigenvalues of an upper Hessenberg matrix by the implicit double-shift LR iteration; of its entries below the subdiagonal
/// none is read.
///
/// `None` also where the multipliers have grown so much that too little is left of the eigenvalues.
pub(super) fn hessenberg_eigenvalues<const N: usize>(h: &mut [[f64; N]; N]) -> Option<[Complex<f64>; N]> {
    for (i, row) in h.iter_mut().enumerate().skip(2) {
        row[..i - 1].fill(0.0);
    }
    let norm = h.iter().flatten().map(|x| x.abs()).sum();
    // The traces of H and H², in which only neighbours meet.
    let (mut trace, mut trace_of_square) = (h[0][0], h[0][0] * h[0][0]);
    for i in 1..N {
        trace += h[i][i];
        trace_of_square += h[i][i] * h[i][i] + 2.0 * h[i][i - 1] * h[i - 1][i];
    }
    let values = deflate(h, norm)?;
    for z in values {
        trace -= z.re;
        trace_of_square -= z.re * z.re - z.im * z.im;
    }
    (trace.abs() <= LOST * norm && trace_of_square.abs() <= LOST * norm * norm).then_some(values)
}

/// The LR iteration, and what it splits off.
fn deflate<const N: usize>(h: &mut [[f64; N]; N], norm: f64) -> Option<[Complex<f64>; N]> {
    let mut values = [Complex::new(0.0, 0.0); N];
    let (mut active, mut exceptional_shift, mut sweep) = (N, 0.0, 0);
    while active > 0 {
        let last = active - 1;
        let first = block_start(h, last, norm);
        let corner = h[last][last];
        if first == last {
            values[last] = Complex::new(corner + exceptional_shift, 0.0);
            (active, sweep) = (last, 0);
            continue;
        }
        let above = h[last - 1][last - 1];
        let product = h[last][last - 1] * h[last - 1][last];
        if first + 1 == last {
            let (x, y) = pair(above, corner, product);
            values[last - 1] = x + exceptional_shift;
            values[last] = y + exceptional_shift;
            (active, sweep) = (last - 1, 0);
            continue;
        }
        if sweep == MAX_SWEEPS {
            return None;
        }
        let mut shift = Shift { x: corner, y: above, w: product };
        if sweep % 10 == 9 {
            // The iteration stalls on matrices that its own shift leaves alone: an unrelated one moves it.
            exceptional_shift += corner;
            for i in 0..active {
                h[i][i] -= corner;
            }
            let s = h[last][last - 1].abs() + h[last - 1][last - 2].abs();
            shift = Shift { x: 0.75 * s, y: 0.75 * s, w: -0.4375 * s * s };
        }
        sweep += 1;
        lr_sweep(h, first, last, &shift);
    }
    Some(values)
}

/// The first row of the unreduced block that ends at `last`.
fn block_start<const N: usize>(h: &[[f64; N]; N], last: usize, norm: f64) -> usize {
    let mut below = h[last][last].abs();
    for l in (1..=last).rev() {
        let above = h[l - 1][l - 1].abs();
        // The last term is for zeros on the diagonal.
        let neighbours = above + below + f64::EPSILON * norm;
        if h[l][l - 1].abs() <= f64::EPSILON * 0.5 * neighbours {
            return l;
        }
        below = above;
    }
    0
}

/// The eigenvalues of `[[above, b], [c, corner]]` with `product = b c`.
fn pair(above: f64, corner: f64, product: f64) -> (Complex<f64>, Complex<f64>) {
    let p = 0.5 * (above - corner);
    let q = p * p + product;
    let z = q.abs().sqrt();
    if q < 0.0 {
        return (Complex::new(corner + p, z), Complex::new(corner + p, -z));
    }
    let z = p + z.copysign(p);
    let other = if z == 0.0 { corner } else { corner - product / z };
    (Complex::new(corner + z, 0.0), Complex::new(other, 0.0))
}

/// The two shifts, as the trace and product of a trailing 2 × 2 block need them.
struct Shift {
    x: f64,
    y: f64,
    w: f64,
}

/// The first column of `(H − x I)(H − y I)` on the block that starts at `k`, up to scale, for the two shifts `x, y`.
fn bulge<const N: usize>(h: &[[f64; N]; N], k: usize, shift: &Shift) -> [f64; 3] {
    let (z, below) = (h[k][k], h[k + 1][k]);
    let (r, s) = (shift.x - z, shift.y - z);
    let v = [
        r * s - shift.w + below * h[k][k + 1],
        below * (h[k + 1][k + 1] - z - r - s),
        below * h[k + 2][k + 1],
    ];
    let over_size = 1.0 / (v[0].abs() + v[1].abs() + v[2].abs());
    v.map(|x| x * over_size)
}

/// One implicit double-shift sweep on the block `first..=last`: a 3 × 3 bulge is chased down by elimination.
fn lr_sweep<const N: usize>(h: &mut [[f64; N]; N], first: usize, last: usize, shift: &Shift) {
    let mut v = bulge(h, first, shift);
    for k in first..last - 1 {
        if k > first {
            v = [h[k][k - 1], h[k + 1][k - 1], h[k + 2][k - 1]];
        }
        v = lr_step(h, k, first, last, v);
        if k > first {
            h[k][k - 1] = v[0];
            h[k + 1][k - 1] = 0.0;
            h[k + 2][k - 1] = 0.0;
        }
    }
    let k = last - 1;
    let [pivot, _] = lr_step(h, k, first, last, [h[k][k - 1], h[last][k - 1]]);
    h[k][k - 1] = pivot;
    h[last][k - 1] = 0.0;
}

/// `H ← L⁻¹ H L`, where `L` has the multipliers that free `v` of all but its first entry in its column `k`, from row `k` on. The
/// pivot is exchanged to the first place if it has to; `v` is returned with it there.
///
/// Two columns at a time lose the multiples of a row, two rows at a time gain those of columns. Pairs begin with an even
/// one: what they reach outside of the block is not needed.
#[inline]
fn lr_step<const M: usize, const N: usize>(
    h: &mut [[f64; N]; N],
    k: usize,
    first: usize,
    last: usize,
    mut v: [f64; M],
) -> [f64; M] {
    let end = (k + 3).min(last);
    let limit = v[0].abs() * (1.0 / SMALL_PIVOT);
    if v[1..].iter().any(|x| x.abs() > limit) {
        let p = if v[M - 1].abs() > v[1].abs() { M - 1 } else { 1 };
        v.swap(0, p);
        h.swap(k, k + p);
        for row in &mut h[first..=end] {
            row.swap(k, k + p);
        }
    }
    if v[0] == 0.0 {
        return v;
    }
    let inverse = 1.0 / v[0];
    let multipliers: [f64; M] = from_fn(|i| v[i] * inverse);
    let [pivot, below @ ..] = &mut h[k..] else { return v };
    let columns = k.div_ceil(2)..last / 2 + 1;
    for (row, factor) in below.iter_mut().zip(&multipliers[1..]) {
        if k % 2 == 1 {
            row[k] -= factor * pivot[k];
        }
        let row = row.as_chunks_mut::<2>().0[columns.clone()].iter_mut();
        for (x, y) in row.zip(&pairs(pivot)[columns.clone()]) {
            *x = (Two::new(*x) - Two::new(*y) * *factor).to_array();
        }
    }
    for [a, b] in &mut h.as_chunks_mut::<2>().0[first / 2..=end / 2] {
        let (Some(a), Some(b)) = (a[k..].first_chunk_mut::<M>(), b[k..].first_chunk_mut::<M>()) else {
            return v;
        };
        let gain = |sum, i: usize| sum + Two::new([a[i], b[i]]) * multipliers[i];
        [a[0], b[0]] = (1..M).fold(Two::new([a[0], b[0]]), gain).to_array();
    }
    v
}
