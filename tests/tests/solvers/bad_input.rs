//! Matches that determine no pose, or only a rotation.

use nalgebra::Vector3;
use quest_core::simulate::{Motion, Scene, SceneOptions};
use quest_core::solver::Kinds;
use quest_core::{Correspondence, Degeneracy};
use quest_tests::scenes::scenes;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{SEED_DEGENERATE, Subject};

pub(crate) fn bad_input_has_its_reason(subject: &Subject) {
    let verdict = |matches: &[Correspondence]| {
        let found = subject.solve(Kinds::All, matches);
        (found.degeneracy(), found.len())
    };
    let least = subject.solver.info().min_matches;
    for one in scenes(subject.scenes, SEED_DEGENERATE, 50) {
        let matches = &one.matches[..least];
        assert_eq!(verdict(&matches[1..]), (Some(Degeneracy::TooFewMatches), 0));
        assert_eq!(verdict(&vec![matches[0]; least]), (Some(Degeneracy::Coincident), 0));
        let mut repeated = matches.to_vec();
        repeated[2] = repeated[0];
        assert_eq!(verdict(&repeated), (Some(Degeneracy::Duplicate), 0));
        let (from, along) = (one.points1[0], one.points1[1] - one.points1[0]);
        let line: Vec<_> = (0..least).map(|k| from + along * (k * k + 1) as f64 * 0.1).collect();
        let collinear = Scene::from_points(one.truth, line).unwrap();
        assert_eq!(verdict(&collinear.matches), (Some(Degeneracy::Collinear), 0));
    }
    assert_eq!(verdict(&[]), (Some(Degeneracy::TooFewMatches), 0));
}

/// Points on a coarse grid: repeated, in lines, in squares, the same in both views.
pub(crate) fn coarse_points_give_finite_candidates(subject: &Subject) {
    let least = subject.solver.info().min_matches;
    let mut rng = ChaCha8Rng::seed_from_u64(SEED_DEGENERATE + 2);
    for round in 0..subject.share(20_000) {
        let size = if round % 2 == 0 { 1 } else { 3 };
        let mut coordinate = || f64::from(rng.random_range(-size..=size)) * 0.25;
        let matches: Vec<_> = (0..least + usize::try_from(round % 5).unwrap())
            .map(|_| [coordinate(), coordinate(), coordinate(), coordinate()])
            .map(|[u1, v1, u2, v2]| Correspondence::from_image_points([u1, v1], [u2, v2]).unwrap())
            .collect();
        let found = subject.solve(Kinds::All, &matches);
        for c in found.iter() {
            assert!((c.pose.q_21.norm() - 1.0).abs() < 1e-12, "round {round}: {c:?}");
            assert!(
                c.pose.t_21.iter().all(|x| x.is_finite()) && c.residual.is_finite(),
                "round {round}: {c:?}"
            );
        }
    }
}

pub(crate) fn pure_rotations_are_named(subject: &Subject) {
    let [_, realistic] = subject.views();
    for points in [realistic.points, 100] {
        let options = SceneOptions { motion: Motion::PureRotation, points, ..realistic };
        for one in scenes(options, SEED_DEGENERATE + 1, subject.share(100)) {
            let found = subject.solve(Kinds::Exact, &one.matches);
            assert_eq!(found.degeneracy(), Some(Degeneracy::PureRotation));
            assert_eq!(found.len(), 1);
            assert!(
                found[0].pose.rotation_error(&one.truth) < 1e-12 && found[0].pose.t_21 == Vector3::zeros()
            );
        }
    }
}
