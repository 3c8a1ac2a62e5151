//! One run, and what became of it.

use quest_core::RelativePose;
use quest_core::servo::scenario;
use quest_core::servo::{
    ControlLaw, DepthFilter, DifferentialDriveLaw, FilterOptions, FreeCameraLaw, Plane, PoseEstimator,
    Record, Rig, Safety, Servo, State, Tracker, World,
};
use quest_core::solver::SolverName;
use rand_chacha::ChaCha8Rng;

use super::super::bound;
use super::cells::Cell;
use super::scenes::{self, Body, LIMITS, UNIT};

/// A minute at 10 Hz.
const IMAGES: usize = 600;
/// A run ends early after so many images with less than 1 mm/s and 2 mrad/s.
const SETTLED: usize = 60;
const BORDER: f64 = 40.0;
const PLANE: Plane = Plane { tilt: 0.002, height: 0.001 };

#[derive(Clone, Copy, Debug)]
pub(crate) struct Outcome {
    /// In metres and degrees.
    pub(crate) position: f64,
    pub(crate) angle: f64,
    /// Whether a resection from the goal image alone, the places of the features being known that the first image shows right, is
    /// within 2 cm and 1°.
    pub(crate) resection_arrives: bool,
    /// How many features the first image shows right.
    pub(crate) right: usize,
    /// How far beyond the start's distance it ever was, in metres, less what it may explore.
    pub(crate) beyond: f64,
    pub(crate) has_started: bool,
    pub(crate) holds: bool,
    pub(crate) restarts: usize,
    /// The largest change of the speed from one command to the next.
    pub(crate) largest_step: f64,
    pub(crate) unsafe_commands: usize,
    pub(crate) state: State,
}

impl Outcome {
    /// Within 2 cm and 1°.
    pub(crate) fn arrives(&self) -> bool {
        self.position < 0.02 && self.angle < 1.0
    }

    /// More than 5 cm further away than it began, at any time.
    pub(crate) fn is_astray(&self) -> bool {
        self.beyond > 0.05
    }
}

/// What a loop is built from.
struct Setup<'a> {
    cell: &'a Cell,
    world: &'a World,
    goal: &'a [[f64; 2]],
    options: FilterOptions,
    safety: Safety,
    rig: Rig,
    /// With the filter in place of the tracker.
    filtered: bool,
}

/// Runs the loop of a cell with what the wheel does by default.
pub(crate) fn run(cell: &Cell, seed: u64, index: u64, filtered: bool) -> Outcome {
    run_watched(cell, seed, index, filtered, |_| {})
}

/// The same; `watch` sees every image.
pub(crate) fn run_watched(
    cell: &Cell,
    seed: u64,
    index: u64,
    filtered: bool,
    watch: impl FnMut(&Record),
) -> Outcome {
    let rng = &mut scenario::generator(seed, index);
    let (world, body) = scenes::draw(cell, rng);
    let goal = world.on_plane(&world.goal_pixels(rng));
    let options = world.filter_options(&LIMITS, UNIT);
    let mut setup = Setup {
        cell,
        world: &world,
        goal: &goal,
        options,
        safety: Safety { explore: cell.explore, ..Safety::for_robot(LIMITS) },
        rig: Rig { unit: UNIT, ..Rig::default() },
        filtered,
    };
    match body {
        Body::Camera(_) => {
            let law = FreeCameraLaw { rate: 0.5, unit: UNIT };
            start(&setup, body, law, rng, watch)
        }
        Body::Robot(_, mount) => {
            setup.safety.border = world.border(BORDER);
            setup.rig.mount = mount;
            let base = mount.pose();
            setup.options.plane = Some(PLANE);
            setup.options.base = RelativePose::new(base.q_21, base.t_21 / UNIT);
            start(&setup, body, DifferentialDriveLaw::default(), rng, watch)
        }
    }
}

