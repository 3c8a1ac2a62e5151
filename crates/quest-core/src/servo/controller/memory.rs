//! What the controller remembers from one image to the next.

use nalgebra::Vector3;

use crate::RelativePose;
use crate::servo::controller::contradictions::Contradictions;
use crate::servo::controller::rig::Rig;
use crate::servo::controller::safety::Safety;
use crate::servo::controller::state::State;
use crate::servo::controller::watchdog::Watchdog;
use crate::servo::estimators::estimate::{Estimate, HoldReason, Motion};
use crate::servo::twist::{Limits, Twist};

#[derive(Clone, Debug)]
pub(crate) struct Memory {
    /// The last command, in the frame that is commanded.
    pub(crate) command: Twist,
    /// The same in the camera's frame.
    pub(crate) camera_command: Twist,
    /// The stamp of the last image.
    pub(crate) time: f64,
    pub(crate) images: u64,
    pub(crate) holding_images: usize,
    pub(crate) holding_seconds: f64,
    pub(crate) arrived: bool,
    /// How long the camera has been at the goal.
    at_goal_seconds: f64,
    pub(crate) watchdog: Watchdog,
    /// The same of the angle alone, where nothing else is known.
    turning: Watchdog,
    pub(crate) contradictions: Contradictions,
    pub(crate) exploration: Exploration,
}

impl Default for Memory {
    fn default() -> Self {
        Self {
            command: Twist::zero(),
            camera_command: Twist::zero(),
            time: 0.0,
            images: 0,
            holding_images: 0,
            holding_seconds: 0.0,
            arrived: false,
            at_goal_seconds: 0.0,
            watchdog: Watchdog::default(),
            turning: Watchdog::default(),
            contradictions: Contradictions::default(),
            exploration: Exploration::default(),
        }
    }
}

impl Memory {
    /// The seconds since the last image; `None` for a stale image. Any other becomes the last image.
    pub(crate) fn seconds_since(&mut self, stamp: f64, now: f64, rig: &Rig, safety: &Safety) -> Option<f64> {
        self.images += 1;
        let seconds = if self.images == 1 { rig.period } else { stamp - self.time };
        let is_fresh = stamp.is_finite() && seconds > 0.0 && now - stamp <= safety.largest_gap;
        if !is_fresh {
            return None;
        }
        self.time = stamp;
        Some(seconds)
    }

    /// The motion that the last command should have produced in this many seconds.
    pub(crate) fn motion(&self, seconds: f64, unit: f64) -> Motion {
        Motion {
            linear: self.camera_command.linear * (seconds / unit),
            angular: self.camera_command.angular * seconds,
        }
    }

    /// The command nearest to what is wanted that the acceleration allows.
    pub(crate) fn accelerated(&self, wanted: &Twist, safety: &Safety, seconds: f64) -> Twist {
        let Some(acceleration) = safety.acceleration else { return *wanted };
        // After a gap the robot cannot have taken the time to speed up.
        let change = Limits {
            speed: acceleration.linear * seconds.min(0.5),
            turn_rate: acceleration.angular * seconds.min(0.5),
        };
        let by = Twist {
            linear: wanted.linear - self.command.linear,
            angular: wanted.angular - self.command.angular,
        };
        let by = change.apply(&by);
        // Between two commands within the limits: the limits are a ball each.
        Twist { linear: self.command.linear + by.linear, angular: self.command.angular + by.angular }
    }

    /// Brings the command towards zero, as fast as the acceleration allows.
    pub(crate) fn slow_down(&mut self, safety: &Safety, seconds: f64) {
        self.command = self.accelerated(&Twist::zero(), safety, seconds);
    }

    /// Whether the last command may go on although this image gave no pose.
    pub(crate) fn may_coast(&self, reason: HoldReason, safety: &Safety) -> bool {
        let passes = matches!(
            reason,
            HoldReason::TooFewFeatures | HoldReason::Inconsistent | HoldReason::Jump | HoldReason::Degenerate
        );
        passes && self.holding_images < safety.coasting_images
    }

    /// Counts an image with a reason to hold, or one without.
    pub(crate) fn held(&mut self, reason: Option<HoldReason>, seconds: f64) {
        if reason.is_some() {
            self.holding_images += 1;
            self.holding_seconds += seconds;
            (self.arrived, self.at_goal_seconds) = (false, 0.0);
        } else {
            (self.holding_images, self.holding_seconds) = (0, 0.0);
        }
    }

    /// Whether the angle to the goal does not fall although the camera is told to turn, where it only turns.
    pub(crate) fn turns_away(&mut self, state: State, estimate: &Estimate, motion: &Motion) -> bool {
        let square = (state == State::RotationOnly).then(|| estimate.pose.q_21.angle().powi(2));
        let variance = estimate.covariance.map_or(0.0, |c| (0..3).map(|k| c[(k, k)]).sum());
        let turn = Motion { linear: Vector3::zeros(), ..*motion };
        let turns_away = self.turning.is_diverging(square, 1.0, variance, &turn);
        if turns_away {
            self.watchdog.count_as_two();
        }
        turns_away
    }

