//! `stewenius`: the five-point method by the eigenvalues of an action matrix, as published in
//!
//! H. Stewénius, C. Engels, D. Nistér, *Recent developments on direct relative orientation*, ISPRS Journal of
//! Photogrammetry and Remote Sensing 60(4), 2006, pages 284–294, doi 10.1016/j.isprsjprs.2006.03.005.
//!
//! **Problem.** The essential matrices, real and complex, and from them the motions, of five matches.
//!
//! **Steps**, with the paper's sections:
//! 1. The null space `E = x X + y Y + z Z + w W` of the five epipolar constraints, `w = 1` (4.1).
//! 2. The ten cubics of the trace constraint and the determinant, a 10 × 20 matrix over the monomials in graded order: ten
//!    of degree three ahead of ten lower ones. Gauss–Jordan elimination gives the first ten by the others (4.2).
//! 3. The lower ones are a basis modulo the cubics; multiplication by one unknown, in this basis, is the 10 × 10 action
//!    matrix. The paper multiplies by `x`, this by `z`, so that the rows of `x³, x²y, xy², y³` are not needed (4.3).
//! 4. Its eigenvalues are `z` at the ten solutions. The eigenvectors are the monomials there (4.3): of each, what is not a
//!    known multiple is the null vector of six equations in `x², xy, y², x, y, 1`.
//! 5. Two rotations and a translation of each essential matrix. Of a complex pair the real parts of both rotations are
//!    kept, with the translation that fits best, as [`FromComplex`](crate::CandidateKind::FromComplex).
//!
//! Not in the paper: the last digits by Newton's iteration, also from a complex pair that is nearly real (`five_point.rs`,
//! which also says what becomes of more than five matches).
//!
//! **Degenerate**: fewer than five independent constraints (all points on a line, repeated points); an exact pure
//! rotation. As the parallax vanishes the ten solutions run together: at a parallax of 0.001 one true rotation in 150 is
//! lost.
//!
//! **Solutions**: ten essential matrices, counting complex ones, a conjugate pair of which gives two candidates and a real
//! one two: at most twenty.

use nalgebra::ComplexField;

use crate::algebra::eigenvalues::eigenvalues;
use crate::algebra::elimination;
use crate::algebra::monomials::{homogeneous, position, sum};
use crate::solver::published::five_point;
use crate::solver::published::trace_cubics::trace_cubics;
use crate::solver::shared::forms::{CUBIC, Cubic};
use crate::solver::{Kinds, PoseSolver};
use crate::{Candidates, Correspondence};

/// The five-point method of Stewénius, Engels and Nistér; its steps stand at the head of the module.
#[derive(Clone, Copy, Debug, Default)]
pub struct Stewenius {
    /// Which candidates are returned.
    pub kinds: Kinds,
}

impl PoseSolver for Stewenius {
    const NAME: &'static str = "stewenius";
    const MIN_MATCHES: usize = five_point::MIN_MATCHES;

    fn solve(&self, matches: &[Correspondence], out: &mut Candidates) {
        five_point::solve(self.kinds, matches, out, |solutions| {
            let Some(action) = Action::new(&trace_cubics(&solutions.basis)) else { return false };
            let Some(values) = eigenvalues(&mut action.matrix()) else { return false };
            for value in values {
                if value.im == 0.0 {
                    action.point(value.re).inspect(|point| solutions.push_real(point));
                } else if value.im > 0.0 {
                    solutions.push_conjugates(value, || action.point(value));
                }
            }
            true
        });
    }
}

/// The monomials in graded order, those of degree three in `x, y, z` by rising powers of `z`, as exponents of
/// `(x, y, z, w)`.
const GRADED: [[u8; 4]; 20] = {
    let mut leading = [[0; 4]; 10];
    let (mut n, mut power) = (0, 0);
    while power <= 3 {
        let mut k = 0;
        while k < 20 {
            if CUBIC[k][2] == power && CUBIC[k][3] == 0 {
                leading[n] = CUBIC[k];
                n += 1;
            }
            k += 1;
        }
        power += 1;
    }
    let lower = homogeneous::<10>(2);
    let mut graded = [[0; 4]; 20];
    let mut k = 0;
    while k < 10 {
        graded[k] = leading[k];
        graded[10 + k] = sum(lower[k], [0, 0, 0, 1]);
        k += 1;
    }
    graded
};

