//! `li-hartley`: the five-point method by the resultant of a hidden variable, as published in
//!
//! H. Li, R. Hartley, *Five-point motion estimation made easy*, 18th International Conference on Pattern Recognition (ICPR)
//! 2006, volume 1, pages 630–633, doi 10.1109/ICPR.2006.579.
//!
//! **Problem.** The essential matrices, real and complex, and from them the motions, of five matches.
//!
//! **Steps**:
//! 1. The null space `E = x X + y Y + z Z + w W` of the five epipolar constraints.
//! 2. The ten cubics of the trace constraint and the determinant, with `z` hidden: `C(z)` times the ten monomials of `x` and
//!    `y` is zero, so that `det C(z) = 0`. Four columns of `C` are constant and are eliminated once; the determinant of the
//!    6 × 6 matrix that is left is the same up to a factor (`hidden_variable.rs`).
//! 3. The determinant is a polynomial of degree ten. It is evaluated, not expanded: at eleven directions `(z : w)`, evenly
//!    around the circle, from which the coefficients follow by a discrete Fourier transform.
//! 4. Its real roots by Sturm's theorem, its complex ones by Laguerre's method. The authors use a companion matrix.
//! 5. `x` and `y` from the null vector of the matrix at the root.
//! 6. Two rotations and a translation of each essential matrix. Of a complex pair the real parts of both rotations are
//!    kept, with the translation that fits best, as [`FromComplex`](crate::CandidateKind::FromComplex).
//!
//! Not in the paper: the last digits by Newton's iteration, also from a complex pair that is nearly real, and another basis of
//! the null space where a first or last coefficient is small (`five_point.rs`, which also says what becomes of more than
//! five matches).
//!
//! **Degenerate**: fewer than five independent constraints (all points on a line, repeated points); an exact pure
//! rotation. As the parallax vanishes the ten solutions run together: at a parallax of 0.001 one true rotation in a thousand is
//! lost, of the published methods here the fewest.
//!
//! **Solutions**: ten essential matrices, counting complex ones, a conjugate pair of which gives two candidates and a real
//! one two: at most twenty.

use nalgebra::Complex;

use crate::algebra::elimination;
use crate::algebra::polynomial::{complex_roots, real_roots};
use crate::solver::published::five_point;
use crate::solver::published::hidden_variable::Hidden;
use crate::solver::published::trace_cubics::trace_cubics;
use crate::solver::{Kinds, PoseSolver};
use crate::{Candidates, Correspondence};

/// The five-point method of Li and Hartley; its steps stand at the head of the module.
#[derive(Clone, Copy, Debug, Default)]
pub struct LiHartley {
    /// Which candidates are returned.
    pub kinds: Kinds,
}

impl PoseSolver for LiHartley {
    const NAME: &'static str = "li-hartley";
    const MIN_MATCHES: usize = five_point::MIN_MATCHES;

    fn solve(&self, matches: &[Correspondence], out: &mut Candidates) {
        five_point::solve(self.kinds, matches, out, |solutions| {
            let Some(hidden) = Hidden::new(&trace_cubics(&solutions.basis)) else { return false };
            let polynomial = determinant(&hidden);
            let real = real_roots(&polynomial);
            for &z in real.as_slice() {
                hidden.point(z, 1.0).inspect(|point| solutions.push_real(point));
            }
            solutions.doubtful = real.close || !real.certain || is_lopsided(&polynomial);
            let mut complex = [Complex::from(0.0); 11];
            let count = complex_roots(&polynomial, real.as_slice(), &mut complex);
            for &z in &complex[..count] {
                solutions.push_conjugates(z, || hidden.point(z, Complex::from(1.0)));
            }
            true
        });
    }
}

/// Whether roots crowd at zero or far out: the Fourier transform gives every coefficient the same absolute error, which is then
/// a large one for the first or the last.
fn is_lopsided(polynomial: &[f64; 11]) -> bool {
    let largest = polynomial.iter().fold(0.0_f64, |largest, c| largest.max(c.abs()));
    polynomial[0].abs().min(polynomial[10].abs()) < LOPSIDED * largest
}

/// Eight digits of the smallest coefficient are left.
const LOPSIDED: f64 = 1e-7;

/// The determinant as a polynomial in `z`, coefficients from the constant up.
fn determinant(hidden: &Hidden) -> [f64; 11] {
    let values = UNIT_ROOTS.map(|[w, z]| elimination::determinant(&mut hidden.matrix(z, w)));
    let mut polynomial = [0.0; 11];
    for (column, value) in INTERPOLATION.iter().zip(values) {
        for (coefficient, weight) in polynomial.iter_mut().zip(column) {
            *coefficient += weight * value;
        }
    }
    polynomial
}

