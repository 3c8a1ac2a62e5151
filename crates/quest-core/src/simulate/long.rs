//! Numbers of twice the length, for images that are as true as an `f64` can be.
//!
//! A scene without noise stands for the truth, and a solver cannot be more accurate than its images. Images computed in plain
//! `f64` are off by several roundings. The exact solution of such matches is three times as far from the truth as that of images
//! that were rounded once.

use nalgebra::{UnitQuaternion, Vector3};

/// The unevaluated sum `high + low`, where `low` is within the rounding of `high` (Dekker, Numerische Mathematik 18, 1971).
#[derive(Clone, Copy)]
struct Long {
    high: f64,
    low: f64,
}

impl Long {
    fn product(x: f64, y: f64) -> Self {
        let high = x * y;
        Self { high, low: x.mul_add(y, -high) }
    }

    fn times(self, x: f64) -> Self {
        let Self { high, low } = Self::product(self.high, x);
        Self { high, low: low + self.low * x }
    }

    fn plus(self, other: Self) -> Self {
        let high = self.high + other.high;
        let of_other = high - self.high;
        let lost = (self.high - (high - of_other)) + (other.high - of_other);
        let low = lost + (self.low + other.low);
        Self { high: high + low, low: low - ((high + low) - high) }
    }

    /// The quotient. It is rounded once, except in one case of 10¹⁵.
    fn over(self, divisor: Self) -> f64 {
        let quotient = self.high / divisor.high;
        let rest = (-quotient).mul_add(divisor.high, self.high) + (self.low - quotient * divisor.low);
        let rounded = quotient + rest / divisor.high;
        if quotient.is_finite() { rounded } else { quotient }
    }
}

/// The image (27) of `R x1 + t` on the plane `z = 1`.
///
/// ```text
/// |q|² R x = (w² − u · u) x + 2 (u · x) u + 2 w (u × x),   q = (w, u)
/// ```
///
/// A quaternion of any length stands for its rotation `R`. The translation is not multiplied by `|q|²`, which differs from 1 in
/// the last digit; its length changes by that much beside `|q|² R x`.
pub(super) fn image2(q_21: &UnitQuaternion<f64>, t_21: &Vector3<f64>, x1: &Vector3<f64>) -> [f64; 2] {
    let (w, u) = (q_21.w, q_21.imag());
    let dot = |a: &Vector3<f64>, b: &Vector3<f64>| {
        Long::product(a.x, b.x).plus(Long::product(a.y, b.y)).plus(Long::product(a.z, b.z))
    };
    let (along, scale) = (dot(&u, x1), Long::product(w, w).plus(dot(&u, &-u)));
    let component = |k: usize| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        let across = Long::product(u[i], x1[j]).plus(Long::product(-u[j], x1[i]));
        let turned = scale.times(x1[k]).plus(along.times(2.0 * u[k])).plus(across.times(2.0 * w));
        turned.plus(Long { high: t_21[k], low: 0.0 })
    };
    let z = component(2);
    [component(0).over(z), component(1).over(z)]
}

#[cfg(test)]
mod tests {
    use nalgebra::Quaternion;
    use rand::RngExt;

    use super::*;
    use crate::simulate::sampling;

    /// The quaternion has integers of 10 bits and the point integers of 35 bits, so numerator and denominator have up to 58 bits. An
    /// integer of 128 bits then holds more than 55 bits of the quotient, enough to round it, unless it is below 1e-4.
    #[test]
    #[expect(clippy::cast_possible_truncation, reason = "integers are cast back to what they were drawn as")]
    fn images_are_rounded_once() {
        let mut rng = sampling::generator(0x1096, 0);
        for _ in 0..1_000 {
            let mut draw = |bits: i32| rng.random_range(-1.0..1.0) * f64::from(bits).exp2();
            let q: [f64; 4] = std::array::from_fn(|_| draw(10).round());
            let [x1, t_21]: [[f64; 3]; 2] = [35, 45].map(|bits| std::array::from_fn(|_| draw(bits).round()));
            let q_21 = UnitQuaternion::new_unchecked(Quaternion::new(q[0], q[1], q[2], q[3]));
            let image = image2(&q_21, &t_21.into(), &x1.into());
            let ([w, x, y, z], [a, b, c]) = (q.map(|v| v as i128), x1.map(|v| v as i128));
            let x2 = [
                (w * w + x * x - y * y - z * z) * a + 2 * ((x * y - w * z) * b + (x * z + w * y) * c),
                (w * w - x * x + y * y - z * z) * b + 2 * ((x * y + w * z) * a + (y * z - w * x) * c),
                (w * w - x * x - y * y + z * z) * c + 2 * ((x * z - w * y) * a + (y * z + w * x) * b),
            ];
            let [x2, y2, z2]: [i128; 3] = std::array::from_fn(|k| x2[k] + t_21[k] as i128);
            let quotient = |x: i128| {
                let (n, d) = (x.abs() << 68, z2.abs());
                // The last bit stands for all that are cut off.
                let bits = (n / d) | i128::from(n % d != 0);
                (bits * x.signum() * z2.signum()) as f64 / 68_f64.exp2()
            };
            assert_eq!(image.map(f64::to_bits), [quotient(x2), quotient(y2)].map(f64::to_bits));
        }
    }

    #[test]
    fn a_point_beside_the_camera_has_an_image_at_infinity() {
        let image = image2(&UnitQuaternion::identity(), &Vector3::zeros(), &Vector3::new(2.0, -3.0, 0.0));
        assert!(image[0] > 0.0 && image[1] < 0.0 && image.iter().all(|x| x.is_infinite()), "{image:?}");
    }
}
