//! Appendix C: a robot with two driven wheels.
//!
//! The goal's origin has the coordinates `t` in the robot's frame: `r = hypot(tx, tz)` away, at the bearing
//! `φ = atan2(tx, tz)`, positive to the right. The paper's (C.1) has the two arguments swapped; with it the law fails.
//! The heading `θ`, positive to the right, is that of `R_21 = R_y(−θ)`:
//!
//! ```text
//! tx = r sin φ,  tz = r cos φ        θ = atan2(R20 − R02, R00 + R22)
//! ```
//!
//! The kinematics (C.3) in these coordinates, with `c` the unit of t in metres, are
//!
//! ```text
//! ṙ = −(ν/c) cos φ        φ̇ = −ω + (ν/c) sin φ / r
//! ```
//!
//! With `s = sign(cos φ)` and `ψ = φ` where the goal is ahead (`s = 1`), `ψ = φ − π` where it is behind, the law
//!
//! ```text
//! ν = k1 tanh(r) cos φ        ω = k2 s sin φ = k2 sin ψ
//! ```
//!
//! gives
//!
//! ```text
//! ṙ = −(k1/c) tanh(r) cos²ψ        ψ̇ = −sin ψ (k2 − (k1/c) (tanh(r)/r) cos ψ)
//! ```
//!
//! For `k2 > k1/c` the bracket is positive, because `tanh(r)/r < 1`: `V = r²/2 + 1 − cos ψ` decreases wherever `r > 0` and
//! `ψ ≠ 0`, and `|ψ| → 0` without ever crossing 90° again. The robot drives to the goal, backwards where the goal is behind
//! it. Always turning towards the goal (`s = 1`) would converge too, by turning its back on the features. With the printed
//! sign `ω = −k2 sin φ` the robot turns away from a goal ahead until it has its back to it.
//!
//! Near the goal (`r` below a limit) it stops and turns: `ν = 0`, `ω = −k2 sin θ`, (C.6), (C.7); `1 − cos θ` decreases.
//!
//! # Beside the paper
//! - **Stopping.** Near the goal `φ` is made of noise. The robot stops where `r` is small, also where what is left lies
//!   sideways (`r |cos φ|` small), which driving cannot mend, and stays stopped until `r` is clearly larger. Both are those of
//!   the running mean of `t` over some images: the smallest `r` of many noisy ones comes long before the goal does.
//! - **Turning fades** with `r² / (r² + f²)` for the same reason.
//! - **Hysteresis.** `s` changes only beyond `|cos φ| > 0.1`.

use crate::RelativePose;
use crate::servo::{ControlLaw, Twist};

/// `s` changes where the cosine of the bearing exceeds this: six degrees past sideways.
const SIDEWAYS: f64 = 0.1;

/// The distance, bearing and heading of a robot that moves on a plane, from its pose relative to the goal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarPose {
    /// The distance of the goal, (C.2), in the unit of t.
    pub distance: f64,
    /// The bearing of the goal `φ` in radians, zero ahead, positive to the right.
    pub bearing: f64,
    /// The robot's heading `θ` in radians, zero as the goal's, positive to the right.
    pub heading: f64,
}

impl PlanarPose {
    /// The part of a pose on the plane x–z; what is not on it is left out.
    #[must_use]
    pub fn new(pose: &RelativePose) -> Self {
        let (r, t) = (pose.r_21(), &pose.t_21);
        Self {
            distance: t.x.hypot(t.z),
            bearing: t.x.atan2(t.z),
            heading: (r[(2, 0)] - r[(0, 2)]).atan2(r[(0, 0)] + r[(2, 2)]),
        }
    }
}

/// The switching law (C.4) to (C.7), its signs derived at the head of the module.
///
/// Distances are in the unit of `t`: the mean depth of the features at the goal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DifferentialDriveLaw {
    /// The gain of the speed, `k1`, in m/s.
    pub speed_gain: f64,
    /// The gain of the turn rate, `k2`, in rad/s. Has to exceed `k1 / c`, `c` the unit of t in metres; twice as much is well.
    pub turn_gain: f64,
    /// The robot stops below this distance.
    pub stop_distance: f64,
    /// It also stops below this distance where the goal lies sideways.
    pub sideways_distance: f64,
    /// It starts again beyond this distance.
    pub start_distance: f64,
    /// Turning towards the goal fades out at this distance.
    pub fade_distance: f64,
    /// Whether the robot is close enough to stop is judged by the mean over about so many images; 1 for none but the last.
    pub averaged_images: f64,
    /// `(tx, tz)`, averaged; none before the first image.
    mean: Option<[f64; 2]>,
    phase: Phase,
}

