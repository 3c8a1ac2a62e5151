//! Poses that are known are found.

use std::f64::consts::PI;

use nalgebra::{Quaternion, UnitQuaternion};
use quest_core::simulate::{Angle, Layout, Motion, Scene, SceneOptions};
use quest_core::solver::Kinds;
use quest_core::{Candidate, RelativePose};
use quest_tests::scenes::scenes;
use quest_tests::solution_sets::nearest;

use super::{NONE, SAME, SEED_PARALLAX, SEED_PLANTED, Subject, distance, rotations};

/// A true pose is lost if the nearest candidate is further from it than this, in radians: where a second solution is near,
/// both are less precise than the others.
const LOST: f64 = 1e-5;

/// The scenes, of `count`, whose true rotation and line of translation are not among the exact candidates.
fn lost(subject: &Subject, options: SceneOptions, seed: u64, count: u64) -> Vec<usize> {
    let is_lost = |scene: &Scene| distance(&scene.truth, &subject.exact(&scene.matches)) > LOST;
    let all = scenes(options, seed, subject.share(count)).enumerate();
    all.filter(|(_, scene)| is_lost(scene)).map(|(index, _)| index).collect()
}

/// The twisted partner `t̂ ⊗ q`: the half turn about the line of the two cameras, on top.
fn twisted(pose: &RelativePose) -> UnitQuaternion<f64> {
    UnitQuaternion::new_unchecked(Quaternion::from_imag(pose.t_21.normalize())) * pose.q_21
}

pub(crate) fn true_poses_are_found(subject: &Subject) {
    for (options, most) in subject.views().into_iter().zip(subject.most_lost) {
        let lost = lost(subject, options, SEED_PLANTED, 10_000);
        assert!(lost.len() <= most, "{:?}: {lost:?}", options.view);
    }
}

pub(crate) fn coplanar_scenes_are_found(subject: &Subject) {
    for (options, most) in subject.views().into_iter().zip(subject.missed.coplanar) {
        let options = SceneOptions { layout: Layout::Coplanar, ..options };
        let lost = lost(subject, options, SEED_PLANTED, 1_000);
        assert!(lost.len() <= most, "{:?}: {} {lost:?}", options.view, lost.len());
    }
}

pub(crate) fn half_turns_are_found(subject: &Subject) {
    let options = SceneOptions { angle: Angle::Exactly(PI), ..subject.scenes };
    let lost = lost(subject, options, SEED_PLANTED, 1_000);
    assert!(lost.len() <= subject.missed.half_turns, "{} {lost:?}", lost.len());
}

pub(crate) fn pure_translations_are_found(subject: &Subject) {
    let options = SceneOptions { motion: Motion::PureTranslation, ..subject.scenes };
    let lost = lost(subject, options, SEED_PLANTED, 1_000);
    assert!(lost.len() <= subject.missed.translations, "{} {lost:?}", lost.len());
}

pub(crate) fn twisted_partners_at_q1_zero_are_found(subject: &Subject) {
    // A translation at right angles to the axis, as of everything that drives on a floor: q1 = 0 for the partner.
    let mut missed = Vec::new();
    let drawn = scenes(SceneOptions::default(), SEED_PLANTED + 1, subject.share(1_000));
    for (index, drawn) in drawn.enumerate() {
        let (q, t) = (drawn.truth.q_21, drawn.truth.t_21);
        let axis = q.axis().unwrap();
        let flat = RelativePose::new(q, t - axis.into_inner() * axis.dot(&t));
        let scene = Scene::from_points(flat, drawn.points1).unwrap();
        let partner = twisted(&scene.truth);
        assert!(partner.w.abs() < 1e-14);
        let found = rotations(&subject.exact(&scene.matches));
        if nearest(&q, &found) > SAME || nearest(&partner, &found) > SAME {
            missed.push(index);
        }
    }
    assert!(missed.len() <= subject.missed.partners, "{} {missed:?}", missed.len());
}

/// True poses are found, with their length, down to the smallest parallax: of 1e-8, rounding is 1e-8.
pub(crate) fn the_length_of_t_is_the_parallax(subject: &Subject) {
    let parallaxes = [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8];
    for parallax in parallaxes.into_iter().filter(|parallax| *parallax >= subject.smallest_parallax) {
        for base in subject.views() {
            let options = SceneOptions { motion: Motion::Parallax(parallax), ..base };
            let (mut wrong, mut missed) = (Vec::new(), Vec::new());
            for (index, scene) in scenes(options, SEED_PARALLAX, 1_000).enumerate() {
                let found = subject.solve(Kinds::Exact, &scene.matches);
                // Other solutions are as near as the parallax: the true one is nearer still.
                let is_true = |c: &&Candidate| c.pose.rotation_error(&scene.truth) < 1e-3 * parallax;
                match found.iter().find(is_true).map(|c| c.pose.t_21.norm() / parallax) {
                    None if subject.missed_at_small_parallax.contains(&(base.view, index)) => {}
                    None => missed.push(index),
                    Some(ratio) if (ratio - 1.0).abs() < 0.01 => {}
                    Some(_) => wrong.push(index),
                }
            }
            assert_eq!(wrong, NONE, "parallax {parallax:e}, {:?}", base.view);
            assert_eq!(missed, NONE, "parallax {parallax:e}, {:?}", base.view);
        }
    }
}

pub(crate) fn more_matches_find_the_truth(subject: &Subject) {
    for more in [1, 2, 5, 95] {
        for base in subject.views() {
            let points = base.points + more;
            let options = SceneOptions { points, ..base };
            let lost = lost(subject, options, SEED_PLANTED + 3, 200);
            let most = subject.missed.more_matches;
            assert!(lost.len() <= most, "{points} points, {:?}: {} {lost:?}", base.view, lost.len());
        }
    }
}
