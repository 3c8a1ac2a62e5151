//! Balancing, the reduction to Hessenberg form, and eigenvectors from there.

use std::array::from_fn;

use nalgebra::{Complex, ComplexField};

use super::lr::hessenberg_eigenvalues;
use super::pairs;
use crate::algebra::vectors::two::Two;

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
pub(super) fn balance<const N: usize>(a: &mut [[f64; N]; N]) -> [f64; N] {
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
pub(super) fn to_hessenberg<const N: usize>(a: &mut [[f64; N]; N]) -> [usize; N] {
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
