//! Poses that are known are found.

use std::f64::consts::PI;

use nalgebra::{Quaternion, UnitQuaternion};
use quest_core::simulate::{Angle, Layout, Motion, Scene, SceneOptions};
use quest_core::{Candidate, RelativePose};
use quest_tests::scenes::{exact_rotations, scenes};
use quest_tests::solution_sets::nearest;

use super::{NONE, SAME, SEED_PARALLAX, SEED_PLANTED, Subject};

/// Whether the true rotation, and the translation up to its sign, is among the exact candidates.
fn is_found(subject: &Subject, scene: &Scene) -> bool {
    let found = subject.exact(&scene.matches);
    let (truth, t) = (&scene.truth, scene.truth.t_21);
    found.iter().any(|c| {
        let along = c.pose.t_21 - t;
        let against = c.pose.t_21 + t;
        c.pose.rotation_error(truth) < SAME && along.norm().min(against.norm()) < 1e-5
    })
}

fn failures(subject: &Subject, options: SceneOptions) -> Vec<usize> {
    let all = scenes(options, SEED_PLANTED, 1_000).enumerate();
    all.filter(|(_, scene)| !is_found(subject, scene)).map(|(index, _)| index).collect()
}

/// The twisted partner `t̂ ⊗ q`: the half turn about the line of the two cameras, on top.
fn twisted(pose: &RelativePose) -> UnitQuaternion<f64> {
    UnitQuaternion::new_unchecked(Quaternion::from_imag(pose.t_21.normalize())) * pose.q_21
}

pub(crate) fn planted_general_and_coplanar_scenes_are_found(subject: &Subject) {
    for layout in [Layout::General, Layout::Coplanar] {
        assert_eq!(failures(subject, SceneOptions { layout, ..SceneOptions::default() }), NONE, "{layout:?}");
        assert_eq!(
            failures(subject, SceneOptions { layout, ..SceneOptions::realistic() }),
            NONE,
            "{layout:?}"
        );
    }
}

pub(crate) fn planted_half_turns_are_found(subject: &Subject) {
    assert_eq!(
        failures(subject, SceneOptions { angle: Angle::Exactly(PI), ..SceneOptions::default() }),
        NONE
    );
}

pub(crate) fn planted_pure_translations_are_found(subject: &Subject) {
    assert_eq!(
        failures(subject, SceneOptions { motion: Motion::PureTranslation, ..SceneOptions::default() }),
        NONE
    );
}

pub(crate) fn twisted_partners_at_q1_zero_are_found(subject: &Subject) {
    // A translation at right angles to the axis, as of everything that drives on a floor: q1 = 0 for the partner.
    let mut missed = Vec::new();
    for (index, drawn) in scenes(SceneOptions::default(), SEED_PLANTED + 1, 1_000).enumerate() {
        let (q, t) = (drawn.truth.q_21, drawn.truth.t_21);
        let axis = q.axis().unwrap();
        let flat = RelativePose::new(q, t - axis.into_inner() * axis.dot(&t));
        let scene = Scene::from_points(flat, drawn.points1).unwrap();
        let partner = twisted(&scene.truth);
        assert!(partner.w.abs() < 1e-14);
        let found = exact_rotations(&subject.exact(&scene.matches));
        if nearest(&q, &found) > SAME || nearest(&partner, &found) > SAME {
            missed.push(index);
        }
    }
    assert_eq!(missed, NONE);
}

/// True poses are found, with their length, down to the smallest parallax: of 1e-8, rounding is 1e-8.
pub(crate) fn the_length_of_t_is_the_parallax(subject: &Subject) {
    let parallaxes = [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8];
    for parallax in parallaxes.into_iter().filter(|parallax| *parallax >= subject.smallest_parallax) {
        for base in [SceneOptions::default(), SceneOptions::realistic()] {
            let options = SceneOptions { motion: Motion::Parallax(parallax), ..base };
            let (mut wrong, mut missed) = (Vec::new(), Vec::new());
            for (index, scene) in scenes(options, SEED_PARALLAX, 1_000).enumerate() {
                let found = subject.exact(&scene.matches);
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

pub(crate) fn more_than_five_noise_free_matches_give_the_truth(subject: &Subject) {
    for points in [6, 7, 10, 100] {
        for base in [SceneOptions::default(), SceneOptions::realistic()] {
            let mut missed = Vec::new();
            for (index, scene) in scenes(SceneOptions { points, ..base }, SEED_PLANTED + 3, 200).enumerate() {
                let found = exact_rotations(&subject.exact(&scene.matches));
                if nearest(&scene.truth.q_21, &found) > SAME {
                    missed.push(index);
                }
            }
            assert_eq!(missed, NONE, "{points} points, {:?}", base.view);
        }
    }
}
