//! Appendix C by simulation: convergence, V, the heading, and the law as printed.

use super::*;
use crate::servo::simulation::plant::{DifferentialDrive, Plant};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::f64::consts::{FRAC_PI_2, PI};

/// The unit of t, in metres.
const UNIT: f64 = 2.0;

fn scaled(plant: &impl Plant) -> RelativePose {
    let pose = plant.pose();
    RelativePose::new(pose.q_21, pose.t_21 / UNIT)
}

/// `r²/2 + 1 − cos ψ`.
fn lyapunov(planar: &PlanarPose) -> f64 {
    0.5 * planar.distance.powi(2) + 1.0 - planar.bearing.cos().abs()
}

/// What a run did.
struct Run {
    end: DifferentialDrive,
    /// The largest increase of V while driving.
    increase: f64,
    /// The largest change of the heading from the start.
    excursion: f64,
}

fn run(mut robot: DifferentialDrive, mut law: impl ControlLaw + Clone, until: f64) -> Run {
    const PERIOD: f64 = 0.02;
    let start = robot.heading;
    let (mut increase, mut excursion, mut before) = (f64::NEG_INFINITY, 0.0_f64, f64::INFINITY);
    for _ in 0..6_000 {
        let planar = PlanarPose::new(&scaled(&robot));
        if planar.distance > until {
            let v = lyapunov(&planar);
            (increase, before) = (increase.max(v - before), v);
        }
        let twist = law.command(&scaled(&robot));
        robot.advance(&twist, PERIOD);
        excursion = excursion.max((robot.heading - start).abs());
        if planar.distance <= until && robot.pose().q_21.angle() < 1e-3 {
            break;
        }
    }
    Run { end: robot, increase, excursion }
}

fn start(rng: &mut ChaCha8Rng) -> DifferentialDrive {
    DifferentialDrive {
        x: rng.random_range(-1.5..1.5),
        z: rng.random_range(-1.5..1.5),
        heading: rng.random_range(-PI..PI),
    }
}

fn is_home(robot: &DifferentialDrive, distance: f64) -> bool {
    robot.x.hypot(robot.z) <= distance && robot.pose().q_21.angle() < 0.01
}

#[test]
fn every_start_converges_and_v_decreases() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    for k in 0..2_000 {
        let robot = start(&mut rng);
        let law = DifferentialDriveLaw::as_published(0.5, 0.6, 0.004);
        let run = run(robot, law, 0.004);
        assert!(is_home(&run.end, 0.004 * UNIT), "start {k}: {robot:?} to {:?}", run.end);
        assert!(run.increase < 0.0, "start {k}: V grows by {:e}", run.increase);
    }
}

#[test]
fn the_precautions_change_nothing_of_that() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    for k in 0..500 {
        let robot = start(&mut rng);
        let run = run(robot, DifferentialDriveLaw::default(), 0.06);
        assert!(is_home(&run.end, 0.06 * UNIT), "start {k}: {robot:?} to {:?}", run.end);
        assert!(run.increase < 0.0, "start {k}: V grows by {:e}", run.increase);
    }
}

/// Six millimetres of noise: by single images the robot stops a centimetre before the goal.
#[test]
fn noise_does_not_stop_the_robot_early() {
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let mut mean_end = |averaged_images| {
        let end = |_| {
            let mut robot = DifferentialDrive { x: 0.0, z: -0.8, heading: 0.0 };
            let mut law = DifferentialDriveLaw { averaged_images, ..DifferentialDriveLaw::default() };
            for _ in 0..400 {
                let mut pose = scaled(&robot);
                pose.t_21.z += 0.003 * rng.sample::<f64, _>(StandardNormal);
                robot.advance(&law.command(&pose), 0.1);
            }
            assert!(law.has_arrived());
            robot.z.abs()
        };
        (0..100).map(end).sum::<f64>() / 100.0
    };
    let (single, averaged) = (mean_end(1.0), mean_end(10.0));
    assert!(averaged < 0.006 && averaged < 0.5 * single, "{averaged} of {single}");
}

/// The heading tells the right signs from those that arrive by turning round.
#[test]
fn the_paper_s_start_needs_little_turning() {
    let robot = DifferentialDrive { x: 0.2, z: -0.8, heading: -20_f64.to_radians() };
    let law = DifferentialDriveLaw::as_published(0.5, 0.6, 0.004);
    let Run { end, excursion, .. } = run(robot, law, 0.004);
    assert!(is_home(&end, 0.004 * UNIT), "{end:?}");
    assert!(excursion.to_degrees() < 30.0, "{}", excursion.to_degrees());
}

/// Appendix C as printed: φ = atan2(tz, tx), ω = −k2 sin φ.
#[derive(Clone)]
struct Printed {
    swapped: bool,
    sign: f64,
}

