//! The distortion all models share, its domain and its inverse.

use nalgebra::{Matrix2, Vector2};

use super::newton::solve;
use super::root::{COEFFICIENTS, Polynomial, positive_up_to};

/// The map `D(x) = h(r²) x + 2 (w·x) x + r² w` with `r = |x|`, `h = N/D` a quotient of polynomials and the
/// tangential vector `w = (p2, p1)`.
///
/// It is the gradient of a potential (the tangential part is the gradient of `r² (w·x)`), so its Jacobian `J` is
/// symmetric. `J` is positive definite on the disc `r <= max_radius`. The disc is convex, so `D` is the gradient of a
/// strictly convex function there, hence one to one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Distortion {
    /// Coefficients of N in `r²`, the first one 1.
    numerator: [f64; 7],
    /// Coefficients of D in `r²`, the first one 1.
    denominator: [f64; 4],
    w: Vector2<f64>,
    max_radius: f64,
    max_radial: f64,
}

impl Distortion {
    /// The distortion with its domain, whose radius is at most `limit`.
    pub(super) fn new(numerator: &[f64], denominator: &[f64], w: Vector2<f64>, limit: f64) -> Self {
        let mut this = Self {
            numerator: one_and(numerator),
            denominator: one_and(denominator),
            w,
            max_radius: limit,
            max_radial: limit,
        };
        this.max_radius = this.conditions().iter().map(|p| positive_up_to(p, limit)).fold(limit, f64::min);
        this.max_radial = this.radial(this.max_radius).0;
        this
    }

    /// Polynomials in `r` that are all positive as far as the map has an inverse.
    ///
    /// With `g(r) = r h(r²)`, `c` the cosine of the angle between x and w, and `t = |w| r`, the Jacobian in
    /// the radial and the tangential direction is `[g' + 6tc, 2ts; 2ts, h + 2tc]` with `s² = 1 - c²`. Its
    /// determinant is a convex quadratic in c; `g' > 6t` and `h > 4t` put the vertex below c = -1, so that
    /// the least determinant over the circle is `(g' - 6t)(h - 2t) > 0`. If `h >= g'` (barrel distortion), the second
    /// condition follows from the first, and the disc is the largest possible.
    fn conditions(&self) -> [Polynomial; 3] {
        let [mut slope, mut ratio, mut denominator] = [[0.0; COEFFICIENTS]; 3];
        let w = self.w.norm();
        for (j, dj) in self.denominator.into_iter().enumerate() {
            denominator[2 * j] = dj;
            ratio[2 * j + 1] = -4.0 * w * dj;
            for (i, ni) in self.numerator.into_iter().enumerate() {
                // Numerators of more than four terms have the denominator 1, which keeps the degree of products below COEFFICIENTS.
                if ni == 0.0 || dj == 0.0 {
                    continue;
                }
                // D² g' = N D + 2 r² (N' D - N D').
                slope[2 * (i + j)] += (1.0 + 2.0 * (i as f64 - j as f64)) * ni * dj;
            }
            for (i, di) in self.denominator.into_iter().enumerate() {
                slope[2 * (i + j) + 1] -= 6.0 * w * di * dj;
            }
        }
        for (i, ni) in self.numerator.into_iter().enumerate() {
            ratio[2 * i] = ni;
        }
        [slope, ratio, denominator]
    }

    /// The radius up to which the map has an inverse.
    pub(super) fn max_radius(&self) -> f64 {
        self.max_radius
    }

    /// The distorted radius up to which there is an inverse in every direction: the least of `|D|` on the
    /// border of the disc, reached opposite to w.
    pub(super) fn max_distorted(&self) -> f64 {
        self.max_radial - self.tangential_radius()
    }

    /// The largest `|r² w + 2 (w·x) x|` in the disc.
    fn tangential_radius(&self) -> f64 {
        3.0 * self.w.norm() * self.max_radius * self.max_radius
    }

