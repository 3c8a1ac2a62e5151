//! From an image to a command: clock, estimator, state, law, guards, limits.

mod contradictions;
pub(crate) mod joints;
mod memory;
pub(crate) mod rig;
pub(crate) mod safety;
pub(crate) mod state;
mod watchdog;

use crate::RelativePose;
use crate::servo::estimators::estimate::{Estimate, HoldReason, PoseEstimator, Support};
use crate::servo::laws::law::ControlLaw;
use crate::servo::twist::Twist;
use memory::Memory;
use rig::{Mount, Rig};
use safety::Safety;
use state::{State, Status, Step};

/// While several hypotheses command different things, the best one is followed at this share of its speed. That is slow enough to
/// find out a wrong one before the camera has gone far. With 0.4 twice as many of the starts with six features went astray, with 0.1
/// as many.
const AMBIGUOUS_SPEED: f64 = 0.2;

/// A pose is followed at this share of its speed until the camera is seen to go where it is sent: for a second at 10 Hz, over a few
/// centimetres.
const CONFIRMING_SPEED: f64 = 0.3;

/// After so many divergences the loop holds until it is reset. Each of them took the camera a little further from its goal.
const MOST_DIVERGENCES: usize = 3;

/// A closed loop's controller: an image in, a command out.
///
/// Where the pose cannot be trusted, the controller commands zero velocity and says why. It goes on by itself once there is a pose
/// to trust.
#[derive(Clone, Debug)]
pub struct Servo<E, L> {
    estimator: E,
    law: L,
    safety: Safety,
    rig: Rig,
    goal: Vec<[f64; 2]>,
    /// The memory of the border for the features' distances.
    reach: Vec<f64>,
    memory: Memory,
}

impl<E: PoseEstimator, L: ControlLaw> Servo<E, L> {
    /// A controller that brings the features to this goal image, given on the plane z = 1, with the default [`Rig`].
    #[must_use]
    pub fn new(goal: &[[f64; 2]], estimator: E, law: L, safety: Safety) -> Self {
        let reach = Vec::with_capacity(goal.len());
        Self {
            estimator,
            law,
            safety,
            rig: Rig::default(),
            goal: goal.to_vec(),
            reach,
            memory: Memory::default(),
        }
    }

    /// The same controller with this rig.
    #[must_use]
    pub fn with_rig(self, rig: Rig) -> Self {
        Self { rig, ..self }
    }

    /// The command for one image. `features` has one entry for each feature of the goal, in the same order: its point on the plane
    /// z = 1 of the current camera, or `None` where it is not seen.
    ///
    /// The image is taken to come one [`Rig::period`] after the last one. Nothing is allocated.
    pub fn step(&mut self, features: &[Option<[f64; 2]>]) -> Step {
        let stamp = self.memory.time + self.rig.period;
        self.step_at(features, stamp, stamp)
    }

    /// As [`step`](Self::step), for an image that was taken at `stamp` and is worked on at `now`, in seconds of one clock.
    ///
    /// An image is stale if its stamp is not later than the last one's, or if it is older than [`Safety::largest_gap`]. A stale
    /// image is not looked at, and the loop holds.
    pub fn step_at(&mut self, features: &[Option<[f64; 2]>], stamp: f64, now: f64) -> Step {
        let Some(seconds) = self.memory.seconds_since(stamp, now, &self.rig, &self.safety) else {
            return self.hold(features, HoldReason::Stale, self.rig.period);
        };
        if self.memory.watchdog.found > MOST_DIVERGENCES {
            return self.hold(features, HoldReason::Diverging, seconds);
        }
        self.estimator.moved(&self.memory.motion(seconds, self.rig.unit));
        match self.estimator.estimate(features) {
            Ok(estimate) if self.is_certain(&estimate) => self.follow(features, &estimate, seconds),
            Ok(_) => self.hold(features, HoldReason::Uncertain, seconds),
            Err(reason) => self.hold(features, reason, seconds),
        }
    }

