//! The closed loop.

mod controller;
mod hostile;
mod known_depths;
mod laboratory;

use super::*;
use crate::servo::simulation::scenario::{self, Features};
use crate::solver::SolverName;
use crate::{Candidates, RelativePose};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

const LIMITS: Limits = Limits { speed: 0.5, turn_rate: 0.6 };

/// A plane that a robot keeps to exactly.
const PLANE: Plane = Plane { tilt: 0.002, height: 0.001 };

fn filter(world: &World, goal: &[[f64; 2]], plane: Option<Plane>) -> DepthFilter<SolverName> {
    let options = FilterOptions { plane, first_images: 1, ..world.filter_options(&LIMITS, 2.0) };
    DepthFilter::new(goal, SolverName::Quest, options)
}

fn robot(rng: &mut ChaCha8Rng, count: usize, disturbances: &Disturbances) -> (World, DifferentialDrive) {
    scenario::random(Features::General, count, disturbances, rng, |_| {
        scenario::robot_start(Features::General)
    })
}

/// All records of a run.
fn records<P: Plant, E: PoseEstimator, L: ControlLaw>(
    world: &World,
    plant: &mut P,
    mut servo: Servo<E, L>,
    images: usize,
    rng: &mut ChaCha8Rng,
) -> Vec<Record> {
    let mut all = Vec::new();
    world.run(plant, &mut servo, images, rng, |record| {
        all.push(record.clone());
        true
    });
    all
}

/// How many images a run without noise or with one first image starts with: one to find candidates in, and one at most for each of
/// them. It stands still meanwhile.
fn starting(records: &[Record]) -> usize {
    let is_starting = |record: &&Record| record.step.estimate == Err(HoldReason::Starting);
    let count = records.iter().take_while(is_starting).count();
    assert!((1..=1 + Candidates::CAPACITY).contains(&count), "{count}");
    assert!(records[..count].iter().all(|record| record.step.command == Twist::zero()));
    count
}

fn harmonic_mean(world: &World) -> f64 {
    world.points.len() as f64 / world.points.iter().map(|x| 1.0 / x.z).sum::<f64>()
}

#[test]
fn the_paper_s_camera_arrives() {
    let (world, mut camera) = scenario::paper();
    let rng = &mut scenario::generator(1, 0);
    let goal = world.on_plane(&world.goal_pixels(rng));
    let servo = Servo::new(
        &goal,
        filter(&world, &goal, None),
        FreeCameraLaw { rate: 0.25, unit: 2.0 },
        Safety::new(LIMITS),
    );
    let all = records(&world, &mut camera, servo, 1_400, rng);
    let all = &all[starting(&all)..];
    let estimates: Vec<_> = all.iter().map(|r| r.step.estimate.unwrap().pose).collect();
    // (10.1), rounded as printed there, in the unit of the goal's depths.
    let unit = harmonic_mean(&world);
    let first = &estimates[0];
    let printed = [0.943, -0.110, -0.223, -0.221];
    assert!(first.wxyz().iter().zip(printed).all(|(a, b)| (a - b).abs() < 6e-4), "{:?}", first.wxyz());
    let millimetres = first.t_21 * unit * 1000.0;
    let printed = nalgebra::Vector3::new(1097.0, -640.0, -47.0);
    assert!((millimetres - printed).amax() < 1.0, "{millimetres}");
    // The right candidate in all frames, and the same unit: the prior on the depths pulls less than 1e-4.
    for (record, estimate) in all.iter().zip(&estimates) {
        assert!(record.truth.rotation_error(estimate) < 1e-4, "at {}", record.time);
        assert!((record.truth.t_21 - estimate.t_21 * unit).norm() < 1e-3 * record.truth.t_21.norm() + 1e-9);
    }
    let end = camera.pose();
    assert!(end.t_21.norm() < 1e-4 && end.q_21.angle().to_degrees() < 0.01, "{end:?}");
}

#[test]
fn the_printed_depths_are_those_of_the_scene() {
    let (world, _) = scenario::paper();
    let sum: f64 = world.points.iter().map(|x| x.z).sum();
    let printed = [0.178, 0.175, 0.180, 0.233, 0.233];
    for (x, printed) in world.points.iter().zip(printed) {
        // The printed depths add up to 0.999.
        assert!((x.z / sum - printed).abs() < 6e-4);
    }
}

