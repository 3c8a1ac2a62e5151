//! `eight-point`: the linear method for many matches, normalised as in
//!
//! R. I. Hartley, *In defense of the eight-point algorithm*, IEEE Transactions on Pattern Analysis and Machine Intelligence
//! 19(6), 1997, pages 580–593, doi 10.1109/34.601246,
//!
//! for calibrated cameras: the essential matrix in place of the fundamental one (H. C. Longuet-Higgins, *A computer
//! algorithm for reconstructing a scene from two projections*, Nature 293, 1981).
//!
//! **Problem.** The one essential matrix that eight or more matches of a general scene determine linearly.
//!
//! **Steps**:
//! 1. Normalise each view: Hartley's two conditions, written for bearings so that points need not lie on a plane `z = 1`
//!    (`normalisation.rs`).
//! 2. One row `x2 ⊗ x1` a match. Of eight rows the null vector by orthogonal factorisation, of more the direction
//!    with the smallest sum of squares, by their Gram matrix.
//! 3. Undo the normalisation, and replace the singular values `σ1, σ2, σ3` by `1, 1, 0`: the nearest essential matrix up
//!    to scale. Hartley enforces the rank before the normalisation is undone, which does not keep two singular
//!    values equal.
//! 4. Two rotations and a translation; the rotation with most points in front comes first.
//!
//! The candidates are not refined. Both are [`Exact`](crate::CandidateKind::Exact); the residual says how well they fit.
//!
//! **Degenerate**: eight matches with fewer than eight independent constraints, as of coplanar points, for which every
//! number of matches gives only six; an exact pure rotation. With little parallax, or points in a shallow box, the
//! result is determined by noise long before it is degenerate.
//!
//! **Solutions**: one essential matrix, two motions.

use nalgebra::{Matrix3, Vector3};

use crate::algebra::symmetric::smallest_eigenvector_3;
use crate::degeneracy::diagnose_fewer_than;
use crate::epipolar_frame::tangent_basis;
use crate::solver::published::five_point::unit;
use crate::solver::published::least_squares::{null_vector, outer};
use crate::solver::published::normalisation::Normalisation;
use crate::solver::shared::essential::decompose;
use crate::solver::shared::motion::Motion;
use crate::solver::shared::shortlist::{Shortlist, is_answered};
use crate::solver::{Kinds, PoseSolver};
use crate::{CandidateKind, Candidates, Correspondence};

/// Hartley's normalised eight-point method; its steps stand at the head of the module.
#[derive(Clone, Copy, Debug, Default)]
pub struct EightPoint;

impl PoseSolver for EightPoint {
    const NAME: &'static str = "eight-point";
    const MIN_MATCHES: usize = 8;

    fn solve(&self, matches: &[Correspondence], out: &mut Candidates) {
        if is_answered(Self::MIN_MATCHES, matches, out) {
            return;
        }
        match motion(matches) {
            None => out.set_degeneracy(diagnose_fewer_than(Self::MIN_MATCHES, matches)),
            Some(motion) => {
                let mut shortlist = Shortlist::new();
                shortlist.push_pair(CandidateKind::Exact, motion);
                shortlist.write(Kinds::Exact, matches, out);
            }
        }
    }
}

/// One of the two motions; `None` where the matches leave more than one essential matrix.
fn motion(matches: &[Correspondence]) -> Option<Motion> {
    let view1 = Normalisation::new(matches.iter().map(Correspondence::bearing1));
    let view2 = Normalisation::new(matches.iter().map(Correspondence::bearing2));
    let row =
        |m: &Correspondence| outer(&(view2.transform * m.bearing2()), &(view1.transform * m.bearing1()));
    let normalised = null_vector(matches.len(), matches.iter().map(row))?;
    let e = view2.transform * Matrix3::from_row_slice(&normalised) * view1.transform;
    let e = nearest_essential(&e)?;
    let (q, t) = decompose(&std::array::from_fn(|i| std::array::from_fn(|j| e[(i, j)])))?;
    Some(Motion { q_21: unit(q), direction: Vector3::from(t).normalize() })
}

/// The essential matrix with singular values 1, 1, 0 that is nearest to a matrix up to scale.
///
/// The last right singular vector is an eigenvector of `Eᵀ E`; on the plane across it `A (AᵀA)^(−½)` sets both other singular
/// values to one, with the square root of a 2 × 2 matrix in closed form.
fn nearest_essential(e: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let plane = tangent_basis(&smallest_eigenvector_3(&e.tr_mul(e))?);
    let [a, b] = plane.map(|v| e * v);
    let (aa, ab, bb) = (a.norm_squared(), a.dot(&b), b.norm_squared());
    let determinant = (aa * bb - ab * ab).sqrt();
    // (S + √det S) / √(tr S + 2 √det S) is the square root of S, and the adjugate over the determinant its inverse.
    let scale = 1.0 / (determinant * (aa + bb + 2.0 * determinant).sqrt());
    let (a, b) = ((a * (bb + determinant) - b * ab) * scale, (b * (aa + determinant) - a * ab) * scale);
    let nearest = a * plane[0].transpose() + b * plane[1].transpose();
    nearest.iter().all(|x| x.is_finite()).then_some(nearest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;

    #[test]
    fn nearest_essential_has_two_equal_singular_values() {
        let r_21 = UnitQuaternion::new(Vector3::new(0.3, -0.2, 0.9)).to_rotation_matrix().into_inner();
        let essential = Vector3::new(0.6, 0.0, -0.8).cross_matrix() * r_21;
        let disturbed = essential * 3.0 + Matrix3::new(0.1, 0.0, 0.2, -0.1, 0.1, 0.0, 0.0, 0.2, 0.1) * 1e-3;
        let found = nearest_essential(&disturbed).unwrap();
        let mut values = found.singular_values();
        values.as_mut_slice().sort_by(f64::total_cmp);
        assert!((values - Vector3::new(0.0, 1.0, 1.0)).norm() < 1e-14);
        assert!((found - essential).norm() < 1e-3);
        assert!((nearest_essential(&essential).unwrap() - essential).norm() < 1e-14);
    }
}
