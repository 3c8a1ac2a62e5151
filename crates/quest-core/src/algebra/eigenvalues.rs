//! All eigenvalues of a small real matrix: balancing, reduction to Hessenberg form, shifted LR. Eigenvectors of those that
//! are asked for, by inverse iteration.
//!
//! After Wilkinson and Reinsch, *Handbook for Automatic Computation II* (1971), contributions II/11 (balancing), II/13
//! (elimination to Hessenberg form), II/14 (implicit double shift), II/16 (elimination with exchanges in place of
//! orthogonal transformations) and II/18 (inverse iteration), for row-major arrays of fixed and even size.
//!
//! LR and not QR: a step of the chase has two operations an entry in place of five, and waits for a division alone, where a
//! reflection waits for a square root as well. It takes about as many sweeps. What it may cost is known afterwards, from the
//! sums of the eigenvalues and of their squares.

use std::array::from_fn;

use nalgebra::{Complex, ComplexField};

use super::two::Two;

/// Sweeps a single eigenvalue may take before the matrix is given up; about three are usual.
const MAX_SWEEPS: usize = 60;

/// A pivot smaller than this beside the largest entry is exchanged, so that multipliers stay below its inverse. To exchange
/// whenever there is a larger entry takes a quarter longer, for a branch that cannot be predicted; at a tenth the eigenvalues
/// err five times as much.
const SMALL_PIVOT: f64 = 0.3;

/// The error of the eigenvalues' sum over the norm, and of the sum of their squares over its square, from which on they are
/// given up; as a rule it is below 1e-13.
const LOST: f64 = 1e-10;

/// The eigenvalues of `a`, complex pairs next to each other; `a` is overwritten.
///
/// `None` where the iteration does not converge or loses too many digits, as for a matrix that is not finite: a caller has
/// another matrix with the same solutions.
pub(crate) fn eigenvalues<const N: usize>(a: &mut [[f64; N]; N]) -> Option<[Complex<f64>; N]> {
    if a.iter().flatten().any(|x| !x.is_finite()) {
        return None;
    }
    balance(a);
    to_hessenberg(a);
    hessenberg_eigenvalues(a)
}

/// A matrix in Hessenberg form, and the way back to its own eigenvectors.
pub(crate) struct Hessenberg<const N: usize> {
    /// Below the subdiagonal the factors of the elimination.
    h: [[f64; N]; N],
    pivots: [usize; N],
    scales: [f64; N],
}

impl<const N: usize> Hessenberg<N> {
    /// `None` for a matrix that is not finite.
    pub(crate) fn new(mut h: [[f64; N]; N]) -> Option<Self> {
        if h.iter().flatten().any(|x| !x.is_finite()) {
            return None;
        }
        let scales = balance(&mut h);
        let pivots = to_hessenberg(&mut h);
        Some(Self { h, pivots, scales })
    }

    /// As [`eigenvalues`].
    pub(crate) fn eigenvalues(&self) -> Option<[Complex<f64>; N]> {
        hessenberg_eigenvalues(&mut self.h.clone())
    }

    /// The eigenvector of an eigenvalue, of any scale, by one step of inverse iteration: exact to the rounding of the
    /// eigenvalue over its distance from the others. `None` where it is not finite.
    pub(crate) fn eigenvector<T: ComplexField<RealField = f64> + Copy>(&self, value: T) -> Option<[T; N]> {
        let mut x = [T::one(); N];
        self.solve_upper(value, &mut x);
        for m in (1..N - 1).rev() {
            for i in m + 1..N {
                let moved = x[m].scale(self.h[i][m - 1]);
                x[i] += moved;
            }
        }
        // Exchanging whole rows has put the factors where they belong after all exchanges.
        for m in (1..N - 1).rev() {
            x.swap(m, self.pivots[m]);
        }
        for (x, scale) in x.iter_mut().zip(self.scales) {
            *x = x.scale(scale);
        }
        x.iter().all(ComplexField::is_finite).then_some(x)
    }

