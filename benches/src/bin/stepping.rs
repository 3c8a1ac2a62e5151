//! How long the closed loop takes for one image: from the features to the command.
#![expect(clippy::print_stdout, reason = "a program for people: tables are its output")]

use std::hint::black_box;
use std::time::Instant;

use clap::Parser;
use quest_benches::SEED;
use quest_benches::statistics::{percentile, sorted};
use quest_core::servo::scenario::{self, Features};
use quest_core::servo::{
    Choice, ControlLaw, DifferentialDriveLaw, Disturbances, FilterOptions, FreeCameraLaw, Length, Limits,
    PerFrame, Plane, Plant, PoseEstimator, Rig, Safety, Servo, Sticky, Tracker,
};
use quest_core::solver::SolverName;
use rand_chacha::ChaCha8Rng;

/// The time of a step of the closed loop, by replaying the images of runs.
#[derive(Debug, Parser)]
struct Arguments {
    /// How often a run is replayed; of each image the fastest counts
    #[arg(long, default_value_t = 50)]
    rounds: usize,
    /// How many runs from different starts; the slowest image is that of all
    #[arg(long, default_value_t = 20)]
    runs: u64,
    /// Seed of the features and the noise
    #[arg(long, default_value_t = SEED)]
    seed: u64,
}

const LIMITS: Limits = Limits { speed: 0.5, turn_rate: 0.6 };
/// Half a minute at 10 Hz.
const IMAGES: usize = 300;
const PLANE: Plane = Plane { tilt: 0.002, height: 0.001 };

fn main() {
    let arguments = Arguments::parse();
    println!(
        "| loop | estimator | µs an image, median | 98 % | first pose, median | most | slowest image | images with a pose |"
    );
    println!("|---|---|{}", "---:|".repeat(6));
    for features in [5, 20] {
        for outliers in [0.0, 0.05] {
            let images = Images { features, outliers };
            let robot = |_: &mut ChaCha8Rng| scenario::robot_start(Features::General);
            rows("robot", &arguments, &images, &DifferentialDriveLaw::default(), Some(PLANE), robot);
            let law = FreeCameraLaw { rate: 0.3, unit: 2.0 };
            rows("arm", &arguments, &images, &law, None, scenario::random_camera);
        }
    }
    many(&arguments);
}

/// A thousand features of the goal, three hundred of them in each image, three in ten of those wrong.
fn many(arguments: &Arguments) {
    const GOAL: usize = 1_000;
    const SEEN: usize = 300;
    let mut times = Times::default();
    for run in 0..arguments.runs.clamp(1, 5) {
        let rng = &mut scenario::generator(arguments.seed, run);
        let disturbances = Disturbances {
            noise_px: 0.5,
            sticky: Some(Sticky { share: 0.3, images: 20.0 }),
            ..Disturbances::default()
        };
        let mut world = scenario::robot_world(Features::General, GOAL, disturbances, rng);
        world.points.iter_mut().for_each(|x| (x.x, x.y) = (0.6 * x.x, 0.6 * x.y));
        let mut plant = scenario::robot_start(Features::General);
        let goal = world.on_plane(&world.goal_pixels(rng));
        let options = world.filter_options(&LIMITS, 2.0);
        let law = FreeCameraLaw { rate: 0.3, unit: 2.0 };
        let rig = Rig { unit: 2.0, ..Rig::default() };
        let tracker = Tracker::new(&goal, SolverName::Quest, options);
        let servo = Servo::new(&goal, tracker, law, Safety::new(LIMITS)).with_rig(rig);
        let mut images = Vec::new();
        world.run(&mut plant, &mut servo.clone(), IMAGES, rng, |record| {
            let mut image = record.features.clone();
            // Others in each image, most of them the same as in the last.
            let first = 3 * images.len() % GOAL;
            for (k, feature) in image.iter_mut().enumerate() {
                if (k + GOAL - first) % GOAL >= SEEN {
                    *feature = None;
                }
            }
            images.push(image);
            true
        });
        times.add(&servo, &images, arguments.rounds.min(5));
    }
    times.report("arm, 300 of 1,000 features, 30 % wrong", "map of the goal");
}

