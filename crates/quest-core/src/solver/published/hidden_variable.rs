//! The ten cubics with one unknown hidden: a matrix polynomial in it.
//!
//! With `E = x E1 + y E2 + z E3 + w E4`, the cubics are linear in the ten monomials of `x` and `y`, their coefficients
//! polynomials in the hidden `z` (Li and Hartley, ICPR 2006; `w` beside it keeps them homogeneous, so that no root lies at
//! infinity):
//!
//! ```text
//! C(z, w) (x³, x²y, xy², y³, x², xy, y², x, y, 1)ᵀ = 0,   C = w³ C0 + w² z C1 + w z² C2 + z³ C3
//! ```
//!
//! `C(z, w)` is 10 × 10, its columns of degree 0, 0, 0, 0, 1, 1, 1, 2, 2 and 3. The first four are constant: eliminated once,
//! they leave a 6 × 6 matrix for the monomials `x², xy, y², x, y, 1`.

use nalgebra::ComplexField;

use crate::algebra::elimination;
use crate::algebra::monomials::position;
use crate::solver::shared::forms::{CUBIC, Cubic};

/// The exponents of `x` and `y` in the ten columns of `C`.
const COLUMNS: [[u8; 2]; 10] =
    [[3, 0], [2, 1], [1, 2], [0, 3], [2, 0], [1, 1], [0, 2], [1, 0], [0, 1], [0, 0]];

/// How many of the columns do not contain `z` nor `w`.
pub(crate) const CONSTANT: usize = 4;

/// The twenty coefficients of a cubic by rising powers of `z`: the columns of `C0` (all), `C1` (those from `x²` on), `C2` (from
/// `x` on) and `C3` (the last), as places in [`CUBIC`].
const BY_POWER: [usize; 20] = {
    let mut places = [0; 20];
    let (mut n, mut power) = (0, 0);
    while power <= 3 {
        let mut k = 0;
        while k < 10 {
            let [x, y] = COLUMNS[k];
            if x + y + power <= 3 {
                places[n] = position(&CUBIC, [x, y, power, 3 - x - y - power]);
                n += 1;
            }
            k += 1;
        }
        power += 1;
    }
    places
};

/// The cubics with their coefficients by rising powers of the hidden unknown.
pub(crate) fn by_power(cubics: &[Cubic; 10]) -> [[f64; 20]; 10] {
    cubics.map(|cubic| BY_POWER.map(|k| cubic[k]))
}

/// The six rows of the matrix polynomial from which the constant columns are eliminated.
pub(crate) struct Hidden {
    /// Six columns of `C0`, six of `C1`, three of `C2`, one of `C3`.
    rows: [[f64; 16]; 6],
}

impl Hidden {
    /// `None` where the constant columns are dependent.
    pub(crate) fn new(cubics: &[Cubic; 10]) -> Option<Self> {
        let mut a = by_power(cubics);
        elimination::eliminate(&mut a, CONSTANT).then(|| Self {
            rows: std::array::from_fn(|i| std::array::from_fn(|j| a[CONSTANT + i][CONSTANT + j])),
        })
    }

    /// From six rows that have been solved for the six columns of `C0`; `right` has the others.
    pub(crate) fn from_solved(right: &[[f64; 10]; 6]) -> Self {
        let entry = |i: usize, j: usize| if j < 6 { f64::from(u8::from(i == j)) } else { right[i][j - 6] };
        Self { rows: std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j))) }
    }

    /// The matrix at `(z, w)`, its columns `x², xy, y², x, y, 1`.
    #[inline]
    pub(crate) fn matrix<T: ComplexField<RealField = f64> + Copy>(&self, z: T, w: T) -> [[T; 6]; 6] {
        let (ww, wz, zz) = (w * w, w * z, z * z);
        let (www, wwz, wzz, zzz) = (ww * w, ww * z, w * zz, zz * z);
        self.rows.each_ref().map(|c| {
            let linear = |k: usize| w.scale(c[k]) + z.scale(c[6 + k]);
            let quadratic = |k: usize| ww.scale(c[3 + k]) + wz.scale(c[9 + k]) + zz.scale(c[12 + k]);
            let cubic = www.scale(c[5]) + wwz.scale(c[11]) + wzz.scale(c[14]) + zzz.scale(c[15]);
            [linear(0), linear(1), linear(2), quadratic(0), quadratic(1), cubic]
        })
    }

    /// `(x, y, z, w)` where the matrix is singular.
    pub(crate) fn point<T: ComplexField<RealField = f64> + Copy>(&self, z: T, w: T) -> Option<[T; 4]> {
        let [_, _, _, x, y, one] = elimination::null_vector(&mut self.matrix(z, w))?;
        Some([x, y, one * z, one * w])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::algebra::monomials::evaluate;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn rows_are_combinations_of_the_cubics() {
        // Random cubics, their constants chosen so that a planted point is a common zero.
        let mut rng = ChaCha8Rng::seed_from_u64(13);
        let v = [0.7, -0.4, 1.3, 0.6];
        let last = position(&CUBIC, [0, 0, 0, 3]);
        let cubics: [Cubic; 10] = std::array::from_fn(|_| {
            let mut cubic: Cubic = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
            cubic[last] -= evaluate(&CUBIC, &cubic, v) / v[3].powi(3);
            cubic
        });
        let hidden = Hidden::new(&cubics).unwrap();
        let [x, y, z, w] = v;
        let monomials = [x * x, x * y, y * y, x, y, 1.0];
        for row in hidden.matrix(z, w) {
            let sum: f64 = row.iter().zip(monomials).map(|(a, b)| a * b).sum();
            assert!(sum.abs() < 1e-12, "{sum:e}");
        }
        let found = hidden.point(z, w).unwrap();
        assert!((0..4).all(|k| (found[k] - v[k]).abs() < 1e-10), "{found:?}");
    }
}
