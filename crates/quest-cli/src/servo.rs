//! `quest-cli servo`: a camera or a robot that moves to where the goal image was taken.

mod charts;
mod frame;
mod replay;
mod summary;

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use quest_core::Camera;
use quest_core::servo::scenario::{self, Features};
use quest_core::servo::{
    Choice, ControlLaw, DepthFilter, DifferentialDriveLaw, Disturbances, FilterOptions, FreeCameraLaw,
    Length, Limits, PerFrame, Plane, Plant, PoseEstimator, Rig, Safety, Servo, Tracker, World,
};
use quest_core::solver::SolverName;
use rand_chacha::ChaCha8Rng;

use crate::options::{Format, OutputOptions, solver_parser};
use crate::plot::{Plot, parse_plot};
use crate::{Failure, Outcome, rows};
use frame::FrameRecord;
use summary::Summary;

const EXAMPLES: &str = "\
Examples:
  quest-cli servo                                            section 10.1 of the paper, without noise
  quest-cli servo --scenario robot --noise 0.5 -o run.csv    every image of a robot's run
  quest-cli servo --scenario random --features 20 --noise 1 --seed 7
  quest-cli servo --scenario robot --translation unit        what a translation without length does
  quest-cli servo --replay run.npz --plot run.html           a live run that quest_pose.servo.Recorder wrote

Exit status: 0 the goal was reached (within 2 cm and 1 degree), 1 it was not, 2 bad arguments.";

/// What a live run has no use for.
const SIMULATED: [&str; 10] = [
    "scenario",
    "solver",
    "noise",
    "seed",
    "features",
    "coplanar",
    "goal_images",
    "delay",
    "rule",
    "translation",
];

/// Moves a simulated camera or robot to its goal by the poses of its images.
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Arguments {
    /// What moves, and where it starts.
    #[arg(long, value_enum, default_value_t = Scenario::Paper)]
    scenario: Scenario,
    /// The solver whose candidates start the loop, or are chosen from in each image with --rule.
    #[arg(long, value_name = "NAME", value_parser = solver_parser(), default_value = SolverName::default().info().name)]
    solver: SolverName,
    /// Standard deviation of the noise on every pixel coordinate; with noise pixels are also rounded.
    #[arg(long, value_name = "PX", default_value_t = 0.0, value_parser = not_negative)]
    noise: f64,
    /// Seed of the features, the start and the noise.
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u64,
    /// How many features there are, for the scenarios robot and random.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u16).range(4..=500))]
    features: u16,
    /// Features on a plane (section 10.4), for the scenarios robot and random.
    #[arg(long)]
    coplanar: bool,
    /// How many goal images are averaged.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..))]
    goal_images: u16,
    /// Delay of the images that the controller gets, in images.
    #[arg(long, value_name = "N", default_value_t = 0)]
    delay: u16,
    /// How poses are made: a filter on the goal's depths, or one candidate of each image by a rule.
    #[arg(long, value_enum, default_value_t = Rule::Filter)]
    rule: Rule,
    /// The length of the translation; others than goal-depths choose by --rule in each image.
    #[arg(long, value_enum, default_value_t = Translation::GoalDepths)]
    translation: Translation,
    /// Show a live run instead of simulating one: a file of `quest_pose.servo.Recorder`.
    #[arg(long, value_name = "RUN.npz", conflicts_with_all = SIMULATED)]
    replay: Option<PathBuf>,
    /// Draw the run (figures 9, 10 and 12 to 19 of the paper); for the robot with the paths from five more starts.
    #[arg(long, value_name = "FILE.svg|html|png|pdf", value_parser = parse_plot)]
    plot: Option<Plot>,
    #[command(flatten)]
    output: OutputOptions,
}

/// What moves, and where it starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Scenario {
    /// Section 10.1: a free camera, five points.
    Paper,
    /// A free camera from a random start, turned by up to 60 degrees.
    Random,
    /// Sections 10.3 and 10.4: a robot 80 cm back and 20 cm aside, turned by 20 degrees.
    Robot,
}

/// How a pose is made of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Rule {
    /// A filter on the goal's inverse depths.
    Filter,
    /// A map of the goal's features with key images, as the Python package uses it.
    Map,
    /// The candidate with the closest goal depths, as section 10.1 chooses.
    ClosestDepths,
    /// The candidate that explains the image best with the goal's depths.
    Reprojection,
    /// The candidate that stays closest to the robot's plane, as section 10.2 chooses.
    RotationAxis,
}