/// How many of the leading monomials do not contain `z`: their rows are not needed.
const WITHOUT_Z: usize = 4;

/// Where multiplication by `z` takes each monomial of the basis, as a position in [`GRADED`].
const TIMES_Z: [usize; 10] = {
    let mut table = [0; 10];
    let mut k = 0;
    while k < 10 {
        let [a, b, c, d] = GRADED[10 + k];
        table[k] = position(&GRADED, [a, b, c + 1, d - 1]);
        k += 1;
    }
    table
};

/// The monomials in `x` and `y` of the null vector, the constant last, by the exponents of both.
const TAIL: [[u8; 2]; 6] = [[2, 0], [1, 1], [0, 2], [1, 0], [0, 1], [0, 0]];

/// Which of [`TAIL`] a monomial contains.
const fn tail(monomial: [u8; 4]) -> usize {
    let mut k = 0;
    while TAIL[k][0] != monomial[0] || TAIL[k][1] != monomial[1] {
        k += 1;
    }
    k
}

/// The six leading monomials with `z` by the basis: multiplication by `z` modulo the cubics.
struct Action {
    reduced: [[f64; 10]; 6],
}

impl Action {
    /// `None` where the cubics are dependent.
    fn new(cubics: &[Cubic; 10]) -> Option<Self> {
        const COLUMNS: [usize; 20] = {
            let mut columns = [0; 20];
            let mut k = 0;
            while k < 20 {
                columns[k] = position(&CUBIC, GRADED[k]);
                k += 1;
            }
            columns
        };
        let mut a = cubics.map(|cubic| COLUMNS.map(|k| cubic[k]));
        let pivot = elimination::reduce(&mut a, WITHOUT_Z);
        let row = |k: usize| std::array::from_fn(|j| -a[WITHOUT_Z + k][10 + j]);
        (pivot > 0.0).then(|| Self { reduced: std::array::from_fn(row) })
    }

    /// The row of a leading monomial.
    fn row(&self, leading: usize) -> &[f64; 10] {
        &self.reduced[leading - WITHOUT_Z]
    }

    fn matrix(&self) -> [[f64; 10]; 10] {
        TIMES_Z.map(|target| {
            if target < 10 {
                *self.row(target)
            } else {
                std::array::from_fn(|j| f64::from(u8::from(j == target - 10)))
            }
        })
    }

    /// `(x, y, z, 1)` at an eigenvalue.
    fn point<T: ComplexField<RealField = f64> + Copy>(&self, z: T) -> Option<[T; 4]> {
        let powers = [T::one(), z, z * z, z * z * z];
        let mut a = [[T::zero(); 6]; 6];
        for (leading, row) in (WITHOUT_Z..10).zip(&mut a) {
            for (j, coefficient) in self.row(leading).iter().enumerate() {
                let monomial = GRADED[10 + j];
                row[tail(monomial)] -= powers[usize::from(monomial[2])].scale(*coefficient);
            }
            let monomial = GRADED[leading];
            row[tail(monomial)] += powers[usize::from(monomial[2])];
        }
        let [_, _, _, x, y, one] = elimination::null_vector(&mut a)?;
        Some([x, y, z, one])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::published::trace_cubics::Basis;
    use nalgebra::Complex;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn every_eigenvalue_is_a_common_zero_of_the_cubics() {
        let mut rng = ChaCha8Rng::seed_from_u64(10);
        let basis: Basis = std::array::from_fn(|_| std::array::from_fn(|_| rng.random_range(-1.0..1.0)));
        let cubics = trace_cubics(&basis);
        let action = Action::new(&cubics).unwrap();
        for value in eigenvalues(&mut action.matrix()).unwrap() {
            let point = action.point(value).unwrap();
            let size = point.iter().map(|x| x.modulus()).fold(0.0, f64::max);
            for cubic in &cubics {
                let term = |(e, c): (&[u8; 4], &f64)| {
                    (0..4).map(|k| point[k].powu(e[k].into())).product::<Complex<f64>>() * *c
                };
                let sum: Complex<f64> = CUBIC.iter().zip(cubic).map(term).sum();
                assert!(sum.norm() < 1e-10 * size.powi(3), "{value}: {:e}", sum.norm());
            }
        }
    }
}
