//! From a pose to a velocity.

use crate::RelativePose;
use crate::servo::Twist;

/// A control law: the velocity that brings the camera to the goal.
pub trait ControlLaw {
    /// The velocity for this pose of the current camera (2) relative to the goal (1).
    ///
    /// The unit of `t_21` has to be the same in every call of a run; its length in metres need not be known.
    fn command(&mut self, pose: &RelativePose) -> Twist;
}

/// A law behind a reference is the same law.
impl<L: ControlLaw + ?Sized> ControlLaw for &mut L {
    fn command(&mut self, pose: &RelativePose) -> Twist {
        (**self).command(pose)
    }
}
