//! The pose of one camera relative to another.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::Correspondence;
use crate::algebra::vectors::lane::{F, Float, Lanes};

/// Two rays closer than this (the sine of their angle) are parallel to rounding: their depths are noise.
pub(crate) const PARALLEL: f64 = 8.0 * f64::EPSILON;

/// Camera 2 relative to camera 1: `X2 = R_21 X1 + t_21` (section 5 of the paper, figure 2).
///
/// `t_21` shares its scale with the depths; see [`crate::Candidate::depths`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(into = "crate::serial::PoseForm", try_from = "crate::serial::PoseForm")
)]
pub struct RelativePose {
    /// The rotation as a unit quaternion; [`wxyz`](Self::wxyz) gives it scalar first.
    pub q_21: UnitQuaternion<f64>,
    /// The translation: the origin of camera 1 in the coordinates of camera 2.
    pub t_21: Vector3<f64>,
}

impl RelativePose {
    /// The pose with rotation `q_21` and translation `t_21`.
    #[must_use]
    pub fn new(q_21: UnitQuaternion<f64>, t_21: Vector3<f64>) -> Self {
        Self { q_21, t_21 }
    }

    /// No rotation and no translation.
    #[must_use]
    pub fn identity() -> Self {
        Self { q_21: UnitQuaternion::identity(), t_21: Vector3::zeros() }
    }

    /// The rotation matrix `R_21`, equation (3).
    #[must_use]
    pub fn r_21(&self) -> Matrix3<f64> {
        self.q_21.to_rotation_matrix().into_inner()
    }

    /// The quaternion scalar first, `(q1, q2, q3, q4)` of the paper, with `q1 >= 0`.
    #[must_use]
    pub fn wxyz(&self) -> [f64; 4] {
        let q = self.q_21.quaternion();
        let s = if q.w < 0.0 { -1.0 } else { 1.0 };
        [s * q.w, s * q.i, s * q.j, s * q.k]
    }

    /// The pose of camera 1 relative to camera 2: `X1 = R_12 X2 + t_12`.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let q_12 = self.q_21.inverse();
        Self { q_21: q_12, t_21: -(q_12 * self.t_21) }
    }

    /// The angle in radians of the rotation that takes this pose's rotation to `other`'s, in `[0, π]`.
    ///
    /// This is twice the metric (61) of the paper. It is exact for small angles.
    #[must_use]
    pub fn rotation_error(&self, other: &Self) -> f64 {
        let d = self.q_21.inverse() * other.q_21;
        2.0 * d.imag().norm().atan2(d.w.abs())
    }

    /// The angle in radians between the two translations, in `[0, π]`, or `None` where one of them vanishes.
    ///
    /// The sign of the translations matters, unlike in the metric (62) of the paper.
    #[must_use]
    pub fn translation_error(&self, other: &Self) -> Option<f64> {
        let (a, b) = (self.t_21.try_normalize(0.0)?, other.t_21.try_normalize(0.0)?);
        Some(a.cross(&b).norm().atan2(a.dot(&b)))
    }

    /// The essential matrix `[t_21]× R_21`, with `x2ᵀ E x1 = 0`.
    #[must_use]
    pub fn essential(&self) -> Matrix3<f64> {
        self.t_21.cross_matrix() * self.r_21()
    }

    /// The depths `(z1, z2)` of a match, in the unit of `t_21`: `z1 R x1 + t = z2 x2`, equation (28), in the
    /// least-squares sense where the two rays do not meet.
    ///
    /// Depths multiply the vectors as they were given to [`Correspondence`]. `None` if no depth is determined, because
    /// the translation is zero or the rays are parallel.
    #[must_use]
    pub fn depths(&self, m: &Correspondence) -> Option<(f64, f64)> {
        // Without a translation every depth fits, also where noise keeps the rays from being parallel.
        if self.t_21.amax() <= 0.0 {
            return None;
        }
        let c = self.q_21 * m.bearing1();
        let n = m.bearing2().cross(&c);
        let nn = n.norm_squared();
        if nn <= PARALLEL * PARALLEL {
            return None;
        }
        // Equation (28) crossed with b, and with c.
        let range1 = -m.bearing2().cross(&self.t_21).dot(&n) / nn;
        let range2 = -c.cross(&self.t_21).dot(&n) / nn;
        Some((range1 / m.length1(), range2 / m.length2()))
    }

    /// The Sampson error of a match on the sphere, in radians: to first order, the root of the summed squares of
    /// the angles by which its two bearings have to turn to satisfy `x2ᵀ E x1 = 0`.
    ///
    /// If the translation is zero, the bearings must coincide instead.
    #[must_use]
    pub fn sampson_error(&self, m: &Correspondence) -> f64 {
        let (b, c) = (m.bearing2(), self.q_21 * m.bearing1());
        match self.t_21.try_normalize(0.0) {
            Some(t) => sampson_square(t.dot(&b.cross(&c)), t.dot(b), t.dot(&c)).sqrt(),
            None => b.cross(&c).norm().atan2(b.dot(&c)) * std::f64::consts::FRAC_1_SQRT_2,
        }
    }

    /// Root mean square of [`sampson_error`](Self::sampson_error) over the matches, in radians.
    #[must_use]
    pub fn residual(&self, matches: &[Correspondence]) -> f64 {
        let sum: f64 = matches.iter().map(|m| self.sampson_error(m).powi(2)).sum();
        (sum / matches.len().max(1) as f64).sqrt()
    }
}

/// The largest Sampson error: no bearing has to turn by more.
pub(crate) const RIGHT_ANGLE: f64 = std::f64::consts::FRAC_PI_2;

/// The squared Sampson error of the constraint `e = t · (b × c)` of unit vectors, by `t · b` and `t · c`.
#[inline]
pub(crate) fn sampson_square(e: f64, tb: f64, tc: f64) -> f64 {
    // The squared gradients in the tangent planes of both spheres. At an epipole both vanish, and so does e.
    let gradient2 = 2.0 - tb * tb - tc * tc - 2.0 * e * e;
    (e * e / gradient2.max(f64::MIN_POSITIVE)).min(RIGHT_ANGLE * RIGHT_ANGLE)
}

/// [`sampson_square`] of many at once.
#[inline(always)]
#[expect(clippy::inline_always, reason = "a call would leave the instructions of the lanes")]
pub(crate) fn sampson_squares<L: Lanes<f64>>(lanes: L, e: F<L>, tb: F<L>, tc: F<L>) -> F<L> {
    let [least, most] = [f64::MIN_POSITIVE, RIGHT_ANGLE * RIGHT_ANGLE].map(|x| lanes.splat(x));
    let two = lanes.splat(2.0);
    let gradient2 = (two * e).neg_mul_add(e, tc.neg_mul_add(tc, tb.neg_mul_add(tb, two)));
    let square = e * e / gradient2.select(least.less(gradient2), least);
    square.select(square.less(most), most)
}