#[test]
fn robots_arrive_without_noise_and_with_it() {
    for (noise_px, count) in [(0.0, 5), (0.5, 20)] {
        let disturbances = Disturbances { noise_px, rounded: noise_px > 0.0, ..Disturbances::default() };
        for index in 0..10 {
            let rng = &mut scenario::generator(2, index);
            let (world, mut plant) = robot(rng, count, &disturbances);
            let goal = world.on_plane(&world.goal_pixels(rng));
            let servo = Servo::new(
                &goal,
                filter(&world, &goal, Some(PLANE)),
                DifferentialDriveLaw::default(),
                Safety { border: world.border(15.0), ..Safety::new(LIMITS) },
            );
            let all = records(&world, &mut plant, servo, 500, rng);
            assert!(plant.x.hypot(plant.z) < 0.02, "{index}: {plant:?}");
            assert!(plant.heading.abs().to_degrees() < 1.0, "{index}: {plant:?}");
            assert!(all[starting(&all)..].iter().all(|r| r.step.estimate.is_ok()), "{index}");
        }
    }
}

/// Normalised by the goal's depths the unit of t stays, by both views' depths it changes, and an essential matrix has none.
#[test]
fn only_the_goal_s_depths_give_a_constant_unit() {
    let (world, _) = scenario::paper();
    let camera = FreeCamera::new(scenario::robot_start(Features::General).pose());
    let ratios = |length| {
        let rng = &mut scenario::generator(3, 0);
        let goal = world.on_plane(&world.goal_pixels(rng));
        let mut estimator = PerFrame::new(&goal, SolverName::Quest, Choice::Reprojection, length);
        estimator.set_depths(&world.points.iter().map(|x| x.z).collect::<Vec<_>>());
        let mut moving = camera;
        let mut law = FreeCameraLaw { rate: 0.25, unit: 2.0 };
        let mut ratios = Vec::new();
        for _ in 0..200 {
            let pose = moving.pose();
            let features: Vec<_> = world
                .points
                .iter()
                .map(|x| pose.q_21 * x + pose.t_21)
                .map(|x| Some([x.x / x.z, x.y / x.z]))
                .collect();
            let estimate = estimator.estimate(&features).unwrap().pose;
            ratios.push(pose.t_21.norm() / estimate.t_21.norm());
            moving.advance(&law.command(&RelativePose::new(pose.q_21, pose.t_21 / 2.0)), world.period);
        }
        let (least, most) = ratios.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), &x| (a.min(x), b.max(x)));
        most / least
    };
    assert!(ratios(Length::GoalDepths) - 1.0 < 1e-9, "{}", ratios(Length::GoalDepths));
    assert!(ratios(Length::BothViews) > 1.05, "{}", ratios(Length::BothViews));
    assert!(ratios(Length::Unit) > 3.0, "{}", ratios(Length::Unit));
}

/// Down to four features and back: it stands still, says why, and goes on.
#[test]
fn lost_features_hold_and_found_ones_resume() {
    for found in [4, 0] {
        let lost = Some((30..60, found));
        let disturbances = Disturbances { noise_px: 0.5, rounded: true, lost, ..Disturbances::default() };
        let rng = &mut scenario::generator(4, 0);
        let (world, mut plant) = robot(rng, 20, &disturbances);
        let goal = world.on_plane(&world.goal_pixels(rng));
        let law = DifferentialDriveLaw::default();
        let servo = Servo::new(&goal, filter(&world, &goal, Some(PLANE)), law, Safety::new(LIMITS));
        let all = records(&world, &mut plant, servo, 500, rng);
        for (index, record) in all.iter().enumerate().skip(starting(&all)) {
            let Step { command, estimate, .. } = &record.step;
            if (30..60).contains(&index) {
                assert_eq!(estimate.unwrap_err(), HoldReason::TooFewFeatures);
                assert_eq!(*command, Twist::zero());
            } else {
                assert!(estimate.is_ok(), "{index}: {estimate:?}");
            }
        }
        assert!(plant.x.hypot(plant.z) < 0.02 && plant.heading.abs() < 0.02, "{plant:?}");
    }
}

/// A copy of an estimator that has seen nothing works as the original does.
#[test]
fn a_clone_averages_the_first_images_too() {
    let rng = &mut scenario::generator(7, 0);
    let (world, plant) = robot(rng, 8, &Disturbances { noise_px: 0.5, ..Disturbances::default() });
    let goal = world.on_plane(&world.goal_pixels(rng));
    let mut original = DepthFilter::new(&goal, SolverName::Quest, world.filter_options(&LIMITS, 2.0));
    let mut copy = original.clone();
    let image: Vec<_> = world.points.iter().map(|x1| plant.pose().q_21 * x1 + plant.pose().t_21).collect();
    let image: Vec<_> = image.iter().map(|x2| Some([x2.x / x2.z, x2.y / x2.z])).collect();
    let mut poses = 0;
    for index in 0..40 {
        let expected = original.estimate(&image);
        assert_eq!(copy.estimate(&image), expected, "image {index}");
        assert!(expected.is_ok() || expected == Err(HoldReason::Starting), "image {index}: {expected:?}");
        assert!(expected.is_err() || index >= 9, "image {index}");
        poses += usize::from(expected.is_ok());
    }
    assert!(poses > 0);
}

