//! How often the closed loop ends at the goal: thousands of random starts a cell, losses by cause, as Markdown.
#![expect(clippy::print_stdout, reason = "a program for people: tables are its output")]

use std::convert::Infallible;

use clap::Parser;
use quest_benches::statistics::{percentile, sorted};
use quest_benches::{SEED, parallel};
use quest_core::RelativePose;
use quest_core::servo::scenario::{self, Features};
use quest_core::servo::{
    Choice, ControlLaw, DepthFilter, DifferentialDriveLaw, Disturbances, FilterOptions, FreeCameraLaw,
    Length, Limits, PerFrame, Plane, Plant, PoseEstimator, Safety, Servo, World,
};
use quest_core::solver::SolverName;
use rand_chacha::ChaCha8Rng;

/// The closed loop from many starts.
#[derive(Debug, Parser)]
struct Arguments {
    /// Starts of a cell
    #[arg(long, default_value_t = 2_000)]
    starts: u64,
    /// Seed of the starts
    #[arg(long, default_value_t = SEED)]
    seed: u64,
    /// Only cells whose name contains this
    #[arg(long, default_value = "")]
    cell: String,
    /// Threads; the numbers do not depend on it
    #[arg(long, default_value_t = parallel::all_cores())]
    threads: usize,
    /// Print the indices of lost starts, so many
    #[arg(long, default_value_t = 0)]
    lost: usize,
}

/// What moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Body {
    Robot,
    Arm,
}

/// How poses are made of images.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Method {
    /// The filter on the goal's depths.
    Filter,
    /// One candidate of each image, the goal's depths being known.
    PerFrame(SolverName, Choice, Length),
}

/// A cell of the table.
#[derive(Clone, Debug)]
struct Cell {
    name: String,
    body: Body,
    features: Features,
    count: usize,
    disturbances: Disturbances,
    goal_images: usize,
    known_depths: bool,
    plane: bool,
    method: Method,
}

impl Cell {
    fn new(body: Body, count: usize, noise_px: f64, name: &str) -> Self {
        let noise = if noise_px > 0.0 { format!("{noise_px} px") } else { "noise-free".to_owned() };
        let body_name = if body == Body::Robot { "robot" } else { "arm" };
        let rounded = noise_px > 0.0 && body == Body::Robot;
        Self {
            name: format!("{body_name}, {count} features, {noise}{name}"),
            body,
            features: Features::General,
            count,
            disturbances: Disturbances { noise_px, rounded, ..Disturbances::default() },
            goal_images: 1,
            known_depths: false,
            plane: body == Body::Robot,
            method: Method::Filter,
        }
    }
}

fn cells() -> Vec<Cell> {
    use Body::{Arm, Robot};
    let features = Features::Coplanar;
    let thirty = ", 30 goal images";
    let mut cells = vec![
        Cell::new(Robot, 5, 0.0, ""),
        Cell::new(Robot, 20, 0.5, ""),
        Cell { goal_images: 30, ..Cell::new(Robot, 8, 0.5, thirty) },
        Cell { goal_images: 30, ..Cell::new(Robot, 5, 0.5, thirty) },
        Cell::new(Robot, 5, 0.5, ""),
        Cell { known_depths: true, ..Cell::new(Robot, 5, 0.5, ", known depths") },
        Cell { plane: false, ..Cell::new(Robot, 20, 0.5, ", plane not known") },
        Cell { features, ..Cell::new(Robot, 20, 0.0, ", coplanar") },
        Cell { features, ..Cell::new(Robot, 20, 0.5, ", coplanar") },
        Cell { features, goal_images: 30, ..Cell::new(Robot, 20, 0.5, ", coplanar, 30 goal images") },
        Cell::new(Arm, 5, 0.0, ""),
        Cell::new(Arm, 20, 0.0, ""),
        Cell::new(Arm, 20, 0.5, ""),
        Cell::new(Arm, 20, 1.0, ""),
        Cell { known_depths: true, ..Cell::new(Arm, 5, 0.5, ", known depths") },
        Cell::new(Arm, 5, 0.5, ""),
    ];
    cells.extend(disturbed());
    cells.extend(per_frame());
    cells
}

