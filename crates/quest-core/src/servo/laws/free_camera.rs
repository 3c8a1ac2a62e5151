//! Section 10.1: a camera that moves freely, on an arm or a quadrotor.
//!
//! With the velocity `(v, w)` of the current camera in its own frame, `X2 = R X1 + t` changes by
//!
//! ```text
//! Ṙ = −[w]× R        ṫ = −w × t − v / c
//! ```
//!
//! where `c` is the unit of `t` in metres. The law `v = λ s t`, `w = λ log R`, with `s` a guess of `c`, gives
//!
//! ```text
//! d/dt |log R| = −λ |log R|        d/dt |t| = −λ (s / c) |t|
//! ```
//!
//! for `log R` is the axis of R itself and `w × t` is orthogonal to t. Both go to zero exponentially: `V = |t|² + |log R|²`
//! decreases on every path, for any guess `s > 0`. The position of the camera in the goal's frame, `p = −Rᵀ t`, follows
//! `ṗ = Rᵀ v / c = −λ (s / c) p`: a straight line. The rotation runs along the quaternions' great circle, as in the
//! paper. A right guess makes both rates equal, which keeps the features in view best.
//!
//! The paper moves by 1/120 of what is left in each iteration: `λ = 1 / 120` per frame.

use crate::RelativePose;
use crate::servo::{ControlLaw, Twist};

/// The proportional law of section 10.1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreeCameraLaw {
    /// How fast the errors decay, `λ`, in 1/s.
    pub rate: f64,
    /// A guess of the unit of `t` in metres: the mean distance of the features from the goal.
    pub unit: f64,
}

impl Default for FreeCameraLaw {
    /// A rate of 0.5/s, and features at 1 m.
    fn default() -> Self {
        Self { rate: 0.5, unit: 1.0 }
    }
}

impl ControlLaw for FreeCameraLaw {
    fn command(&mut self, pose: &RelativePose) -> Twist {
        Twist { linear: pose.t_21 * (self.rate * self.unit), angular: pose.q_21.scaled_axis() * self.rate }
    }

    /// `V = |t|² + |log R|²`.
    fn potential(&self, pose: &RelativePose) -> Option<f64> {
        Some(pose.t_21.norm_squared() + pose.q_21.angle().powi(2))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::servo::simulation::plant::{FreeCamera, Plant};
    use nalgebra::{UnitQuaternion, Vector3};

    #[test]
    fn both_errors_decay_at_the_rate_along_a_straight_line() {
        let start = RelativePose::new(
            UnitQuaternion::new(Vector3::new(0.5, -1.0, 2.0)),
            Vector3::new(0.4, -0.2, 0.7),
        );
        for (rate, unit) in [(0.5, 1.0), (0.5, 3.0), (2.0, 0.4)] {
            let mut law = FreeCameraLaw { rate, unit };
            let mut camera = FreeCamera::new(start);
            let period = 1e-3;
            let steps = 1000;
            for _ in 0..steps {
                let twist = law.command(&camera.pose());
                camera.advance(&twist, period);
            }
            let time = period * f64::from(steps);
            let end = camera.pose();
            let angle = |p: &RelativePose| p.q_21.angle();
            // Euler's step against the exponential: λ² T dt / 2, below 2e-3 for the fastest here.
            assert!((angle(&end) / angle(&start) / (-rate * time).exp() - 1.0).abs() < 4e-3);
            let expected = (-rate * unit * time).exp();
            assert!((end.t_21.norm() / start.t_21.norm() / expected - 1.0).abs() < 4e-3);
            let position = |p: &RelativePose| p.inverse().t_21;
            let turn = position(&end).normalize().cross(&position(&start).normalize()).norm();
            // The chord of each step turns with the camera: w dt / 2 of the step's length.
            assert!(turn < 2e-2, "{turn}");
        }
    }
}
