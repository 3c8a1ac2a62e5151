//! The covariance of a pose, from the normal equations of its last refinement.
//!
//! It is `(E[ψ²] H⁻¹ + H⁻¹ S H⁻¹) / E[ψ']²` with `H = Σ J Jᵀ` over the inliers and `ψ` the influence of a residual under the
//! last refinement's loss, the means being those of normal noise as large as the inliers show. `S` is what false matches
//! that happen to agree with the pose pull at it: as many as there are outliers are expected to have `S = Σ ψ² J Jᵀ`, which is
//! measured on false matches (see [`significance`](super::significance)). For few inliers there is a factor close to one
//! (P. J. Huber, *Robust statistics*, 1981, section 7.6).
//! The five parameters of a motion become the six of a pose by the length of the translation and its derivatives.

use nalgebra::{Matrix3, Matrix5, Matrix6, SMatrix, UnitQuaternion, Vector5};

use super::columns::Columns;
use super::length::{Length, length};
use super::loss::{SquaredInfluence, Truncated};
use super::observations::Observations;
use super::polish::Polished;
use super::refine::Subset;
use super::transfer::rotation_hessian;
use crate::epipolar_frame::tangent_basis;
use crate::solver::motion::Motion;

/// Steps of the numerical derivatives of the length, in radians.
const STEP: f64 = 1e-5;

/// Matches that the derivatives of the length are taken over.
const ENOUGH: usize = 100;

/// The covariance of the five parameters of a motion.
fn of_motion(
    observations: &Observations,
    motion: &Motion,
    inliers: &[u32],
    polished: &Polished,
    false_matches: &Columns,
) -> Option<Matrix5<f64>> {
    let subset = Subset::new(&observations.columns, inliers);
    let equations = subset.equations(motion, &Truncated::new(f64::INFINITY));
    let inverse = equations.hessian.cholesky()?.inverse();
    let outliers = (observations.len() - inliers.len()) as f64;
    let mut pull = Matrix5::zeros();
    if outliers > 0.0 {
        pull = pull_of_a_match(false_matches, motion, polished) * outliers;
    }
    let normal = polished.loss.of_normal(polished.sigma);
    let spread = normal.square_slope / normal.slope.powi(2) - 1.0;
    let few = (1.0 + 5.0 / inliers.len() as f64 * spread) / normal.slope;
    Some((inverse * normal.square + inverse * pull * inverse) * (few * few))
}

/// The mean of `ψ² J Jᵀ` over false matches, most of which are too far off to count.
fn pull_of_a_match(false_matches: &Columns, motion: &Motion, polished: &Polished) -> Matrix5<f64> {
    let subset = Subset::new(false_matches, &false_matches.agreeing(motion, polished.limit));
    let influence = SquaredInfluence(polished.loss);
    subset.equations(motion, &influence).hessian / false_matches.len().max(1) as f64
}

/// The covariance of `(ω, t_21)` of a motion whose translation has this length.
pub(super) fn of_pose(
    observations: &Observations,
    motion: &Motion,
    inliers: &[u32],
    polished: &Polished,
    size: Length,
    false_matches: &Columns,
) -> Option<Matrix6<f64>> {
    let five = of_motion(observations, motion, inliers, polished, false_matches)?;
    let tangent = tangent_basis(&motion.direction);
    // The derivatives of the length hardly need all of the matches.
    let some = &inliers[..inliers.len().min(ENOUGH)];
    let at =
        |steps: &[f64; 5]| length(observations, &motion.stepped(&tangent, steps), some, polished.sigma).value;
    let here = at(&[0.0; 5]);
    let slope = Vector5::from_fn(|k, _| {
        let mut steps = [0.0; 5];
        steps[k] = STEP;
        (at(&steps) - here) / STEP
    });
    let mut jacobian = SMatrix::<f64, 6, 5>::zeros();
    jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(&Matrix3::identity());
    for k in 0..5 {
        let mut column = motion.direction * slope[k];
        if k >= 3 {
            column += tangent[k - 3] * size.value;
        }
        jacobian.fixed_view_mut::<3, 1>(3, k).copy_from(&column);
    }
    let mut covariance = jacobian * five * jacobian.transpose();
    let along = motion.direction * motion.direction.transpose() * size.variance;
    let mut block = covariance.fixed_view_mut::<3, 3>(3, 3);
    block += along;
    // Rounding must not show which triangle it was computed from.
    Some((covariance + covariance.transpose()) * 0.5)
}

/// The covariance of `(ω, t_21)` where there is no translation: that of the rotation alone, and for a translation of which
/// only the length is known to be small, its square in every direction.
pub(super) fn of_rotation(
    observations: &Observations,
    q_21: &UnitQuaternion<f64>,
    inliers: &[u32],
    sigma: f64,
    size: Length,
) -> Option<Matrix6<f64>> {
    let rotation =
        rotation_hessian(&observations.framed(inliers), q_21).cholesky()?.inverse() * (sigma * sigma);
    let mut covariance = Matrix6::zeros();
    covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(&rotation);
    let any = Matrix3::identity() * (size.value * size.value + size.variance);
    covariance.fixed_view_mut::<3, 3>(3, 3).copy_from(&any);
    Some(covariance)
}