/// The eleventh roots of unity, `(cos, sin)` of `2πj / 11`.
const UNIT_ROOTS: [[f64; 2]; 11] = {
    let upper = [
        [0.841_253_532_831_181_2, 0.540_640_817_455_597_6],
        [0.415_415_013_001_886_44, 0.909_631_995_354_518_4],
        [-0.142_314_838_273_285_14, 0.989_821_441_880_932_7],
        [-0.654_860_733_945_285_1, 0.755_749_574_354_258_3],
        [-0.959_492_973_614_497_4, 0.281_732_556_841_429_67],
    ];
    let mut roots = [[1.0, 0.0]; 11];
    let mut j = 1;
    while j <= 5 {
        let [cos, sin] = upper[j - 1];
        roots[j] = [cos, sin];
        roots[11 - j] = [cos, -sin];
        j += 1;
    }
    roots
};

/// `INTERPOLATION[j][k]`: how the value in direction `j` counts for the coefficient of `z^k`.
///
/// On the circle `(w, z) = (cos θ, sin θ)` a form of degree ten is a sum of `e^(2imθ)`, `|m| ≤ 5`. Eleven values give these
/// by a discrete Fourier transform, and `e^(2imθ) = (w + iz)^(2m) (w² + z²)^(5−m)` for `m ≥ 0`, the conjugate for the others.
const INTERPOLATION: [[f64; 11]; 11] = {
    let mut table = [[0.0; 11]; 11];
    let mut m = 0;
    while m <= 5 {
        // (w + iz)^(2m) (w² + z²)^(5−m), real and imaginary parts.
        let (mut re, mut im) = ([0.0; 11], [0.0; 11]);
        re[0] = 1.0;
        let mut factor = 0;
        while factor < 5 {
            let (mut next_re, mut next_im) = (re, im);
            let mut k = 0;
            while k + 2 < 11 {
                // (w + iz)² = w² + 2i wz − z².
                let square = if factor < m { -1.0 } else { 1.0 };
                next_re[k + 2] += square * re[k];
                next_im[k + 2] += square * im[k];
                k += 1;
            }
            k = 0;
            while factor < m && k + 1 < 11 {
                next_re[k + 1] -= 2.0 * im[k];
                next_im[k + 1] += 2.0 * re[k];
                k += 1;
            }
            (re, im) = (next_re, next_im);
            factor += 1;
        }
        let share = if m == 0 { 1.0 / 11.0 } else { 2.0 / 11.0 };
        let mut j = 0;
        while j < 11 {
            // Re(e^(−2imθ) · form), the frequencies m and −m together.
            let [cos, sin] = UNIT_ROOTS[2 * m * j % 11];
            let mut k = 0;
            while k < 11 {
                table[j][k] += share * (cos * re[k] + sin * im[k]);
                k += 1;
            }
            j += 1;
        }
        m += 1;
    }
    table
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::published::trace_cubics::Basis;

    #[test]
    fn interpolation_reproduces_every_form_of_degree_ten() {
        for (k, power) in (0..11).enumerate() {
            // The form w^(10−k) z^k.
            let values = UNIT_ROOTS.map(|[w, z]| w.powi(10 - power) * z.powi(power));
            for l in 0..11_usize {
                let found: f64 = INTERPOLATION.iter().zip(values).map(|(weights, x)| weights[l] * x).sum();
                // The coefficients of (w + iz)^10 are up to 252.
                assert!((found - f64::from(u8::from(k == l))).abs() < 1e-12, "{k} {l}: {found}");
            }
        }
    }

    #[test]
    fn determinant_is_that_of_the_matrix_everywhere() {
        let basis: Basis =
            std::array::from_fn(|m| std::array::from_fn(|k| ((3 * m + 7 * k) as f64 * 1.3 + 0.2).sin()));
        let hidden = Hidden::new(&trace_cubics(&basis)).unwrap();
        let polynomial = determinant(&hidden);
        let scale = polynomial.iter().fold(0.0_f64, |largest, c| largest.max(c.abs()));
        for z in [-1.7, -0.3, 0.2, 0.9, 2.5] {
            let value = polynomial.iter().rev().fold(0.0, |sum, c| sum * z + c);
            let expected = elimination::determinant(&mut hidden.matrix(z, 1.0));
            assert!((value - expected).abs() < 1e-12 * scale * (1.0 + z.abs()).powi(10));
        }
    }
}