/// What the images show.
struct Images {
    features: usize,
    /// The share of features that are somewhere else.
    outliers: f64,
}

/// Both estimators on the images of the same runs.
fn rows<P: Plant, L: ControlLaw + Clone>(
    body: &str,
    arguments: &Arguments,
    shown: &Images,
    law: &L,
    plane: Option<Plane>,
    start: impl Fn(&mut ChaCha8Rng) -> P,
) {
    let Images { features, outliers } = *shown;
    let disturbances = Disturbances { noise_px: 0.5, rounded: true, outliers, ..Disturbances::default() };
    let (mut filtered, mut chosen) = (Times::default(), Times::default());
    for run in 0..arguments.runs.max(1) {
        let rng = &mut scenario::generator(arguments.seed, run);
        let (mut world, mut plant) =
            scenario::random(Features::General, features, &disturbances, rng, &start);
        world.goal_images = 30;
        let goal = world.on_plane(&world.goal_pixels(rng));
        // As in the tables of the closed loop.
        let min_features = if plane.is_some() && features < 20 { 4 } else { 5 };
        let options = FilterOptions { plane, min_features, ..world.filter_options(&LIMITS, 2.0) };
        let tracker = Tracker::new(&goal, SolverName::Quest, options);
        let mut choice = PerFrame::new(&goal, SolverName::Quest, Choice::Reprojection, Length::GoalDepths);
        choice.set_depths(&world.points.iter().map(|x| x.z).collect::<Vec<_>>());
        let safety = Safety { border: plane.and(world.border(40.0)), ..Safety::new(LIMITS) };
        let rig = Rig { unit: 2.0, ..Rig::default() };
        let tracker = Servo::new(&goal, tracker, law.clone(), safety).with_rig(rig);
        let choice = Servo::new(&goal, choice, law.clone(), safety);
        let mut images = Vec::new();
        world.run(&mut plant, &mut tracker.clone(), IMAGES, rng, |record| {
            images.push(record.features.clone());
            true
        });
        filtered.add(&tracker, &images, arguments.rounds);
        chosen.add(&choice, &images, arguments.rounds);
    }
    let disturbed =
        if outliers > 0.0 { format!(", {:.0} % outliers", 100.0 * outliers) } else { String::new() };
    let name = format!("{body}, {features} features{disturbed}");
    filtered.report(&name, "map of the goal");
    if outliers == 0.0 {
        chosen.report(&name, "one candidate an image");
    }
}

/// The fastest µs of every image, those of the image with the first pose of every run, and how many images had a pose.
#[derive(Default)]
struct Times {
    all: Vec<f64>,
    first: Vec<f64>,
    poses: usize,
}

impl Times {
    fn add<E: PoseEstimator + Clone, L: ControlLaw + Clone>(
        &mut self,
        servo: &Servo<E, L>,
        images: &[Vec<Option<[f64; 2]>>],
        rounds: usize,
    ) {
        let mut fastest = vec![f64::INFINITY; images.len()];
        let mut has_pose = vec![false; images.len()];
        for _ in 0..rounds.max(1) {
            let mut servo = servo.clone();
            for (k, image) in images.iter().enumerate() {
                let start = Instant::now();
                let step = black_box(servo.step(black_box(image)));
                fastest[k] = fastest[k].min(1e6 * start.elapsed().as_secs_f64());
                has_pose[k] = step.estimate.is_ok();
            }
        }
        self.first.extend(has_pose.iter().position(|&has| has).map(|k| fastest[k]));
        self.poses += has_pose.iter().filter(|&&has| has).count();
        self.all.extend(fastest);
    }

    fn report(&self, name: &str, estimator: &str) {
        let (all, first) = (sorted(self.all.iter().copied()), sorted(self.first.iter().copied()));
        let [median, most, slowest] = [0.5, 0.98, 1.0].map(|p| percentile(&all, p));
        let [first_median, first_most] = [0.5, 1.0].map(|p| percentile(&first, p));
        println!(
            "| {name} | {estimator} | {median:.1} | {most:.1} | {first_median:.1} | {first_most:.1} | {slowest:.1} | {} of {} |",
            self.poses,
            all.len()
        );
    }
}
