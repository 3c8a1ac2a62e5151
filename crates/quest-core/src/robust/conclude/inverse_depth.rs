//! Inverse depths, whose noise is symmetric where depths have none that could be named.

use std::ops::Mul;

use nalgebra::Vector3;

use crate::robust::data::columns::Columns;
use crate::solver::shared::motion::Motion;

/// The share, in per cent, of the inverse depths that are within `γ` of their median. Real scenes have a foreground: half of
/// them, as for a median deviation, may be one wall.
const MOST: usize = 90;

/// The standard deviations in `γ` where the inverse depths are normal: 90 % of a normal variable lie within 1.645 of them.
const DEVIATIONS: f64 = 1.645;

/// The least square of the sine between a ray and the translation: at the epipole itself there is no depth.
const SQUARE: f64 = 1e-18;

/// The inverse depth of a match in view 1, its translation having length one, and the inverse of its variance at unit
/// noise.
#[derive(Clone, Copy, Debug)]
pub(crate) struct InverseDepth {
    pub(crate) x1: Vector3<f64>,
    pub(crate) x2: Vector3<f64>,
    pub(crate) value: f64,
    pub(crate) precision: f64,
}

impl InverseDepth {
    /// The signed inverse depth `ρ = −(x2 × t) · (x2 × R x1) / |x2 × t|²` of a match in view 1.
    pub(crate) fn new(columns: &Columns, motion: &Motion, index: usize) -> Self {
        let [x1, x2] = columns.vectors(index);
        let across = x2.cross(&motion.direction);
        let square = across.norm_squared().max(SQUARE);
        let value = -across.dot(&x2.cross(&(motion.q_21 * x1))) / square;
        let precision = square / (x2.norm_squared() * columns.square_angle_of_pixel());
        Self { x1, x2, value, precision }
    }

    /// In view 1 and in view 2, by the motion: `z1 R x1 + t = z2 x2`, crossed with `x2` and with `y = R x1`.
    pub(crate) fn differentiated(&self, motion: &Motion) -> [Differentiated; 2] {
        let Self { x1, x2, value: rho1, .. } = self;
        let (y, t) = (motion.q_21 * x1, motion.direction);
        // ρ1 = −a · c / a² with a = x2 × t and c = x2 × y.
        let (a, c) = (x2.cross(&t), x2.cross(&y));
        let inverse = 1.0 / a.norm_squared().max(SQUARE);
        let around = a.cross(x2);
        let one = Differentiated {
            value: *rho1,
            by_rotation: around.cross(&y) * inverse,
            by_direction: (x2.cross(&c) - around * (2.0 * rho1)) * inverse,
        };
        // ρ2 = −b · c / b² with b = y × t.
        let b = y.cross(&t);
        let inverse = 1.0 / b.norm_squared().max(SQUARE);
        let rho2 = -b.dot(&c) * inverse;
        let by_b = -c - b * (2.0 * rho2);
        let two = Differentiated {
            value: rho2,
            by_rotation: y.cross(&(t.cross(&by_b) - b.cross(x2))) * inverse,
            by_direction: by_b.cross(&y) * inverse,
        };
        [one, two]
    }

    /// The inverse depths of all of these matches.
    pub(crate) fn all(columns: &Columns, motion: &Motion, indices: &[u32]) -> Vec<Self> {
        indices.iter().map(|&i| Self::new(columns, motion, i as usize)).collect()
    }

    /// The variance of the value with noise of `sigma` pixels.
    pub(crate) fn variance(&self, sigma: f64) -> f64 {
        sigma * sigma / self.precision
    }
}

/// A signed inverse depth and its derivatives by a rotation of the motion and by its direction, which the caller keeps a unit
/// vector.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Differentiated {
    pub(crate) value: f64,
    pub(crate) by_rotation: Vector3<f64>,
    pub(crate) by_direction: Vector3<f64>,
}

impl Mul<f64> for Differentiated {
    type Output = Self;

    fn mul(self, scale: f64) -> Self {
        Self {
            value: self.value * scale,
            by_rotation: self.by_rotation * scale,
            by_direction: self.by_direction * scale,
        }
    }
}

/// Where most inverse depths of a scene are: `m ± γ`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Usual {
    median: f64,
    reach: f64,
}

impl Usual {
    /// What is known of at least one depth.
    pub(crate) fn new(depths: &[InverseDepth]) -> Self {
        let quantile = |mut values: Vec<f64>, percent: usize| {
            let index = (values.len() - 1) * percent / 100;
            *values.select_nth_unstable_by(index, f64::total_cmp).1
        };
        let median = quantile(depths.iter().map(|d| d.value).collect(), 50);
        let reach = quantile(depths.iter().map(|d| (d.value - median).abs()).collect(), MOST);
        Self { median, reach }
    }

    /// `γ`, not less than what the noise of this depth alone would make it.
    fn scale(&self, depth: &InverseDepth, sigma: f64) -> f64 {
        self.reach.max(depth.variance(sigma).sqrt())
    }

    /// How many times `γ` a depth is away from `m`.
    pub(crate) fn distance(&self, depth: &InverseDepth, sigma: f64) -> f64 {
        (depth.value - self.median).abs() / self.scale(depth, sigma)
    }