    /// Whether the camera was seen again and again not to go where it is sent.
    pub(crate) fn is_contradicted(&mut self) -> bool {
        let is_contradicted = self.contradictions.are_a_divergence();
        if is_contradicted {
            self.watchdog.count_as_two();
        }
        is_contradicted
    }

    /// Counts the time at the goal.
    pub(crate) fn has_arrived(
        &mut self,
        state: State,
        pose: &RelativePose,
        rig: &Rig,
        safety: &Safety,
        seconds: f64,
    ) {
        let arrival = &safety.arrival;
        let is_there = state == State::Tracking
            && pose.t_21.norm() * rig.unit <= arrival.distance
            && pose.q_21.angle() <= arrival.angle;
        self.at_goal_seconds = if is_there { self.at_goal_seconds + seconds } else { 0.0 };
        self.arrived = is_there && self.at_goal_seconds >= arrival.seconds;
    }
}

/// A small deliberate motion where the images show no parallax.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Exploration {
    /// How many there have been.
    pub(crate) tries: usize,
    /// The number of images for which the camera has stood still, its rotation done.
    still: usize,
    /// How far this one has gone, in metres.
    travelled: f64,
    has_ended: bool,
}

impl Exploration {
    /// Before the camera is moved, its rotation must be within `DONE` radians for `STILL_IMAGES` images.
    const DONE: f64 = 0.02;
    const STILL_IMAGES: usize = 8;
    const MOST_TRIES: usize = 3;

    /// The motion, along `direction`, for as long as it takes.
    pub(crate) fn command(
        &mut self,
        direction: &Twist,
        angle: f64,
        length: f64,
        safety: &Safety,
        seconds: f64,
    ) -> Option<Twist> {
        self.still = if angle < Self::DONE || self.travelled > 0.0 { self.still + 1 } else { 0 };
        if self.still <= Self::STILL_IMAGES || self.tries >= Self::MOST_TRIES {
            return None;
        }
        let norm = direction.linear.norm();
        if self.travelled >= length || norm <= 0.0 {
            *self = Self { tries: self.tries + 1, has_ended: true, ..Self::default() };
            return None;
        }
        // A third of the speed: a second or so for four hundredths of the depth.
        let speed = (safety.limits.speed / 3.0).min((length - self.travelled) / seconds.max(1e-3));
        self.travelled += speed * seconds;
        Some(Twist { linear: direction.linear * (speed / norm), ..Twist::zero() })
    }

    /// Whether a motion has just ended.
    pub(crate) fn take_end(&mut self) -> bool {
        std::mem::take(&mut self.has_ended)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exploration_is_as_fast_whatever_the_length_of_its_direction() {
        let mut exploration = Exploration::default();
        let safety = Safety::new(Limits { speed: 0.3, turn_rate: 1.0 });
        let direction = Twist { linear: Vector3::y() * 4.0, ..Twist::zero() };
        let commands: Vec<_> =
            (0..10).map(|_| exploration.command(&direction, 0.0, 0.015, &safety, 0.1)).collect();
        assert!(commands[..8].iter().all(Option::is_none));
        // A third of the speed, then what is left of the way.
        for (command, expected) in commands[8..].iter().zip([0.1, 0.05]) {
            assert!((command.unwrap().linear - Vector3::y() * expected).amax() < 1e-12, "{command:?}");
        }
    }

    #[test]
    fn an_exploration_that_has_begun_is_not_ended_by_a_turn_and_one_without_direction_is() {
        let safety = Safety::new(Limits { speed: 0.3, turn_rate: 1.0 });
        let direction = Twist { linear: Vector3::x(), ..Twist::zero() };
        let mut exploration = Exploration::default();
        let mut command =
            |direction: &Twist, angle: f64| exploration.command(direction, angle, 0.04, &safety, 0.1);
        // A turn that is not done yet lets it wait.
        assert!((0..8).all(|_| command(&direction, 0.0).is_none()));
        assert!(command(&direction, 0.1).is_none());
        assert!((0..8).all(|_| command(&direction, 0.0).is_none()));
        assert!(command(&direction, 0.0).is_some());
        // On its way it goes on, whatever the rotation shows.
        assert!((0..3).all(|_| command(&direction, 0.1).is_some()));
        assert!(command(&direction, 0.1).is_none());
        assert!(exploration.take_end() && !exploration.take_end());
        assert_eq!(exploration.tries, 1);
        // A law that knows no direction ends it at once.
        assert!((0..9).all(|_| exploration.command(&Twist::zero(), 0.0, 0.04, &safety, 0.1).is_none()));
        assert!(exploration.take_end());
        assert_eq!(exploration.tries, 2);
    }
}
