//! What the printed algorithms find, and what they lose, counted.

use std::f64::consts::PI;

use nalgebra::{Quaternion, UnitQuaternion};

use crate::simulate::{Angle, Motion, Scene, SceneOptions};
use crate::solver::{Kinds, SolverName};
use crate::{CandidateKind, Candidates, Correspondence};

const SEED: u64 = 433;

fn solve(solver: SolverName, matches: &[Correspondence]) -> Vec<UnitQuaternion<f64>> {
    let mut out = Candidates::new();
    solver.solve(Kinds::Exact, matches, &mut out);
    out.iter().filter(|c| c.kind == CandidateKind::Exact).map(|c| c.pose.q_21).collect()
}

fn nearest(q: &UnitQuaternion<f64>, found: &[UnitQuaternion<f64>]) -> f64 {
    found.iter().map(|other| q.angle_to(other)).fold(f64::INFINITY, f64::min)
}

/// How many of `count` scenes the true rotation is lost of, and the twisted one.
fn lost(solver: SolverName, options: &SceneOptions, count: u64, within: f64) -> [usize; 2] {
    let mut lost = [0; 2];
    for index in 0..count {
        let scene = Scene::generate(options, SEED, index).unwrap();
        let found = solve(solver, &scene.matches);
        let half_turn = Quaternion::from_imag(scene.truth.t_21.normalize());
        let twisted = UnitQuaternion::new_unchecked(half_turn) * scene.truth.q_21;
        lost[0] += usize::from(nearest(&scene.truth.q_21, &found) > within);
        lost[1] += usize::from(nearest(&twisted, &found) > within);
    }
    lost
}

/// As the paper draws scenes, and as a camera sees them.
fn views() -> [SceneOptions; 2] {
    [SceneOptions::default(), SceneOptions::realistic()]
}

#[test]
fn true_rotations_and_their_twisted_partners_are_found() {
    for (base, solver) in
        views().into_iter().flat_map(|base| SolverName::LITERAL.map(|solver| (base, solver)))
    {
        for points in [5, 6, 7, 8, 9, 10, 30] {
            let count = if points == 5 { 200 } else { 30 };
            let lost = lost(solver, &SceneOptions { points, ..base }, count, 1e-5);
            assert!(lost[0] <= 1 && lost[1] <= 1, "{:?} {solver:?} {points}: {lost:?}", base.view);
        }
    }
}

#[test]
fn the_solutions_under_noise_are_those_of_quest() {
    for (base, solver) in
        views().into_iter().flat_map(|base| SolverName::LITERAL.map(|solver| (base, solver)))
    {
        let (mut missed, mut more, mut all) = (0, 0, 0);
        for index in 0..250 {
            let options = SceneOptions { noise_px: 0.75, ..base };
            let scene = Scene::generate(&options, SEED + 1, index).unwrap();
            let expected = solve(SolverName::Quest, &scene.matches);
            let found = solve(solver, &scene.matches);
            all += expected.len();
            missed += expected.iter().filter(|q| nearest(q, &found) > 1e-6).count();
            more += found.iter().filter(|q| nearest(q, &expected) > 1e-6).count();
        }
        assert!(missed + more <= 4 && all > 2_000, "{:?} {solver:?}: {missed} {more} {all}", base.view);
    }
}

#[test]
fn what_the_printed_form_loses() {
    let base = SceneOptions::default();
    let half_turn = SceneOptions { angle: Angle::Exactly(PI), ..base };
    let translation = SceneOptions { motion: Motion::PureTranslation, ..base };
    let [quest, relinearization] = SolverName::LITERAL;
    // (43) divides by q1; the relinearisation by nothing.
    assert!(lost(quest, &half_turn, 50, 1e-5)[0] > 10 && lost(quest, &translation, 50, 1e-5)[1] > 5);
    assert_eq!(lost(relinearization, &half_turn, 20, 1e-5), [0, 0]);
    assert_eq!(lost(relinearization, &translation, 20, 1e-5), [0, 0]);
    // As the parallax vanishes the solutions run together.
    let with = |parallax| SceneOptions { motion: Motion::Parallax(parallax), ..base };
    assert_eq!(lost(quest, &with(0.1), 100, 1e-4)[0], 0);
    assert!(lost(quest, &with(1e-4), 50, 1e-7)[0] > 25);
}
