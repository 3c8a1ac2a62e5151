//! The least-squares null space of any number of rows of nine.

use nalgebra::{SMatrix, SymmetricEigen, Vector3};

use crate::algebra::null_space::null_space;
use crate::algebra::tridiagonal::eigen;
use crate::solver::shared::parallax_frame::{DEPENDENT, GRAM_DEPENDENT};

/// An orthonormal basis of the nine coordinates, those that the rows constrain most first, and the sums of squares that the
/// rows leave of each.
///
/// By the Gram matrix of the rows, so that their number costs no memory: half of the digits are lost where the rows
/// are close to dependent. By nalgebra's iteration: what is not refined afterwards shows the rounding of [`eigen`], in one of
/// 1,600 scenes of six matches by a lost pose.
pub(crate) fn principal_basis(rows: impl Iterator<Item = [f64; 9]>) -> ([f64; 9], [[f64; 9]; 9]) {
    let gram = gram(rows);
    let eigen = SymmetricEigen::new(SMatrix::<f64, 9, 9>::from_fn(|i, j| gram[i][j]));
    let mut order = [0, 1, 2, 3, 4, 5, 6, 7, 8];
    order.sort_unstable_by(|&i, &j| eigen.eigenvalues[j].total_cmp(&eigen.eigenvalues[i]));
    let basis = order.map(|k| std::array::from_fn(|i| eigen.eigenvectors[(i, k)]));
    (order.map(|k| eigen.eigenvalues[k]), basis)
}

fn gram(rows: impl Iterator<Item = [f64; 9]>) -> [[f64; 9]; 9] {
    let mut lower = [[0.0; 9]; 9];
    for row in rows {
        for i in 0..9 {
            for j in 0..=i {
                lower[i][j] += row[i] * row[j];
            }
        }
    }
    std::array::from_fn(|i| std::array::from_fn(|j| lower[i.max(j)][i.min(j)]))
}

/// The unit vector that at least eight rows leave the smallest sum of squares; `None` where they leave more than one.
pub(crate) fn null_vector(count: usize, rows: impl Iterator<Item = [f64; 9]>) -> Option<[f64; 9]> {
    if count == 8 {
        let mut eight = [[0.0; 9]; 8];
        for (row, given) in eight.iter_mut().zip(rows) {
            *row = given;
        }
        let ([vector], pivot) = null_space(&eight);
        return (pivot > DEPENDENT).then_some(vector);
    }
    let (squares, [.., vector]) = eigen(gram(rows));
    (squares[7] > GRAM_DEPENDENT * squares[0]).then_some(vector)
}

/// The row of nine products `u_i v_j` of the bilinear form `uᵀ X v` in the entries of `X`, row by row.
#[inline]
pub(crate) fn outer(u: &Vector3<f64>, v: &Vector3<f64>) -> [f64; 9] {
    [u.x * v.x, u.x * v.y, u.x * v.z, u.y * v.x, u.y * v.y, u.y * v.z, u.z * v.x, u.z * v.y, u.z * v.z]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_a_plane_leave_seven_directions() {
        let rows = [[1.0; 9], std::array::from_fn(|k| k as f64)];
        let (squares, basis) = principal_basis(rows.into_iter());
        let dot = |x: &[f64; 9], y: &[f64; 9]| -> f64 { x.iter().zip(y).map(|(a, b)| a * b).sum() };
        for (k, direction) in basis.iter().enumerate() {
            let left: f64 = rows.iter().map(|row| dot(row, direction).powi(2)).sum();
            assert!((left - squares[k]).abs() < 1e-11);
            assert!(k < 2 || left < 1e-24);
            assert!((dot(direction, direction) - 1.0).abs() < 1e-14);
        }
    }
}