    /// The command while no image comes. [`step`](Self::step) answers for one period only, so call this at the rate of the robot's
    /// own control. The last command goes on until there was no image for [`Safety::largest_gap`]; then it goes to zero. `now` is
    /// on the clock of the stamps.
    pub fn idle(&mut self, now: f64) -> Twist {
        if now - self.memory.time > self.safety.largest_gap {
            self.memory.slow_down(&self.safety, self.rig.period);
        }
        self.memory.command
    }

    /// Forgets everything but the goal: the next images start the loop as the first ones did.
    pub fn reset(&mut self) {
        self.estimator.reset();
        self.law.reset();
        self.memory = Memory::default();
    }

    /// The estimator.
    pub fn estimator(&self) -> &E {
        &self.estimator
    }

    /// The estimator, for instance to give it depths.
    pub fn estimator_mut(&mut self) -> &mut E {
        &mut self.estimator
    }

    /// The control law.
    pub fn law(&self) -> &L {
        &self.law
    }

    /// The control law, for instance to give it other gains.
    pub fn law_mut(&mut self) -> &mut L {
        &mut self.law
    }

    /// The limits and guards, to change them.
    pub fn safety_mut(&mut self) -> &mut Safety {
        &mut self.safety
    }

    /// How the loop is built, for instance to set its unit once metric depths are known.
    pub fn rig_mut(&mut self) -> &mut Rig {
        &mut self.rig
    }

    /// Whether an estimate is certain enough to act on.
    fn is_certain(&self, estimate: &Estimate) -> bool {
        let finite = estimate.pose.t_21.iter().chain(estimate.pose.q_21.coords.iter()).all(|x| x.is_finite());
        let Some(covariance) = estimate.covariance else {
            // There is nothing to hold against an estimator that knows no covariance.
            return finite;
        };
        let variance = |first: usize| (0..3).map(|k| covariance[(first + k, first + k)]).sum::<f64>();
        // Not a number compares as false: it is uncertain.
        let within = |variance: f64, most: f64| variance >= 0.0 && variance.sqrt() <= most;
        finite
            && within(variance(0), self.safety.rotation_uncertainty)
            && (estimate.support == Support::RotationOnly
                || within(variance(3), self.safety.translation_uncertainty))
    }

    /// The law's potential at a pose.
    fn potential(&self, pose: &RelativePose) -> Option<f64> {
        self.law.potential(&self.rig.axes.of_pose(pose))
    }

    /// The command for an image with a pose.
    fn follow(&mut self, features: &[Option<[f64; 2]>], estimate: &Estimate, seconds: f64) -> Step {
        let pose = self.rig.mount.pose_for_law(&estimate.pose, self.rig.unit);
        let (mut state, wanted) = match estimate.support {
            Support::RotationOnly => (State::RotationOnly, self.law.turn(&pose)),
            Support::Several => (State::Ambiguous, self.law.command(&pose)),
            Support::Unconfirmed => (State::Confirming, self.law.command(&pose)),
            Support::Full => (State::Tracking, self.law.command(&pose)),
        };
        let motion = self.memory.motion(seconds, self.rig.unit);
        let potential = self.potential(&pose).filter(|_| state != State::RotationOnly);
        let begin = self.estimator.begin().map(|begin| self.rig.mount.pose_for_law(&begin, self.rig.unit));
        let scale = begin.and_then(|begin| self.potential(&begin)).unwrap_or(1.0);
        let variance = estimate.covariance.map_or(0.0, |c| c.trace());
        if self.safety.watchdog {
            self.memory.contradictions.count(self.estimator.restarts(), state, potential);
        }
        if self.safety.watchdog
            && (self.memory.watchdog.is_diverging(potential, scale, variance, &motion)
                || self.memory.turns_away(state, estimate, &motion)
                || self.memory.is_contradicted())
        {
            self.restart();
            return self.hold(features, HoldReason::Diverging, seconds);
        }
        let (wanted, border_limits) = self.guarded(wanted, features, state);
        // To go another way rests on a pose of which it is known how good it is.
        self.law.hindered(border_limits && estimate.covariance.is_some());
        if border_limits {
            self.memory.watchdog.forget();
        }
        let mut wanted = wanted;
        if state == State::RotationOnly && self.safety.explore > 0.0 {
            let direction = self.rig.axes.of(&self.law.exploration(self.memory.exploration.tries));
            let angle = estimate.pose.q_21.angle();
            let length = self.safety.explore * self.rig.unit;
            if let Some(twist) =
                self.memory.exploration.command(&direction, angle, length, &self.safety, seconds)
            {
                (state, wanted) = (State::Exploring, self.rig.mount.carry(&twist));
            } else if self.memory.exploration.take_end() {
                self.restart();
            }
        }
        let command = self.memory.accelerated(&wanted, &self.safety, seconds);
        self.memory.has_arrived(state, &pose, &self.rig, &self.safety, seconds);
        self.memory.held(None, seconds);
        self.finish(features, command, &Ok(*estimate), state, border_limits)
    }

