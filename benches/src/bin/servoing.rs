//! How often the closed loop ends at the goal: thousands of random starts a cell, losses by cause, as Markdown.
#![expect(clippy::print_stdout, reason = "a program for people: tables are its output")]

use std::convert::Infallible;

use clap::Parser;
use quest_benches::statistics::{percentile, sorted};
use quest_benches::{SEED, parallel};
use quest_core::RelativePose;
use quest_core::servo::scenario::{self, Features};
use quest_core::servo::{
    ControlLaw, DepthFilter, DifferentialDriveLaw, Disturbances, FilterOptions, FreeCameraLaw, Limits, Plane,
    Plant, Safety, Servo, World,
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
}

impl Cell {
    fn new(name: &str, body: Body, count: usize, noise_px: f64) -> Self {
        let rounded = noise_px > 0.0 && body == Body::Robot;
        Self {
            name: name.to_owned(),
            body,
            features: Features::General,
            count,
            disturbances: Disturbances { noise_px, rounded, ..Disturbances::default() },
            goal_images: 1,
            known_depths: false,
            plane: body == Body::Robot,
        }
    }
}

fn cells() -> Vec<Cell> {
    let robot = |name: &str, count, noise| Cell::new(name, Body::Robot, count, noise);
    let arm = |name: &str, count, noise| Cell::new(name, Body::Arm, count, noise);
    let mut cells = vec![
        robot("robot, 5 features, noise-free", 5, 0.0),
        robot("robot, 20 features, 0.5 px", 20, 0.5),
        Cell { goal_images: 30, ..robot("robot, 8 features, 30 goal images, 0.5 px", 8, 0.5) },
        Cell { goal_images: 30, ..robot("robot, 5 features, 30 goal images, 0.5 px", 5, 0.5) },
        robot("robot, 5 features, 0.5 px", 5, 0.5),
        Cell { features: Features::Coplanar, ..robot("robot, 5 coplanar features, 0.5 px", 5, 0.5) },
        Cell { features: Features::Coplanar, ..robot("robot, 20 coplanar features, 0.5 px", 20, 0.5) },
        Cell { plane: false, ..robot("robot free, 20 features, 0.5 px", 20, 0.5) },
        Cell {
            plane: false,
            goal_images: 30,
            ..robot("robot free, 5 features, 30 goal images, 0.5 px", 5, 0.5)
        },
        Cell { plane: false, ..robot("robot free, 5 features, 0.5 px", 5, 0.5) },
        arm("arm, 5 features, noise-free", 5, 0.0),
        arm("arm, 20 features, noise-free", 20, 0.0),
        arm("arm, 20 features, 0.5 px", 20, 0.5),
        arm("arm, 20 features, 1 px", 20, 1.0),
        Cell { known_depths: true, ..arm("arm, 5 features, known depths, 0.5 px", 5, 0.5) },
        arm("arm, 5 features, 0.5 px", 5, 0.5),
    ];
    for count in [5, 8, 20] {
        let mut cell = robot(&format!("robot, {count} features, 5 % outliers, 0.5 px"), count, 0.5);
        cell.disturbances.outliers = 0.05;
        cell.goal_images = 30;
        cells.push(cell);
    }
    for body in [Body::Robot, Body::Arm] {
        let mut cell = Cell::new(&format!("{body:?}, 20 features, 2 % wrong images, 0.5 px"), body, 20, 0.5);
        cell.disturbances.wrong_images = 0.02;
        cells.push(cell);
        let mut cell =
            Cell::new(&format!("{body:?}, 20 features, down to four and back, 0.5 px"), body, 20, 0.5);
        cell.disturbances.lost = Some((20..60, 4));
        cells.push(cell);
        let mut cell = Cell::new(&format!("{body:?}, 20 features, 3 images late, 0.5 px"), body, 20, 0.5);
        cell.disturbances.delay = 3;
        cells.push(cell);
    }
    cells
}

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    Converged,
    /// Features were out of the image when it ended.
    LeftImage,
    /// The controller held.
    Held,
    /// Near the goal, but not within the tolerance.
    Inaccurate,
    /// Somewhere else.
    Astray,
}

