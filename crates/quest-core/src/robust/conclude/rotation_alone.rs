//! The rotation alone that best explains the inliers, and how much a model leaves beside the essential matrix.

use nalgebra::UnitQuaternion;

use crate::alignment::best_rotation;
use crate::robust::data::observations::Observations;
use crate::robust::data::point_transfer::Framed;
use crate::robust::refine::loss::{CAP, GemanMcClure, SCALE};
use crate::robust::refine::point_transfer::refine_rotation;

/// A rotation that leaves more than this is not enough, whatever the evidence says.
pub(crate) const NOT_A_ROTATION: f64 = 5.0;

/// A rotation whose mean capped error over some of the matches is above this is not refined over all of them: it is not enough.
const HOPELESS: f64 = 7.0;

/// Matches over which the two starts of the rotation are compared.
const FITTED: usize = 60;

/// Steps of the rotation's refinement.
const STEPS: usize = 8;

/// `F` of a model at this noise.
pub(crate) fn excess(model: &[f64], general: &[f64], sigma: f64) -> f64 {
    let capped = |squares: &[f64]| squares.iter().map(|s| (s / (sigma * sigma)).min(CAP)).sum::<f64>();
    (capped(model) - capped(general)) / general.len().max(1) as f64
}

/// The rotation that best takes the points to their matches, from two starts: that of the pose and that which aligns the
/// bearings.
pub(crate) fn rotation_alone(
    observations: &Observations,
    inliers: &[u32],
    framed: &Framed,
    q_21: &UnitQuaternion<f64>,
    sigma: f64,
) -> UnitQuaternion<f64> {
    let some = &observations.framed(&inliers[..inliers.len().min(FITTED)]);
    let matches = observations.some(inliers);
    let wide = GemanMcClure::new(2.0 * SCALE * sigma);
    let starts = [*q_21, best_rotation(&matches)].map(|mut q| {
        let cost = refine_rotation(some, &mut q, &wide, STEPS);
        (q, cost)
    });
    let mut q = if starts[1].1 < starts[0].1 { starts[1].0 } else { starts[0].0 };
    let r_21 = q.to_rotation_matrix().into_inner();
    let squares = some.square_errors(&r_21).into_iter().map(|s| (s / (sigma * sigma)).min(CAP));
    if squares.sum::<f64>() < HOPELESS * some.len() as f64 {
        refine_rotation(framed, &mut q, &GemanMcClure::new(SCALE * sigma), STEPS);
    }
    q
}

/// The root of the median, infinite of nothing.
pub(crate) fn median_root(mut squares: Vec<f64>) -> f64 {
    let middle = squares.len() / 2;
    if squares.is_empty() {
        return f64::INFINITY;
    }
    squares.select_nth_unstable_by(middle, f64::total_cmp).1.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_model_leaves_is_capped() {
        // In units of a variance of four: 1, 4 and the cap, less 0.25 each.
        let found = excess(&[4.0, 16.0, 1e9], &[1.0; 3], 2.0);
        assert!((found - (5.0 + CAP - 0.75) / 3.0).abs() < 1e-12, "{found}");
        assert!(excess(&[], &[], 2.0).abs() <= 0.0);
        assert_eq!((median_root(vec![9.0, 1.0, 4.0]), median_root(Vec::new())), (2.0, f64::INFINITY));
    }
}
