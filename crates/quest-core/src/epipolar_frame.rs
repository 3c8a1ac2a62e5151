//! The frame of an essential matrix: its third axis is the baseline, and the constraint is a 2 × 2 determinant.

use nalgebra::{Matrix3, Vector3};

use crate::Correspondence;
use crate::algebra::vectors::two::{TwoVectors, times};

/// A rotation `F` of view 2 that takes the direction of the translation to the third axis.
///
/// With `b` and `c = R a` in this frame, `t = (0, 0, 1)`:
///
/// ```text
/// t · (b × c) = b1 c2 − b2 c1        b × c = (b2 c3 − b3 c2, b3 c1 − b1 c3, b1 c2 − b2 c1)
/// ```
///
/// The twisted partner, turned by 180° about `t`, has `c' = (−c1, −c2, c3)`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EpipolarFrame {
    /// `F R`: from camera 1 into the frame.
    pub(crate) from_1: Matrix3<f64>,
    /// `F`: from camera 2 into the frame.
    pub(crate) from_2: Matrix3<f64>,
}

impl EpipolarFrame {
    /// The frame of a rotation and a unit direction of the translation.
    #[inline]
    pub(crate) fn new(r_21: &Matrix3<f64>, direction: &Vector3<f64>) -> Self {
        let [e1, e2] = tangent_basis(direction);
        let from_2 = Matrix3::from_columns(&[e1, e2, *direction]).transpose();
        Self { from_1: from_2 * r_21, from_2 }
    }

    /// The bearings `(b, c)` of a match: of view 2, and of view 1 after the rotation.
    #[inline]
    pub(crate) fn bearings(&self, m: &Correspondence) -> ([f64; 3], [f64; 3]) {
        ((self.from_2 * m.bearing2()).into(), (self.from_1 * m.bearing1()).into())
    }

    /// Two bearings `b` of view 2.
    #[inline]
    pub(crate) fn of_view2(&self, bearings: &TwoVectors) -> TwoVectors {
        times(&self.from_2, bearings)
    }

    /// The bearings `c` of two of view 1, after the rotation.
    #[inline]
    pub(crate) fn of_view1(&self, bearings: &TwoVectors) -> TwoVectors {
        times(&self.from_1, bearings)
    }

    /// A vector of this frame in the frame of camera 2.
    #[inline]
    pub(crate) fn to_2(self, v: &Vector3<f64>) -> Vector3<f64> {
        self.from_2.tr_mul(v)
    }
}

/// Two unit vectors that complete `t` to a right-handed frame (Duff et al., JCGT 2017): no branch that fails.
pub(crate) fn tangent_basis(t: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let sign = 1.0_f64.copysign(t.z);
    let a = -1.0 / (sign + t.z);
    let b = t.x * t.y * a;
    [
        Vector3::new(1.0 + sign * t.x * t.x * a, sign * b, -sign * t.x),
        Vector3::new(b, sign + t.y * t.y * a, -t.y),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;

    #[test]
    fn tangent_basis_is_orthonormal_everywhere() {
        for t in [Vector3::z(), -Vector3::z(), Vector3::x(), Vector3::new(0.6, 0.0, -0.8)] {
            let [e1, e2] = tangent_basis(&t);
            assert!((e1.cross(&e2) - t).norm() < 1e-15 && e1.dot(&e2).abs() < 1e-15);
        }
    }

    #[test]
    fn constraint_is_a_determinant_in_the_frame() {
        let q_21 = UnitQuaternion::new(Vector3::new(0.3, -0.2, 0.5));
        let t = Vector3::new(0.6, 0.0, -0.8);
        let m = Correspondence::from_bearings([0.2, 0.5, 0.8], [-0.1, 0.4, 0.9]).unwrap();
        let frame = EpipolarFrame::new(&q_21.to_rotation_matrix().into_inner(), &t);
        let (b, c) = frame.bearings(&m);
        let n = m.bearing2().cross(&(q_21 * m.bearing1()));
        assert!((t.dot(&n) - (b[0] * c[1] - b[1] * c[0])).abs() < 1e-15);
        assert!((frame.to_2(&Vector3::from(b)) - m.bearing2()).norm() < 1e-15);
        assert!((frame.to_2(&Vector3::z()) - t).norm() < 1e-15);
    }
}