    /// `p(ρ) = 3√3 / (4π γ (1 + u³))` with `u` the distance: that few points are near, as if all were spread evenly over a
    /// ground, `p(z) ∝ z` of the depth, makes a tail `p(ρ) ∝ ρ⁻³`.
    pub(crate) fn density(&self, depth: &InverseDepth, sigma: f64) -> f64 {
        let norm = 0.75 * 3.0_f64.sqrt() / std::f64::consts::PI;
        norm / (self.scale(depth, sigma) * (1.0 + self.distance(depth, sigma).powi(3)))
    }

    /// The mean and the standard deviation of an inverse depth, given what was measured of it and of the others; `spread` is the
    /// variance of those.
    pub(crate) fn given(&self, depth: &InverseDepth, sigma: f64, spread: f64) -> [f64; 2] {
        let noise = depth.variance(sigma);
        let share = spread / (spread + noise);
        [self.median + share * (depth.value - self.median), (share * noise).sqrt()]
    }

    /// The variance of the inverse depths themselves, without that of their noise, whose median is `noise`. It is not less than
    /// two standard deviations of what the noise of `count` depths may hide.
    pub(crate) fn spread(&self, noise: f64, count: usize) -> f64 {
        let hidden = 2.0 * noise * (2.0 / count as f64).sqrt();
        ((self.reach / DEVIATIONS).powi(2) - noise).max(hidden)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robust::data::image::Image;
    use nalgebra::{Unit, UnitQuaternion};

    #[test]
    fn depths_and_derivatives() {
        let motion = Motion {
            q_21: UnitQuaternion::from_scaled_axis(Vector3::new(0.2, -0.3, 0.1)),
            direction: Unit::new_normalize(Vector3::new(0.8, 0.3, -0.4)).into_inner(),
        };
        let x1 = Vector3::new(0.3, -0.2, 1.0);
        let point2 = motion.q_21 * x1 * 5.0 + motion.direction;
        let points = [x1, point2 / point2.z];
        let differentiated = |points: [Vector3<f64>; 2], motion: &Motion| {
            let columns = Columns::of_points([Image::Plane([1.0; 2]); 2], 1.0, [points].into_iter());
            InverseDepth::new(&columns, motion, 0).differentiated(motion)
        };
        let [one, two] = differentiated(points, &motion);
        // Rounding of products of order one.
        assert!((one.value - 0.2).abs() < 1e-14 && (two.value * point2.z - 1.0).abs() < 1e-13);
        // Off the epipolar plane the two differ, and so do the derivatives.
        let points = [x1, points[1] + Vector3::new(0.01, 0.02, 0.0)];
        let h = 1e-6;
        let at = |turn: Vector3<f64>, by: Vector3<f64>| {
            let q_21 = UnitQuaternion::from_scaled_axis(turn) * motion.q_21;
            differentiated(points, &Motion { q_21, direction: motion.direction + by }).map(|d| d.value)
        };
        let all = differentiated(points, &motion);
        for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
            let zero = Vector3::zeros();
            let (turned, back) = (at(axis * h, zero), at(-axis * h, zero));
            let (moved, moved_back) = (at(zero, axis * h), at(zero, -axis * h));
            for (k, d) in all.iter().enumerate() {
                // Rounding over the step, and the third derivative times its square.
                let by_rotation = (turned[k] - back[k]) / (2.0 * h);
                let by_direction = (moved[k] - moved_back[k]) / (2.0 * h);
                assert!((d.by_rotation.dot(&axis) - by_rotation).abs() < 1e-8, "{k} {by_rotation}");
                assert!((d.by_direction.dot(&axis) - by_direction).abs() < 1e-8, "{k} {by_direction}");
            }
        }
    }

    /// A depth of this value, known so well that its noise says nothing.
    fn known(value: f64, precision: f64) -> InverseDepth {
        InverseDepth { x1: Vector3::z(), x2: Vector3::z(), value, precision }
    }

    #[test]
    fn what_is_known_of_inverse_depths_is_a_density() {
        let usual = Usual { median: 0.7, reach: 0.02 };
        // Beyond 400 γ is `3√3/(4π) u⁻²` of it.
        let (step, ends) = (0.01, 400.0);
        let places = (-40_000..=40_000).map(|k| step * f64::from(k));
        let (mut all, mut beyond) = (0.0, 0.0);
        for u in places {
            let density = usual.density(&known(0.7 + 0.02 * u, 1e12), 1.0) * 0.02 * step;
            all += density;
            beyond += if u.abs() > 3.0 { density } else { 0.0 };
        }
        let rest = 0.413_5 / (ends * ends);
        assert!((all + rest - 1.0).abs() < 1e-4, "{all}");
        // The share that chance inliers are counted against.
        assert!((beyond + rest - 0.0452).abs() < 5e-4, "{beyond}");
        // Of a depth that is not known so well the noise is the scale.
        assert!((usual.distance(&known(0.9, 100.0), 1.0) - 2.0).abs() < 1e-12);
    }

    #[test]
    fn the_spread_of_inverse_depths_is_without_that_of_their_noise() {
        let spread = |reach: f64, noise: f64| Usual { median: 0.0, reach }.spread(noise, 50);
        assert!((spread(0.3 * DEVIATIONS, 0.04) - 0.05).abs() < 1e-12);
        // Noise alone may hide two deviations of its own scatter: √(2/50) of it.
        assert!((spread(0.2 * DEVIATIONS, 0.04) - 2.0 * 0.04 * 0.2).abs() < 1e-12);
        assert!((spread(0.0, 9.0) - 2.0 * 9.0 * 0.2).abs() < 1e-12);
    }
}
