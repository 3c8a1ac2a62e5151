//! The linear part: each match `(a, b)` constrains the essential matrix by `⟨b aᵀ, E⟩ = 0`.

use nalgebra::{Matrix3, Matrix5, SMatrix, SVector, SymmetricEigen, Vector3, Vector5};

use super::motion::{Motion, essential_jacobian};
use crate::degeneracy::diagnose;
use crate::{Correspondence, Degeneracy};

/// Five matches whose constraints are closer to dependent than this have no reliable solution: the smallest pivot
/// is at most 1e-16 for collinear, coincident and repeated points, and above 1e-4 for ordinary ones.
const DEPENDENT: f64 = 1e-11;

/// The Gram matrix loses the square of [`DEPENDENT`] in rounding: its smallest resolvable ratio.
const GRAM_DEPENDENT: f64 = 1e-14;

type Matrix9 = SMatrix<f64, 9, 9>;

/// Five independent constraints `⟨Y, E⟩ = 0`: those of five matches, or for more matches the five that fit them
/// all best, in the least-squares sense.
pub(crate) type FiveConstraints = [Matrix3<f64>; 5];

fn constraint(m: &Correspondence) -> Matrix3<f64> {
    m.bearing2() * m.bearing1().transpose()
}

/// The constraints of five matches, checked for independence.
pub(crate) fn of_five(matches: &[Correspondence; 5]) -> Result<FiveConstraints, Degeneracy> {
    let constraints = matches.each_ref().map(constraint);
    // Gram–Schmidt with the longest remainder first; its lengths are the pivots of a QR decomposition.
    let mut rest = constraints;
    for k in 0..5 {
        let longest = (k..5).fold(k, |best, i| if rest[i].norm() > rest[best].norm() { i } else { best });
        rest.swap(k, longest);
        let length = rest[k].norm();
        if length < DEPENDENT {
            return Err(diagnose(matches));
        }
        let unit = rest[k] / length;
        for y in &mut rest[k + 1..] {
            *y -= unit * unit.dot(y);
        }
    }
    Ok(constraints)
}

/// `Σ y yᵀ` over the constraints `y = vec(b aᵀ)` of any number of matches.
#[derive(Clone, Debug)]
pub(crate) struct Gram(Matrix9);

impl Gram {
    pub(crate) fn new(matches: &[Correspondence]) -> Self {
        let mut lower = [[0.0; 9]; 9];
        for m in matches {
            let (b, a) = (m.bearing2(), m.bearing1());
            let mut y = [0.0; 9];
            for i in 0..3 {
                for j in 0..3 {
                    y[3 * i + j] = b[i] * a[j];
                }
            }
            for i in 0..9 {
                for j in 0..=i {
                    lower[i][j] += y[i] * y[j];
                }
            }
        }
        Self(Matrix9::from_fn(|i, j| lower[i.max(j)][i.min(j)]))
    }

    /// The five constraints that carry most of the sum: its leading eigenvectors.
    pub(crate) fn leading_five(&self, matches: &[Correspondence]) -> Result<FiveConstraints, Degeneracy> {
        let eigen = SymmetricEigen::new(self.0);
        let mut order = [0, 1, 2, 3, 4, 5, 6, 7, 8];
        order.sort_unstable_by(|&i, &j| eigen.eigenvalues[j].total_cmp(&eigen.eigenvalues[i]));
        if eigen.eigenvalues[order[4]] < GRAM_DEPENDENT * eigen.eigenvalues[order[0]] {
            return Err(diagnose(matches));
        }
        Ok(std::array::from_fn(|k| {
            let y = eigen.eigenvectors.column(order[k]);
            Matrix3::from_fn(|i, j| y[3 * i + j])
        }))
    }

    /// The summed squares of the constraints at a motion.
    pub(crate) fn cost(&self, motion: &Motion) -> f64 {
        let e = essential(motion);
        e.dot(&(self.0 * e))
    }

    /// The normal equations of a Gauss–Newton step.
    pub(crate) fn normal_equations(
        &self,
        motion: &Motion,
        tangent: &[Vector3<f64>; 2],
    ) -> (Matrix5<f64>, Vector5<f64>) {
        let jacobian = essential_jacobian(motion, tangent);
        let weighted = self.0 * jacobian;
        (jacobian.tr_mul(&weighted), weighted.tr_mul(&essential(motion)))
    }
}

/// The essential matrix `[t]× R`, row by row.
fn essential(motion: &Motion) -> SVector<f64, 9> {
    let e = motion.direction.cross_matrix() * motion.q_21.to_rotation_matrix().into_inner();
    SVector::from_fn(|k, _| e[(k / 3, k % 3)])
}
