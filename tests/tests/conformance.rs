//! The published solvers, under laws that are stated once: planted truth, the symmetries of the problem, bad input, and for
//! the five-point solvers the same solutions as `quest`.
//!
//! The five-point solvers bring every solution of five matches to rounding. What else is lost, by the linear solvers and for
//! more matches, is counted and bounded here, at about twice what was found.
#![expect(clippy::unwrap_used, reason = "scenes that cannot be made are a failed test")]

use nalgebra::{UnitQuaternion, Vector3};
use quest_core::simulate::{Layout, Motion, Scene, SceneOptions};
use quest_core::solver::{Kinds, SolverName};
use quest_core::{Candidate, CandidateKind, Candidates, Correspondence, Degeneracy, RelativePose};
use quest_tests::scenes::scenes;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const SEED_PLANTED: u64 = 300;
const SEED_NOISY: u64 = 301;
const SEED_SYMMETRIES: u64 = 302;
const SEED_DEGENERATE: u64 = 303;

/// Two poses are the same solution if their rotations, and the directions of their translations, agree this well.
const SAME: f64 = 1e-6;

/// A true pose is lost if the nearest candidate is further from it than this, in radians: a pixel.
const LOST: f64 = 1e-3;

/// A solver under test, and what it is known not to do.
struct Subject {
    solver: SolverName,
    /// The scenes that it is made for.
    options: SceneOptions,
    /// How many of 10,000 true poses without noise it may lose, over all angles and in realistic scenes.
    most_lost: [usize; 2],
    /// How many of 200 for more matches than it needs.
    most_lost_of_more: usize,
    /// How many of 1,000 noisy problems may have other solutions after a change that should not matter, in number or
    /// by more than [`SAME`]: those with nearly double ones.
    most_different: usize,
}

impl Subject {
    fn solve(&self, kinds: Kinds, matches: &[Correspondence]) -> Candidates {
        let mut out = Candidates::new();
        self.solver.solve(kinds, matches, &mut out);
        out
    }

    fn exact(&self, matches: &[Correspondence]) -> Vec<RelativePose> {
        poses(&self.solve(Kinds::Exact, matches))
    }

    /// The same scenes as a camera sees them.
    fn realistic(&self) -> SceneOptions {
        let SceneOptions { layout, points, .. } = self.options;
        SceneOptions { layout, points, ..SceneOptions::realistic() }
    }

    fn noisy(&self) -> SceneOptions {
        SceneOptions { noise_px: 0.75, ..self.options }
    }

    /// Counts the noisy problems whose poses are not those expected.
    fn assert_same(&self, seed: u64, mut pair: impl FnMut(&Scene) -> [Vec<RelativePose>; 2]) {
        let mut different = Vec::new();
        for (index, scene) in scenes(self.noisy(), seed, 1_000).enumerate() {
            let [found, expected] = pair(&scene);
            if !same_poses(&found, &expected) {
                different.push((index, found.len(), expected.len()));
            }
        }
        assert!(different.len() <= self.most_different, "{}: {different:?}", different.len());
    }
}

fn poses(candidates: &Candidates) -> Vec<RelativePose> {
    let exact = candidates.iter().filter(|c| c.kind == CandidateKind::Exact);
    exact.map(|c| c.pose).collect()
}

/// The larger of the angles between the rotations and between the lines of translation.
fn distance(a: &RelativePose, b: &RelativePose) -> f64 {
    let sine = a.t_21.normalize().cross(&b.t_21.normalize()).norm();
    a.rotation_error(b).max(sine)
}

fn nearest(pose: &RelativePose, among: &[RelativePose]) -> f64 {
    among.iter().map(|other| distance(pose, other)).fold(f64::INFINITY, f64::min)
}

fn same_poses(a: &[RelativePose], b: &[RelativePose]) -> bool {
    let within = |a: &[RelativePose], b: &[RelativePose]| a.iter().all(|pose| nearest(pose, b) < SAME);
    a.len() == b.len() && within(a, b) && within(b, a)
}

fn mapped(
    matches: &[Correspondence],
    map: impl Fn(&Correspondence) -> (Vector3<f64>, Vector3<f64>),
) -> Vec<Correspondence> {
    let one = |m: &Correspondence| {
        let (b1, b2) = map(m);
        Correspondence::from_bearings(b1.into(), b2.into()).unwrap()
    };
    matches.iter().map(one).collect()
}