/// Which features an image shows where they are, within four standard deviations.
fn right_ones(world: &World, record: &Record) -> Vec<bool> {
    const NEAR_PX: f64 = 2.0;
    let is_right = |(x, seen): (&nalgebra::Vector3<f64>, &Option<[f64; 2]>)| {
        let truth = world.camera.project(&(record.truth.q_21 * x + record.truth.t_21)).ok();
        seen.zip(truth).is_some_and(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1]) < NEAR_PX)
    };
    world.points.iter().zip(&record.pixels).map(is_right).collect()
}

fn start<L: ControlLaw>(
    setup: &Setup<'_>,
    body: Body,
    law: L,
    rng: &mut ChaCha8Rng,
    watch: impl FnMut(&Record),
) -> Outcome {
    let Setup { cell, world, goal, options, safety, rig, filtered } = *setup;
    let depths: Vec<f64> = world.points.iter().map(|x| x.z).collect();
    if filtered {
        let mut filter = DepthFilter::new(goal, SolverName::Quest, options);
        if cell.known_depths {
            filter.set_depths(&depths, 0.02);
        }
        return drive(setup, body, Servo::new(goal, filter, law, safety).with_rig(rig), rng, watch);
    }
    let mut tracker = Tracker::new(goal, SolverName::Quest, options);
    if cell.known_depths {
        tracker.set_depths(&depths, 0.02);
    }
    drive(setup, body, Servo::new(goal, tracker, law, safety).with_rig(rig), rng, watch)
}

fn drive<E: PoseEstimator, L: ControlLaw>(
    setup: &Setup<'_>,
    mut body: Body,
    mut servo: Servo<E, L>,
    rng: &mut ChaCha8Rng,
    mut watch: impl FnMut(&Record),
) -> Outcome {
    let Setup { cell, world, .. } = *setup;
    let begin = body.off().0;
    let mut outcome = Outcome {
        position: begin,
        angle: 0.0,
        resection_arrives: false,
        right: 0,
        beyond: f64::NEG_INFINITY,
        has_started: false,
        holds: false,
        restarts: 0,
        largest_step: 0.0,
        unsafe_commands: 0,
        state: State::Coasting,
    };
    let (mut still, mut last) = (0, nalgebra::Vector3::zeros());
    let may = cell.explore * UNIT;
    world.run(&mut body, &mut servo, IMAGES, rng, |record| {
        watch(record);
        let step = &record.step;
        if step.status.images == 1 {
            let right = right_ones(world, record);
            outcome.right = right.iter().filter(|r| **r).count();
            // Without wrong matches features count that come into view later, too.
            let takes = |i: usize| cell.sticky.is_none() || right[i];
            let bound = bound::resection(&world.points, takes, setup.goal, &setup.options, UNIT);
            let (position, angle) = bound::error(&bound);
            outcome.resection_arrives = position < 0.02 && angle < 1.0;
        }
        let is_safe = step.command.is_finite()
            && step.command.linear.norm() <= LIMITS.speed * (1.0 + 1e-12)
            && step.command.angular.norm() <= LIMITS.turn_rate * (1.0 + 1e-12);
        outcome.unsafe_commands += usize::from(!is_safe);
        outcome.largest_step = outcome.largest_step.max((step.command.linear - last).norm());
        last = step.command.linear;
        outcome.has_started |= step.state.has_pose();
        outcome.holds = !step.state.has_pose();
        outcome.restarts = step.status.restarts;
        outcome.state = step.state;
        outcome.beyond = outcome.beyond.max(record.truth.t_21.norm() - begin - may);
        // While it may still explore, standing still is no end.
        let stands =
            !outcome.holds && step.command.linear.norm() < 1e-3 && step.command.angular.norm() < 2e-3;
        still = if stands { still + 1 } else { 0 };
        still < SETTLED
    });
    let (position, angle) = body.off();
    // A robot's camera swings about its axle: its own way counts.
    if matches!(body, Body::Robot(..)) {
        outcome.beyond = f64::max(0.0, position - begin);
    }
    Outcome { position, angle: angle.to_degrees(), ..outcome }
}
