//! From a twist to the velocities of an arm's joints.

use nalgebra::{Matrix6, Vector6};

use crate::servo::twist::Twist;

/// What an arm's joints allow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointLimits<'a> {
    /// The largest speed of each joint, in its unit per second.
    pub speeds: &'a [f64],
    /// The position and the ends of each joint; empty for joints without ends.
    pub positions: &'a [JointPosition],
    /// At its velocity a joint would need at least this many seconds to its end.
    pub seconds: f64,
}

/// The position and the ends of a joint, in radians or metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointPosition {
    /// Where it is now.
    pub now: f64,
    /// The lower end.
    pub least: f64,
    /// The upper end.
    pub most: f64,
}

/// The joint velocities that produce a twist, by damped least squares: `q̇ = Jᵀ (J Jᵀ + μ² I)⁻¹ (v, w)`.
///
/// `jacobian` has one column for each joint: the twist that the joint produces at velocity one, linear part first, in the frame of
/// `twist`. `damping` is μ; with 0.05 the joints stay slow where the arm is stretched out. The result is written to `out`, one
/// velocity for each joint. All velocities are slowed by the same factor until each is within its limits, so that the hand keeps
/// its direction.
///
/// Returns that factor. It is zero where the input is not finite or has the wrong lengths: the joints then stand still.
///
/// After Nakamura and Hanafusa, *Inverse kinematic solutions with singularity robustness for robot manipulator control* (1986).
pub fn joint_velocities(
    twist: &Twist,
    jacobian: &[[f64; 6]],
    damping: f64,
    limits: &JointLimits<'_>,
    out: &mut [f64],
) -> f64 {
    out.fill(0.0);
    let has_ends = !limits.positions.is_empty();
    let fits = limits.speeds.len() == out.len()
        && jacobian.len() == out.len()
        && (!has_ends || limits.positions.len() == out.len());
    if !fits {
        return 0.0;
    }
    let (v, w) = (twist.linear, twist.angular);
    let wanted = Vector6::new(v.x, v.y, v.z, w.x, w.y, w.z);
    let mut square = Matrix6::identity() * damping.powi(2).max(f64::EPSILON);
    for column in jacobian {
        let column = Vector6::from(*column);
        square.ger(1.0, &column, &column, 1.0);
    }
    let Some(forces) = square.cholesky().map(|factor| factor.solve(&wanted)) else { return 0.0 };
    for (speed, column) in out.iter_mut().zip(jacobian) {
        *speed = Vector6::from(*column).dot(&forces);
    }
    let mut factor = 1.0_f64;
    for (k, speed) in out.iter().enumerate() {
        let mut most = limits.speeds[k].abs();
        if let Some(joint) = limits.positions.get(k) {
            let room = if *speed > 0.0 { joint.most - joint.now } else { joint.now - joint.least };
            most = most.min(room.max(0.0) / limits.seconds.max(f64::EPSILON));
        }
        if speed.abs() > most {
            factor = factor.min(most / speed.abs());
        }
    }
    if !out.iter().all(|s| s.is_finite()) {
        out.fill(0.0);
        return 0.0;
    }
    for speed in out.iter_mut() {
        *speed *= factor;
    }
    factor
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    /// An arm of seven joints with columns in general position.
    fn jacobian() -> Vec<[f64; 6]> {
        (0..7)
            .map(|j| std::array::from_fn(|k| (1.3 * j as f64 + 0.7 * k as f64 + 0.2 * (j * k) as f64).sin()))
            .collect()
    }

    #[test]
    fn the_joints_make_the_twist_within_their_limits() {
        let jacobian = jacobian();
        let twist = Twist { linear: Vector3::new(0.1, -0.05, 0.2), angular: Vector3::new(0.1, 0.2, -0.1) };
        for (speed, slowed) in [(100.0, false), (0.01, true)] {
            let mut out = [0.0; 7];
            let limits = JointLimits { speeds: &[speed; 7], positions: &[], seconds: 1.0 };
            let factor = joint_velocities(&twist, &jacobian, 1e-9, &limits, &mut out);
            assert_eq!(factor < 1.0, slowed);
            assert!(out.iter().all(|s| s.abs() <= speed * (1.0 + 1e-12)));
            let made =
                jacobian.iter().zip(out).fold(Vector6::zeros(), |sum, (c, s)| sum + Vector6::from(*c) * s);
            let wanted = Vector6::new(0.1, -0.05, 0.2, 0.1, 0.2, -0.1) * factor;
            assert!((made - wanted).norm() < 1e-6 * wanted.norm(), "{made} {wanted}");
        }
    }

    #[test]
    fn a_joint_at_its_end_stops_the_arm_and_a_bad_twist_moves_nothing() {
        let twist = Twist { linear: Vector3::new(0.1, 0.0, 0.0), angular: Vector3::zeros() };
        let mut out = [0.0; 7];
        let free = JointLimits { speeds: &[1.0; 7], positions: &[], seconds: 1.0 };
        joint_velocities(&twist, &jacobian(), 0.05, &free, &mut out);
        let ends =
            out.map(|s| JointPosition { now: 0.0, least: if s < 0.0 { 0.0 } else { -1.0 }, most: 1.0 });
        let at_end = JointLimits { positions: &ends, ..free };
        assert!(joint_velocities(&twist, &jacobian(), 0.05, &at_end, &mut out) <= 0.0);
        assert!(out.iter().all(|s| *s == 0.0));
        // Lists of other lengths.
        let three = JointLimits { speeds: &[1.0; 3], ..free };
        let some = JointLimits { positions: &ends[..3], ..free };
        for (jacobian, limits) in [(jacobian(), three), (jacobian(), some), (jacobian()[..6].to_vec(), free)]
        {
            out.fill(1.0);
            assert!(joint_velocities(&twist, &jacobian, 0.05, &limits, &mut out) <= 0.0);
            assert!(out.iter().all(|s| *s == 0.0));
        }
        // In two seconds a joint may come to its end, on either side.
        let one = [JointPosition { now: 0.5, least: 0.3, most: 0.8 }];
        let limits = JointLimits { speeds: &[9.0], positions: &one, seconds: 2.0 };
        for (along, expected) in [(1.0, 0.15), (-1.0, -0.1)] {
            let twist = Twist { linear: Vector3::new(along, 0.0, 0.0), angular: Vector3::zeros() };
            let mut out = [0.0];
            joint_velocities(&twist, &[[1.0, 0.0, 0.0, 0.0, 0.0, 0.0]], 0.05, &limits, &mut out);
            assert!((out[0] - expected).abs() < 1e-12, "{out:?}");
        }
        // An arm that is not finite has no velocities either.
        for bad in [f64::NAN, f64::INFINITY] {
            let mut arm = jacobian();
            arm[3][2] = bad;
            out.fill(1.0);
            assert!(joint_velocities(&twist, &arm, 0.05, &free, &mut out) <= 0.0);
            assert!(out.iter().all(|s| *s == 0.0));
        }
        let bad = Twist { linear: Vector3::repeat(f64::NAN), ..twist };
        assert!(joint_velocities(&bad, &jacobian(), 0.05, &free, &mut out) <= 0.0);
        assert!(out.iter().all(|s| *s == 0.0));
    }
}