impl ControlLaw for Printed {
    fn command(&mut self, pose: &RelativePose) -> Twist {
        let PlanarPose { distance, bearing, heading } = PlanarPose::new(pose);
        let phi = if self.swapped { FRAC_PI_2 - bearing } else { bearing };
        if distance < 0.004 {
            return Twist::drive(0.0, -0.6 * heading.sin());
        }
        Twist::drive(0.5 * distance.tanh() * phi.cos(), self.sign * 0.6 * phi.sin())
    }
}

#[test]
fn the_printed_bearing_never_arrives_and_the_printed_sign_turns_round() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    for sign in [-1.0, 1.0] {
        for _ in 0..100 {
            let run = run(start(&mut rng), Printed { swapped: true, sign }, 0.004);
            assert!(!is_home(&run.end, 0.05), "{:?}", run.end);
        }
    }
    let robot = DifferentialDrive { x: 0.2, z: -0.8, heading: -20_f64.to_radians() };
    let run = run(robot, Printed { swapped: false, sign: -1.0 }, 0.004);
    assert!(run.excursion.to_degrees() > 120.0, "{}", run.excursion.to_degrees());
}

#[test]
fn the_planar_pose_is_what_the_plant_has() {
    let robot = DifferentialDrive { x: 0.2, z: -0.8, heading: -0.35 };
    let planar = PlanarPose::new(&robot.pose());
    assert!((planar.heading + 0.35).abs() < 1e-15);
    assert!((planar.distance - 0.2_f64.hypot(0.8)).abs() < 1e-15);
    // The goal lies ahead and to the left, seen from the robot's place; it looks further to the left.
    assert!((planar.bearing - ((-0.2_f64).atan2(0.8) + 0.35)).abs() < 1e-15);
}

/// A border that keeps the robot from turning away from the goal's heading by more than 14° stands for one of its image.
#[test]
fn a_robot_that_may_not_turn_away_backs_off_and_arrives() {
    const FREE: f64 = 0.25;
    const PERIOD: f64 = 0.1;
    let limits = crate::servo::Limits { speed: 0.3, turn_rate: 0.5 };
    let run = |mut robot: DifferentialDrive, furthest_back: f64| {
        let mut law = DifferentialDriveLaw { furthest_back, ..DifferentialDriveLaw::default() };
        let mut furthest = 0.0_f64;
        for _ in 0..1_200 {
            let mut twist = law.command(&scaled(&robot));
            let wanted = twist.angular.y;
            let (least, most) = ((-FREE - robot.heading) / PERIOD, (FREE - robot.heading) / PERIOD);
            twist.angular.y = wanted.clamp(least.min(0.0), most.max(0.0));
            law.hindered((twist.angular.y - wanted).abs() > 0.3 * wanted.abs() + 1e-3);
            robot.advance(&limits.apply(&twist), PERIOD);
            furthest = furthest.max(robot.x.hypot(robot.z));
        }
        (robot, furthest)
    };
    for (x, z) in [(0.4, -0.4), (-0.4, -0.4), (0.3, -0.8), (-0.2, -0.3), (0.3, 0.2)] {
        let start = DifferentialDrive { x, z, heading: 0.0 };
        let (end, furthest) = run(start, 1.5);
        assert!(is_home(&end, 0.02), "{start:?}: {end:?}");
        assert!(furthest < 1.6 * UNIT, "{start:?}: {furthest}");
    }
    // Without backing off it ends beside the goal.
    let start = DifferentialDrive { x: 0.4, z: -0.4, heading: 0.0 };
    assert!(!is_home(&run(start, 0.0).0, 0.1));
}

#[test]
fn exploring_goes_ahead_and_back_in_turn() {
    let law = DifferentialDriveLaw::default();
    for attempt in 0..4 {
        let expected = if attempt % 2 == 0 { 1.0 } else { -1.0 };
        assert_eq!(law.exploration(attempt), Twist::drive(expected, 0.0), "{attempt}");
    }
}

#[test]
fn the_direction_to_the_goal_is_that_in_the_frame_of_the_goal() {
    for (position, heading) in
        [([-0.5, -2.0], 0.2), ([-0.5, -2.0], -0.7), ([1.0, -0.5], 0.4), ([0.0, -1.0], 1.0)]
    {
        let [x, z] = position;
        // A turn to the right takes what is ahead to the left.
        let q_21 = nalgebra::UnitQuaternion::from_axis_angle(&nalgebra::Vector3::y_axis(), -heading);
        let pose = RelativePose::new(q_21, q_21 * nalgebra::Vector3::new(-x, 0.0, -z));
        let planar = PlanarPose::new(&pose);
        assert!((planar.heading - heading).abs() < 1e-12, "{planar:?}");
        assert!((planar.direction() - (-x).atan2(-z)).abs() < 1e-12, "{planar:?}");
    }
}
