//! Solvers against each other: the same problem has the same real solutions.

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

/// The five-point solvers that return the real solutions, and of how many of 10,000 problems each may find others than the
/// rest do: those with nearly double solutions, of which rounding makes a complex pair. About twice what was found.
const EXACT: [(SolverName, usize); 8] = [
    (SolverName::Quest, 2),
    (SolverName::QuestEigen, 0),
    (SolverName::Relinearization, 0),
    (SolverName::Nister, 0),
    (SolverName::Stewenius, 0),
    (SolverName::LiHartley, 0),
    (SolverName::Kukelova, 0),
    (SolverName::Kneip, 0),
];

#[test]
fn all_exact_solvers_find_the_same_solutions() {
    let mut different = [[0; EXACT.len()]; EXACT.len()];
    for options in [SceneOptions::default(), SceneOptions::realistic()] {
        for scene in scenes(noisy(options), SEED_AGREEMENT + 1, 5_000) {
            let found =
                EXACT.map(|(solver, _)| exact_rotations(&solve(solver, Kinds::Exact, &scene.matches)));
            for i in 0..EXACT.len() {
                for j in 0..i {
                    different[i][j] += usize::from(!same_rotations(&found[i], &found[j]));
                }
            }
        }
    }
    for i in 0..EXACT.len() {
        for j in 0..i {
            let [(a, some), (b, others)] = [EXACT[i], EXACT[j]];
            assert!(different[i][j] <= some + others, "{a:?} and {b:?}: {different:?}");
        }
    }
}
