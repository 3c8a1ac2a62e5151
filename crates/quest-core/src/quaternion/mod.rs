//! Sections 5 and 6: the epipolar constraints as quartics in the quaternion of the rotation.
//!
//! With the matrices of (33), (34), a match `(a, b)` of bearings gives the symmetric traceless 4 × 4 matrix
//! `M = L(b) R(a)` of left and right multiplication by pure quaternions, `M q = b ⊗ q ⊗ a`. It is linear in the
//! entries of `b aᵀ`, and for a unit quaternion
//!
//! ```text
//! qᵀ M q = −b · R a          M q = (−b · R a, n) ⊗ q,   n = b × R a
//! ```
//!
//! The translation is orthogonal to every `n`, so `q, M_1 q, …, M_5 q` span no more than three dimensions: every
//! maximal minor of that 4 × 6 matrix of linear forms vanishes at the true rotation. The ten minors with `q` are
//! the quartics (39) of the paper, `±det[n_i n_j n_k] / (q·q)`; the five without it are new. The fifteen are
//! independent, so that the 35 quartic monomials modulo these leave the 20 dimensions of the 20 solutions.

mod constraint;
mod minors;
pub(crate) mod monomials;

use nalgebra::{Matrix3, Matrix4, Quaternion, Vector3, Vector4};

pub(crate) use constraint::ten_quartics;
pub use constraint::{constraint_matrix, constraint_matrix_5};
#[cfg(feature = "faer")]
pub(crate) use minors::minor_with_q;
pub(crate) use minors::{minors_with_q, minors_without_q};
pub use monomials::{MONOMIALS, NORM_ROW, monomial_names};

/// `M` for the 3 × 3 matrix `y = b aᵀ`, or a sum of such: with `q = (q1, q_v)`, `M q = b ⊗ q ⊗ a`.
///
/// From `b ⊗ a = (−b·a, b × a)` and `b ⊗ v ⊗ a = (·, (b·a) v − (a·v) b − (b·v) a)` for a vector `v`.
#[must_use]
pub fn bilinear(y: &Matrix3<f64>) -> Matrix4<f64> {
    let trace = y.trace();
    let cross = Vector3::new(y[(1, 2)] - y[(2, 1)], y[(2, 0)] - y[(0, 2)], y[(0, 1)] - y[(1, 0)]);
    let mut m = Matrix4::zeros();
    m[(0, 0)] = -trace;
    for i in 0..3 {
        m[(0, i + 1)] = cross[i];
        m[(i + 1, 0)] = cross[i];
        for j in 0..3 {
            m[(i + 1, j + 1)] = -y[(i, j)] - y[(j, i)];
        }
        m[(i + 1, i + 1)] += trace;
    }
    m
}

/// A quaternion with the components `(q1, q2, q3, q4)`, scalar first, as the paper writes it.
pub(crate) fn from_wxyz(q: &Vector4<f64>) -> Quaternion<f64> {
    Quaternion::new(q[0], q[1], q[2], q[3])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bilinear_multiplies_from_both_sides() {
        let (b, a) = (Vector3::new(0.3, -0.8, 1.1), Vector3::new(-0.4, 0.2, 0.9));
        let q = Vector4::new(0.5, -1.3, 0.7, 0.2);
        let expected = Quaternion::from_imag(b) * from_wxyz(&q) * Quaternion::from_imag(a);
        let found = from_wxyz(&(bilinear(&(b * a.transpose())) * q));
        assert!((expected - found).norm() < 1e-15);
    }
}