#[derive(Clone, Copy, Debug)]
struct Outcome {
    end: End,
    position: f64,
    angle: f64,
    holds: usize,
    unsafe_commands: usize,
}

const LIMITS: Limits = Limits { speed: 0.5, turn_rate: 0.6 };
const IMAGES: usize = 600;

impl Cell {
    fn run(&self, seed: u64, index: u64) -> Outcome {
        let rng = &mut scenario::generator(seed, index);
        match self.body {
            Body::Robot => {
                let law = DifferentialDriveLaw::default;
                let (world, plant) = self.start(rng, scenario::random_robot, law);
                self.drive(world, plant, law(), rng)
            }
            Body::Arm => {
                let law = || FreeCameraLaw { rate: 0.3, unit: 2.0 };
                let (world, plant) = self.start(rng, scenario::random_camera, law);
                self.drive(world, plant, law(), rng)
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
                let command = law.command(&RelativePose::new(pose.q_21, pose.t_21 / 2.0));
                moving.advance(&LIMITS.apply(&command), world.period);
                world.sees_all(&pose, 0.0)
            });
            if stays {
                return (world, plant);
            }
        }
    }

    fn drive<P: Plant, L: ControlLaw>(
        &self,
        world: World,
        mut plant: P,
        law: L,
        rng: &mut ChaCha8Rng,
    ) -> Outcome {
        let goal = world.on_plane(&world.goal_pixels(rng));
        let options = FilterOptions {
            plane: self.plane.then_some(Plane { tilt: 0.002, height: 0.001 }),
            ..world.filter_options(&LIMITS, 2.0)
        };
        let mut filter = DepthFilter::new(&goal, SolverName::Quest, options);
        if self.known_depths {
            let depths: Vec<f64> = world.points.iter().map(|x| x.z).collect();
            filter.set_depths(&depths, 0.02);
        }
        let mut safety = Safety::new(LIMITS);
        if self.body == Body::Robot {
            safety.border = world.border(15.0);
        }
        let mut servo = Servo::new(&goal, filter, law, safety);
        let (mut holds, mut unsafe_commands, mut last) = (0, 0, None);
        world.run(&mut plant, &mut servo, IMAGES, rng, |record| {
            let command = record.step.command;
            let is_safe = command.is_finite()
                && command.linear.norm() <= LIMITS.speed
                && command.angular.norm() <= LIMITS.turn_rate;
            unsafe_commands += usize::from(!is_safe);
            holds += usize::from(record.step.estimate.is_err());
            last = Some(record.clone());
            true
        });
        let position = plant.pose().t_21.norm();
        let angle = plant.pose().q_21.angle().to_degrees();
        let end = if position < 0.02 && angle < 1.0 {
            End::Converged
        } else if !world.sees_all(&plant.pose(), 0.0) {
            End::LeftImage
        } else if last.is_none_or(|r| r.step.estimate.is_err()) {
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
        "| cell | converged % | left image | held | inaccurate | astray | median cm | 98 % cm | median ° | 98 % ° | holds a run | unsafe |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|");
    for cell in cells().iter().filter(|c| c.name.contains(&arguments.cell)) {
        let run = |index| Ok::<_, Infallible>(cell.run(arguments.seed, index));
        let Ok(outcomes) = parallel::map(arguments.starts, arguments.threads, run);
        let count = |end| outcomes.iter().filter(|o| o.end == end).count();
        let position = sorted(outcomes.iter().map(|o| 100.0 * o.position));
        let angle = sorted(outcomes.iter().map(|o| o.angle));
        println!(
            "| {} | {:.2} | {} | {} | {} | {} | {:.2} | {:.2} | {:.2} | {:.2} | {:.1} | {} |",
            cell.name,
            100.0 * count(End::Converged) as f64 / outcomes.len() as f64,
            count(End::LeftImage),
            count(End::Held),
            count(End::Inaccurate),
            count(End::Astray),
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