/// What the robot is doing.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    /// Before the first command.
    Start,
    /// Driving with this sign `s`.
    Driving(f64),
    /// At the goal, turning to its heading.
    Turning,
}

impl DifferentialDriveLaw {
    /// The law with these gains, in m/s and rad/s, and the distances that were found best for pixel noise.
    #[must_use]
    pub fn new(speed_gain: f64, turn_gain: f64) -> Self {
        Self {
            speed_gain,
            turn_gain,
            stop_distance: 0.0025,
            sideways_distance: 0.03,
            start_distance: 0.12,
            fade_distance: 0.02,
            averaged_images: 10.0,
            mean: None,
            phase: Phase::Start,
        }
    }

    /// The law as published, but for the signs: it stops driving below `stop_distance` and has no other precautions.
    #[must_use]
    pub fn as_published(speed_gain: f64, turn_gain: f64, stop_distance: f64) -> Self {
        Self {
            stop_distance,
            sideways_distance: 0.0,
            start_distance: stop_distance,
            fade_distance: 0.0,
            averaged_images: 1.0,
            ..Self::new(speed_gain, turn_gain)
        }
    }

    /// Whether the robot stands at the goal, and only turns.
    #[must_use]
    pub fn has_arrived(&self) -> bool {
        self.phase == Phase::Turning
    }

    /// Whether there is nothing left to drive, by the running mean with this `(tx, tz)` in it.
    fn is_at_goal(&mut self, t: [f64; 2]) -> bool {
        let before = self.mean.unwrap_or(t);
        let [x, z] = [0, 1].map(|k| before[k] + (t[k] - before[k]) / self.averaged_images.max(1.0));
        self.mean = Some([x, z]);
        let r = x.hypot(z);
        r < self.stop_distance || (r < self.sideways_distance && z.abs() < self.stop_distance)
    }

    fn next_phase(&self, planar: &PlanarPose, at_goal: bool) -> Phase {
        let ahead = planar.bearing.cos();
        let direction = if ahead < 0.0 { -1.0 } else { 1.0 };
        match self.phase {
            Phase::Turning if planar.distance < self.start_distance => Phase::Turning,
            _ if at_goal => Phase::Turning,
            Phase::Driving(s) if ahead.abs() <= SIDEWAYS => Phase::Driving(s),
            _ => Phase::Driving(direction),
        }
    }
}

impl Default for DifferentialDriveLaw {
    /// 0.5 m/s and 0.6 rad/s.
    fn default() -> Self {
        Self::new(0.5, 0.6)
    }
}

impl ControlLaw for DifferentialDriveLaw {
    fn command(&mut self, pose: &RelativePose) -> Twist {
        let planar = PlanarPose::new(pose);
        let at_goal = self.is_at_goal([pose.t_21.x, pose.t_21.z]);
        self.phase = self.next_phase(&planar, at_goal);
        let PlanarPose { distance: r, bearing, heading } = planar;
        match self.phase {
            Phase::Driving(s) => {
                let fade = r * r / (r * r + self.fade_distance * self.fade_distance);
                Twist::drive(
                    self.speed_gain * r.tanh() * bearing.cos(),
                    self.turn_gain * s * bearing.sin() * fade,
                )
            }
            Phase::Start | Phase::Turning => Twist::drive(0.0, -self.turn_gain * heading.sin()),
        }
    }

    /// To the goal's heading, on the spot.
    fn turn(&mut self, pose: &RelativePose) -> Twist {
        Twist::drive(0.0, -self.turn_gain * PlanarPose::new(pose).heading.sin())
    }

    /// `r² (2 − cos ψ)` while it drives: both factors fall, and noise of the bearing near the goal does no harm. On the spot there is
    /// no distance to fall.
    fn potential(&self, pose: &RelativePose) -> Option<f64> {
        let planar = PlanarPose::new(pose);
        let is_driving = matches!(self.phase, Phase::Driving(_));
        is_driving.then(|| planar.distance.powi(2) * (2.0 - planar.bearing.cos().abs()))
    }

    /// Ahead, back, ahead.
    fn exploration(&self, attempt: usize) -> Twist {
        Twist::drive(if attempt.is_multiple_of(2) { 1.0 } else { -1.0 }, 0.0)
    }

    fn reset(&mut self) {
        (self.mean, self.phase) = (None, Phase::Start);
    }
}

#[cfg(test)]
mod tests;
