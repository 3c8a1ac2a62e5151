//! The epipolar constraints in the frame of the best alignment, scaled so that they survive a vanishing parallax.
//!
//! With `R0` the rotation that best aligns the bearings, `c = R0 a` and `E` the essential matrix between the turned view 1
//! and view 2, write
//!
//! ```text
//! E = [t]× + p S,   S symmetric,   n = c × b = c × (b − c),   p = rms |n|
//! bᵀ E c = t · n + p bᵀ S c = p (t · n/p + S · sym(b cᵀ))
//! ```
//!
//! Any matrix has this form. The row `[n/p, sym(b cᵀ)]` of nine unknowns `(t, S)` is of order one however small the
//! parallax, and so are `t` and `S` at the true motion: `R = R0` to first order in `p`, so that the symmetric part of
//! `E = [t]× R R0ᵀ` is of order `p`.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::algebra::null_space::null_space;
use crate::algebra::number::Number;
use crate::alignment::{best_rotation, best_rotation_of_lines, outer_sum, rotation_of_outer_sum};
use crate::degeneracy::diagnose;
use crate::{Correspondence, Degeneracy};

/// Bearings closer to aligned than this (root mean square of the sine) are a pure rotation to rounding.
const NO_PARALLAX: f64 = 1e-13;

/// With more parallax than this the last digits of the alignment do not matter: any rotation near it serves.
const LARGE_PARALLAX: f64 = 1e-3;

/// Constraints closer to dependent than this have no reliable solution: the smallest pivot of the
/// rows is at most 1e-15 for collinear, coincident and repeated points, and above 1e-4 for ordinary ones.
pub(crate) const DEPENDENT: f64 = 1e-11;

/// What [`DEPENDENT`] becomes for the eigenvalues of the Gram matrix, where rounding is.
pub(crate) const GRAM_DEPENDENT: f64 = 1e-14;

/// Coordinates `(t, S11, S22, S33, S12, S13, S23)` of an essential matrix `[t]× + p S`.
pub(crate) type Coordinates = [f64; 9];

/// The frame of the best alignment.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Alignment {
    /// The rotation `R0` from camera 1 to camera 2 that best aligns the bearings.
    pub(crate) q0_21: UnitQuaternion<f64>,
    /// `p`: how far the bearings are from aligned, root mean square of the sine.
    pub(crate) parallax: f64,
}

impl Alignment {
    pub(crate) fn new(matches: &[Correspondence]) -> Self {
        let sum = outer_sum(matches);
        let nearly = Self::with_rotation(rotation_of_outer_sum(&sum, matches.len()), matches);
        let rays = if nearly.parallax > LARGE_PARALLAX {
            nearly
        } else {
            Self::with_rotation(best_rotation(matches), matches)
        };
        // Bearings in a plane are aligned as lines just as well by another half turn: rounding must not choose that.
        if rays.is_pure_rotation() {
            return rays;
        }
        // The constraints hold for lines as well as for rays, and so must what keeps them well scaled.
        match best_rotation_of_lines(matches, &sum).map(|q0_21| Self::with_rotation(q0_21, matches)) {
            Some(lines) if lines.parallax < rays.parallax => lines,
            _ => rays,
        }
    }

    /// The frame of another rotation, which leaves a parallax of its own.
    pub(crate) fn with_rotation(q0_21: UnitQuaternion<f64>, matches: &[Correspondence]) -> Self {
        let r0_21 = q0_21.to_rotation_matrix();
        let square = |m: &Correspondence| {
            let c = r0_21 * m.bearing1();
            moment(&same_side(m.bearing2(), &c), &c).norm_squared()
        };
        let sum: f64 = matches.iter().map(square).sum();
        Self { q0_21, parallax: (sum / matches.len() as f64).sqrt() }
    }

    /// The alignment of matches that a rotation alone explains. It preserves the angles between bearings, which
    /// rules out most matches at little cost.
    pub(crate) fn of_pure_rotation(matches: &[Correspondence]) -> Option<Self> {
        let (first, rest) = matches.split_first()?;
        rest.iter()
            .all(|m| angle_is_kept(first, m, matches.len()))
            .then(|| Self::new(matches))
            .filter(Self::is_pure_rotation)
    }

    /// Whether a rotation alone explains four of the matches, as where four points are at infinity. The fifth gives one
    /// constraint on the direction of the translation, which leaves a whole circle of them.
    pub(crate) fn all_but_one_turn(matches: &[Correspondence; 5]) -> bool {
        let [m0, m1, m2, m3, m4] = *matches;
        // Whichever is left out, one of these pairs stays.
        (angle_is_kept(&m0, &m1, 2) || angle_is_kept(&m2, &m3, 2))
            && [[m1, m2, m3, m4], [m0, m2, m3, m4], [m0, m1, m3, m4], [m0, m1, m2, m4], [m0, m1, m2, m3]]
                .iter()
                .any(|four| Self::of_pure_rotation(four).is_some())
    }

