//! The laws of every solver and of `estimate` on generated scenes, which proptest shrinks to the smallest that breaks one.
#![expect(clippy::expect_used, reason = "helpers of tests fail as tests do")]

use nalgebra::{UnitQuaternion, Vector3};
use proptest::prelude::*;
use proptest::sample::select;
use proptest::strategy::ValueTree;
use proptest::test_runner::{RngSeed, TestRunner};
use quest_core::robust::{self, Options, Problem};
use quest_core::solver::{Kinds, SolverName};
use quest_core::{CandidateKind, Candidates, Correspondence, RelativePose};
use quest_tests::invariants;
use quest_tests::scenes::solve;

const SEED: u64 = 0x9407;

/// So many scenes, the same ones in every run.
fn fixed(cases: u32) -> ProptestConfig {
    let rng_seed = RngSeed::Fixed(SEED);
    ProptestConfig { cases, rng_seed, failure_persistence: None, ..ProptestConfig::default() }
}

/// Two cameras before points that both see.
#[derive(Clone, Debug)]
struct Planted {
    truth: RelativePose,
    points: Vec<Vector3<f64>>,
}

impl Planted {
    /// A point of view 1 in the frame of view 2.
    fn seen2(&self, x1: &Vector3<f64>) -> Vector3<f64> {
        self.truth.q_21 * x1 + self.truth.t_21
    }

    fn matches(&self) -> Vec<Correspondence> {
        let seen = |x: &Vector3<f64>| Correspondence::from_bearings((*x).into(), self.seen2(x).into());
        self.points.iter().map(|x| seen(x).expect("a point in front of both cameras")).collect()
    }
}

fn vector(length: f64) -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(-length..length).prop_map(Vector3::from)
}

/// Points in a box of three units before the cameras, which turn by up to half a radian and move by a tenth to one unit.
fn planted(points: impl Into<prop::collection::SizeRange>) -> impl Strategy<Value = Planted> {
    let places = prop::collection::vec(vector(1.5).prop_map(|x| x + Vector3::z() * 4.0), points);
    (vector(0.3), vector(1.0), 0.1..1.0, places).prop_filter_map(
        "no direction",
        |(turn, way, length, points)| {
            let t_21 = way.try_normalize(1e-3)? * length;
            Some(Planted { truth: RelativePose::new(UnitQuaternion::from_scaled_axis(turn), t_21), points })
        },
    )
}

/// Rotation and direction of the translation, in radians, whichever is further off.
fn off(found: &RelativePose, truth: &RelativePose) -> f64 {
    let lines = |angle: f64| angle.min(std::f64::consts::PI - angle);
    found.rotation_error(truth).max(found.translation_error(truth).map_or(f64::INFINITY, lines))
}

fn general() -> Vec<SolverName> {
    SolverName::ALL.into_iter().filter(|solver| *solver != SolverName::Homography).collect()
}

/// What must hold of whatever a solver finds.
fn lawful(solver: SolverName, kinds: Kinds, matches: &[Correspondence]) -> Candidates {
    let found = solve(solver, kinds, matches);
    invariants::candidates(&found, matches);
    invariants::order(&found);
    assert!(found.len() <= solver.most_candidates(kinds), "{solver:?}: {} candidates", found.len());
    let again = solve(solver, kinds, matches);
    assert_eq!((&*found, found.degeneracy()), (&*again, again.degeneracy()));
    found
}

proptest! {
    #![proptest_config(fixed(300))]

    /// The planted pose is among the candidates of every solver.
    #[test]
    fn solvers_find_the_planted_pose(scene in planted(8..30), solver in select(general())) {
        let matches = scene.matches();
        let found = lawful(solver, Kinds::All, &matches);
        let nearest = found.iter().map(|c| off(&c.pose, &scene.truth)).fold(f64::INFINITY, f64::min);
        // Rounding of the bearings times what a scene of a tenth of a unit of parallax makes of it.
        prop_assert!(nearest < 1e-6, "{solver:?}: {nearest:e}");
    }

    /// Of five matches, the exact candidates satisfy the epipolar constraints to rounding, and the planted pose is one of them.
    #[test]
    fn candidates_of_five_satisfy_their_equations(scene in planted(5..6)) {
        let matches = scene.matches();
        let found = lawful(SolverName::Quest, Kinds::Exact, &matches);
        for candidate in found.iter() {
            prop_assert!(candidate.residual < 1e-9, "{:e}", candidate.residual);
        }
        let nearest = found.iter().map(|c| off(&c.pose, &scene.truth)).fold(f64::INFINITY, f64::min);
        prop_assert!(nearest < 1e-5, "{nearest:e}");
    }

    /// The order of the matches and their lengths change nothing but rounding.
    #[test]
    fn order_and_lengths_of_matches_play_no_part(scene in planted(5..20), scale in -30.0..30.0_f64) {
        let matches = scene.matches();
        let scale = 10.0_f64.powf(scale);
        let mut other: Vec<_> = scene.points.iter().map(|x| {
            let x2 = scene.seen2(x);
            Correspondence::from_bearings((x * scale).into(), (x2 / scale).into()).expect("the same directions")
        }).collect();
        other.reverse();
        let [one, two] = [&matches, &other].map(|m| lawful(SolverName::Quest, Kinds::Exact, m));
        let at_truth = |found: &Candidates| found.iter().map(|c| off(&c.pose, &scene.truth)).fold(f64::INFINITY, f64::min);
        prop_assert!(at_truth(&one) < 1e-5 && at_truth(&two) < 1e-5);
    }

    /// A solver answers matches of chance with poses or with none, whatever their number.
    #[test]
    fn matches_of_chance_are_answered(
        rows in prop::collection::vec((vector(1.0), vector(1.0)), 5..16),
        solver in select(SolverName::ALL.to_vec()),
        kinds in select(Kinds::CHOICES.to_vec()),
    ) {
        let matches: Vec<_> =
            rows.iter().filter_map(|(a, b)| Correspondence::from_bearings((*a).into(), (*b).into()).ok()).collect();
        if matches.len() >= solver.info().min_matches {
            lawful(solver, kinds, &matches);
        }
    }

    /// The motion of a plane is among the candidates of the homography.
    #[test]
    fn the_homography_finds_the_motion_of_a_plane(scene in planted(8..20), normal in vector(0.4)) {
        let flat = |x: &Vector3<f64>| {
            let normal = normal + Vector3::z();
            x * (4.0 / normal.dot(x))
        };
        let scene = Planted { points: scene.points.iter().map(flat).collect(), ..scene };
        let matches = scene.matches();
        let found = lawful(SolverName::Homography, Kinds::All, &matches);
        let nearest = found.iter().map(|c| off(&c.pose, &scene.truth)).fold(f64::INFINITY, f64::min);
        prop_assert!(nearest < 1e-6, "{nearest:e}");
    }
}

