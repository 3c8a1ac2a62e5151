//! Fisheye lenses with tangential and thin prism distortion.
//!
//! On the vector `x` of length `θ` in the direction of the image point:
//!
//! ```text
//! y  = x h(|x|²)                                     the radial part
//! D  = y + 2 (w·p) p + |p|² w + |p|² s + |p|⁴ q       with p = x (THIN_PRISM_FISHEYE) or p = y (RAD_TAN_THIN_PRISM_FISHEYE)
//! ```
//!
//! A map whose Jacobian has a positive definite symmetric part on a disc is one to one there. The least eigenvalue of the
//! symmetric part of what is added is at least `-c(ρ)` at `|p| = ρ`, with `c(ρ) = (6 |w| + 2 |s|) ρ + 4 |q| ρ³`; that of the
//! radial part is `min(g', h)`.

use std::f64::consts::PI;

use nalgebra::{Matrix2, Vector2};

use super::distortion::{Distortion, scale};
use super::newton::solve;
use super::root::{COEFFICIENTS, positive_up_to};

/// The lens, with its domain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Prism {
    radial: Distortion,
    w: Vector2<f64>,
    s: Vector2<f64>,
    q: Vector2<f64>,
    /// Whether the radial part is taken first.
    is_composed: bool,
    /// In radians.
    max_radius: f64,
}

impl Prism {
    /// `THIN_PRISM_FISHEYE`: `k1, k2, p1, p2, k3, k4, sx1, sy1`.
    pub(super) fn thin([k1, k2, p1, p2, k3, k4, sx1, sy1]: [f64; 8]) -> Self {
        let radial = Distortion::new(&[k1, k2, k3, k4], &[], Vector2::zeros(), PI);
        let (w, s) = (Vector2::new(p2, p1), Vector2::new(sx1, sy1));
        let this =
            Self { radial, w, s, q: Vector2::zeros(), is_composed: false, max_radius: radial.max_radius() };
        let [mut slope, mut ratio] = [[0.0; COEFFICIENTS]; 2];
        for (i, k) in [1.0, k1, k2, k3, k4].into_iter().enumerate() {
            slope[2 * i] = (2.0 * i as f64 + 1.0) * k;
            ratio[2 * i] = k;
        }
        for polynomial in [&mut slope, &mut ratio] {
            polynomial[1] -= this.linear();
        }
        let limit = [slope, ratio].iter().map(|p| positive_up_to(p, this.max_radius)).fold(PI, f64::min);
        Self { max_radius: limit.min(this.max_radius), ..this }
    }

    /// `RAD_TAN_THIN_PRISM_FISHEYE`: `k0 … k5, p0, p1, s0 … s3`.
    pub(super) fn radial_tangential([k0, k1, k2, k3, k4, k5, p0, p1, s0, s1, s2, s3]: [f64; 12]) -> Self {
        let radial = Distortion::new(&[k0, k1, k2, k3, k4, k5], &[], Vector2::zeros(), PI);
        let (w, s, q) = (Vector2::new(p0, p1), Vector2::new(s0, s2), Vector2::new(s1, s3));
        let max_radius = radial.max_radius();
        let this = Self { radial, w, s, q, is_composed: true, max_radius };
        let mut slope = [0.0; COEFFICIENTS];
        (slope[0], slope[1], slope[3]) = (1.0, -this.linear(), -4.0 * q.norm());
        let reach = positive_up_to(&slope, radial.radial(max_radius).0);
        Self { max_radius: radial.undistort_radius(reach).map_or(max_radius, |r| r.min(max_radius)), ..this }
    }

    /// The coefficient of ρ in the bound `c(ρ)`.
    fn linear(&self) -> f64 {
        6.0 * self.w.norm() + 2.0 * self.s.norm()
    }

    /// The angle from the optical axis up to which the lens sees.
    pub(super) fn max_radius(&self) -> f64 {
        self.max_radius
    }

    /// The distorted radius up to which there is an inverse in every direction: no less than this is `|D|` on the border.
    pub(super) fn max_distorted(&self) -> f64 {
        let edge = self.radial.radial(self.max_radius).0;
        let p2 = if self.is_composed { edge * edge } else { self.max_radius * self.max_radius };
        edge - (3.0 * self.w.norm() + self.s.norm()) * p2 - self.q.norm() * p2 * p2
    }

    /// What is added at `p`, and its Jacobian.
    fn added(&self, p: &Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
        let r2 = p.norm_squared();
        let along = self.w + self.s + self.q * r2;
        let wp = self.w.dot(p);
        let value = p * (2.0 * wp) + along * r2;
        let jacobian = Matrix2::identity() * (2.0 * wp)
            + p * self.w.transpose() * 2.0
            + (along + self.q * r2) * p.transpose() * 2.0;
        (value, jacobian)
    }

    /// `D(x)` and its Jacobian.
    pub(super) fn distort(&self, x: &Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
        let (y, dy) = self.radial.distort(x);
        if self.is_composed {
            let (added, da) = self.added(&y);
            return (y + added, dy + da * dy);
        }
        let (added, da) = self.added(x);
        (y + added, dy + da)
    }

    /// The vector in the domain that is distorted to `d`, if there is one.
    pub(super) fn undistort(&self, d: &Vector2<f64>) -> Option<Vector2<f64>> {
        let radius = d.norm();
        let edge = self.radial.radial(self.max_radius).0;
        // Far beyond the border there is nothing to be found.
        if radius.is_nan() || radius > 2.0 * edge + 1.0 {
            return None;
        }
        let start = self.radial.undistort_radius(radius.min(edge)).unwrap_or(self.max_radius);
        let start = d * (scale(start.min(self.max_radius), radius) * (1.0 - 1e-9));
        let distort = |x: &Vector2<f64>| self.distort(x);
        solve(distort, d, start, self.max_radius)
            .or_else(|| solve(distort, d, Vector2::zeros(), self.max_radius))
    }
}
