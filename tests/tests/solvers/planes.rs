//! The planar candidates: where there is a plane they come closer to the truth, and nothing else changes.

use quest_core::simulate::{Layout, Motion, Scene, SceneOptions};
use quest_core::solver::{Kinds, SolverName};
use quest_core::{Candidate, CandidateKind, Candidates, RelativePose};
use quest_tests::scenes::{scenes, solve};

use super::{closest, noisy};

const SEED_PLANES: u64 = 107;
const WITH_PLANES: [SolverName; 3] = [SolverName::Quest, SolverName::QuestEigen, SolverName::Relinearization];

fn is_planar(candidate: &Candidate) -> bool {
    candidate.kind == CandidateKind::Planar
}

fn error(found: &Candidates, truth: &RelativePose) -> f64 {
    closest(found, truth).unwrap().pose.rotation_error(truth)
}

#[test]
fn on_planes_they_come_closer_and_the_others_stay() {
    for solver in WITH_PLANES {
        for points in [5, 20] {
            let options =
                noisy(SceneOptions { layout: Layout::Coplanar, points, ..SceneOptions::realistic() });
            let (mut all_errors, mut planar_errors) = (0.0, 0.0);
            for one in scenes(options, SEED_PLANES, 300) {
                let [all, planar] =
                    [Kinds::All, Kinds::Planar].map(|kinds| solve(solver, kinds, &one.matches));
                assert!(planar.iter().filter(|c| !is_planar(c)).eq(all.iter()));
                all_errors += error(&all, &one.truth);
                planar_errors += error(&planar, &one.truth);
            }
            // 0.79 to 0.88 of the sum, by solver and number of points.
            assert!(planar_errors < 0.93 * all_errors, "{planar_errors} {all_errors}");
        }
    }
}

#[test]
fn there_are_none_without_a_plane_or_beside_its_exact_solutions() {
    let exact_plane = SceneOptions { layout: Layout::Coplanar, ..SceneOptions::default() };
    let turned = SceneOptions { motion: Motion::PureRotation, ..noisy(SceneOptions::default()) };
    let spread = SceneOptions { points: 20, ..noisy(SceneOptions::realistic()) };
    // Five points that noise moves without parallax lie close to a plane by accident once in a while.
    for (options, most) in [(exact_plane, 0), (turned, 10), (spread, 0)] {
        let found = |one: &Scene| solve(SolverName::Quest, Kinds::Planar, &one.matches);
        let is_flat = |one: &Scene| found(one).iter().any(is_planar);
        let count = scenes(options, SEED_PLANES, 300).filter(is_flat).count();
        assert!(count <= most, "{count} {options:?}");
    }
}
