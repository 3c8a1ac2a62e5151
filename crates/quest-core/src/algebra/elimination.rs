//! Gaussian elimination on arrays of fixed size.

use nalgebra::ComplexField;

use crate::algebra::vectors::two::Two;

/// Brings the first `R` columns of an `R × C` matrix to the identity, by row operations with partial
/// pivoting, for the rows from `keep` on; the rows above are spent on the way and left as they are.
///
/// Afterwards only the columns from `R` on are valid in the rows that are kept. Returns the smallest pivot over the largest
/// one. It is zero if the matrix is singular, and then nothing is valid.
pub(crate) fn reduce<const R: usize, const C: usize>(a: &mut [[f64; C]; R], keep: usize) -> f64 {
    const { assert!(R <= 64) }
    let (mut smallest, mut largest) = (f64::INFINITY, 0.0_f64);
    for k in 0..R {
        // The bits of absolute values are ordered as these are; in place of the last six stands the row.
        let key = |i: usize| (a[i][k].abs().to_bits() & !63) | i as u64;
        let pivot = ((k..R).map(key).fold(0, u64::max) & 63) as usize;
        let size = a[pivot][k].abs();
        smallest = smallest.min(size);
        largest = largest.max(size);
        if size == 0.0 || size.is_nan() {
            return 0.0;
        }
        // Whole rows: what stands left of column k is not read again, and loops of fixed length vectorise.
        let inverse = 1.0 / a[pivot][k];
        let row = a[pivot].map(|x| x * inverse);
        for i in k + 1..R {
            // Row k takes the place of the pivot's.
            let from = if i == pivot { k } else { i };
            let (mut next, factor) = (a[from], a[from][k]);
            subtract(&mut next, factor, &row);
            a[i] = next;
        }
        a[k] = row;
    }
    for k in (keep + 1..R).rev() {
        let (others, rows) = a.split_at_mut(k);
        for other in &mut others[keep..] {
            let factor = other[k];
            subtract(&mut other[R..], factor, &rows[0][R..]);
        }
    }
    smallest / largest
}

/// `x − factor · y` in place of `x`.
#[inline]
fn subtract(x: &mut [f64], factor: f64, y: &[f64]) {
    let ((x, x_rest), (y, y_rest)) = (x.as_chunks_mut::<2>(), y.as_chunks::<2>());
    for (x, y) in x.iter_mut().zip(y) {
        *x = (Two::new(*x) - Two::new(*y) * factor).to_array();
    }
    for (x, y) in x_rest.iter_mut().zip(y_rest) {
        *x -= factor * y;
    }
}

/// Eliminates the first `columns` columns by row operations with partial pivoting: below the first `columns` rows they
/// are free of them. Whether no pivot was zero; what stands in the eliminated columns is not valid.
pub(crate) fn eliminate<const R: usize, const C: usize>(a: &mut [[f64; C]; R], columns: usize) -> bool {
    for k in 0..columns {
        let pivot = (k..R).fold(k, |best, i| if a[i][k].abs() > a[best][k].abs() { i } else { best });
        a.swap(k, pivot);
        let row = a[k];
        let inverse = 1.0 / row[k];
        if !inverse.is_finite() {
            return false;
        }
        for other in &mut a[k + 1..] {
            let factor = other[k] * inverse;
            for j in 0..C {
                other[j] -= factor * row[j];
            }
        }
    }
    true
}

/// The determinant of a square matrix by elimination with partial pivoting; `a` is overwritten.
pub(crate) fn determinant<const N: usize>(a: &mut [[f64; N]; N]) -> f64 {
    let mut product = 1.0;
    for k in 0..N {
        let pivot = (k..N).fold(k, |best, i| if a[i][k].abs() > a[best][k].abs() { i } else { best });
        if pivot != k {
            a.swap(k, pivot);
            product = -product;
        }
        let row = a[k];
        product *= row[k];
        if product == 0.0 {
            return 0.0;
        }
        let inverse = 1.0 / row[k];
        for other in &mut a[k + 1..] {
            let factor = other[k] * inverse;
            for j in k + 1..N {
                other[j] -= factor * row[j];
            }
        }
    }
    product
}

