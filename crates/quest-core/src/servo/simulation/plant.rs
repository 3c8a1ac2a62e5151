//! What moves: a free camera, and a robot with two driven wheels.

use nalgebra::{UnitQuaternion, Vector3};

use crate::RelativePose;
use crate::servo::Twist;

/// A camera that is moved by commands, with its pose relative to the goal in metres.
pub trait Plant {
    /// The current camera (2) relative to the goal (1).
    fn pose(&self) -> RelativePose;

    /// Moves with this velocity for so many seconds.
    fn advance(&mut self, twist: &Twist, seconds: f64);
}

/// A camera that follows all six velocities.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreeCamera {
    pose: RelativePose,
}

impl FreeCamera {
    /// A camera at this pose relative to the goal.
    #[must_use]
    pub fn new(pose: RelativePose) -> Self {
        Self { pose }
    }
}

impl Plant for FreeCamera {
    fn pose(&self) -> RelativePose {
        self.pose
    }

    /// Exact for a constant velocity in the camera's frame: the exponential of the twist.
    fn advance(&mut self, twist: &Twist, seconds: f64) {
        let turn = UnitQuaternion::new(-twist.angular * seconds);
        // X2(T) = turn · X2(0) − ∫ exp(−[w] τ) v dτ
        let moved = mean_rotation(&(-twist.angular * seconds), &(twist.linear * seconds));
        let q_21 = UnitQuaternion::new_normalize((turn * self.pose.q_21).into_inner());
        self.pose = RelativePose::new(q_21, turn * self.pose.t_21 - moved);
    }
}

/// The mean of `exp(τ [w]×) v` over τ from 0 to 1.
fn mean_rotation(w: &Vector3<f64>, v: &Vector3<f64>) -> Vector3<f64> {
    let angle = w.norm();
    let (a, b) = if angle < 1e-4 {
        (0.5 - angle.powi(2) / 24.0, 1.0 / 6.0 - angle.powi(2) / 120.0)
    } else {
        ((1.0 - angle.cos()) / angle.powi(2), (angle - angle.sin()) / angle.powi(3))
    };
    let wv = w.cross(v);
    v + wv * a + w.cross(&wv) * b
}

/// A robot on the plane `y = 0` with two driven wheels, the camera on its axle, looking ahead: equation (C.3),
/// `ż = ν cos θ`, `ẋ = ν sin θ`, `θ̇ = ω`. It takes the speed `linear.z` and the turn rate `angular.y` of a twist.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DifferentialDrive {
    /// To the right of the goal, in metres.
    pub x: f64,
    /// Ahead of the goal, in metres.
    pub z: f64,
    /// The heading in radians, zero as the goal's, positive to the right.
    pub heading: f64,
}

impl Plant for DifferentialDrive {
    fn pose(&self) -> RelativePose {
        let q_21 = UnitQuaternion::new(Vector3::new(0.0, -self.heading, 0.0));
        RelativePose::new(q_21, -(q_21 * Vector3::new(self.x, 0.0, self.z)))
    }

    /// Exact for constant speed and turn rate: an arc of a circle.
    fn advance(&mut self, twist: &Twist, seconds: f64) {
        let (length, half) = (twist.linear.z * seconds, 0.5 * twist.angular.y * seconds);
        // The chord of the arc lies half way between both headings.
        let chord = if half.abs() < 1e-8 { length } else { length * half.sin() / half };
        self.x += chord * (self.heading + half).sin();
        self.z += chord * (self.heading + half).cos();
        self.heading += 2.0 * half;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Both plants, moved by small steps, come to where one large step brings them.
    #[test]
    fn a_long_step_is_many_short_ones() {
        let twist = Twist { linear: Vector3::new(0.1, -0.2, 0.3), angular: Vector3::new(0.5, 0.7, -0.4) };
        let start =
            RelativePose::new(UnitQuaternion::new(Vector3::new(0.1, 0.2, 0.3)), Vector3::new(1.0, 2.0, 3.0));
        let (mut long, mut short) = (FreeCamera::new(start), FreeCamera::new(start));
        long.advance(&twist, 2.0);
        (0..20_000).for_each(|_| short.advance(&twist, 1e-4));
        // Rounding of 2e4 steps, at 1e-16 each.
        assert!((long.pose().t_21 - short.pose().t_21).norm() < 1e-11);
        assert!(long.pose().rotation_error(&short.pose()) < 1e-11);
    }

    /// On the plane the two plants are the same.
    #[test]
    fn a_robot_is_a_camera_on_a_plane() {
        let mut robot = DifferentialDrive { x: 0.2, z: -0.8, heading: -0.35 };
        let mut camera = FreeCamera::new(robot.pose());
        for k in 0..50 {
            let twist = Twist::drive(0.1 * f64::from(k % 7 - 3), 0.3 * f64::from(k % 5 - 2));
            robot.advance(&twist, 0.1);
            camera.advance(&twist, 0.1);
            assert!((robot.pose().t_21 - camera.pose().t_21).norm() < 1e-13);
            assert!(robot.pose().rotation_error(&camera.pose()) < 1e-13);
        }
    }
}