/// The length of the translation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Translation {
    /// In the unit of the goal's depths.
    GoalDepths,
    /// In the unit of the depths of both views.
    BothViews,
    /// Always one, as an essential matrix has it.
    Unit,
}

fn not_negative(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|v| v.is_finite() && *v >= 0.0);
    value.ok_or_else(|| "expected a finite number that is not negative".to_owned())
}

/// What a scenario is made of, besides what moves.
struct Setup {
    world: World,
    limits: Limits,
    images: usize,
    /// About how far the features are from the goal, in metres.
    unit: f64,
    plane: Option<Plane>,
    rng: ChaCha8Rng,
}

/// How a run went.
struct Run {
    summary: Summary,
    frames: Vec<FrameRecord>,
    camera: Camera,
    /// The features of the goal image, in pixels.
    goal: Vec<[f64; 2]>,
    /// The features in the frame of the goal, in metres.
    points: Vec<[f64; 3]>,
    /// Whether the camera moves in space, not on a floor.
    is_free: bool,
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    if let Some(path) = &arguments.replay {
        return replay::run(path, arguments.plot.as_ref(), &arguments.output);
    }
    let mut output = arguments.output.open()?;
    let plot = match &arguments.plot {
        Some(plot) => Some((plot, plot.open()?)),
        None => None,
    };
    let run = simulate(arguments, 0);
    output.write(|writer| match arguments.output.format(Format::Table) {
        Format::Table => summary::write(writer, &run.summary),
        Format::Json => quest_io::write_json(writer, &run.summary),
        Format::Jsonl => run.frames.iter().try_for_each(|frame| rows::write_line(writer, frame)),
        Format::Csv => frame::write_csv(writer, &run.frames),
    })?;
    if let Some((plot, file)) = plot {
        let starts = if arguments.scenario == Scenario::Robot { 1..6 } else { 1..1 };
        let others: Vec<_> = starts.map(|index| simulate(arguments, index)).collect();
        plot.write(file, charts::drawn(&arguments.title(), &run, &others, plot.is_svg())?)?;
    }
    output.finish()?;
    Ok(if run.summary.reached { Outcome::Answer } else { Outcome::NoPose })
}

impl Arguments {
    fn title(&self) -> String {
        let moves = match self.scenario {
            Scenario::Paper => "Section 10.1",
            Scenario::Random => "A free camera",
            Scenario::Robot if self.coplanar => "Section 10.4: a robot, coplanar features",
            Scenario::Robot => "Section 10.3: a robot, general features",
        };
        format!("{moves}, {} px of noise, seed {}", self.noise, self.seed)
    }
}

/// About how far the features are, in metres.
const UNIT: f64 = 2.0;

/// Random starts that are tried: with very many features hardly one keeps them all in view.
const START_TRIES: usize = 200;

/// A minute at 30 Hz.
const ROBOT_IMAGES: usize = 1_800;

/// Run number `index`: the robot's first start is the paper's; the others are random ones from which it can see all features on
/// its way.
fn simulate(arguments: &Arguments, index: u64) -> Run {
    let features = if arguments.coplanar { Features::Coplanar } else { Features::General };
    let count = usize::from(arguments.features);
    let disturbances = Disturbances {
        noise_px: arguments.noise,
        rounded: arguments.noise > 0.0,
        delay: usize::from(arguments.delay),
        ..Disturbances::default()
    };
    let mut rng = scenario::generator(arguments.seed, index);
    let limits = Limits { speed: 0.5, turn_rate: 0.6 };
    let setup = |mut world: World, images, plane, rng| {
        world.goal_images = usize::from(arguments.goal_images);
        Setup { world, limits, images, unit: UNIT, plane, rng }
    };
    match arguments.scenario {
        Scenario::Paper => {
            let (mut world, plant) = scenario::paper();
            world.disturbances = disturbances;
            drive(arguments, setup(world, 1_400, None, rng), plant, FreeCameraLaw { rate: 0.25, unit: UNIT })
        }
        Scenario::Random => {
            let (world, plant) =
                scenario::random(features, count, &disturbances, &mut rng, scenario::random_camera);
            drive(arguments, setup(world, 600, None, rng), plant, FreeCameraLaw { rate: 0.3, unit: UNIT })
        }
        Scenario::Robot => {
            let law = DifferentialDriveLaw::default;
            let mut start = || {
                let (world, plant) = scenario::random(features, count, &disturbances, &mut rng, |rng| {
                    if index == 0 { scenario::robot_start(features) } else { scenario::random_robot(rng) }
                });
                (World { period: 1.0 / 30.0, ..world }, plant)
            };
            let (mut world, mut plant) = start();
            let tries = if index > 0 { START_TRIES } else { 0 };
            for _ in 0..tries {
                if world.stays_in_view(plant, law(), &limits, UNIT, ROBOT_IMAGES) {
                    break;
                }
                (world, plant) = start();
            }
            let plane = Some(Plane { tilt: 0.002, height: 0.001 });
            drive(arguments, setup(world, ROBOT_IMAGES, plane, rng), plant, law())
        }
    }
}

