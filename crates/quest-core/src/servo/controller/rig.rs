//! How the camera is carried, and which of its motions are free.

use nalgebra::Vector3;

use crate::RelativePose;
use crate::servo::twist::Twist;

/// What carries the camera.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Mount {
    /// Commands are for the camera's own frame.
    #[default]
    Camera,
    /// Commands are for a hand. The pose takes points of the camera's frame to the hand's, in metres: `X_hand = R X_cam + p`.
    Hand(RelativePose),
    /// Commands are for a base that drives on the plane x–z of its own frame, x to the right, y down, z forward. The pose takes
    /// points of the camera's frame to the base's, in metres.
    Base(RelativePose),
}

impl Mount {
    /// A camera at these distances ahead of the axle and above it, in metres, that looks down by `tilt` radians.
    #[must_use]
    pub fn ahead(forward: f64, height: f64, tilt: f64) -> Self {
        // Looking down turns the optical axis, z, towards y of the base: a rotation about x by −tilt.
        let turn = nalgebra::UnitQuaternion::new(Vector3::new(-tilt, 0.0, 0.0));
        Self::Base(RelativePose::new(turn, Vector3::new(0.0, -height, forward)))
    }

    /// The pose of the camera in the frame that is commanded.
    #[must_use]
    pub fn pose(&self) -> RelativePose {
        match self {
            Self::Camera => RelativePose::identity(),
            Self::Hand(pose) | Self::Base(pose) => *pose,
        }
    }

    /// The camera's twist as that of the frame that carries it.
    #[must_use]
    pub fn carry(&self, camera: &Twist) -> Twist {
        let RelativePose { q_21: q, t_21: p } = self.pose();
        let angular = q * camera.angular;
        Twist { linear: q * camera.linear + p.cross(&angular), angular }
    }

    /// The twist of the frame that carries the camera as that of the camera.
    #[must_use]
    pub fn carried(&self, body: &Twist) -> Twist {
        let RelativePose { q_21: q, t_21: p } = self.pose();
        let inverse = q.inverse();
        Twist { linear: inverse * (body.linear - p.cross(&body.angular)), angular: inverse * body.angular }
    }

    /// The pose that the law gets. With a base it is the pose of the base relative to where the base is at the goal; with any other
    /// mount it is the camera's own. `unit` is the unit of `t_21` in metres.
    #[must_use]
    pub fn pose_for_law(&self, camera: &RelativePose, unit: f64) -> RelativePose {
        let Self::Base(mount) = self else { return *camera };
        let q_21 = mount.q_21 * camera.q_21 * mount.q_21.inverse();
        let p = mount.t_21 / unit;
        RelativePose::new(q_21, mount.q_21 * camera.t_21 + p - q_21 * p)
    }
}

/// Which parts of a twist of the camera may be used: the three translations along its axes, then the three rotations about them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Axes(pub [bool; 6]);

impl Default for Axes {
    /// All six.
    fn default() -> Self {
        Self([true; 6])
    }
}

impl Axes {
    /// Their names, in order.
    pub const NAMES: [&'static str; 6] = ["x", "y", "z", "rx", "ry", "rz"];

    /// The axes with these names, each one of [`NAMES`](Self::NAMES).
    ///
    /// # Errors
    /// The first name that is none of them.
    pub fn from_names<'a>(names: impl IntoIterator<Item = &'a str>) -> Result<Self, &'a str> {
        let mut axes = [false; 6];
        for name in names {
            let known = Self::NAMES.iter().position(|n| *n == name).ok_or(name)?;
            axes[known] = true;
        }
        Ok(Self(axes))
    }

    /// The twist without its parts along and about the other axes.
    #[must_use]
    pub fn of(self, twist: &Twist) -> Twist {
        let part = |v: &Vector3<f64>, first: usize| {
            Vector3::from_fn(|k, _| if self.0[first + k] { v[k] } else { 0.0 })
        };
        Twist { linear: part(&twist.linear, 0), angular: part(&twist.angular, 3) }
    }

    /// The part of a pose that motions of these axes bring to zero.
    pub(crate) fn of_pose(self, pose: &RelativePose) -> RelativePose {
        if self.0 == [true; 6] {
            return *pose;
        }
        let left = self.of(&Twist { linear: pose.t_21, angular: pose.q_21.scaled_axis() });
        RelativePose::new(nalgebra::UnitQuaternion::new(left.angular), left.linear)
    }
}

/// How the loop is built: its rate, its unit, and what carries the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rig {
    /// Seconds from one image to the next, for images without stamps.
    pub period: f64,
    /// The unit of `t_21` in metres: the harmonic mean of the features' depths at the goal. It is a guess unless metric depths are
    /// given.
    pub unit: f64,
    /// What carries the camera.
    pub mount: Mount,
    /// Which motions of the camera are free.
    pub axes: Axes,
}

impl Default for Rig {
    /// 10 Hz, features at a metre, commands for a camera that moves freely.
    fn default() -> Self {
        Self { period: 0.1, unit: 1.0, mount: Mount::default(), axes: Axes::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::servo::{FreeCamera, Plant};
    use nalgebra::UnitQuaternion;

    /// A hand that follows the carried twist takes the camera where the camera's own twist takes it.
    #[test]
    fn a_carried_twist_moves_the_camera_as_its_own() {
        let mount = RelativePose::new(
            UnitQuaternion::new(Vector3::new(0.3, -0.8, 0.4)),
            Vector3::new(0.1, -0.2, 0.3),
        );
        let twist = Twist { linear: Vector3::new(0.1, 0.3, -0.2), angular: Vector3::new(0.4, -0.1, 0.2) };
        let hand = Mount::Hand(mount);
        let carried = hand.carry(&twist);
        let back = hand.carried(&carried);
        assert!((back.linear - twist.linear).norm() < 1e-15 && (back.angular - twist.angular).norm() < 1e-15);
        let mut camera = FreeCamera::new(RelativePose::identity());
        let mut body = camera;
        camera.advance(&twist, 0.5);
        body.advance(&carried, 0.5);
        // Both start at the identity: the body's motion B is M C M⁻¹.
        let expected = Mount::Base(mount).pose_for_law(&camera.pose(), 1.0);
        assert!(body.pose().rotation_error(&expected) < 1e-12);
        assert!((body.pose().t_21 - expected.t_21).norm() < 1e-12);
    }

    #[test]
    fn axes_have_names() {
        let axes = Axes::from_names(["x", "rz"]).unwrap();
        let all = Twist { linear: Vector3::repeat(1.0), angular: Vector3::repeat(2.0) };
        let some = axes.of(&all);
        assert_eq!(some.linear, Vector3::new(1.0, 0.0, 0.0));
        assert_eq!(some.angular, Vector3::new(0.0, 0.0, 2.0));
        assert_eq!(Axes::from_names(["x", "yaw"]), Err("yaw"));
    }
}