    /// Solves `U x = (1, …, 1)` for the upper factor `U` of `H − value · I`, by rows from the top, the larger of two neighbours
    /// first: a start `L⁻¹ (1, …, 1)` of the iteration as good as any other.
    fn solve_upper<T: ComplexField<RealField = f64> + Copy>(&self, value: T, x: &mut [T; N]) {
        let mut u = [[T::zero(); N]; N];
        let mut largest = 0.0_f64;
        for (i, row) in u.iter_mut().enumerate() {
            let start = i.saturating_sub(1);
            for (x, h) in row[start..].iter_mut().zip(&self.h[i][start..]) {
                *x = T::from_real(*h);
                largest = largest.max(h.abs());
            }
            row[i] -= value;
        }
        for k in 0..N - 1 {
            if u[k + 1][k].norm1() > u[k][k].norm1() {
                u.swap(k, k + 1);
            }
            if u[k + 1][k].is_zero() {
                continue;
            }
            let (upper, lower) = u.split_at_mut(k + 1);
            let factor = lower[0][k] / upper[k][k];
            for (x, y) in lower[0][k + 1..].iter_mut().zip(&upper[k][k + 1..]) {
                *x -= factor * *y;
            }
        }
        // The pivot that an exact eigenvalue makes zero.
        let smallest = f64::EPSILON * largest;
        for k in (0..N).rev() {
            let mut sum = x[k];
            for (a, x) in u[k][k + 1..].iter().zip(&x[k + 1..]) {
                sum -= *a * *x;
            }
            let pivot = if u[k][k].norm1() < smallest { T::from_real(smallest) } else { u[k][k] };
            x[k] = sum / pivot;
        }
    }
}

/// Scales rows and columns by powers of two until they have about the same size: no rounding. An eigenvector of `a` as it was
/// has these scales times the entries of one of `a` as it is then.
fn balance<const N: usize>(a: &mut [[f64; N]; N]) -> [f64; N] {
    const RADIX: f64 = 2.0;
    let mut scales = [1.0; N];
    let mut settled = false;
    // A bound in place of "until nothing changes": a matrix with a zero row against a tiny column crawls.
    for _ in 0..20 {
        if settled {
            break;
        }
        settled = true;
        for i in 0..N {
            let (mut row, mut column) = (0.0, 0.0);
            for j in 0..N {
                if j != i {
                    row += a[i][j].abs();
                    column += a[j][i].abs();
                }
            }
            if row == 0.0 || column == 0.0 {
                continue;
            }
            let (total, mut factor) = (row + column, 1.0);
            while column < row / RADIX && factor < 1e100 {
                factor *= RADIX;
                column *= RADIX * RADIX;
            }
            while column >= row * RADIX && factor > 1e-100 {
                factor /= RADIX;
                column /= RADIX * RADIX;
            }
            if (column + row) / factor < 0.95 * total {
                settled = false;
                scales[i] *= factor;
                let inverse = 1.0 / factor;
                for x in &mut a[i] {
                    *x *= inverse;
                }
                for j in 0..N {
                    a[j][i] *= factor;
                }
            }
        }
    }
    scales
}

/// Reduces to upper Hessenberg form by stabilised elementary similarity transformations: half the work of
/// reflections. Their factors are left below the subdiagonal; with which row each was exchanged is returned.
fn to_hessenberg<const N: usize>(a: &mut [[f64; N]; N]) -> [usize; N] {
    let mut pivots = from_fn(|m| m);
    for m in 1..N.saturating_sub(1) {
        let pivot = (m..N).fold(m, |best, i| if a[i][m - 1].abs() > a[best][m - 1].abs() { i } else { best });
        pivots[m] = pivot;
        if a[pivot][m - 1] == 0.0 {
            continue;
        }
        if pivot != m {
            a.swap(pivot, m);
            for row in a.iter_mut() {
                row.swap(pivot, m);
            }
        }
        // Every row behind m loses a multiple of row m; column m gains the same multiples of the columns behind it.
        let inverse = 1.0 / a[m][m - 1];
        let mut gains = [0.0; N];
        gains[m] = 1.0;
        for i in m + 1..N {
            gains[i] = a[i][m - 1] * inverse;
        }
        // By whole pairs of columns: what stands left of column m takes no part.
        let mut pivot_row = a[m];
        pivot_row[m - 1] = 0.0;
        let (pivot_row, pairs) = (&pairs(&pivot_row)[m / 2..], &pairs(&gains)[m / 2..]);
        for (i, row) in a.iter_mut().enumerate() {
            let mut sum = Two::ZERO;
            let x = row.as_chunks_mut::<2>().0[m / 2..].iter_mut().zip(pairs);
            if i > m {
                for ((x, gain), y) in x.zip(pivot_row) {
                    let rest = Two::new(*x) - Two::new(*y) * gains[i];
                    *x = rest.to_array();
                    sum += rest * Two::new(*gain);
                }
                row[m - 1] = gains[i];
            } else {
                for (x, gain) in x {
                    sum += Two::new(*x) * Two::new(*gain);
                }
            }
            row[m] = sum.reduce_add();
        }
    }
    pivots
}

