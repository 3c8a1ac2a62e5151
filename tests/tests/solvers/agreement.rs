//! Solvers against each other: the same problem has the same real solutions.

use std::collections::BTreeMap;

use nalgebra::UnitQuaternion;
use quest_core::simulate::{SceneOptions, View};
use quest_core::solver::{Kinds, SolverName};
use quest_tests::scenes::{exact_rotations, scenes, solve};
use quest_tests::solution_sets::nearest;

use super::{noisy, same_rotations};

const SEED_AGREEMENT: u64 = 104;

/// The scenes, of `count` with each view, of which `quest` and `quest-eigen` have different real solutions, to 1e-7 rad; and
/// how many solutions there are.
fn differences(count: usize) -> (Vec<(View, usize)>, usize) {
    let (mut differ, mut solutions) = (Vec::new(), 0);
    for options in [SceneOptions::default(), SceneOptions::realistic()] {
        for (index, scene) in scenes(noisy(options), SEED_AGREEMENT, count as u64).enumerate() {
            let [a, b] = [SolverName::Quest, SolverName::QuestEigen]
                .map(|solver| exact_rotations(&solve(solver, Kinds::Exact, &scene.matches)));
            solutions += a.len();
            let lonely = |q: &UnitQuaternion<f64>, set: &[_]| nearest(q, set) > 1e-7;
            if a.len() != b.len() || a.iter().any(|q| lonely(q, &b)) || b.iter().any(|q| lonely(q, &a)) {
                differ.push((options.view, index));
            }
        }
    }
    (differ, solutions)
}

#[test]
fn quest_and_quest_eigen_find_the_same_solutions() {
    let (differ, solutions) = differences(20_000);
    assert_eq!(differ, []);
    // About nine real solutions a problem.
    assert!(solutions > 350_000, "{solutions}");
}

#[test]
#[ignore = "a hundred thousand problems: a minute"]
fn quest_and_quest_eigen_find_the_same_solutions_of_a_hundred_thousand() {
    let (differ, solutions) = differences(50_000);
    assert_eq!(differ, []);
    assert!(solutions > 875_000, "{solutions}");
}

/// Of 10,000 problems, those with nearly double solutions among them, of which rounding may make a complex pair, none has other
/// solutions by one of the five-point solvers than by another.
#[test]
fn all_five_point_solvers_find_the_same_solutions() {
    let solvers = SolverName::ALL.into_iter().filter(|solver| solver.info().min_matches == 5);
    let solvers: Vec<_> = solvers.collect();
    let mut different = BTreeMap::new();
    for options in [SceneOptions::default(), SceneOptions::realistic()] {
        for scene in scenes(noisy(options), SEED_AGREEMENT + 1, 5_000) {
            let rotations =
                |solver: &SolverName| exact_rotations(&solve(*solver, Kinds::Exact, &scene.matches));
            let found: Vec<_> = solvers.iter().map(rotations).collect();
            for i in 0..found.len() {
                for j in (0..i).filter(|&j| !same_rotations(&found[i], &found[j])) {
                    *different.entry((solvers[i].info().name, solvers[j].info().name)).or_insert(0) += 1;
                }
            }
        }
    }
    assert_eq!(different, BTreeMap::<_, usize>::new());
}