/// Chooses the estimator.
fn drive<P: Plant, L: ControlLaw>(arguments: &Arguments, mut setup: Setup, plant: P, law: L) -> Run {
    let pixels = setup.world.goal_pixels(&mut setup.rng);
    let goal = setup.world.on_plane(&pixels);
    let choice = match arguments.rule {
        Rule::ClosestDepths => Some(Choice::ClosestDepths),
        Rule::Reprojection => Some(Choice::Reprojection),
        Rule::RotationAxis => Some(Choice::RotationAxis),
        Rule::Filter | Rule::Map => None,
    };
    let length = match arguments.translation {
        Translation::GoalDepths => Length::GoalDepths,
        Translation::BothViews => Length::BothViews,
        Translation::Unit => Length::Unit,
    };
    let depths: Vec<f64> = setup.world.points.iter().map(|x| x.z).collect();
    if choice.is_none() && length == Length::GoalDepths {
        let options =
            FilterOptions { plane: setup.plane, ..setup.world.filter_options(&setup.limits, setup.unit) };
        // Exact images need no averaging.
        let first_images = if arguments.noise > 0.0 { options.first_images } else { 1 };
        let options = FilterOptions { first_images, ..options };
        if arguments.rule == Rule::Map {
            let tracker = Tracker::new(&goal, arguments.solver, options);
            let servo = controller(&setup, &goal, tracker, law);
            return watch(arguments, setup, plant, (pixels, &goal), servo);
        }
        let filter = DepthFilter::new(&goal, arguments.solver, options);
        let servo = controller(&setup, &goal, filter, law);
        return watch(arguments, setup, plant, (pixels, &goal), servo);
    }
    let choice = choice.unwrap_or(Choice::Reprojection);
    let mut estimator = PerFrame::new(&goal, arguments.solver, choice, length);
    estimator.set_depths(&depths);
    let servo = controller(&setup, &goal, estimator, law);
    watch(arguments, setup, plant, (pixels, &goal), servo)
}

fn controller<E: PoseEstimator, L: ControlLaw>(
    setup: &Setup,
    goal: &[[f64; 2]],
    estimator: E,
    law: L,
) -> Servo<E, L> {
    let mut safety = Safety::new(setup.limits);
    safety.border = setup.plane.and_then(|_| setup.world.border(40.0));
    let rig = Rig { unit: setup.unit, period: setup.world.period, ..Rig::default() };
    Servo::new(goal, estimator, law, safety).with_rig(rig)
}

/// Runs the loop and records it.
fn watch<P: Plant, L: ControlLaw, E: PoseEstimator>(
    arguments: &Arguments,
    mut setup: Setup,
    mut plant: P,
    (pixels, goal): (Vec<[f64; 2]>, &[[f64; 2]]),
    mut servo: Servo<E, L>,
) -> Run {
    let depths: Vec<f64> = setup.world.points.iter().map(|x| x.z).collect();
    // What the essential matrix says of the same images, by Stewénius' method as in the paper's figures.
    let compared = |solver, length| {
        let mut estimator = PerFrame::new(goal, solver, Choice::Reprojection, length);
        estimator.set_depths(&depths);
        estimator
    };
    let mut essential = compared(SolverName::Stewenius, Length::Unit);
    let mut homography = arguments.coplanar.then(|| compared(SolverName::Homography, Length::GoalDepths));
    let mut frames = Vec::with_capacity(setup.images);
    let mut summary = Summary::new(arguments.solver.info().name, &depths, &plant.pose());
    setup.world.run(&mut plant, &mut servo, setup.images, &mut setup.rng, |record| {
        let essential = essential.estimate(&record.features).ok();
        let homography = homography.as_mut().and_then(|h| h.estimate(&record.features).ok());
        summary.add(record);
        frames.push(FrameRecord::new(record, essential.as_ref(), homography.as_ref()));
        true
    });
    summary.finish(&plant.pose());
    Run {
        summary,
        frames,
        camera: setup.world.camera,
        goal: pixels,
        points: setup.world.points.iter().map(|x| (*x).into()).collect(),
        is_free: arguments.scenario != Scenario::Robot,
    }
}