/// A tracker that is copied before every image works as the original does, through its start and beyond.
#[test]
fn a_tracker_can_be_copied_at_any_time() {
    for (seed, count) in [(8, 5), (9, 8), (10, 30)] {
        let rng = &mut scenario::generator(seed, 0);
        let disturbances = Disturbances { noise_px: 0.5, ..Disturbances::default() };
        let (world, plant) = robot(rng, count, &disturbances);
        let goal = world.on_plane(&world.goal_pixels(rng));
        let mut original = Tracker::new(&goal, SolverName::Quest, world.filter_options(&LIMITS, 2.0));
        let mut copy = original.clone();
        let mut poses = 0;
        let pose = plant.pose();
        let seen: Vec<_> = world.points.iter().map(|x1| pose.q_21 * x1 + pose.t_21).collect();
        for index in 0..60 {
            let mut noise = || rng.random_range(-1e-3..1e-3);
            let image: Vec<_> =
                seen.iter().map(|x2| Some([x2.x / x2.z + noise(), x2.y / x2.z + noise()])).collect();
            copy = copy.clone();
            let expected = original.estimate(&image);
            assert_eq!(copy.estimate(&image), expected, "{count} features, image {index}");
            poses += usize::from(expected.is_ok());
        }
        assert!(poses > 20, "{count}: {poses}");
    }
}

/// Turning gives way to features at the border.
#[test]
fn turns_do_not_push_features_out() {
    struct Fixed(f64);
    impl ControlLaw for Fixed {
        fn command(&mut self, _: &RelativePose) -> Twist {
            Twist::drive(0.1, self.0)
        }
    }
    struct Still;
    impl PoseEstimator for Still {
        fn estimate(&mut self, features: &[Option<[f64; 2]>]) -> Result<Estimate, HoldReason> {
            Ok(Estimate {
                pose: RelativePose::identity(),
                covariance: Some(nalgebra::Matrix6::zeros()),
                inliers: features.len(),
                residual: 0.0,
                alternatives: 1,
                support: Support::Full,
            })
        }
    }
    let safety = Safety { border: Some(Border { left: -0.5, right: 0.5 }), ..Safety::new(LIMITS) };
    let turn = |goal: [f64; 2], now: [f64; 2], rate| {
        Servo::new(&[goal], Still, Fixed(rate), safety).step(&[Some(now)]).command.angular.y
    };
    // To the right, features move to the left: one that is out there is brought back.
    assert!(turn([0.0, 0.0], [-0.55, 0.0], 0.2) < -0.1);
    assert!((turn([0.0, 0.0], [-0.55, 0.0], -0.2) + 0.2).abs() < 1e-15);
    assert!((turn([0.0, 0.0], [-0.45, 0.0], 0.2) - 0.2).abs() < 1e-15);
    assert!((turn([-0.6, 0.0], [-0.55, 0.0], 0.2) - 0.2).abs() < 1e-15);
    assert!(turn([0.0, 0.0], [0.55, 0.0], -0.2) > 0.1);
}

/// A law that stands still.
#[derive(Clone, Debug)]
struct Still;

impl ControlLaw for Still {
    fn command(&mut self, _: &RelativePose) -> Twist {
        Twist::zero()
    }
}

/// The records of a camera that stands still at a robot's start, with these disturbances.
fn standing(disturbances: &Disturbances, images: usize) -> (World, Vec<Record>) {
    let rng = &mut scenario::generator(21, 0);
    let (world, mut plant) = robot(rng, 20, disturbances);
    let goal = world.on_plane(&world.goal_pixels(rng));
    let servo = Servo::new(&goal, filter(&world, &goal, Some(PLANE)), Still, Safety::new(LIMITS));
    let all = records(&world, &mut plant, servo, images, rng);
    (world, all)
}

