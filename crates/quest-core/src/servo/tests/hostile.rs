//! Anything at all in place of an image: commands are finite and within the limits, and the loop goes on afterwards.

use nalgebra::Vector3;
use rand::RngExt;

use super::*;

type Image = Vec<Option<[f64; 2]>>;

fn points() -> [Vector3<f64>; 6] {
    [
        [0.3, -0.2, 1.8],
        [-0.4, 0.3, 2.1],
        [0.1, 0.2, 2.4],
        [-0.2, -0.3, 1.6],
        [0.5, 0.1, 2.0],
        [-0.5, 0.0, 2.2],
    ]
    .map(Vector3::from)
}

fn seen_from(pose: &RelativePose) -> Image {
    let x2 = points().map(|x1| pose.q_21 * x1 + pose.t_21);
    x2.iter().map(|x2| Some([x2.x / x2.z, x2.y / x2.z])).collect()
}

fn goal() -> Vec<[f64; 2]> {
    seen_from(&RelativePose::identity()).into_iter().flatten().collect()
}

/// A robot's pose 30 cm back and turned a little, which an arm may have too.
fn start() -> RelativePose {
    DifferentialDrive { x: 0.05, z: -0.3, heading: 0.1 }.pose()
}

fn is_safe(step: &Step) -> bool {
    let Step { command, estimate, .. } = step;
    command.is_finite()
        && command.linear.norm() <= LIMITS.speed
        && command.angular.norm() <= LIMITS.turn_rate
        && (estimate.is_ok() || *command == Twist::zero())
}

/// What a camera should never show, by name.
fn images() -> Vec<(&'static str, Image)> {
    let good = seen_from(&start());
    let with = |change: &dyn Fn(&mut Image)| {
        let mut image = good.clone();
        change(&mut image);
        image
    };
    vec![
        ("not a number", vec![Some([f64::NAN; 2]); 6]),
        ("one not a number", with(&|image| image[2] = Some([f64::NAN, 0.0]))),
        ("infinite", vec![Some([f64::INFINITY, f64::NEG_INFINITY]); 6]),
        ("huge", vec![Some([1e300, -1e300]); 6]),
        ("all lost", vec![None; 6]),
        ("no entries", Vec::new()),
        ("too many entries", with(&|image| image.extend(vec![Some([0.1, 0.1]); 20]))),
        ("all at one place", vec![Some([0.1, -0.2]); 6]),
        ("all at the principal point", vec![Some([0.0, 0.0]); 6]),
        ("on a line", (0..6).map(|k| Some([0.1 * f64::from(k), 0.05 * f64::from(k)])).collect()),
        ("four, beyond the border", (0..6).map(|k| (k < 4).then_some([0.6, 0.1 * f64::from(k)])).collect()),
        ("two swapped", with(&|image| image.swap(0, 4))),
        ("all in another order", with(&|image| image.rotate_left(2))),
        ("mirrored", with(&|image| image.iter_mut().flatten().for_each(|p| p[0] = -p[0]))),
        ("upside down", with(&|image| image.iter_mut().flatten().for_each(|p| *p = [-p[0], -p[1]]))),
    ]
}

/// Good images, each of the bad ones for a while, and good ones again.
fn survives<E: PoseEstimator + Clone, L: ControlLaw + Clone>(
    name: &str,
    servo: &Servo<E, L>,
    has_to_resume: bool,
) {
    let good = seen_from(&start());
    for (what, bad) in images() {
        let mut servo = servo.clone();
        let mut all = Vec::new();
        all.extend((0..60).map(|_| servo.step(&good)));
        all.extend((0..60).map(|_| servo.step(&bad)));
        all.extend((0..100).map(|_| servo.step(&good)));
        for (index, step) in all.iter().enumerate() {
            assert!(is_safe(step), "{name}, {what}, image {index}: {step:?}");
        }
        assert!(!has_to_resume || all[59].estimate.is_ok(), "{name}: {:?}", all[59]);
        let last = all.last().unwrap();
        assert!(!has_to_resume || last.estimate.is_ok(), "{name}, {what}: {last:?}");
    }
}

