//! Ten cubics in `x, y, z` as a polynomial of degree ten in `z`.
//!
//! After D. Nistér, *An efficient solution to the five-point relative pose problem*, PAMI 26 (2004), section 3.2. With `w = 1` the cubics
//! are reduced to the six leading monomials that matter; what follows these in their rows is linear in `x` and `y`:
//!
//! ```text
//! x² z + …   less z times   x² + …        and the same with y² and x y        three equations X(z) x + Y(z) y + W(z) = 0
//! ```
//!
//! `X` and `Y` have degree three, `W` has degree four, and the determinant of the three equations has degree ten.

use crate::algebra::elimination;
use crate::algebra::number::Number;
use crate::solver::shared::forms::Cubic;

/// The first of the eliminated rows that is used: `x²z, x²w, y²z, y²w, xyz, xyw`.
const FIRST_USED: usize = 4;

/// Three equations `X(z) x + Y(z) y + W(z) = 0`; coefficients from the constant up.
pub(crate) struct Resultant {
    pub(crate) x: [[f64; 4]; 3],
    pub(crate) y: [[f64; 4]; 3],
    pub(crate) w: [[f64; 5]; 3],
}

impl Resultant {
    /// The three equations of the ten cubics over [`CUBIC`](crate::solver::shared::forms::CUBIC) of an essential matrix, which are overwritten, and
    /// how far the elimination was from singular.
    #[inline]
    pub(crate) fn new(cubics: &mut [Cubic; 10]) -> (Self, f64) {
        let pivot = elimination::reduce(cubics, FIRST_USED);
        let mut out = Self { x: [[0.0; 4]; 3], y: [[0.0; 4]; 3], w: [[0.0; 5]; 3] };
        for r in 0..3 {
            // The row led by a monomial times z, less z times the row led by the monomial: no leader is left.
            let tail = |row: usize| &cubics[FIRST_USED + 2 * r + row][10..];
            let (with_z, without) = (tail(0), tail(1));
            for k in 0..3 {
                out.x[r][k] += with_z[2 - k];
                out.x[r][k + 1] -= without[2 - k];
                out.y[r][k] += with_z[5 - k];
                out.y[r][k + 1] -= without[5 - k];
            }
            for k in 0..4 {
                out.w[r][k] += with_z[9 - k];
                out.w[r][k + 1] -= without[9 - k];
            }
        }
        (out, pivot)
    }

    /// The determinant, whose roots are the values of `z`.
    pub(crate) fn polynomial(&self) -> [f64; 11] {
        let mut out = [0.0; 11];
        for r in 0..3 {
            let (i, j) = ((r + 1) % 3, (r + 2) % 3);
            let mut minor = [0.0; 7];
            for a in 0..4 {
                for b in 0..4 {
                    minor[a + b] += self.x[i][a] * self.y[j][b] - self.y[i][a] * self.x[j][b];
                }
            }
            for a in 0..7 {
                for b in 0..5 {
                    out[a + b] += minor[a] * self.w[r][b];
                }
            }
        }
        out
    }

    /// `(x, y, z, w)` at a root, up to scale: the null vector of the three equations.
    #[inline]
    pub(crate) fn point<T: Number>(&self, z: T) -> [T; 4] {
        let m: [[T; 3]; 3] =
            std::array::from_fn(|r| [horner(&self.x[r], z), horner(&self.y[r], z), horner(&self.w[r], z)]);
        let cross = |a: &[T; 3], b: &[T; 3]| -> [T; 3] {
            std::array::from_fn(|k| {
                let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                a[i] * b[j] - a[j] * b[i]
            })
        };
        let two_of = T::longer(&cross(&m[0], &m[1]), &cross(&m[1], &m[2]));
        let [x, y, w] = T::longer(&two_of, &cross(&m[2], &m[0]));
        [x, y, z * w, w]
    }
}

#[inline]
fn horner<T: Number, const N: usize>(p: &[f64; N], z: T) -> T {
    p[..N - 1].iter().rev().fold(T::real(p[N - 1]), |value, c| value * z + T::real(*c))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::algebra::monomials::evaluate;
    use crate::algebra::polynomial::real_roots;
    use crate::solver::quest::cubics::ten_cubics;
    use crate::solver::shared::forms::CUBIC;

    #[test]
    fn roots_are_common_zeros_of_the_cubics() {
        let mut roots = 0;
        for shift in 0..20 {
            let entry = |m: usize, k: usize| (((3 * m + 7 * k) as f64 + 0.37 * f64::from(shift)) * 1.3).sin();
            let basis = std::array::from_fn(|m| std::array::from_fn(|k| entry(m, k)));
            let cubics = ten_cubics(&basis, 0.4);
            let (resultant, pivot) = Resultant::new(&mut cubics.clone());
            for &z in real_roots(&resultant.polynomial()).as_slice() {
                let point = resultant.point(z);
                let size = point.iter().map(|x| x * x).sum::<f64>().sqrt();
                let unit = point.map(|x| x / size);
                // Coefficients of order ten, and what the elimination loses.
                assert!(cubics.iter().all(|c| evaluate(&CUBIC, c, unit).abs() < 1e-12 / pivot));
                roots += 1;
            }
        }
        assert!(roots > 20, "{roots}");
    }
}
