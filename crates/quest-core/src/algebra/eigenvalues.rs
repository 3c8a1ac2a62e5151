//! All eigenvalues of a small real matrix: balancing, reduction to Hessenberg form, shifted QR. Eigenvectors of those that
//! are asked for, by inverse iteration.
//!
//! The classical sequence of Wilkinson and Reinsch, *Handbook for Automatic Computation II* (1971),
//! contributions II/11 (balancing), II/13 (elimination to Hessenberg form), II/14 (Francis' implicit double
//! shift) and II/18 (inverse iteration), for row-major arrays of fixed size.

use std::array::from_fn;

use nalgebra::{Complex, ComplexField};

use super::number::Number;
use super::two::Two;

/// Sweeps a single eigenvalue may take before the matrix is given up; about three are usual.
const MAX_SWEEPS: usize = 60;

/// The eigenvalues of `a`, complex pairs next to each other; `a` is overwritten.
///
/// `None` where the iteration does not converge, as for a matrix that is not finite.
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
                for j in 0..N {
                    a[i][j] /= factor;
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

/// Eigenvalues of an upper Hessenberg matrix by the implicit double-shift QR iteration.
fn hessenberg_eigenvalues<const N: usize>(h: &mut [[f64; N]; N]) -> Option<[Complex<f64>; N]> {
    let mut values = [Complex::new(0.0, 0.0); N];
    let mut norm = 0.0;
    for i in 0..N {
        for j in i.saturating_sub(1)..N {
            norm += h[i][j].abs();
        }
    }
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
        francis_sweep(h, first, last, &shift);
    }
    Some(values)
}