    /// `g(r) = r h(r²)` and its derivative.
    pub(super) fn radial(&self, r: f64) -> (f64, f64) {
        let s = r * r;
        let (h, dh) = self.factor(s);
        (r * h, h + 2.0 * s * dh)
    }

    /// `h(s)` and its derivative.
    fn factor(&self, s: f64) -> (f64, f64) {
        let (n, dn) = horner(&self.numerator, s);
        let (d, dd) = horner(&self.denominator, s);
        let h = n / d;
        (h, (dn - h * dd) / d)
    }

    /// `D(x)` and its Jacobian.
    pub(super) fn distort(&self, x: &Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
        let s = x.norm_squared();
        let (h, dh) = self.factor(s);
        let isotropic = h + 2.0 * self.w.dot(x);
        let wx = self.w * x.transpose();
        let jacobian =
            Matrix2::identity() * isotropic + x * x.transpose() * (2.0 * dh) + (wx + wx.transpose()) * 2.0;
        (x * isotropic + self.w * s, jacobian)
    }

    /// The radius in the domain whose distorted radius without the tangential part is `distorted`.
    pub(super) fn undistort_radius(&self, distorted: f64) -> Option<f64> {
        (distorted <= self.max_radial).then(|| self.solve_radial(distorted, f64::EPSILON))
    }

    /// The point of the domain that is distorted to `y`, if there is one.
    pub(super) fn undistort(&self, y: &Vector2<f64>) -> Option<Vector2<f64>> {
        let radius = y.x.hypot(y.y);
        if self.w == Vector2::zeros() {
            return Some(y * scale(self.undistort_radius(radius)?, radius));
        }
        if radius > self.max_radial + self.tangential_radius() {
            return None;
        }
        // Three digits will do for a start that the tangential part moves anyway.
        let start = self.solve_radial(radius.min(self.max_radial), 1e-3);
        // Close to the border, with absurd tangential distortion, steps from there may run into the border.
        // From the centre Newton's flow is the inverse of the segment from 0 to y, which for all radii up to
        // max_distorted lies in the disc.
        let distort = |x: &Vector2<f64>| self.distort(x);
        solve(distort, y, y * scale(start, radius), self.max_radius)
            .or_else(|| solve(distort, y, Vector2::zeros(), self.max_radius))
    }

    /// Solves `g(r) = distorted` on `[0, max_radius]`, where g increases, by Newton's method. Bisects whenever a Newton
    /// step leaves the bracket or is not half as long as the last one. Ends at a relative step below `tolerance`.
    fn solve_radial(&self, distorted: f64, tolerance: f64) -> f64 {
        let (mut low, mut high) = (0.0, self.max_radius);
        let mut r = distorted.min(high);
        let mut last_step = f64::INFINITY;
        for _ in 0..200 {
            let (g, slope) = self.radial(r);
            let step = (g - distorted) / slope;
            // The second test ends the search where the slope vanishes, at the border of the domain.
            if step.abs() <= tolerance * r || (g - distorted).abs() <= 0.5 * f64::EPSILON * distorted {
                break;
            }
            if g < distorted {
                low = r;
            } else {
                high = r;
            }
            if high - low <= f64::EPSILON * high {
                break;
            }
            let newton = r - step;
            let trusted = newton > low && newton < high && step.abs() <= 0.5 * last_step;
            let next = if trusted { newton } else { 0.5 * (low + high) };
            last_step = (next - r).abs();
            r = next;
        }
        r
    }
}

/// The factor that changes the length of a vector from `old` to `new`; 1 for the zero vector.
pub(super) fn scale(new: f64, old: f64) -> f64 {
    if old > 0.0 { new / old } else { 1.0 }
}

fn one_and<const N: usize>(rest: &[f64]) -> [f64; N] {
    let mut all = [0.0; N];
    all[0] = 1.0;
    all[1..=rest.len()].copy_from_slice(rest);
    all
}

/// The polynomial and its derivative.
fn horner(coefficients: &[f64], s: f64) -> (f64, f64) {
    coefficients.iter().rev().fold((0.0, 0.0), |(value, slope), c| (value * s + c, slope * s + value))
}
