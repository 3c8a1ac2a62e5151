//! Scenes and solves, for tests that want no error handling.

use nalgebra::UnitQuaternion;
use quest_core::simulate::{Scene, SceneOptions};
use quest_core::solver::{Kinds, SolverName};
use quest_core::{CandidateKind, Candidates, Correspondence};

/// A scene that is known to exist.
#[must_use]
pub fn scene(options: &SceneOptions, seed: u64, index: u64) -> Scene {
    Scene::generate(options, seed, index).expect("a possible scene")
}

/// `count` scenes of one seed.
pub fn scenes(options: SceneOptions, seed: u64, count: u64) -> impl Iterator<Item = Scene> {
    (0..count).map(move |index| scene(&options, seed, index))
}

/// What a solver finds.
#[must_use]
pub fn solve(solver: SolverName, kinds: Kinds, matches: &[Correspondence]) -> Candidates {
    let mut out = Candidates::new();
    solver.solve(kinds, matches, &mut out);
    out
}

/// The rotations of the exact candidates.
#[must_use]
pub fn exact_rotations(candidates: &Candidates) -> Vec<UnitQuaternion<f64>> {
    let exact = candidates.iter().filter(|c| c.kind == CandidateKind::Exact);
    exact.map(|c| c.pose.q_21).collect()
}
