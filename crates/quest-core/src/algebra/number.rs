//! What the solutions are computed with: real and complex numbers, and two of either side by side.

use std::ops::{Add, Div, Mul, RangeInclusive, Sub};

use nalgebra::Complex;

use crate::algebra::vectors::two::Two;

/// Sums of squares of numbers whose squares lose nothing either.
const RANGE: RangeInclusive<f64> = 1e-100..=1e100;

/// A number.
pub(crate) trait Number:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// A real number.
    fn real(x: f64) -> Self;

    /// A multiple.
    #[inline]
    fn times(self, x: f64) -> Self {
        self * Self::real(x)
    }

    /// The square root; of a complex number the one with a real part that is not negative, and without angles: a tenth of the
    /// time.
    fn square_root(self) -> Self;

    /// Numbers not all zero, of the same ratios and of order one, so that powers of them neither overflow nor vanish.
    fn of_order_one<const N: usize>(x: [Self; N]) -> [Self; N];

    /// Whether a vector is finite, and its square far from overflow and from zero.
    fn is_in_range<const N: usize>(x: &[Self; N]) -> bool;

    /// The longer of two vectors.
    fn longer<const N: usize>(x: &[Self; N], y: &[Self; N]) -> [Self; N];
}

/// A number with an imaginary part.
pub(crate) trait ComplexNumber: Number {
    /// What its parts are.
    type Part: Number;

    /// The real part.
    fn re(self) -> Self::Part;

    /// With the other sign of the imaginary part.
    fn conjugate(self) -> Self;
}

/// The vector product, without a conjugate.
#[expect(clippy::inline_always, reason = "a call would leave the instructions of the lanes")]
#[inline(always)]
pub(crate) fn cross<T: Number>(a: &[T; 3], b: &[T; 3]) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

impl Number for f64 {
    #[inline]
    fn real(x: f64) -> Self {
        x
    }

    #[inline]
    fn square_root(self) -> Self {
        self.sqrt()
    }

    #[inline]
    fn of_order_one<const N: usize>(x: [Self; N]) -> [Self; N] {
        let inverse = 1.0 / x.iter().map(|x| x.abs()).sum::<f64>();
        x.map(|x| x * inverse)
    }

    #[inline]
    fn is_in_range<const N: usize>(x: &[Self; N]) -> bool {
        RANGE.contains(&x.iter().map(|x| x * x).sum::<f64>())
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
    fn of_order_one<const N: usize>(x: [Self; N]) -> [Self; N] {
        let inverse = 1.0 / x.iter().map(Self::l1_norm).sum::<f64>();
        x.map(|x| x * inverse)
    }

    #[inline]
    fn is_in_range<const N: usize>(x: &[Self; N]) -> bool {
        RANGE.contains(&x.iter().map(Self::norm_sqr).sum::<f64>())
    }

    #[inline]
    fn longer<const N: usize>(x: &[Self; N], y: &[Self; N]) -> [Self; N] {
        let square = |v: &[Self; N]| v.iter().map(Self::norm_sqr).sum::<f64>();
        if square(y) > square(x) { *y } else { *x }
    }
}

impl ComplexNumber for Complex<f64> {
    type Part = f64;

    #[inline]
    fn re(self) -> f64 {
        self.re
    }

    #[inline]
    fn conjugate(self) -> Self {
        self.conj()
    }
}

impl Number for Two {
    #[inline]
    fn real(x: f64) -> Self {
        Self::splat(x)
    }

    #[inline]
    fn square_root(self) -> Self {
        self.sqrt()
    }

    #[inline]
    fn of_order_one<const N: usize>(x: [Self; N]) -> [Self; N] {
        let inverse = Self::splat(1.0) / x.iter().fold(Self::ZERO, |sum, x| sum + x.abs());
        x.map(|x| x * inverse)
    }

    #[inline]
    fn is_in_range<const N: usize>(x: &[Self; N]) -> bool {
        let square = x.iter().fold(Self::ZERO, |sum, x| sum + *x * *x);
        square.to_array().iter().all(|square| RANGE.contains(square))
    }

    #[inline]
    fn longer<const N: usize>(x: &[Self; N], y: &[Self; N]) -> [Self; N] {
        let square = |v: &[Self; N]| v.iter().fold(Self::ZERO, |sum, x| sum + *x * *x);
        let is_longer = square(y).simd_gt(square(x));
        std::array::from_fn(|k| is_longer.select(y[k], x[k]))
    }
}

/// Two complex numbers side by side.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TwoComplex {
    re: Two,
    im: Two,
}

impl TwoComplex {
    #[inline]
    pub(crate) fn new(z: [Complex<f64>; 2]) -> Self {
        Self { re: Two::new(z.map(|z| z.re)), im: Two::new(z.map(|z| z.im)) }
    }