#[test]
fn disturbances_do_what_they_say() {
    let (world, exact) = standing(&Disturbances::default(), 30);
    assert_eq!(exact.len(), 30);
    let true_pixels = &exact[0].pixels;
    assert!(true_pixels.iter().all(Option::is_some) && exact.iter().all(|r| r.pixels == *true_pixels));
    // Nothing comes before the first image has come through.
    let (_, late) = standing(&Disturbances { delay: 3, ..Disturbances::default() }, 30);
    for (index, record) in late.iter().enumerate() {
        let is_there = record.pixels.iter().all(Option::is_some);
        assert!(is_there == (index >= 3) && record.pixels.iter().any(Option::is_some) == is_there, "{index}");
    }
    assert_eq!(late[3].pixels, *true_pixels);
    // One feature in five elsewhere in the image; one image in four from somewhere else.
    let changed = |records: &[Record]| {
        let count = |r: &Record| r.pixels.iter().zip(true_pixels).filter(|(a, b)| a != b).count();
        records.iter().map(count).collect::<Vec<_>>()
    };
    let (_, some) = standing(&Disturbances { outliers: 0.2, ..Disturbances::default() }, 100);
    let share = changed(&some).iter().sum::<usize>() as f64 / 2_000.0;
    assert!((share - 0.2).abs() < 0.05, "{share}");
    let (width, height) = world.camera.size().unwrap();
    let is_inside =
        |[u, v]: &[f64; 2]| (0.0..f64::from(width)).contains(u) && (0.0..f64::from(height)).contains(v);
    assert!(some.iter().flat_map(|r| r.pixels.iter().flatten()).all(is_inside));
    let (_, wrong) = standing(&Disturbances { wrong_images: 0.25, ..Disturbances::default() }, 200);
    let counts = changed(&wrong);
    assert!(counts.iter().all(|count| [0, 20].contains(count)), "{counts:?}");
    let share = counts.iter().filter(|count| **count > 0).count() as f64 / 200.0;
    assert!((share - 0.25).abs() < 0.1, "{share}");
}

#[test]
fn who_watches_a_run_may_end_it() {
    let rng = &mut scenario::generator(22, 0);
    let (world, mut plant) = robot(rng, 20, &Disturbances::default());
    let goal = world.on_plane(&world.goal_pixels(rng));
    let mut servo = Servo::new(&goal, filter(&world, &goal, Some(PLANE)), Still, Safety::new(LIMITS));
    let mut times = Vec::new();
    world.run(&mut plant, &mut servo, 50, rng, |record| {
        times.push(record.time);
        times.len() < 7
    });
    assert_eq!(times.len(), 7);
    assert!(times.iter().enumerate().all(|(k, time)| (time - 0.1 * k as f64).abs() < 1e-12));
}

#[test]
fn a_camera_without_a_size_sees_all_that_is_in_front() {
    let (mut world, _) = scenario::paper();
    let camera = crate::Camera::new(world.camera.model(), world.camera.params()).unwrap();
    let aside = RelativePose::new(nalgebra::UnitQuaternion::identity(), nalgebra::Vector3::x() * 9.0);
    assert!(!world.sees_all(&aside, 0.0) && world.seen_from(&aside) == 0);
    world.camera = camera;
    assert!(world.sees_all(&aside, 15.0) && world.seen_from(&aside) == 5 && world.border(15.0).is_none());
    let behind = RelativePose::new(nalgebra::UnitQuaternion::identity(), nalgebra::Vector3::z() * -9.0);
    assert!(!world.sees_all(&behind, 0.0) && world.seen_from(&behind) == 0);
}

#[test]
fn a_start_before_a_plane_is_mirrored() {
    let (general, coplanar) =
        (scenario::robot_start(Features::General), scenario::robot_start(Features::Coplanar));
    assert!((general.x + coplanar.x).abs() < 1e-15 && (general.heading + coplanar.heading).abs() < 1e-15);
    assert!((general.z - coplanar.z).abs() < 1e-15 && general.x > 0.0);
}

/// A tracker that knows the plane of its base brings the robot to its goal, with few features and with many.
#[test]
fn robots_arrive_with_a_tracker_that_knows_their_plane() {
    for (count, seed) in [(8, 23), (20, 24), (150, 25)] {
        let rng = &mut scenario::generator(seed, 0);
        let disturbances = Disturbances { noise_px: 0.5, ..Disturbances::default() };
        let (world, mut plant) = robot(rng, count, &disturbances);
        let goal = world.on_plane(&world.goal_pixels(rng));
        let options = FilterOptions { plane: Some(PLANE), ..world.filter_options(&LIMITS, 2.0) };
        let tracker = Tracker::new(&goal, SolverName::Quest, options);
        let safety = Safety { border: world.border(15.0), ..Safety::new(LIMITS) };
        let rig = Rig { unit: 2.0, period: world.period, ..Rig::default() };
        let servo = Servo::new(&goal, tracker, DifferentialDriveLaw::default(), safety).with_rig(rig);
        let all = records(&world, &mut plant, servo, 400, rng);
        assert!(plant.x.hypot(plant.z) < 0.03, "{count}: {plant:?}");
        assert!(plant.heading.abs().to_degrees() < 1.0, "{count}: {plant:?}");
        // It keeps to its plane on the way.
        for record in &all {
            if let Ok(Estimate { pose, support: Support::Full, .. }) = record.step.estimate {
                let tilt = (pose.q_21 * nalgebra::Vector3::y() - nalgebra::Vector3::y()).norm();
                assert!(tilt < 0.02 && pose.t_21.y.abs() < 0.01, "{count}, {}: {pose:?}", record.time);
            }
        }
    }
}
