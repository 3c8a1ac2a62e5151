//! From an image to a command: estimator, law, guards, limits.

use super::{ControlLaw, Limits, Twist};
use crate::servo::estimators::estimate::{Estimate, HoldReason, PoseEstimator};

/// Where the features are to stay in the image, on the plane z = 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Border {
    /// The left end.
    pub left: f64,
    /// The right end.
    pub right: f64,
}

/// What keeps a robot safe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Safety {
    /// Speed and turn rate.
    pub limits: Limits,
    /// Turning about the vertical gives way to features at the left and right border of the image.
    pub border: Option<Border>,
    /// Where the rotation's standard deviation is larger than this, in radians, there is no command.
    pub rotation_uncertainty: f64,
    /// The same of the translation, in the unit of the goal's depths.
    pub translation_uncertainty: f64,
}

impl Safety {
    /// These limits, no border, a quarter of a radian and of the goal's depths as the largest uncertainty.
    #[must_use]
    pub fn new(limits: Limits) -> Self {
        Self { limits, border: None, rotation_uncertainty: 0.25, translation_uncertainty: 0.25 }
    }
}

/// What one image led to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// What to do until the next image: finite, within the limits, zero while holding.
    pub command: Twist,
    /// What it is based on, or why the robot holds.
    pub estimate: Result<Estimate, HoldReason>,
}

/// A closed loop's controller: an image in, a command out.
///
/// Where the pose cannot be trusted it commands standing still and says why; it goes on by itself once it can.
#[derive(Clone, Debug)]
pub struct Servo<E, L> {
    estimator: E,
    law: L,
    safety: Safety,
    goal: Vec<[f64; 2]>,
}

impl<E: PoseEstimator, L: ControlLaw> Servo<E, L> {
    /// A controller that brings the features to this goal image, given on the plane z = 1.
    #[must_use]
    pub fn new(goal: &[[f64; 2]], estimator: E, law: L, safety: Safety) -> Self {
        Self { estimator, law, safety, goal: goal.to_vec() }
    }

    /// The command for one image: one entry for each feature of the goal, in the same order, on the plane z = 1 of the
    /// current camera; `None` where it is not seen. Takes nothing from the heap.
    pub fn step(&mut self, features: &[Option<[f64; 2]>]) -> Step {
        let estimate = self.estimator.estimate(features);
        let estimate =
            estimate.and_then(|e| if self.is_certain(&e) { Ok(e) } else { Err(HoldReason::Uncertain) });
        let command = match &estimate {
            Ok(estimate) => {
                let wanted = self.law.command(&estimate.pose);
                self.guarded(wanted, features)
            }
            // Nor does it turn features back from the border.
            Err(_) => Twist::zero(),
        };
        Step { command, estimate }
    }

    /// The estimator.
    pub fn estimator(&self) -> &E {
        &self.estimator
    }

    /// The control law.
    pub fn law(&self) -> &L {
        &self.law
    }

    fn is_certain(&self, estimate: &Estimate) -> bool {
        let deviation =
            |first: usize| (0..3).map(|k| estimate.covariance[(first + k, first + k)]).sum::<f64>().sqrt();
        // An estimator without a covariance says infinite: there is nothing to hold against it.
        let within = |deviation: f64, most: f64| !deviation.is_finite() || deviation <= most;
        within(deviation(0), self.safety.rotation_uncertainty)
            && within(deviation(3), self.safety.translation_uncertainty)
    }

    fn guarded(&self, twist: Twist, features: &[Option<[f64; 2]>]) -> Twist {
        let mut twist = twist;
        if let Some(border) = &self.safety.border {
            twist.angular.y = border.turn(twist.angular.y, features.iter().zip(&self.goal));
        }
        self.safety.limits.apply(&twist)
    }
}

impl Border {
    /// How fast a feature outside of the border is brought back: in 1/s.
    const RETURN_RATE: f64 = 3.0;

    /// The turn rate, in rad/s, that is closest to what is wanted and brings features back from outside of the border, each at a rate
    /// in proportion to its distance. Where it is outside at the goal too the goal's place takes the place of the border.
    fn turn<'a>(
        &self,
        wanted: f64,
        features: impl Iterator<Item = (&'a Option<[f64; 2]>, &'a [f64; 2])>,
    ) -> f64 {
        let (mut least, mut most) = (f64::NEG_INFINITY, f64::INFINITY);
        for (seen, goal) in features {
            let Some([u, _]) = *seen else { continue };
            let (left, right) = (self.left.min(goal[0]), self.right.max(goal[0]));
            // Turning right by w moves a feature to the left by w (1 + u²).
            let outside = if u > right { u - right } else { (u - left).min(0.0) };
            let rate = Self::RETURN_RATE * outside / (1.0 + u * u);
            if outside > 0.0 {
                least = least.max(rate);
            } else if outside < 0.0 {
                most = most.min(rate);
            }
        }
        // Features on both sides: turning helps none of them.
        if least > most { 0.0 } else { wanted.clamp(least, most) }
    }
}
