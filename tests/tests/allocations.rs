//! No solver takes memory from the heap.

use quest_benches::SEED;
use quest_benches::cells::Cell;
use quest_core::Candidates;
use quest_core::lanes::{
    BatchSolver, Essentials, ImageMatches, Instructions, Scorer, SearchScore, Stop, Tolerance,
};
use quest_core::simulate::{Motion, Scene, SceneOptions};
use quest_core::solver::{Kinds, SolverName};

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

/// The paper's own steps work in buffers that are kept: what is left is one block that faer asks for inside its eigenvectors.
#[test]
fn the_literal_solvers_allocate_in_faer_alone() {
    for solver in SolverName::LITERAL {
        let options = SceneOptions { noise_px: 0.75, ..SceneOptions::realistic() };
        let mut out = Candidates::new();
        for index in 0..20 {
            let scene = Scene::generate(&options, SEED, index).unwrap();
            let mut solve = || solver.solve(Kinds::All, &scene.matches, &mut out);
            // The first solve lets the buffers grow.
            solve();
            let count = allocation_counter::measure(solve).count_total;
            assert!(count <= 1, "{solver:?}, scene {index}: {count}");
        }
    }
}

/// Once the buffers have grown.
#[test]
fn no_batch_in_lanes_allocates() {
    let options = SceneOptions { points: 130, ..SceneOptions::realistic() };
    let scene = Scene::generate(&options, SEED, 0).unwrap();
    let samples: Vec<[u32; 5]> = (0..101).map(|k| [k, k + 1, k + 7, k + 19, k + 29]).collect();
    let mut image = ImageMatches::<f32>::new();
    for m in &scene.matches {
        let (a, b) = (m.bearing1() / m.bearing1().z, m.bearing2() / m.bearing2().z);
        image.push([a.x, a.y], [b.x, b.y]);
    }
    for instructions in Instructions::ALL.into_iter().filter(|i| i.is_available()) {
        let scorer = Scorer::with_instructions(instructions).unwrap();
        for tolerance in [Tolerance::Tight, Tolerance::Loop] {
            let solver = BatchSolver::with_instructions(tolerance, instructions).unwrap();
            let (mut found, mut mask, mut candidates) = (Essentials::new(), Vec::new(), Candidates::new());
            let mut all = || {
                solver.solve_all(&scene.matches, &samples, &mut found).unwrap();
                found.candidates(0, &scene.matches[..5], &mut candidates);
                for e in &found.matrices()[..5] {
                    std::hint::black_box(scorer.score(&image, e, 1e-3, SearchScore::default(), Stop::Never));
                    std::hint::black_box(scorer.inliers(&image, e, 1e-3, &mut mask));
                }
            };
            all();
            assert_eq!(allocation_counter::measure(all).count_total, 0, "{instructions:?} {tolerance:?}");
        }
    }
}

/// One image of the closed loop: candidates, fit, choice, filter, law, guards.
#[test]
fn no_step_of_the_filter_s_loop_allocates() {
    use quest_core::servo::{DepthFilter, FreeCameraLaw, Limits, Safety, Servo, scenario};
    let limits = Limits { speed: 0.5, turn_rate: 0.6 };
    let (world, mut camera) = scenario::paper();
    let rng = &mut scenario::generator(SEED, 0);
    let goal = world.on_plane(&world.goal_pixels(rng));
    let filter = DepthFilter::new(&goal, SolverName::Quest, world.filter_options(&limits, 2.0));
    let law = FreeCameraLaw { rate: 0.25, unit: 2.0 };
    let mut servo = Servo::new(&goal, filter, law, Safety::new(limits));
    let mut images = Vec::new();
    let mut seen = Servo::new(&goal, servo.estimator().clone(), law, Safety::new(limits));
    world.run(&mut camera, &mut seen, 100, rng, |record| {
        images.push(record.features.clone());
        true
    });
    // Lost, one false, and found again.
    images[50].fill(None);
    images[60][2] = Some([0.9, 0.9]);
    for (index, image) in images.iter().enumerate() {
        let info = allocation_counter::measure(|| {
            std::hint::black_box(servo.step(image));
        });
        assert_eq!(info.count_total, 0, "image {index}");
    }
}

/// One image of the closed loop: start, search, poses, map, law, guards. Also where features are lost, wrong and found again.
#[test]
fn no_step_of_the_tracker_s_loop_allocates() {
    use quest_core::servo::{Disturbances, FreeCameraLaw, Limits, Plant, Rig, Safety, Servo, Sticky};
    use quest_core::servo::{Tracker, scenario};
    let limits = Limits { speed: 0.5, turn_rate: 0.6 };
    for (stream, count, share) in [(0, 5, 0.0), (1, 20, 0.1), (2, 200, 0.3)] {
        let sticky = Some(Sticky { share, images: 20.0 });
        let disturbances = Disturbances { noise_px: 0.5, sticky, ..Disturbances::default() };
        let rng = &mut scenario::generator(SEED, stream);
        let features = scenario::Features::General;
        let mut world = scenario::robot_world(features, count, disturbances, rng);
        // All of them in view.
        world.points.iter_mut().for_each(|x| (x.x, x.y) = (0.6 * x.x, 0.6 * x.y));
        let mut camera = scenario::robot_start(features);
        let goal = world.on_plane(&world.goal_pixels(rng));
        let tracker = Tracker::new(&goal, SolverName::Quest, world.filter_options(&limits, 2.0));
        let law = FreeCameraLaw { rate: 0.25, unit: 2.0 };
        let rig = Rig { unit: 2.0, ..Rig::default() };
        let mut servo = Servo::new(&goal, tracker, law, Safety::for_robot(limits)).with_rig(rig);
        let mut images = Vec::new();
        let mut poses = 0;
        world.run(&mut camera, &mut servo.clone(), 150, rng, |record| {
            images.push(record.features.clone());
            poses += usize::from(record.step.state.has_pose());
            true
        });
        assert!(poses > 80, "{count}: {poses}");
        assert!(camera.pose().t_21.norm() < 1.0);
        // Lost for a while, so that the pose is searched for, and one false.
        images[60..80].iter_mut().for_each(|image| image.rotate_left(1));
        images[80].fill(None);
        images[90][2] = Some([0.9, 0.9]);
        for (index, image) in images.iter().enumerate() {
            let info = allocation_counter::measure(|| {
                std::hint::black_box(servo.step(image));
            });
            assert_eq!(info.count_total, 0, "{count} features, image {index}");
        }
    }
}