fn true_poses_are_found(subject: &Subject) {
    for (options, most_lost) in [subject.options, subject.realistic()].into_iter().zip(subject.most_lost) {
        let mut lost = Vec::new();
        for (index, scene) in scenes(options, SEED_PLANTED, 10_000).enumerate() {
            if nearest(&scene.truth, &subject.exact(&scene.matches)) > LOST {
                lost.push(index);
            }
        }
        assert!(lost.len() <= most_lost, "{:?}: {lost:?}", options.view);
    }
}

fn more_matches_find_the_truth(subject: &Subject) {
    for more in [1, 2, 5, 95] {
        for base in [subject.options, subject.realistic()] {
            let points = base.points + more;
            let mut lost = Vec::new();
            for (index, scene) in scenes(SceneOptions { points, ..base }, SEED_PLANTED + 1, 200).enumerate() {
                if nearest(&scene.truth, &subject.exact(&scene.matches)) > LOST {
                    lost.push(index);
                }
            }
            assert!(lost.len() <= subject.most_lost_of_more, "{points}, {:?}: {lost:?}", base.view);
        }
    }
}

fn the_order_of_the_matches_does_not_matter(subject: &Subject) {
    subject.assert_same(SEED_SYMMETRIES, |scene| {
        let mut permuted = scene.matches.clone();
        permuted.reverse();
        permuted.rotate_left(1);
        [subject.exact(&permuted), subject.exact(&scene.matches)]
    });
}

fn rotating_the_cameras_rotates_the_poses(subject: &Subject) {
    let turn1 = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -1.2, 0.4));
    let turn2 = UnitQuaternion::from_scaled_axis(Vector3::new(-2.0, 0.1, 0.7));
    subject.assert_same(SEED_SYMMETRIES + 1, |scene| {
        // X1' = P X1 and X2' = Q X2 = (Q R Pᵀ) X1' + Q t.
        let turned = mapped(&scene.matches, |m| (turn1 * m.bearing1(), turn2 * m.bearing2()));
        let expected = subject.exact(&scene.matches);
        let expected =
            expected.iter().map(|p| RelativePose::new(turn2 * p.q_21 * turn1.inverse(), turn2 * p.t_21));
        [subject.exact(&turned), expected.collect()]
    });
}

fn exchanging_the_views_inverts_the_poses(subject: &Subject) {
    subject.assert_same(SEED_SYMMETRIES + 2, |scene| {
        let exchanged = mapped(&scene.matches, |m| (*m.bearing2(), *m.bearing1()));
        let expected = subject.exact(&scene.matches);
        [subject.exact(&exchanged), expected.iter().map(RelativePose::inverse).collect()]
    });
}

fn candidates_are_finite_and_ranked(subject: &Subject) {
    let info = subject.solver.info();
    for scene in scenes(subject.noisy(), SEED_NOISY, 500) {
        let (all, exact) =
            (subject.solve(Kinds::All, &scene.matches), subject.solve(Kinds::Exact, &scene.matches));
        assert_eq!(all.degeneracy(), None);
        assert!(all.len() <= info.max_candidates);
        assert!(exact.iter().all(|c| c.kind == CandidateKind::Exact));
        assert!(same_poses(&poses(&all), &poses(&exact)));
        let finite = |c: &Candidate| c.residual.is_finite() && c.pose.t_21.iter().all(|x| x.is_finite());
        assert!(all.iter().all(finite));
        assert!(all.windows(2).all(|w| w[0].in_front >= w[1].in_front));
        // A used list is emptied first.
        let mut used = all.clone();
        subject.solver.solve(Kinds::All, &scene.matches, &mut used);
        assert_eq!(&used[..], &all[..]);
    }
}

