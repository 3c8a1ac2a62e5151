//! How long the closed loop takes for one image: from the features to the command.
#![expect(clippy::print_stdout, reason = "a program for people: tables are its output")]

use std::hint::black_box;
use std::time::Instant;

use clap::Parser;
use quest_benches::SEED;
use quest_benches::statistics::{percentile, sorted};
use quest_core::servo::scenario::{self, Features};
use quest_core::servo::{
    Choice, DepthFilter, DifferentialDriveLaw, Disturbances, FilterOptions, Length, Limits, PerFrame, Plane,
    PoseEstimator, Safety, Servo,
};
use quest_core::solver::SolverName;

/// The time of a step of the closed loop, by replaying the images of a robot's run.
#[derive(Debug, Parser)]
struct Arguments {
    /// How often the run is replayed; of each image the fastest counts
    #[arg(long, default_value_t = 50)]
    rounds: usize,
    /// Seed of the features and the noise
    #[arg(long, default_value_t = SEED)]
    seed: u64,
}

const LIMITS: Limits = Limits { speed: 0.5, turn_rate: 0.6 };
/// Half a minute at 10 Hz.
const IMAGES: usize = 300;

fn main() {
    let arguments = Arguments::parse();
    println!("| features | estimator | µs an image, median | 98 % | slowest image | images with a pose |");
    println!("|---:|---|{}", "---:|".repeat(4));
    for features in [5, 20] {
        let disturbances = Disturbances { noise_px: 0.5, rounded: true, ..Disturbances::default() };
        let rng = &mut scenario::generator(arguments.seed, 0);
        let (mut world, mut robot) =
            scenario::random(Features::General, features, &disturbances, rng, |_| {
                scenario::robot_start(Features::General)
            });
        world.goal_images = 30;
        let goal = world.on_plane(&world.goal_pixels(rng));
        let options = FilterOptions {
            plane: Some(Plane { tilt: 0.002, height: 0.001 }),
            ..world.filter_options(&LIMITS, 2.0)
        };
        let filter = DepthFilter::new(&goal, SolverName::Quest, options);
        let mut chosen = PerFrame::new(&goal, SolverName::Quest, Choice::Reprojection, Length::GoalDepths);
        chosen.set_depths(&world.points.iter().map(|x| x.z).collect::<Vec<_>>());
        let mut images = Vec::new();
        let mut servo = controller(&goal, filter.clone());
        world.run(&mut robot, &mut servo, IMAGES, rng, |record| {
            images.push(record.features.clone());
            true
        });
        let rounds = arguments.rounds;
        report(features, "filter", &times(&controller(&goal, filter), &images, rounds));
        report(features, "one candidate an image", &times(&controller(&goal, chosen), &images, rounds));
    }
}

fn controller<E: PoseEstimator>(goal: &[[f64; 2]], estimator: E) -> Servo<E, DifferentialDriveLaw> {
    Servo::new(goal, estimator, DifferentialDriveLaw::default(), Safety::new(LIMITS))
}

/// Of every image, its fastest µs, and how many of them had a pose.
fn times<E: PoseEstimator + Clone>(
    servo: &Servo<E, DifferentialDriveLaw>,
    images: &[Vec<Option<[f64; 2]>>],
    rounds: usize,
) -> (Vec<f64>, usize) {
    let mut fastest = vec![f64::INFINITY; images.len()];
    let mut poses = 0;
    for _ in 0..rounds.max(1) {
        let mut servo = servo.clone();
        poses = 0;
        for (image, fastest) in images.iter().zip(&mut fastest) {
            let start = Instant::now();
            let step = black_box(servo.step(black_box(image)));
            *fastest = fastest.min(1e6 * start.elapsed().as_secs_f64());
            poses += usize::from(step.estimate.is_ok());
        }
    }
    (fastest, poses)
}

fn report(features: usize, estimator: &str, (times, poses): &(Vec<f64>, usize)) {
    let times = sorted(times.iter().copied());
    let [median, most, slowest] = [0.5, 0.98, 1.0].map(|p| percentile(&times, p));
    println!(
        "| {features} | {estimator} | {median:.1} | {most:.1} | {slowest:.1} | {poses} of {} |",
        times.len()
    );
}