/// Everything that can be wrong with images.
fn disturbed() -> Vec<Cell> {
    let mut cells = Vec::new();
    let mut add = |body, count, name: &str, disturb: &dyn Fn(&mut Disturbances)| {
        let mut cell = Cell::new(body, count, 0.5, name);
        disturb(&mut cell.disturbances);
        cell.goal_images = if count < 20 { 30 } else { 1 };
        cells.push(cell);
    };
    for count in [5, 8, 20] {
        let name = if count < 20 { ", 5 % outliers, 30 goal images" } else { ", 5 % outliers" };
        add(Body::Robot, count, name, &|d| d.outliers = 0.05);
    }
    for body in [Body::Robot, Body::Arm] {
        add(body, 20, ", 2 % wrong images", &|d| d.wrong_images = 0.02);
        add(body, 20, ", down to four and back", &|d| d.lost = Some((20..60, 4)));
        add(body, 20, ", 3 images late", &|d| d.delay = 3);
    }
    cells
}

/// The paper's way, and the essential matrix.
fn per_frame() -> Vec<Cell> {
    let mut cells = Vec::new();
    for body in [Body::Robot, Body::Arm] {
        for (count, noise) in [(5, 0.0), (5, 0.5), (20, 0.5)] {
            for (name, solver, choice, length) in [
                (", rule (10.1)", SolverName::Quest, Choice::ClosestDepths, Length::GoalDepths),
                (", rule of reprojection", SolverName::Quest, Choice::Reprojection, Length::GoalDepths),
                (", essential matrix", SolverName::Stewenius, Choice::Reprojection, Length::Unit),
            ] {
                let method = Method::PerFrame(solver, choice, length);
                cells.push(Cell { method, ..Cell::new(body, count, noise, name) });
            }
        }
    }
    let method = Method::PerFrame(SolverName::Homography, Choice::Reprojection, Length::GoalDepths);
    for noise in [0.0, 0.5] {
        let cell = Cell::new(Body::Robot, 20, noise, ", coplanar, homography");
        cells.push(Cell { method, features: Features::Coplanar, ..cell });
    }
    cells
}

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    /// Within 2 cm and 1°.
    Converged,
    /// Features were out of the image.
    LeftImage,
    /// The controller held.
    Held,
    /// Within 10 cm and 5°.
    Inaccurate,
    /// Somewhere else.
    Astray,
}

#[derive(Clone, Copy, Debug)]
struct Outcome {
    end: End,
    /// In metres and degrees.
    position: f64,
    angle: f64,
    holds: usize,
    /// Commands above the limits, or not finite.
    unsafe_commands: usize,
}

const LIMITS: Limits = Limits { speed: 0.5, turn_rate: 0.6 };
/// A minute at 10 Hz.
const IMAGES: usize = 600;
/// A run ends early after so many images with less than 2 mm/s and 4 mrad/s.
const SETTLED: usize = 50;
/// About how far the features are, in metres.
const UNIT: f64 = 2.0;
/// Of the image, in pixels.
const BORDER: f64 = 40.0;
const PLANE: Plane = Plane { tilt: 0.002, height: 0.001 };

impl Cell {
    fn run(&self, seed: u64, index: u64) -> Outcome {
        let rng = &mut scenario::generator(seed, index);
        match self.body {
            Body::Robot => {
                let law = DifferentialDriveLaw::default;
                let (world, plant) = self.start(rng, scenario::random_robot, law);
                self.estimate(&world, plant, law(), rng)
            }
            Body::Arm => {
                let law = || FreeCameraLaw { rate: 0.3, unit: UNIT };
                let (world, plant) = self.start(rng, scenario::random_camera, law);
                self.estimate(&world, plant, law(), rng)
            }
        }
    }

    /// A start from which the law, given the true pose, keeps all features in view.
    fn start<P: Plant + Clone, L: ControlLaw>(
        &self,
        rng: &mut ChaCha8Rng,
        start: impl Fn(&mut ChaCha8Rng) -> P,
        law: impl Fn() -> L,
    ) -> (World, P) {
        loop {
            let (mut world, plant) =
                scenario::random(self.features, self.count, &self.disturbances, rng, &start);
            world.goal_images = self.goal_images;
            let (mut moving, mut law) = (plant.clone(), law());
            let stays = (0..IMAGES).all(|_| {
                let pose = moving.pose();
                let command = law.command(&RelativePose::new(pose.q_21, pose.t_21 / UNIT));
                moving.advance(&LIMITS.apply(&command), world.period);
                world.sees_all(&pose, 0.0)
            });
            if stays {
                return (world, plant);
            }
        }
    }

