//! What the solutions are computed with: real numbers, complex ones, and two real ones side by side.

use std::ops::{Add, Mul, Sub};

use nalgebra::Complex;

use super::two::Two;

/// A number.
pub(crate) trait Number:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + std::ops::Div<Output = Self>
{
    /// A real number.
    fn real(x: f64) -> Self;

    /// A multiple.
    fn times(self, x: f64) -> Self;

    /// The square root; of a complex number the one with a real part that is not negative, and without angles: a tenth of the
    /// time.
    fn square_root(self) -> Self;

    /// The longer of two vectors.
    fn longer<const N: usize>(x: &[Self; N], y: &[Self; N]) -> [Self; N];
}

impl Number for f64 {
    #[inline]
    fn real(x: f64) -> Self {
        x
    }

    #[inline]
    fn times(self, x: f64) -> Self {
        self * x
    }

    #[inline]
    fn square_root(self) -> Self {
        self.sqrt()
    }

    #[inline]
    fn longer<const N: usize>(x: &[Self; N], y: &[Self; N]) -> [Self; N] {
        let square = |v: &[Self; N]| v.iter().map(|x| x * x).sum::<f64>();
        if square(y) > square(x) { *y } else { *x }
    }
}

impl Number for Complex<f64> {
    #[inline]
    fn real(x: f64) -> Self {
        Self::from(x)
    }

    #[inline]
    fn times(self, x: f64) -> Self {
        self * x
    }

    #[inline]
    fn square_root(self) -> Self {
        let half = (0.5 * (self.norm_sqr().sqrt() + self.re.abs())).sqrt();
        if half == 0.0 {
            return Self::new(0.0, 0.0);
        }
        let other = 0.5 * self.im / half;
        if self.re >= 0.0 { Self::new(half, other) } else { Self::new(other.abs(), half.copysign(self.im)) }
    }

    #[inline]
    fn longer<const N: usize>(x: &[Self; N], y: &[Self; N]) -> [Self; N] {
        let square = |v: &[Self; N]| v.iter().map(Self::norm_sqr).sum::<f64>();
        if square(y) > square(x) { *y } else { *x }
    }
}

impl Number for Two {
    #[inline]
    fn real(x: f64) -> Self {
        Self::splat(x)
    }

    #[inline]
    fn times(self, x: f64) -> Self {
        self * x
    }

    #[inline]
    fn square_root(self) -> Self {
        self.sqrt()
    }

    #[inline]
    fn longer<const N: usize>(x: &[Self; N], y: &[Self; N]) -> [Self; N] {
        let square = |v: &[Self; N]| v.iter().fold(Self::ZERO, |sum, x| sum + *x * *x);
        let is_longer = square(y).simd_gt(square(x));
        std::array::from_fn(|k| is_longer.select(y[k], x[k]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_are_the_library_s() {
        for re in [-2.0, -1e-9, 0.0, 0.3, 4.0] {
            for im in [-3.0, -1e-12, 0.0, 1e-5, 2.0] {
                let z = Complex::new(re, im);
                assert!((z.square_root() - z.sqrt()).norm() < 1e-15 * (1.0 + z.norm()), "{z}");
            }
        }
        assert!((2.25_f64.square_root() - 1.5).abs() < 1e-15);
    }

    #[test]
    fn each_of_two_has_its_own_longer_vector() {
        let (x, y) = ([3.0, -1.0], [2.0, 2.5]);
        assert_eq!([f64::longer(&x, &y), f64::longer(&y, &x)], [y, y]);
        let z = |v: [f64; 2]| v.map(|x| Complex::new(0.0, x));
        assert_eq!(Complex::longer(&z(x), &z(y)), z(y));
        let two = Two::longer(&x.map(|x| Two::new([x, 2.0 * x])), &y.map(Two::splat));
        assert_eq!(two.map(Two::to_array), [[2.0, 6.0], [2.5, -2.0]]);
    }
}