#[test]
fn bad_images_make_no_wild_command_and_good_ones_resume() {
    let limits = Safety::new(LIMITS);
    let robot = Safety { border: Some(Border { left: -0.4, right: 0.4 }), ..limits };
    let fast = FreeCameraLaw { rate: 10.0, unit: 5.0 };
    for first_images in [1, 10] {
        for known in [false, true] {
            let options = FilterOptions { first_images, ..FilterOptions::default() };
            let filter = |plane| {
                let options = FilterOptions { plane, ..options };
                let mut filter = DepthFilter::new(&goal(), SolverName::Quest, options);
                if known {
                    filter.set_depths(&points().map(|x| x.z), 0.02);
                }
                filter
            };
            let name = format!("{first_images} first images, depths known: {known}");
            survives(&format!("arm, {name}"), &Servo::new(&goal(), filter(None), fast, limits), true);
            let law = DifferentialDriveLaw::new(5.0, 20.0);
            survives(&format!("robot, {name}"), &Servo::new(&goal(), filter(Some(PLANE)), law, robot), true);
        }
    }
}

#[test]
fn bad_images_make_no_wild_command_by_a_rule_in_each_image() {
    for choice in [Choice::ClosestDepths, Choice::Reprojection, Choice::RotationAxis] {
        for length in [Length::GoalDepths, Length::BothViews, Length::Unit] {
            for solver in [SolverName::Quest, SolverName::Stewenius, SolverName::Homography] {
                let estimator = PerFrame::new(&goal(), solver, choice, length);
                let law = FreeCameraLaw { rate: 10.0, unit: 5.0 };
                let servo = Servo::new(&goal(), estimator, law, Safety::new(LIMITS));
                survives(&format!("{choice:?} {length:?} {solver:?}"), &servo, false);
            }
        }
    }
}

/// A goal image that is no use is refused by holding, not by moving.
#[test]
fn a_bad_goal_makes_no_wild_command() {
    for (what, bad) in images() {
        let goal: Vec<[f64; 2]> = bad.iter().map(|p| p.unwrap_or([f64::NAN; 2])).collect();
        let law = FreeCameraLaw { rate: 10.0, unit: 5.0 };
        let filter = DepthFilter::new(&goal, SolverName::Quest, FilterOptions::default());
        let mut servo = Servo::new(&goal, filter, law, Safety::new(LIMITS));
        for index in 0..100 {
            let step = servo.step(&seen_from(&start()));
            assert!(is_safe(&step), "{what}, image {index}: {step:?}");
        }
    }
}

/// At the goal there is no parallax and nothing to do.
#[test]
fn at_the_goal_it_stands_still() {
    let now: Image = goal().into_iter().map(Some).collect();
    let law = FreeCameraLaw { rate: 1.0, unit: 2.0 };
    let filter = DepthFilter::new(&goal(), SolverName::Quest, FilterOptions::default());
    let mut servo = Servo::new(&goal(), filter, law, Safety::new(LIMITS));
    let steps: Vec<_> = (0..100).map(|_| servo.step(&now)).collect();
    assert!(steps.iter().all(|s| s.command.linear.norm() < 1e-6 && s.command.angular.norm() < 1e-6));
    assert!(steps[99].estimate.is_ok(), "{:?}", steps[99]);
}

#[test]
fn random_images_make_no_wild_command() {
    let rng = &mut scenario::generator(5, 0);
    for round in 0..20 {
        let (world, _) = robot(rng, 6, &Disturbances { noise_px: 0.5, ..Disturbances::default() });
        let goal = world.on_plane(&world.goal_pixels(rng));
        let law = FreeCameraLaw { rate: 10.0, unit: 5.0 };
        let mut servo = Servo::new(&goal, filter(&world, &goal, None), law, Safety::new(LIMITS));
        for _ in 0..100 {
            let mut coordinate = || match rng.random_range(0..12) {
                0 => f64::NAN,
                1 => f64::INFINITY,
                2 => 1e300,
                3 => 0.0,
                _ => rng.random_range(-1.0..1.0),
            };
            let mut image: Vec<_> = (0..6).map(|_| Some([coordinate(), coordinate()])).collect();
            if round % 2 == 0 {
                image.pop();
            }
            let step = servo.step(&image);
            assert!(is_safe(&step), "{step:?}");
        }
    }
}