/// The first row of the unreduced block that ends at `last`.
fn block_start<const N: usize>(h: &[[f64; N]; N], last: usize, norm: f64) -> usize {
    let mut below = h[last][last].abs();
    for l in (1..=last).rev() {
        let above = h[l - 1][l - 1].abs();
        let neighbours = (above + below).max(f64::EPSILON * norm);
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

/// One implicit double-shift sweep on the block `first..=last`: a 3 × 3 bulge is chased down by reflections.
///
/// Every reflection waits for the one before, through a square root and a division, but only where rows and columns of the
/// two meet. That part comes first, so that the next reflection is under way while the rest of the matrix is reflected.
fn francis_sweep<const N: usize>(h: &mut [[f64; N]; N], first: usize, last: usize, shift: &Shift) {
    let mut now = Reflection::new(bulge(h, first, shift));
    // What stands below the subdiagonal is zero, though not stored; this one is about to be read.
    h[first + 2][first] = 0.0;
    for k in first..last - 1 {
        let next = Reflection::new(now.reflect_bulge::<3, N>(h, k, last));
        now.reflect_rows(h, k, last);
        now.reflect_columns::<3, N>(h, k, first);
        h[k + 1][k] = -next.s;
        now = next;
    }
    now.reflect_bulge::<2, N>(h, last - 1, last);
    now.reflect_columns::<2, N>(h, last - 1, first);
}

/// The reflection `I − u wᵀ` that takes `v` to `(−s, 0, 0)`: `u = (v + s e1) / s`, and `w` is `u` scaled to `w_0 = 1`. Applied
/// from row and column `k` on; to two of them where there are no three, with `v_2 = 0`.
struct Reflection {
    s: f64,
    u: [f64; 3],
    w: [f64; 3],
}

impl Reflection {
    #[inline]
    fn new(v: [f64; 3]) -> Self {
        // The matrix is balanced, so the squares stay in range.
        let s = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt().copysign(v[0]);
        if s == 0.0 {
            return Self { s, u: [0.0; 3], w: [1.0, 0.0, 0.0] };
        }
        let p = v[0] + s;
        let (over_s, over_p) = (1.0 / s, 1.0 / p);
        Self { s, u: [p * over_s, v[1] * over_s, v[2] * over_s], w: [1.0, v[1] * over_p, v[2] * over_p] }
    }

    /// `x ← (I − u wᵀ) x`: from the left.
    #[inline]
    fn times<T: Number, const M: usize>(&self, x: [T; M]) -> [T; M] {
        let sum = (1..M).fold(x[0], |sum, i| sum + x[i].times(self.w[i]));
        from_fn(|i| x[i] - sum.times(self.u[i]))
    }

    /// `xᵀ ← xᵀ (I − u wᵀ)`: from the right.
    #[inline]
    fn transposed_times<T: Number, const M: usize>(&self, x: [T; M]) -> [T; M] {
        let sum = (1..M).fold(x[0].times(self.u[0]), |sum, i| sum + x[i].times(self.u[i]));
        from_fn(|i| if i == 0 { x[i] - sum } else { x[i] - sum.times(self.w[i]) })
    }

    /// Reflects `M` rows and columns where they meet, and the row below. The next `v`: the first column, from the second row on.
    #[inline]
    fn reflect_bulge<const M: usize, const N: usize>(
        &self,
        h: &mut [[f64; N]; N],
        k: usize,
        last: usize,
    ) -> [f64; 3] {
        let mut next = [0.0; 3];
        let columns: [[f64; M]; M] = from_fn(|j| self.times(from_fn(|i| h[k + i][k + j])));
        for i in 0..M {
            let row = self.transposed_times::<f64, M>(from_fn(|j| columns[j][i]));
            h[k + i][k..k + M].copy_from_slice(&row);
            if i > 0 {
                next[i - 1] = row[0];
            }
        }
        if k + M <= last {
            let below = &mut h[k + M][k..k + M];
            let mut row = [0.0; M];
            row[M - 1] = below[M - 1];
            row = self.transposed_times(row);
            below.copy_from_slice(&row);
            next[M - 1] = row[0];
        }
        next
    }

    /// Reflects three rows right of the bulge. By pairs of columns that begin with an even one: past the last column it does
    /// no harm.
    #[inline]
    fn reflect_rows<const N: usize>(&self, h: &mut [[f64; N]; N], k: usize, last: usize) {
        let [a, b, c, ..] = &mut h[k..] else { return };
        let j = k + 3;
        if j % 2 == 1 && j <= last {
            [a[j], b[j], c[j]] = self.times([a[j], b[j], c[j]]);
        }
        let columns = j.div_ceil(2)..last / 2 + 1;
        let [a, b, c] = [a, b, c].map(|row| row.as_chunks_mut::<2>().0[columns.clone()].iter_mut());
        for ((a, b), c) in a.zip(b).zip(c) {
            [*a, *b, *c] = self.times([*a, *b, *c].map(Two::new)).map(Two::to_array);
        }
    }

    /// Reflects `M` columns above the bulge. By pairs of rows that begin with an even one: ahead of the first row it does no
    /// harm.
    #[inline]
    fn reflect_columns<const M: usize, const N: usize>(&self, h: &mut [[f64; N]; N], k: usize, first: usize) {
        if k % 2 == 1
            && k > first
            && let Some(row) = h[k - 1][k..].first_chunk_mut::<M>()
        {
            *row = self.transposed_times(*row);
        }
        let rows = (first / 2).min(k / 2)..k / 2;
        for [a, b] in &mut h.as_chunks_mut::<2>().0[rows] {
            let (Some(a), Some(b)) = (a[k..].first_chunk_mut::<M>(), b[k..].first_chunk_mut::<M>()) else {
                return;
            };
            let reflected = self.transposed_times::<Two, M>(from_fn(|i| Two::new([a[i], b[i]])));
            for (i, x) in reflected.into_iter().enumerate() {
                [a[i], b[i]] = x.to_array();
            }
        }
    }
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
            let b: [[f64; 10]; 10] = std::array::from_fn(|i| std::array::from_fn(|j| a[i][j]));
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
