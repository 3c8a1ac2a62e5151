//! One run of the closed loop, and how it ends.

use quest_core::servo::scenario;
use quest_core::servo::{
    ControlLaw, DepthFilter, DifferentialDriveLaw, FilterOptions, FreeCameraLaw, Limits, PerFrame, Plane,
    Plant, PoseEstimator, Rig, Safety, Servo, Tracker, World,
};
use quest_core::solver::SolverName;
use rand_chacha::ChaCha8Rng;

use super::bound;
use super::cells::{Body, Cell, Method};

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum End {
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
pub(crate) struct Outcome {
    pub(crate) end: End,
    /// In metres and degrees.
    pub(crate) position: f64,
    pub(crate) angle: f64,
    pub(crate) holds: usize,
    /// Commands above the limits, or not finite.
    pub(crate) unsafe_commands: usize,
    /// Whether a resection from the goal image alone, the features' places being known, is within 2 cm and 1°.
    pub(crate) resection_converged: bool,
}

fn has_converged(position: f64, angle: f64) -> bool {
    position < 0.02 && angle < 1.0
}

const LIMITS: Limits = Limits { speed: 0.5, turn_rate: 0.6 };
/// A minute at 10 Hz.
const IMAGES: usize = 600;
/// A run ends early after so many images with less than 2 mm/s and 4 mrad/s.
const SETTLED: usize = 50;
/// About how far the features are, in metres.
const UNIT: f64 = 2.0;
/// The border of the image, in pixels.
const BORDER: f64 = 40.0;
const PLANE: Plane = Plane { tilt: 0.002, height: 0.001 };

impl Cell {
    pub(crate) fn run(&self, seed: u64, index: u64) -> Outcome {
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
            if world.stays_in_view(plant.clone(), law(), &LIMITS, UNIT, IMAGES) {
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
        let options = FilterOptions {
            plane: self.plane.then_some(PLANE),
            // Four features tell the three numbers of a pose on a plane; others wait for the fifth.
            min_features: if self.plane && self.count < 20 { 4 } else { 5 },
            ..world.filter_options(&LIMITS, UNIT)
        };
        let (position, angle) =
            bound::error(&bound::resection(&world.points, |_| true, &goal, &options, UNIT));
        let outcome = match self.method {
            Method::Filter => {
                let mut filter = DepthFilter::new(&goal, SolverName::Quest, options);
                if self.known_depths {
                    filter.set_depths(&depths, 0.02);
                }
                self.drive(world, plant, law, &goal, filter, rng)
            }
            Method::Tracker => {
                let mut tracker = Tracker::new(&goal, SolverName::Quest, options);
                if self.known_depths {
                    tracker.set_depths(&depths, 0.02);
                }
                self.drive(world, plant, law, &goal, tracker, rng)
            }
            Method::PerFrame(solver, choice, length) => {
                let mut estimator = PerFrame::new(&goal, solver, choice, length);
                estimator.set_depths(&depths);
                self.drive(world, plant, law, &goal, estimator, rng)
            }
        };
        Outcome { resection_converged: has_converged(position, angle), ..outcome }
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
        let rig = Rig { unit: UNIT, ..Rig::default() };
        let mut servo = Servo::new(goal, estimator, law, safety).with_rig(rig);
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
        let end = if has_converged(position, angle) {
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
        Outcome { end, position, angle, holds, unsafe_commands, resection_converged: false }
    }
}