/// The null vector of a singular square matrix, scaled so that its last entry is one; `None` where the matrix
/// has no such vector. `a` is overwritten.
pub(crate) fn null_vector<T: ComplexField<RealField = f64> + Copy, const N: usize>(
    a: &mut [[T; N]; N],
) -> Option<[T; N]> {
    for k in 0..N - 1 {
        let pivot = (k..N).fold(k, |best, i| if a[i][k].norm1() > a[best][k].norm1() { i } else { best });
        let size = a[pivot][k].norm1();
        if size == 0.0 || !size.is_finite() {
            return None;
        }
        a.swap(k, pivot);
        let inverse = T::one() / a[k][k];
        let (upper, lower) = a.split_at_mut(k + 1);
        let pivot_row = &upper[k];
        for row in lower {
            let factor = row[k] * inverse;
            for j in k + 1..N {
                row[j] -= factor * pivot_row[j];
            }
        }
    }
    let mut x = [T::one(); N];
    for k in (0..N - 1).rev() {
        let mut sum = T::zero();
        for j in k + 1..N {
            sum += a[k][j] * x[j];
        }
        x[k] = -sum / a[k][k];
    }
    x.iter().all(ComplexField::is_finite).then_some(x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Complex, SMatrix};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn reduced_rows_solve_the_system() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let a: [[f64; 9]; 5] = std::array::from_fn(|_| std::array::from_fn(|_| rng.random_range(-1.0..1.0)));
        let left = SMatrix::<f64, 5, 5>::from_fn(|i, j| a[i][j]);
        let right = SMatrix::<f64, 5, 4>::from_fn(|i, j| a[i][5 + j]);
        let expected = left.lu().solve(&right).unwrap();
        let mut reduced = a;
        assert!(reduce(&mut reduced, 2) > 0.0);
        for i in 2..5 {
            for j in 0..4 {
                assert!((reduced[i][5 + j] - expected[(i, j)]).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn eliminated_columns_are_gone_and_determinants_agree_with_nalgebra() {
        let mut rng = ChaCha8Rng::seed_from_u64(12);
        let mut a: [[f64; 5]; 5] =
            std::array::from_fn(|_| std::array::from_fn(|_| rng.random_range(-1.0..1.0)));
        let expected = SMatrix::<f64, 5, 5>::from_fn(|i, j| a[i][j]).determinant();
        assert!((determinant(&mut a.clone()) - expected).abs() < 1e-13);
        // A column that the first three span is eliminated with them.
        for row in &mut a {
            row[4] = row[0] - 2.0 * row[1] + 0.5 * row[2];
        }
        assert!(eliminate(&mut a, 3));
        assert!(a[3][4].abs() < 1e-14 && a[4][4].abs() < 1e-14 && a[3][3].abs() > 1e-3);
        assert!(determinant(&mut [[1.0; 3]; 3]).abs() < 1e-15);
        assert!(!eliminate(&mut [[0.0; 5]; 3], 1));
    }

    #[test]
    fn null_vector_of_planted_singular_matrices() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for _ in 0..100 {
            let x: [Complex<f64>; 6] = std::array::from_fn(|k| {
                let one = Complex::new(1.0, 0.0);
                if k == 5 {
                    one
                } else {
                    Complex::new(rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0))
                }
            });
            let mut a = [[Complex::new(0.0, 0.0); 6]; 6];
            for row in &mut a {
                for j in 0..5 {
                    row[j] = Complex::new(rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0));
                }
                row[5] = -(0..5).map(|j| row[j] * x[j]).sum::<Complex<f64>>();
            }
            let found = null_vector(&mut a).unwrap();
            // The condition number of a random 6 × 6 matrix stays below 1e5 in a hundred draws.
            assert!(found.iter().zip(x).all(|(f, x)| (f - x).norm() < 1e-10));
        }
    }

    #[test]
    fn matrices_without_a_pivot_are_told() {
        for bad in [0.0, f64::NAN] {
            // The first column, then the second one after a good first one.
            for column in [0, 1] {
                let mut a = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]];
                for row in &mut a {
                    row[column] = bad;
                }
                assert!(reduce(&mut a, 0) <= 0.0, "{bad} {column}");
                let mut a = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 10.0]];
                for row in &mut a {
                    row[column] = bad;
                }
                assert!(null_vector(&mut a).is_none(), "{bad} {column}");
            }
        }
    }
}
