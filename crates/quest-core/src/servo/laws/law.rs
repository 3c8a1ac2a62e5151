//! From a pose to a velocity.

use nalgebra::Vector3;

use crate::RelativePose;
use crate::servo::Twist;

/// A control law: the velocity that brings the camera to the goal.
pub trait ControlLaw {
    /// The velocity for this pose of the current camera (2) relative to the goal (1).
    ///
    /// The unit of `t_21` has to be the same in every call of a run; its length in metres need not be known.
    fn command(&mut self, pose: &RelativePose) -> Twist;

    /// The velocity where only the rotation is known.
    fn turn(&mut self, pose: &RelativePose) -> Twist {
        let turned = RelativePose::new(pose.q_21, Vector3::zeros());
        Twist { linear: Vector3::zeros(), ..self.command(&turned) }
    }

    /// The law's Lyapunov function, which falls as long as the pose is right. `None` where the law is not to be judged by one.
    fn potential(&self, _pose: &RelativePose) -> Option<f64> {
        None
    }

    /// The direction of a small motion that shows parallax, another one in each attempt: to the right, down, to the left.
    fn exploration(&self, attempt: usize) -> Twist {
        let direction = [Vector3::x(), Vector3::y(), -Vector3::x()][attempt % 3];
        Twist { linear: direction, angular: Vector3::zeros() }
    }

    /// Tells the law whether the border of the image was in the way of the last command. A law that knows another way may take it.
    fn hindered(&mut self, _is_hindered: bool) {}

    /// Forgets what it remembers of earlier images.
    fn reset(&mut self) {}
}

/// A law behind a reference is the same law.
impl<L: ControlLaw + ?Sized> ControlLaw for &mut L {
    fn command(&mut self, pose: &RelativePose) -> Twist {
        (**self).command(pose)
    }

    fn turn(&mut self, pose: &RelativePose) -> Twist {
        (**self).turn(pose)
    }

    fn potential(&self, pose: &RelativePose) -> Option<f64> {
        (**self).potential(pose)
    }

    fn exploration(&self, attempt: usize) -> Twist {
        (**self).exploration(attempt)
    }

    fn hindered(&mut self, is_hindered: bool) {
        (**self).hindered(is_hindered);
    }

    fn reset(&mut self) {
        (**self).reset();
    }
}
