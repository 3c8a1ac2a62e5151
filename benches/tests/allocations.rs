//! No solver takes memory from the heap.

use quest_benches::SEED;
use quest_benches::cells::Cell;
use quest_core::Candidates;
use quest_core::simulate::{Motion, Scene, SceneOptions};
use quest_core::solver::SolverName;

#[test]
fn the_counter_counts() {
    let info = allocation_counter::measure(|| drop(std::hint::black_box(Box::new(1))));
    assert_eq!(info.count_total, 1);
}

#[test]
fn no_solver_allocates() {
    let motions = [Motion::General, Motion::Parallax(1e-3), Motion::PureRotation, Motion::PureTranslation];
    for cell in Cell::of(&SolverName::ALL, usize::MAX) {
        for points in [4, 5, 6, 50] {
            for motion in motions {
                for noise_px in [0.0, 0.75] {
                    let options = SceneOptions { motion, points, noise_px, ..SceneOptions::realistic() };
                    for index in 0..20 {
                        let scene = Scene::generate(&options, SEED, index).unwrap();
                        let mut out = Candidates::new();
                        let info = allocation_counter::measure(|| cell.solve(&scene.matches, &mut out));
                        assert_eq!(info.count_total, 0, "{cell:?}, scene {index} of {options:?}");
                    }
                }
            }
        }
    }
}
