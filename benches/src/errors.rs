//! How far candidates are from the truth.

use std::f64::consts::FRAC_PI_2;

use quest_core::{Candidate, RelativePose};

/// A rotation further from the truth than this (radians) is a failure.
pub const TOLERANCE: f64 = 1e-6;

/// The parallax below which the tolerance of [`pose_error`] no longer shrinks: the rounding of the bearings, 1e-16
/// times the condition of the problem, would count as a failure.
const SMALLEST_PARALLAX: f64 = 1e-6;

/// The rotation error of the best candidate, infinite without one.
#[must_use]
pub fn rotation_error(truth: &RelativePose, candidates: &[Candidate]) -> f64 {
    let errors = candidates.iter().map(|c| truth.rotation_error(&c.pose));
    errors.fold(f64::INFINITY, f64::min)
}

/// The error of a pose relative to its parallax, in radians.
///
/// A small rotation δ changes an epipolar constraint by δ, a small turn ε of the translation by `|t| ε`. With little
/// parallax every candidate has nearly the right rotation, so that the larger of the two, divided by `|t|`, is what
/// tells the true pose from the others.
#[must_use]
pub fn pose_error(truth: &RelativePose, pose: &RelativePose) -> f64 {
    let parallax = truth.t_21.norm();
    let rotation = truth.rotation_error(pose);
    if parallax == 0.0 {
        return rotation;
    }
    let direction = truth.translation_error(pose).unwrap_or(FRAC_PI_2);
    rotation.max(parallax * direction) / parallax.clamp(SMALLEST_PARALLAX, 1.0)
}

/// The candidate nearest to the truth by [`pose_error`], and that error.
#[must_use]
pub fn nearest<'a>(truth: &RelativePose, candidates: &'a [Candidate]) -> Option<(&'a Candidate, f64)> {
    let errors = candidates.iter().map(|c| (c, pose_error(truth, &c.pose)));
    errors.min_by(|a, b| a.1.total_cmp(&b.1))
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};

    use super::*;

    #[test]
    fn with_little_parallax_the_rotation_has_to_be_better() {
        let truth = RelativePose::new(UnitQuaternion::identity(), Vector3::new(0.0, 0.0, 1e-3));
        let turned = |angle| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), angle);
        let rotated = RelativePose::new(turned(1e-5), truth.t_21);
        assert!((pose_error(&truth, &rotated) - 1e-2).abs() < 1e-12);
        let moved = RelativePose::new(truth.q_21, turned(1e-5) * truth.t_21);
        assert!((pose_error(&truth, &moved) - 1e-5).abs() < 1e-12);
    }
}