    #[inline]
    pub(crate) fn to_array(self) -> [Complex<f64>; 2] {
        let (re, im) = (self.re.to_array(), self.im.to_array());
        [Complex::new(re[0], im[0]), Complex::new(re[1], im[1])]
    }

    #[inline]
    fn square_norm(self) -> Two {
        self.re * self.re + self.im * self.im
    }
}

impl Add for TwoComplex {
    type Output = Self;

    #[inline]
    fn add(self, z: Self) -> Self {
        Self { re: self.re + z.re, im: self.im + z.im }
    }
}

impl Sub for TwoComplex {
    type Output = Self;

    #[inline]
    fn sub(self, z: Self) -> Self {
        Self { re: self.re - z.re, im: self.im - z.im }
    }
}

impl Mul for TwoComplex {
    type Output = Self;

    #[inline]
    fn mul(self, z: Self) -> Self {
        Self { re: self.re * z.re - self.im * z.im, im: self.re * z.im + self.im * z.re }
    }
}

impl Div for TwoComplex {
    type Output = Self;

    #[inline]
    fn div(self, z: Self) -> Self {
        let Self { re, im } = self * z.conjugate();
        let inverse = Two::splat(1.0) / z.square_norm();
        Self { re: re * inverse, im: im * inverse }
    }
}

impl Number for TwoComplex {
    #[inline]
    fn real(x: f64) -> Self {
        Self { re: Two::splat(x), im: Two::ZERO }
    }

    #[inline]
    fn times(self, x: f64) -> Self {
        Self { re: self.re * x, im: self.im * x }
    }

    #[inline]
    fn square_root(self) -> Self {
        let half = ((self.square_norm().sqrt() + self.re.abs()) * 0.5).sqrt();
        let other = self.im * 0.5 / half;
        let is_right = self.re.simd_ge(Two::ZERO);
        let signed = half | (self.im & Two::splat(-0.0));
        let is_zero = half.simd_eq(Two::ZERO);
        Self {
            re: is_zero.select(half, is_right.select(half, other.abs())),
            im: is_zero.select(half, is_right.select(other, signed)),
        }
    }

    #[inline]
    fn of_order_one<const N: usize>(x: [Self; N]) -> [Self; N] {
        let inverse = Two::splat(1.0) / x.iter().fold(Two::ZERO, |sum, x| sum + (x.re.abs() + x.im.abs()));
        x.map(|x| Self { re: x.re * inverse, im: x.im * inverse })
    }

    #[inline]
    fn is_in_range<const N: usize>(x: &[Self; N]) -> bool {
        let square = x.iter().fold(Two::ZERO, |sum, x| sum + x.square_norm());
        square.to_array().iter().all(|square| RANGE.contains(square))
    }

    #[inline]
    fn longer<const N: usize>(x: &[Self; N], y: &[Self; N]) -> [Self; N] {
        let square = |v: &[Self; N]| v.iter().fold(Two::ZERO, |sum, x| sum + x.square_norm());
        let is_longer = square(y).simd_gt(square(x));
        std::array::from_fn(|k| Self {
            re: is_longer.select(y[k].re, x[k].re),
            im: is_longer.select(y[k].im, x[k].im),
        })
    }
}

impl ComplexNumber for TwoComplex {
    type Part = Two;

    #[inline]
    fn re(self) -> Two {
        self.re
    }

    #[inline]
    fn conjugate(self) -> Self {
        Self { im: -self.im, ..self }
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
                let two = TwoComplex::new([z, -z]).square_root().to_array();
                assert!((z.square_root() - z.sqrt()).norm() < 1e-15 * (1.0 + z.norm()), "{z}");
                assert_eq!(two, [z, -z].map(Number::square_root));
            }
        }
        assert!((2.25_f64.square_root() - 1.5).abs() < 1e-15);
    }

    #[test]
    fn two_complex_numbers_are_as_one_and_one() {
        let (x, y) = ([Complex::new(0.3, -2.0), Complex::i()], [Complex::new(-1.5, 0.4), Complex::from(2.0)]);
        let (two_x, two_y) = (TwoComplex::new(x), TwoComplex::new(y));
        for (two, one) in [
            (two_x + two_y, [x[0] + y[0], x[1] + y[1]]),
            (two_x - two_y, [x[0] - y[0], x[1] - y[1]]),
            (two_x * two_y, [x[0] * y[0], x[1] * y[1]]),
            (two_x / two_y, [x[0] / y[0], x[1] / y[1]]),
            (two_x.times(3.0) + TwoComplex::real(1.0), x.map(|x| x * 3.0 + 1.0)),
            (two_x.conjugate(), x.map(|x| x.conj())),
            (TwoComplex::longer(&[two_x], &[two_y])[0], [x[0], y[1]]),
        ] {
            assert!(two.to_array().iter().zip(one).all(|(two, one)| (two - one).norm() < 1e-15));
        }
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
