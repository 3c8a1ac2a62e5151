//! How far candidates are from the truth.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::Vector3;
use quest_core::simulate::Scene;
use quest_core::{Candidate, Correspondence, RelativePose};

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

/// The error of a pose relative to the true parallax, in radians.
///
/// A small rotation δ changes an epipolar constraint by δ, a small turn ε of the translation by `|t| ε`. With little
/// parallax every candidate has nearly the right rotation, so that the larger of the two, divided by `|t|`, is what
/// tells the true pose from the others. Where points lie behind camera 2 nothing decides the sign of t, and both count.
#[must_use]
pub fn pose_error(scene: &Scene, pose: &RelativePose) -> f64 {
    let truth = &scene.truth;
    let parallax = truth.t_21.norm();
    let rotation = truth.rotation_error(pose);
    if parallax == 0.0 {
        return rotation;
    }
    let signed = truth.translation_error(pose).unwrap_or(FRAC_PI_2);
    let direction = if is_in_front(scene) { signed } else { signed.min(PI - signed) };
    rotation.max(parallax * direction) / parallax.clamp(SMALLEST_PARALLAX, 1.0)
}

/// Whether all points lie in front of both cameras.
#[must_use]
pub fn is_in_front(scene: &Scene) -> bool {
    scene.points1.iter().copied().chain(scene.points2()).all(|x| x.z > 0.0)
}

/// The candidate nearest to the truth by [`pose_error`], and that error.
#[must_use]
pub fn nearest<'a>(scene: &Scene, candidates: &'a [Candidate]) -> Option<(&'a Candidate, f64)> {
    let errors = candidates.iter().map(|c| (c, pose_error(scene, &c.pose)));
    errors.min_by(|a, b| a.1.total_cmp(&b.1))
}

/// The candidate that explains other matches best, chosen without the truth.
///
/// A point that the pose puts behind a camera is taken to be infinitely far away, and the angle between its bearings
/// is its error: the essential matrix alone cannot tell a pose from its twisted partner.
#[must_use]
pub fn chosen<'a>(candidates: &'a [Candidate], others: &[Correspondence]) -> Option<&'a Candidate> {
    let cost = |c: &Candidate| -> f64 { others.iter().map(|m| error_in_front(&c.pose, m).powi(2)).sum() };
    let costs = candidates.iter().map(|c| (c, cost(c)));
    costs.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(c, _)| c)
}

fn error_in_front(pose: &RelativePose, m: &Correspondence) -> f64 {
    if pose.depths(m).is_some_and(|(z1, z2)| z1 > 0.0 && z2 > 0.0) {
        return pose.sampson_error(m);
    }
    RelativePose::new(pose.q_21, Vector3::zeros()).sampson_error(m)
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;
    use quest_core::simulate::{Motion, SceneOptions};
    use quest_core::{CandidateKind, Candidates};

    use super::*;

    fn scene(parallax: f64) -> Scene {
        let options = SceneOptions { motion: Motion::Parallax(parallax), ..SceneOptions::realistic() };
        Scene::generate(&options, crate::SEED, 0).unwrap()
    }

    #[test]
    fn with_little_parallax_the_rotation_has_to_be_better() {
        let scene = scene(1e-3);
        let turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 1e-5);
        let RelativePose { q_21, t_21 } = scene.truth;
        assert!((pose_error(&scene, &RelativePose::new(turn * q_21, t_21)) - 1e-2).abs() < 1e-12);
        // An error of the direction counts as it is, whatever the parallax.
        let moved = pose_error(&scene, &RelativePose::new(q_21, turn * t_21));
        assert!(moved > 1e-6 && moved <= 1e-5 + 1e-12);
    }

    #[test]
    fn the_sign_of_t_counts_where_all_points_are_in_front() {
        let scene = scene(0.1);
        assert!(is_in_front(&scene));
        assert!(pose_error(&scene, &RelativePose::new(scene.truth.q_21, -scene.truth.t_21)) > 3.0);
    }

    #[test]
    fn the_twisted_partner_is_not_chosen() {
        let scene = scene(0.1);
        let RelativePose { q_21, t_21 } = scene.truth;
        let half_turn = UnitQuaternion::new(PI * t_21.normalize());
        let mut candidates = Candidates::new();
        for q_21 in [half_turn * q_21, q_21] {
            for t_21 in [-t_21, t_21] {
                let pose = RelativePose::new(q_21, t_21);
                candidates.push(Candidate { kind: CandidateKind::Exact, pose, residual: 0.0, in_front: 0 });
            }
        }
        assert_eq!(chosen(&candidates, &scene.matches).unwrap().pose, scene.truth);
    }
}