/// The entries of a row, two and two.
fn pairs<const N: usize>(row: &[f64; N]) -> &[[f64; 2]] {
    const { assert!(N.is_multiple_of(2)) }
    row.as_chunks().0
}

/// Eigenvalues of an upper Hessenberg matrix by the implicit double-shift LR iteration; of its entries below the subdiagonal
/// none is read.
///
/// `None` also where the multipliers have grown so much that too little is left of the eigenvalues.
fn hessenberg_eigenvalues<const N: usize>(h: &mut [[f64; N]; N]) -> Option<[Complex<f64>; N]> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn agrees_with_faer<const N: usize>(a: &[[f64; N]; N]) {
        let ours = eigenvalues(&mut a.clone()).unwrap();
        let theirs = faer::Mat::from_fn(N, N, |i, j| a[i][j]).eigenvalues().unwrap();
        let mut left: Vec<_> = theirs.iter().map(|z| Complex::new(z.re, z.im)).collect();
        let norm = a.iter().flatten().map(|x| x * x).sum::<f64>().sqrt();
        for z in ours {
            let (k, distance) = left
                .iter()
                .enumerate()
                .map(|(k, y)| (k, (y - z).norm()))
                .min_by(|a, b| a.1.total_cmp(&b.1))
                .unwrap();
            // Backward stable to N ε |A|; an eigenvalue of a random matrix has a condition number of
            // up to some thousand, and both sides err.
            assert!(distance < 1e-9 * norm, "{z} is off by {distance:e}");
            left.swap_remove(k);
        }
    }

    #[test]
    fn random_matrices_agree_with_faer() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..200 {
            let mut a = [[0.0; 20]; 20];
            for x in a.as_flattened_mut() {
                *x = rng.random_range(-1.0..1.0);
            }
            agrees_with_faer(&a);
            let b: [[f64; 10]; 10] = from_fn(|i| from_fn(|j| a[i][j]));
            agrees_with_faer(&b);
        }
    }

    #[test]
    fn eigenvectors_of_badly_scaled_matrices() {
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        for _ in 0..200 {
            let mut a = [[0.0; 20]; 20];
            for (row, down) in a.iter_mut().zip([1.0, 1e1, 1e2].into_iter().cycle()) {
                for (x, along) in row.iter_mut().zip([1.0, 1e-1, 1e-2, 1e-3].into_iter().cycle()) {
                    *x = rng.random_range(-1.0..1.0) * down * along;
                }
            }
            let form = Hessenberg::new(a).unwrap();
            for value in form.eigenvalues().unwrap() {
                let x = form.eigenvector(value).unwrap();
                let size = x.iter().map(|x| x.norm()).fold(0.0, f64::max);
                for (k, row) in a.iter().enumerate() {
                    let product: Complex<f64> = row.iter().zip(&x).map(|(a, x)| x * a).sum();
                    // Entries of up to 100, twenty terms; eigenvalues err by 1e-12 or so.
                    assert!((product - value * x[k]).norm() < 1e-9 * size, "{value}");
                }
            }
        }
    }

    #[test]
    fn companion_matrix_has_the_planted_roots() {
        // (x − 1)(x − 2)…(x − 6): the shift that stalls on a cyclic permutation is exercised below.
        let coefficients = [21.0, -175.0, 735.0, -1624.0, 1764.0, -720.0];
        let mut a = [[0.0; 6]; 6];
        a[0] = coefficients;
        for i in 1..6 {
            a[i][i - 1] = 1.0;
        }
        let mut values: Vec<_> = eigenvalues(&mut a).unwrap().iter().map(|z| z.re).collect();
        values.sort_by(f64::total_cmp);
        for (k, x) in values.iter().enumerate() {
            assert!((x - (k + 1) as f64).abs() < 1e-9, "{x}");
        }
    }

    #[test]
    fn cyclic_permutation_has_the_roots_of_unity() {
        let mut a = [[0.0; 8]; 8];
        for i in 0..8 {
            a[i][(i + 1) % 8] = 1.0;
        }
        for z in eigenvalues(&mut a).unwrap() {
            assert!((z.powu(8) - Complex::new(1.0, 0.0)).norm() < 1e-12);
        }
    }

    #[test]
    fn matrices_that_are_not_finite_are_refused() {
        let mut a = [[1.0; 4]; 4];
        a[2][1] = f64::NAN;
        assert!(eigenvalues(&mut a).is_none());
        assert_eq!(eigenvalues(&mut [[0.0; 4]; 4]).unwrap(), [Complex::new(0.0, 0.0); 4]);
    }
}