    fn estimate<P: Plant, L: ControlLaw>(
        &self,
        world: &World,
        plant: P,
        law: L,
        rng: &mut ChaCha8Rng,
    ) -> Outcome {
        let goal = world.on_plane(&world.goal_pixels(rng));
        let depths: Vec<f64> = world.points.iter().map(|x| x.z).collect();
        match self.method {
            Method::Filter => {
                let options = FilterOptions {
                    plane: self.plane.then_some(PLANE),
                    // Four features tell the three numbers of a pose on a plane; others wait for the fifth.
                    min_features: if self.plane && self.count < 20 { 4 } else { 5 },
                    ..world.filter_options(&LIMITS, UNIT)
                };
                let mut filter = DepthFilter::new(&goal, SolverName::Quest, options);
                if self.known_depths {
                    filter.set_depths(&depths, 0.02);
                }
                self.drive(world, plant, law, &goal, filter, rng)
            }
            Method::PerFrame(solver, choice, length) => {
                let mut estimator = PerFrame::new(&goal, solver, choice, length);
                estimator.set_depths(&depths);
                self.drive(world, plant, law, &goal, estimator, rng)
            }
        }
    }

    fn drive<P: Plant, L: ControlLaw, E: PoseEstimator>(
        &self,
        world: &World,
        mut plant: P,
        law: L,
        goal: &[[f64; 2]],
        estimator: E,
        rng: &mut ChaCha8Rng,
    ) -> Outcome {
        let mut safety = Safety::new(LIMITS);
        safety.border = world.border(BORDER).filter(|_| self.body == Body::Robot);
        let mut servo = Servo::new(goal, estimator, law, safety);
        let (mut holds, mut unsafe_commands, mut holds_now, mut still) = (0, 0, false, 0);
        world.run(&mut plant, &mut servo, IMAGES, rng, |record| {
            let command = record.step.command;
            let is_safe = command.is_finite()
                && command.linear.norm() <= LIMITS.speed
                && command.angular.norm() <= LIMITS.turn_rate;
            unsafe_commands += usize::from(!is_safe);
            holds_now = record.step.estimate.is_err();
            holds += usize::from(holds_now);
            let stands = !holds_now && command.linear.norm() < 2e-3 && command.angular.norm() < 4e-3;
            still = if stands { still + 1 } else { 0 };
            still < SETTLED
        });
        let pose = plant.pose();
        let (position, angle) = (pose.t_21.norm(), pose.q_21.angle().to_degrees());
        let end = if position < 0.02 && angle < 1.0 {
            End::Converged
        } else if !world.sees_all(&pose, 0.0) {
            End::LeftImage
        } else if holds_now {
            End::Held
        } else if position < 0.1 && angle < 5.0 {
            End::Inaccurate
        } else {
            End::Astray
        };
        Outcome { end, position, angle, holds, unsafe_commands }
    }
}

fn main() {
    let arguments = Arguments::parse();
    println!("{} starts a cell, seed {}\n", arguments.starts, arguments.seed);
    println!(
        "| cell | 2 cm, 1° | 5 cm, 2° | left image | held | inaccurate | astray | cm, median | 98 % | °, median | 98 % | holds a run | unsafe |"
    );
    println!("|---|{}", "---:|".repeat(12));
    for cell in cells().iter().filter(|cell| cell.name.contains(&arguments.cell)) {
        let run = |index| Ok::<_, Infallible>(cell.run(arguments.seed, index));
        // What is only there to be compared with gets a quarter of the starts.
        let starts =
            if cell.method == Method::Filter { arguments.starts } else { arguments.starts.div_ceil(4) };
        let Ok(outcomes) = parallel::map(starts, arguments.threads, run);
        let count = |end| outcomes.iter().filter(|o| o.end == end).count();
        let share = |count: usize| 100.0 * count as f64 / outcomes.len() as f64;
        let near = outcomes.iter().filter(|o| o.position < 0.05 && o.angle < 2.0).count();
        let position = sorted(outcomes.iter().map(|o| 100.0 * o.position));
        let angle = sorted(outcomes.iter().map(|o| o.angle));
        let causes =
            [End::LeftImage, End::Held, End::Inaccurate, End::Astray].map(|end| count(end).to_string());
        println!(
            "| {} | {:.2} % | {:.2} % | {} | {:.2} | {:.2} | {:.2} | {:.2} | {:.1} | {} |",
            cell.name,
            share(count(End::Converged)),
            share(near),
            causes.join(" | "),
            percentile(&position, 0.5),
            percentile(&position, 0.98),
            percentile(&angle, 0.5),
            percentile(&angle, 0.98),
            outcomes.iter().map(|o| o.holds).sum::<usize>() as f64 / outcomes.len() as f64,
            outcomes.iter().map(|o| o.unsafe_commands).sum::<usize>(),
        );
        let lost = outcomes.iter().enumerate().filter(|(_, o)| o.end != End::Converged);
        for (index, outcome) in lost.take(arguments.lost) {
            println!("  {index}: {outcome:?}");
        }
    }
}
