//! Solvers against each other: the same problem has the same real solutions.

use nalgebra::UnitQuaternion;
use quest_core::simulate::{SceneOptions, View};
use quest_core::solver::{Kinds, SolverName};
use quest_tests::scenes::{exact_rotations, scenes, solve};
use quest_tests::solution_sets::nearest;

use super::noisy;

const SEED_AGREEMENT: u64 = 104;

/// Scenes of which `quest` finds four of eight real solutions, all of them well apart: an open fault.
const INCOMPLETE: [(View, usize); 1] = [(View::InBothImages, 18_698)];

#[test]
fn quest_and_quest_eigen_find_the_same_solutions() {
    let mut solutions = 0;
    let mut differ = Vec::new();
    for options in [SceneOptions::default(), SceneOptions::realistic()] {
        for (index, scene) in scenes(noisy(options), SEED_AGREEMENT, 20_000).enumerate() {
            let [a, b] = [SolverName::Quest, SolverName::QuestEigen]
                .map(|solver| exact_rotations(&solve(solver, Kinds::Exact, &scene.matches)));
            solutions += a.len();
            let lonely = |q: &UnitQuaternion<f64>, set: &[_]| nearest(q, set) > 1e-7;
            if a.len() != b.len() || a.iter().any(|q| lonely(q, &b)) || b.iter().any(|q| lonely(q, &a)) {
                differ.push((options.view, index));
            }
        }
    }
    differ.retain(|scene| !INCOMPLETE.contains(scene));
    assert_eq!(differ, []);
    // About nine real solutions a problem.
    assert!(solutions > 350_000, "{solutions}");
}
