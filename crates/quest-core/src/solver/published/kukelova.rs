//! `kukelova`: the five-point method as a polynomial eigenvalue problem, as published in
//!
//! Z. Kukelova, M. Bujnak, T. Pajdla, *Polynomial eigenvalue solutions to minimal problems in computer vision*, IEEE
//! Transactions on Pattern Analysis and Machine Intelligence 34(7), 2012, pages 1381–1393, doi 10.1109/TPAMI.2011.230.
//!
//! **Problem.** The essential matrices, real and complex, and from them the motions, of five matches.
//!
//! **Steps**:
//! 1. The null space `E = x X + y Y + z Z + w W` of the five epipolar constraints, `w = 1`.
//! 2. The ten cubics of the trace constraint and the determinant, with `z` hidden, are a cubic eigenvalue problem
//!    `(C0 + z C1 + z² C2 + z³ C3) v = 0` in the monomials `v` of `x` and `y` (`hidden_variable.rs`).
//! 3. `C3` is singular, so the problem is reversed: `α = 1/z`, `(α³ C0 + α² C1 + α C2 + C3) v = 0`, and multiplied by the
//!    inverse of `C0`. Linearised, `α (v, αv, α²v)` is a 30 × 30 matrix times `(v, αv, α²v)`.
//! 4. Six of the ten columns of `C1` are not zero, three of `C2` and one of `C3`. The other twenty columns of the 30 × 30 matrix
//!    are zero. They give twenty zero eigenvalues, which are no solutions. Without them and their rows a 10 × 10 matrix is left.
//! 5. Its eigenvalues are `α` at the ten solutions. `x` and `y` are the null vector of six of the equations there.
//! 6. Each essential matrix gives two rotations and a translation. A complex pair gives the real parts of both rotations,
//!    with the translation that fits best, as [`FromComplex`](crate::CandidateKind::FromComplex).
//!
//! The 10 × 10 matrix multiplies by `1/z` modulo the cubics: it is the action matrix of [`stewenius`](crate::solver::published::stewenius) with `z` and
//! `w` exchanged, found without a Gröbner basis.
//!
//! Not in the paper: the last digits by Newton's iteration, also from a complex pair that is nearly real (`five_point.rs`,
//! which also says what becomes of more than five matches).
//!
//! **Degenerate**: fewer than five independent constraints (all points on a line, repeated points); an exact pure
//! rotation. As the parallax vanishes the ten solutions run together: at a parallax of 0.001 one true rotation in 200 is
//! lost.
//!
//! **Solutions**: ten essential matrices, counting complex ones, a conjugate pair of which gives two candidates and a real
//! one two: at most twenty.

use nalgebra::Complex;

use crate::algebra::eigenvalues::eigenvalues;
use crate::algebra::elimination;
use crate::solver::published::five_point;
use crate::solver::published::hidden_variable::{CONSTANT, Hidden, by_power};
use crate::solver::published::trace_cubics::trace_cubics;
use crate::solver::{Kinds, PoseSolver};
use crate::{Candidates, Correspondence};

/// The five-point method of Kukelova, Bujnak and Pajdla; its steps stand at the head of the module.
#[derive(Clone, Copy, Debug, Default)]
pub struct Kukelova {
    /// Which candidates are returned.
    pub kinds: Kinds,
}

impl PoseSolver for Kukelova {
    const NAME: &'static str = "kukelova";
    const MIN_MATCHES: usize = five_point::MIN_MATCHES;

    fn solve(&self, matches: &[Correspondence], out: &mut Candidates) {
        five_point::solve(self.kinds, matches, out, |solutions| {
            let mut a = by_power(&trace_cubics(&solutions.basis));
            if elimination::reduce(&mut a, CONSTANT) == 0.0 {
                return false;
            }
            let right = std::array::from_fn(|i| std::array::from_fn(|j| a[CONSTANT + i][10 + j]));
            let Some(values) = eigenvalues(&mut linearised(&right)) else { return false };
            let hidden = Hidden::from_solved(&right);
            for alpha in values {
                if alpha.im == 0.0 {
                    hidden.point(1.0, alpha.re).inspect(|point| solutions.push_real(point));
                } else if alpha.im > 0.0 {
                    solutions.push_conjugates(alpha, || hidden.point(Complex::from(1.0), alpha));
                }
            }
            true
        });
    }
}

/// The 10 × 10 matrix of the linearised problem on six entries of `α²v` (`x², xy, y², x, y, 1`), three of `αv` (`x, y, 1`)
/// and one of `v` (`1`), given the columns of `C0⁻¹ C1`, `C0⁻¹ C2` and `C0⁻¹ C3` that are not zero.
fn linearised(right: &[[f64; 10]; 6]) -> [[f64; 10]; 10] {
    let unit = |k: usize| std::array::from_fn(|j| f64::from(u8::from(j == k)));
    // α · αv are entries 3, 4, 5; α · v is entry 8.
    let mut matrix = [
        [0.0; 10],
        [0.0; 10],
        [0.0; 10],
        [0.0; 10],
        [0.0; 10],
        [0.0; 10],
        unit(3),
        unit(4),
        unit(5),
        unit(8),
    ];
    for (row, given) in matrix.iter_mut().zip(right) {
        *row = given.map(|x| -x);
    }
    matrix
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::published::trace_cubics::Basis;
    use crate::solver::shared::forms::CUBIC;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn every_eigenvalue_is_a_common_zero_of_the_cubics() {
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        let basis: Basis = std::array::from_fn(|_| std::array::from_fn(|_| rng.random_range(-1.0..1.0)));
        let cubics = trace_cubics(&basis);
        let mut a = by_power(&cubics);
        assert!(elimination::reduce(&mut a, CONSTANT) > 0.0);
        let right = std::array::from_fn(|i| std::array::from_fn(|j| a[CONSTANT + i][10 + j]));
        let hidden = Hidden::from_solved(&right);
        for alpha in eigenvalues(&mut linearised(&right)).unwrap() {
            let point = hidden.point(Complex::from(1.0), alpha).unwrap();
            let size = point.iter().map(|x| x.norm()).fold(0.0, f64::max);
            for cubic in &cubics {
                let term = |(e, c): (&[u8; 4], &f64)| {
                    (0..4).map(|k| point[k].powu(e[k].into())).product::<Complex<f64>>() * *c
                };
                let sum: Complex<f64> = CUBIC.iter().zip(cubic).map(term).sum();
                assert!(sum.norm() < 1e-10 * size.powi(3), "{alpha}: {:e}", sum.norm());
            }
        }
    }
}