/// False matches in so many places of ten, and noise.
fn spoiled(scene: &Planted, false_of_ten: usize, noise: f64, chance: &[Vector3<f64>]) -> Vec<Correspondence> {
    let clean = scene.matches();
    let spoil = |(k, m): (usize, &Correspondence)| {
        let any = chance[k % chance.len()];
        let b2 = if k % 10 < false_of_ten { any + Vector3::z() * 1.5 } else { m.bearing2() + any * noise };
        Correspondence::from_bearings((*m.bearing1()).into(), b2.into()).expect("in front of the camera")
    };
    clean.iter().enumerate().map(spoil).collect()
}

proptest! {
    #![proptest_config(fixed(150))]

    /// An estimate is whole; its pose is the planted one, the true matches are its inliers, and a batch gives the same bits.
    #[test]
    fn estimates_find_the_planted_pose(
        scene in planted(60..120),
        false_of_ten in 0..5_usize,
        chance in prop::collection::vec(vector(1.0), 97),
        index in 0..1_000_u64,
    ) {
        let matches = spoiled(&scene, false_of_ten, 2e-4, &chance);
        let options = Options { threshold: 1e-3, index, ..Options::default() };
        let found = robust::estimate(&matches, &options);
        prop_assert!(found.is_ok(), "{:?}", found.as_ref().err());
        let found = found.expect("checked above");
        invariants::estimate(&found, matches.len());
        // Some twentieths of a degree are what so much noise makes of so many matches at the smallest parallax.
        let error = found.pose.rotation_error(&scene.truth);
        prop_assert!(error < 0.01, "{error} rad");
        let true_ones = (0..matches.len()).filter(|k| k % 10 >= false_of_ten);
        let missed = true_ones.clone().filter(|&k| !found.inliers[k]).count();
        prop_assert!(10 * missed <= true_ones.count(), "{missed} true matches are no inliers");
        let problem = Problem { matches: &matches, focal_lengths: [[1.0; 2]; 2] };
        let batch = robust::estimate_batch(&[problem, problem], &Options { index: index - index.min(1), ..options }, 1);
        let same = &batch[usize::from(index > 0)];
        prop_assert_eq!(same.as_ref().ok(), Some(&found));
    }

    /// Matches of chance alone have no pose, but in one case of thirty.
    #[test]
    fn estimates_of_chance_are_whole_or_refused(
        rows in prop::collection::vec((vector(0.5), vector(0.5)), 5..80),
        max_false_alarms in select(vec![0.03, f64::INFINITY]),
        focal_length in select(vec![1.0, 500.0, 1e6]),
    ) {
        let z = Vector3::z();
        let matches: Vec<_> = rows
            .iter()
            .map(|(a, b)| Correspondence::from_bearings((a + z).into(), (b + z).into()).expect("in front"))
            .collect();
        let options = Options {
            threshold: 1e-3 * focal_length,
            focal_lengths: [[focal_length; 2]; 2],
            max_iterations: 300,
            max_false_alarms,
            ..Options::default()
        };
        let found = robust::estimate(&matches, &options);
        if let Ok(found) = &found {
            invariants::estimate(found, matches.len());
        }
        prop_assert_eq!(found, robust::estimate(&matches, &options));
    }
}

#[test]
fn exact_candidates_are_real_solutions() {
    // The strategies above would say nothing if the solver found rotations alone.
    let mut runner = TestRunner::new(fixed(1));
    let scene = planted(5..6).new_tree(&mut runner).expect("a scene").current();
    let found = solve(SolverName::Quest, Kinds::Exact, &scene.matches());
    assert!(!found.is_empty() && found.iter().all(|c| c.kind == CandidateKind::Exact));
}