fn bad_input_has_its_reason(subject: &Subject) {
    let verdict = |matches: &[Correspondence]| {
        let found = subject.solve(Kinds::All, matches);
        (found.degeneracy(), found.len())
    };
    let least = subject.solver.info().min_matches;
    for one in scenes(subject.options, SEED_DEGENERATE, 50) {
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
fn coarse_points_give_finite_candidates(subject: &Subject) {
    let least = subject.solver.info().min_matches;
    let mut rng = ChaCha8Rng::seed_from_u64(SEED_DEGENERATE + 2);
    for round in 0..20_000 {
        let size = if round % 2 == 0 { 1 } else { 3 };
        let mut coordinate = || f64::from(rng.random_range(-size..=size)) * 0.25;
        let matches: Vec<_> = (0..least + round % 5)
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

fn pure_rotations_are_named(subject: &Subject) {
    for points in [subject.options.points, 100] {
        let options = SceneOptions { motion: Motion::PureRotation, points, ..subject.realistic() };
        for one in scenes(options, SEED_DEGENERATE + 1, 100) {
            let found = subject.solve(Kinds::Exact, &one.matches);
            assert_eq!(found.degeneracy(), Some(Degeneracy::PureRotation));
            assert_eq!(found.len(), 1);
            assert!(
                found[0].pose.rotation_error(&one.truth) < 1e-12 && found[0].pose.t_21 == Vector3::zeros()
            );
        }
    }
}

/// Solutions as those of `quest`, which refines them.
fn solutions_are_those_of_quest(subject: &Subject) {
    for (options, seed) in [(subject.options, SEED_NOISY + 1), (subject.realistic(), SEED_NOISY + 2)] {
        let mut different = Vec::new();
        let options = SceneOptions { noise_px: 0.75, ..options };
        for (index, scene) in scenes(options, seed, 1_000).enumerate() {
            let mut quest = Candidates::new();
            SolverName::Quest.solve(Kinds::Exact, &scene.matches, &mut quest);
            if !same_poses(&subject.exact(&scene.matches), &poses(&quest)) {
                different.push(index);
            }
        }
        assert!(different.len() <= subject.most_different, "{}: {different:?}", different.len());
    }
}

/// No solution misses the matches by more than rounding.
fn residuals_are_rounding(subject: &Subject) {
    for scene in scenes(subject.noisy(), SEED_NOISY + 3, 1_000) {
        for candidate in subject.solve(Kinds::Exact, &scene.matches).iter() {
            assert!(candidate.residual < 1e-9, "{candidate:?}");
        }
    }
}

/// A true pose that noise does not move far stays near a candidate, complex ones included.
fn noise_moves_the_pose_a_little(subject: &Subject) {
    let options = SceneOptions { noise_px: 0.1, points: 20, ..subject.realistic() };
    let mut errors: Vec<f64> = scenes(options, SEED_NOISY + 4, 300)
        .map(|one| {
            let found = subject.solve(Kinds::All, &one.matches);
            found.iter().map(|c| c.pose.rotation_error(&one.truth)).fold(f64::INFINITY, f64::min)
        })
        .collect();
    errors.sort_by(f64::total_cmp);
    // 0.1 px are 0.1 mrad; linear estimates of twenty points magnify them by some ten.
    assert!(errors[150] < 5e-3, "{:e}", errors[150]);
}

/// The laws, each a test of the solver's own.
macro_rules! laws {
    ($module:ident: $subject:expr; $($law:ident,)*) => {
        mod $module {
            use super::*;
            $(
                #[test]
                fn $law() {
                    super::$law(&$subject);
                }
            )*
        }
    };
    (common $module:ident: $subject:expr; $($more:ident,)*) => {
        laws! { $module: $subject;
            true_poses_are_found,
            more_matches_find_the_truth,
            the_order_of_the_matches_does_not_matter,
            rotating_the_cameras_rotates_the_poses,
            exchanging_the_views_inverts_the_poses,
            candidates_are_finite_and_ranked,
            bad_input_has_its_reason,
            coarse_points_give_finite_candidates,
            pure_rotations_are_named,
            noise_moves_the_pose_a_little,
            $($more,)*
        }
    };
    (five_point $module:ident: $subject:expr) => {
        laws! { common $module: $subject; solutions_are_those_of_quest, residuals_are_rounding, }
    };
}

fn five_points() -> SceneOptions {
    SceneOptions::default()
}

laws!(five_point nister: Subject {
    solver: SolverName::Nister,
    options: five_points(),
    most_lost: [0, 0],
    most_lost_of_more: 0,
    most_different: 0,
});

laws!(five_point stewenius: Subject {
    solver: SolverName::Stewenius,
    options: five_points(),
    most_lost: [0, 0],
    most_lost_of_more: 0,
    most_different: 0,
});

laws!(five_point li_hartley: Subject {
    solver: SolverName::LiHartley,
    options: five_points(),
    most_lost: [0, 0],
    most_lost_of_more: 0,
    most_different: 0,
});

laws!(five_point kukelova: Subject {
    solver: SolverName::Kukelova,
    options: five_points(),
    most_lost: [0, 0],
    most_lost_of_more: 0,
    most_different: 0,
});

laws!(common eight_point: Subject {
    solver: SolverName::EightPoint,
    options: SceneOptions { points: 8, ..five_points() },
    most_lost: [1, 1],
    most_lost_of_more: 0,
    most_different: 1,
};);

laws!(common homography: Subject {
    solver: SolverName::Homography,
    options: SceneOptions { points: 4, layout: Layout::Coplanar, ..five_points() },
    most_lost: [1, 1],
    most_lost_of_more: 0,
    most_different: 6,
};);
