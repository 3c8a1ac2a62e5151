//! From an image to a command: estimator, law, guards, limits.

use nalgebra::Vector3;

use super::estimate::{Estimate, HoldReason, PoseEstimator};
use super::{ControlLaw, Limits, Twist};

/// A rectangle of the image in which the features are to stay, on the plane z = 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Border {
    /// Left and upper end.
    pub least: [f64; 2],
    /// Right and lower end.
    pub most: [f64; 2],
}

/// What keeps a robot safe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Safety {
    /// Speed and turn rate.
    pub limits: Limits,
    /// Turns that push a feature out of this rectangle are left out.
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
        let wanted = estimate.as_ref().map_or(Twist::zero(), |estimate| self.law.command(&estimate.pose));
        let command = self.guarded(wanted, features);
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
            let seen = features.iter().zip(&self.goal).filter_map(|(m, goal)| m.map(|m| (m, goal)));
            if seen.into_iter().any(|(m, goal)| is_pushed_out(border, m, goal, &twist.angular)) {
                twist.angular = Vector3::zeros();
            }
        }
        self.safety.limits.apply(&twist)
    }
}

/// Whether turning moves a feature further out of the border, away from where it is at the goal.
fn is_pushed_out(border: &Border, m: [f64; 2], goal: &[f64; 2], w: &Vector3<f64>) -> bool {
    // The point (u, v, 1) moves by −w × (u, v, 1), its image by what is left on the plane z = 1.
    let moves = -w.cross(&Vector3::new(m[0], m[1], 1.0));
    (0..2).any(|k| {
        let flow = moves[k] - m[k] * moves.z;
        (m[k] < border.least[k].min(goal[k]) && flow < 0.0)
            || (m[k] > border.most[k].max(goal[k]) && flow > 0.0)
    })
}