    /// Whether a rotation alone explains the matches to the last digit.
    pub(crate) fn is_pure_rotation(&self) -> bool {
        self.parallax <= NO_PARALLAX
    }

    /// How well the direction of the translation is determined (radians): the rounding of the bearings over the
    /// parallax.
    pub(crate) fn direction_resolution(&self) -> f64 {
        1e-13 / self.parallax
    }

    /// The bearing of camera 1 in the aligned frame.
    pub(crate) fn turned(&self) -> impl Fn(&Correspondence) -> Vector3<f64> {
        let r0_21 = self.q0_21.to_rotation_matrix();
        move |m| r0_21 * m.bearing1()
    }

    /// The row of a match.
    #[inline]
    pub(crate) fn row(&self, b: &Vector3<f64>, c: &Vector3<f64>) -> Coordinates {
        let b = same_side(b, c);
        let n = moment(&b, c) * (1.0 / self.parallax);
        [
            n.x,
            n.y,
            n.z,
            b.x * c.x,
            b.y * c.y,
            b.z * c.z,
            b.x * c.y + b.y * c.x,
            b.x * c.z + b.z * c.x,
            b.y * c.z + b.z * c.y,
        ]
    }

    /// The null space of the rows of five matches, or why they are dependent.
    pub(crate) fn null_space(&self, matches: &[Correspondence; 5]) -> Result<[Coordinates; 4], Degeneracy> {
        let turned = self.turned();
        let rows = matches.each_ref().map(|m| self.row(m.bearing2(), &turned(m)));
        let (basis, pivot) = null_space(&rows);
        if pivot < DEPENDENT { Err(diagnose(matches)) } else { Ok(basis) }
    }

    /// The essential matrix with these coordinates, between the turned view 1 and view 2.
    #[inline]
    pub(crate) fn essential<T: Number>(&self, e: &[T; 9]) -> [[T; 3]; 3] {
        let [tx, ty, tz, rest @ ..] = *e;
        let [xx, yy, zz, xy, xz, yz] = rest.map(|s| s.times(self.parallax));
        [[xx, xy - tz, xz + ty], [xy + tz, yy, yz - tx], [xz - ty, yz + tx, zz]]
    }

    /// The rotation that is left of `q_21` after the alignment.
    pub(crate) fn after_alignment(&self, q_21: &UnitQuaternion<f64>) -> Matrix3<f64> {
        (q_21 * self.q0_21.inverse()).to_rotation_matrix().into_inner()
    }

    /// The coordinates of an essential matrix between the turned view 1 and view 2.
    #[inline]
    pub(crate) fn coordinates(&self, e: &Matrix3<f64>) -> Coordinates {
        let (half, over_p) = (0.5, 1.0 / self.parallax);
        [
            half * (e[(2, 1)] - e[(1, 2)]),
            half * (e[(0, 2)] - e[(2, 0)]),
            half * (e[(1, 0)] - e[(0, 1)]),
            over_p * e[(0, 0)],
            over_p * e[(1, 1)],
            over_p * e[(2, 2)],
            half * over_p * (e[(0, 1)] + e[(1, 0)]),
            half * over_p * (e[(0, 2)] + e[(2, 0)]),
            half * over_p * (e[(1, 2)] + e[(2, 1)]),
        ]
    }

    /// The constraint `⟨Y, E⟩ = 0` on the essential matrix between view 1 and view 2 that a row stands for; of any
    /// scale.
    pub(crate) fn constraint(&self, row: &Coordinates) -> Matrix3<f64> {
        let [nx, ny, nz, xx, yy, zz, xy, xz, yz] = *row;
        let n = Vector3::new(nx, ny, nz) * self.parallax;
        let symmetric = Matrix3::new(2.0 * xx, xy, xz, xy, 2.0 * yy, yz, xz, yz, 2.0 * zz);
        (symmetric + n.cross_matrix()) * self.q0_21.to_rotation_matrix().into_inner()
    }
}

/// Whether the angle between the lines of two of `count` matches is the same in both views, as after a rotation.
#[inline]
fn angle_is_kept(first: &Correspondence, second: &Correspondence, count: usize) -> bool {
    // No bearing is off by more than all are in root sum of squares; two of them make an angle.
    let tolerance = 2.0 * NO_PARALLAX * (count as f64).sqrt();
    let cosine1 = first.bearing1().dot(second.bearing1()).abs();
    (cosine1 - first.bearing2().dot(second.bearing2()).abs()).abs() <= tolerance
}

/// `b` or `−b`, the one that points the same way as `c`.
#[inline]
fn same_side(b: &Vector3<f64>, c: &Vector3<f64>) -> Vector3<f64> {
    b * 1.0_f64.copysign(b.dot(c))
}

/// `n = c × b`, of full relative precision also where the two are close.
#[inline]
fn moment(b: &Vector3<f64>, c: &Vector3<f64>) -> Vector3<f64> {
    c.cross(&(b - c))
}