    /// The estimator begins anew, by no fault of its own.
    fn restart(&mut self) {
        self.estimator.restart();
        self.memory.contradictions.expect(self.estimator.restarts());
    }

    /// The command for an image without a pose: the last command, or one closer to zero.
    fn hold(&mut self, features: &[Option<[f64; 2]>], reason: HoldReason, seconds: f64) -> Step {
        let coasts = self.memory.may_coast(reason, &self.safety);
        self.memory.held(Some(reason), seconds);
        if !coasts {
            self.memory.watchdog.forget();
            self.memory.slow_down(&self.safety, seconds);
        }
        let state = if coasts { State::Coasting } else { State::Holding(reason) };
        let command = self.memory.command;
        self.finish(features, command, &Err(reason), state, false)
    }

    fn finish(
        &mut self,
        features: &[Option<[f64; 2]>],
        command: Twist,
        estimate: &Result<Estimate, HoldReason>,
        state: State,
        border_limits: bool,
    ) -> Step {
        self.memory.command = command;
        self.memory.camera_command = self.rig.mount.carried(&command);
        let memory = &self.memory;
        let status = Status {
            images: memory.images,
            time: memory.time,
            seen: features.iter().flatten().filter(|p| p.iter().all(|c| c.is_finite())).count(),
            inliers: estimate.as_ref().map_or(0, |e| e.inliers),
            hypotheses: self.estimator.hypotheses(),
            holding_images: memory.holding_images,
            holding_seconds: memory.holding_seconds,
            restarts: self.estimator.restarts(),
            arrived: memory.arrived,
            border_limits,
        };
        Step { command, estimate: *estimate, state, status }
    }

    /// The command within the border, the free axes and the limits, in the frame that is commanded. The second value is whether the
    /// border changed it.
    fn guarded(&mut self, twist: Twist, features: &[Option<[f64; 2]>], state: State) -> (Twist, bool) {
        let mut twist = twist;
        let mut border_limits = false;
        if let Some(border) = &self.safety.border {
            let wanted = twist.angular.y;
            twist.angular.y = border.turn(wanted, features, &self.goal, &mut self.reach);
            border_limits = (twist.angular.y - wanted).abs() > 0.3 * wanted.abs() + 1e-3;
        }
        let twist = match self.rig.mount {
            Mount::Base(_) => twist,
            Mount::Camera | Mount::Hand(_) => self.rig.mount.carry(&self.rig.axes.of(&twist)),
        };
        let mut twist = self.safety.limits.apply(&twist);
        let share = match state {
            State::Ambiguous => AMBIGUOUS_SPEED * self.memory.contradictions.trust(),
            State::Confirming => CONFIRMING_SPEED * self.memory.contradictions.trust(),
            _ => 1.0,
        };
        (twist.linear, twist.angular) = (twist.linear * share, twist.angular * share);
        (twist, border_limits)
    }
}
