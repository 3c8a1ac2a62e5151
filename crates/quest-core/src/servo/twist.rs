//! What a control law commands: a velocity of the camera.

use nalgebra::Vector3;

/// The velocity of a camera in its own frame: x to the right, y down, z forward.
///
/// A robot on a plane uses two of the six numbers: its speed is `linear.z`, its turn rate, positive to the right,
/// is `angular.y`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Twist {
    /// In metres per second.
    pub linear: Vector3<f64>,
    /// In radians per second.
    pub angular: Vector3<f64>,
}

impl Twist {
    /// Zero velocity.
    #[must_use]
    pub fn zero() -> Self {
        Self { linear: Vector3::zeros(), angular: Vector3::zeros() }
    }

    /// The twist of a differential-drive robot: speed in m/s, turn rate in rad/s, positive to the right.
    #[must_use]
    pub fn drive(speed: f64, turn_rate: f64) -> Self {
        Self { linear: Vector3::new(0.0, 0.0, speed), angular: Vector3::new(0.0, turn_rate, 0.0) }
    }

    /// Whether all six numbers are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.linear.iter().chain(&self.angular).all(|x| x.is_finite())
    }
}

/// The largest velocities that are commanded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// In metres per second.
    pub speed: f64,
    /// In radians per second.
    pub turn_rate: f64,
}

impl Limits {
    /// The twist, slowed until it is within both limits. Both parts are slowed by the same factor, so that the path stays the same.
    /// A twist that is not finite becomes zero.
    #[must_use]
    pub fn apply(&self, twist: &Twist) -> Twist {
        let factor = self.factor(twist);
        // A factor that is rounded up may leave a norm above its limit by an ulp.
        let factor = if factor < 1.0 { factor * (1.0 - 4.0 * f64::EPSILON) } else { factor };
        let limited = Twist { linear: twist.linear * factor, angular: twist.angular * factor };
        if limited.is_finite() { limited } else { Twist::zero() }
    }

    fn factor(&self, twist: &Twist) -> f64 {
        let ratio = |limit: f64, norm: f64| if norm > limit { limit / norm } else { 1.0 };
        ratio(self.speed, twist.linear.norm()).min(ratio(self.turn_rate, twist.angular.norm()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_keep_the_direction() {
        let limits = Limits { speed: 0.5, turn_rate: 0.2 };
        let fast = Twist { linear: Vector3::new(3.0, 0.0, 4.0), angular: Vector3::new(0.0, 1.0, 0.0) };
        let slow = limits.apply(&fast);
        assert!(slow.linear.norm() <= 0.5 && slow.angular.norm() <= 0.2);
        assert!((slow.linear.norm() - 0.5).abs() < 1e-12 && (slow.angular.norm() - 0.1).abs() < 1e-12);
        assert!(slow.linear.cross(&fast.linear).norm() < 1e-15);
        let allowed = Twist::drive(-0.3, 0.1);
        assert_eq!(limits.apply(&allowed), allowed);
    }

    #[test]
    fn what_is_not_finite_stands_still() {
        let limits = Limits { speed: 0.5, turn_rate: 0.2 };
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(limits.apply(&Twist::drive(bad, 0.1)), Twist::zero());
            assert_eq!(limits.apply(&Twist::drive(0.1, bad)), Twist::zero());
        }
    }
}
