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
//! - **Stopping.** Near the goal `φ` is made of noise. The robot stops where `r` is small. It also stops where the goal lies
//!   sideways (`r |cos φ|` small), which driving cannot mend. It stays stopped until `r` is clearly larger. `r` and `φ` are those
//!   of the running mean of `t` over some images, for the smallest `r` of many noisy ones comes long before the goal does.
//! - **Turning fades** with `r² / (r² + f²)` for the same reason.
//! - **Hysteresis.** `s` changes only beyond `|cos φ| > 0.1`.
//! - **Backing off.** A robot beside its goal has to turn away from the features to get there. Where the border of the image does
//!   not let it turn, the robot drives back, leaning to the side that takes it behind the goal. It stops backing once the direction
//!   `α = φ + θ` from it to the goal is close to the goal's heading: from there it can drive to the goal with the features in view.
//!   From x beside the goal, with the lean β, it drives back by about `x / tan β`.

use crate::RelativePose;
use crate::servo::{ControlLaw, Twist};

/// `s` changes where the cosine of the bearing exceeds this: six degrees past sideways.
const SIDEWAYS: f64 = 0.1;
/// The robot backs off where the border has been in its way for so many images in a row,
const HINDERED: usize = 4;
/// and the sine of the goal's bearing is larger than this: seven degrees.
const OFF_COURSE: f64 = 0.12;
/// It has backed off far enough where the sine of the goal's direction is smaller than this: four degrees, which the view of most
/// cameras allows.
const IN_LINE: f64 = 0.07;
/// How far it leans to the side meanwhile, in radians, and its speed as a share of the gain.
const LEAN: f64 = 0.35;
const BACKING_SPEED: f64 = 0.4;
/// It backs off so often at most. Each time takes it closer to the line behind the goal.
const MOST_BACKINGS: usize = 6;

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
    /// The part of a pose on the plane x–z. The height and the tilt are left out.
    #[must_use]
    pub fn new(pose: &RelativePose) -> Self {
        let (r, t) = (pose.r_21(), &pose.t_21);
        Self {
            distance: t.x.hypot(t.z),
            bearing: t.x.atan2(t.z),
            heading: (r[(2, 0)] - r[(0, 2)]).atan2(r[(0, 0)] + r[(2, 2)]),
        }
    }

    /// The direction from the robot to the goal in the goal's frame, in radians: zero behind the goal, positive to the right.
    #[must_use]
    pub fn direction(&self) -> f64 {
        self.bearing + self.heading
    }
}

/// The switching law (C.4) to (C.7), its signs derived at the head of the module.
///
/// Distances are in the unit of `t`: the mean depth of the features at the goal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DifferentialDriveLaw {
    /// The gain of the speed, `k1`, in m/s.
    pub speed_gain: f64,
    /// The gain of the turn rate, `k2`, in rad/s. It must exceed `k1 / c`, where `c` is the unit of t in metres; twice as much is good.
    pub turn_gain: f64,
    /// The robot stops below this distance.
    pub stop_distance: f64,
    /// It also stops below this distance where the goal lies sideways.
    pub sideways_distance: f64,
    /// It starts again beyond this distance.
    pub start_distance: f64,
    /// Turning towards the goal fades out at this distance.
    pub fade_distance: f64,
    /// The number of images whose mean decides whether the robot is close enough to stop; 1 for the last image alone.
    pub averaged_images: f64,
    /// The robot backs off no further from the goal than this; 0 for never.
    pub furthest_back: f64,
    /// For so many images in a row the border of the image has been in the way.
    hindered: usize,
    backings: usize,
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
    /// Driving back, to get behind the goal.
    Backing,
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
            furthest_back: 1.5,
            hindered: 0,
            backings: 0,
            mean: None,
            phase: Phase::Start,
        }
    }

    /// The law as published, with its signs corrected. It stops driving below `stop_distance` and takes no other precautions.
    #[must_use]
    pub fn as_published(speed_gain: f64, turn_gain: f64, stop_distance: f64) -> Self {
        Self {
            stop_distance,
            sideways_distance: 0.0,
            start_distance: stop_distance,
            fade_distance: 0.0,
            averaged_images: 1.0,
            furthest_back: 0.0,
            ..Self::new(speed_gain, turn_gain)
        }
    }

    /// Whether the robot stands at the goal, and only turns.
    #[must_use]
    pub fn has_arrived(&self) -> bool {
        self.phase == Phase::Turning
    }

    /// Whether the robot is at the goal by the running mean of `(tx, tz)`, into which this one is taken.
    fn is_at_goal(&mut self, t: [f64; 2]) -> bool {
        let before = self.mean.unwrap_or(t);
        let [x, z] = [0, 1].map(|k| before[k] + (t[k] - before[k]) / self.averaged_images.max(1.0));
        self.mean = Some([x, z]);
        let r = x.hypot(z);
        r < self.stop_distance || (r < self.sideways_distance && z.abs() < self.stop_distance)
    }

    /// Whether the border has kept the robot from turning to a goal that it could drive to from further back.
    fn has_to_back(&self, planar: &PlanarPose) -> bool {
        self.hindered >= HINDERED
            && self.backings < MOST_BACKINGS
            && planar.bearing.sin().abs() > OFF_COURSE
            && planar.distance > self.sideways_distance
            && !self.is_in_line(planar)
    }

    /// Whether the robot is behind the goal, or as far back as it may go.
    fn is_in_line(&self, planar: &PlanarPose) -> bool {
        let direction = planar.direction();
        let is_behind = direction.cos() > 0.0 && direction.sin().abs() < IN_LINE;
        is_behind || planar.distance > self.furthest_back
    }

    fn next_phase(&self, planar: &PlanarPose, at_goal: bool) -> Phase {
        let ahead = planar.bearing.cos();
        let direction = if ahead < 0.0 { -1.0 } else { 1.0 };
        match self.phase {
            Phase::Turning if planar.distance < self.start_distance => Phase::Turning,
            Phase::Backing if !self.is_in_line(planar) => Phase::Backing,
            _ if at_goal => Phase::Turning,
            Phase::Driving(_) if self.has_to_back(planar) => Phase::Backing,
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
        let next = self.next_phase(&planar, at_goal);
        self.backings += usize::from(next == Phase::Backing && self.phase != Phase::Backing);
        self.phase = next;
        let PlanarPose { distance: r, bearing, heading } = planar;
        match self.phase {
            Phase::Driving(s) => {
                let fade = r * r / (r * r + self.fade_distance * self.fade_distance);
                Twist::drive(
                    self.speed_gain * r.tanh() * bearing.cos(),
                    self.turn_gain * s * bearing.sin() * fade,
                )
            }
            Phase::Backing => {
                let lean = -(2.0 * planar.direction().sin()).clamp(-LEAN, LEAN);
                Twist::drive(-BACKING_SPEED * self.speed_gain, self.turn_gain * (lean - heading).sin())
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

    fn hindered(&mut self, is_hindered: bool) {
        self.hindered = if is_hindered { self.hindered + 1 } else { 0 };
    }

    fn reset(&mut self) {
        (self.mean, self.phase, self.hindered, self.backings) = (None, Phase::Start, 0, 0);
    }
}

#[cfg(test)]
mod tests;
