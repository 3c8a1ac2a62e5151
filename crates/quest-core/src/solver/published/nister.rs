//! `nister`: the five-point method, as published in
//!
//! D. Nistér, *An efficient solution to the five-point relative pose problem*, IEEE Transactions on Pattern Analysis and
//! Machine Intelligence 26(6), 2004, pages 756–770, doi 10.1109/TPAMI.2004.17.
//!
//! **Problem.** The essential matrices, and from them the motions, of five matches.
//!
//! **Steps**, with the paper's sections:
//! 1. The null space `E = x X + y Y + z Z + w W` of the five epipolar constraints, by orthogonal factorisation (3.1).
//! 2. With `w = 1` nine cubics from the trace constraint and one from the determinant, a 10 × 20 matrix, reduced by
//!    Gauss–Jordan elimination with partial pivoting (3.2). The rows led by `x³, y³, x²y, xy²` are not needed, nor
//!    the columns to the left of the last ten.
//! 3. Three combinations `⟨k⟩ = ⟨e⟩ − z⟨f⟩` of the others are linear in `x` and `y`: a 3 × 3 matrix of polynomials in `z`,
//!    whose determinant has degree ten (3.2.1).
//! 4. Its real roots by Sturm's theorem; bisection isolates them, and here a safeguarded Newton iteration refines each in
//!    place of thirty more bisections (3.2.4).
//! 5. `x` and `y` from the null vector of the 3 × 3 matrix, so that `w = 0` is no exception.
//! 6. Two rotations and a translation of each essential matrix (3.2.2, without its singular value decomposition), of
//!    which the one with most points in front comes first (3.2.3).
//!
//! Complex roots are dropped. Every candidate is [`Exact`](crate::CandidateKind::Exact).
//!
//! Not in the paper: the last digits by Newton's iteration, and another basis of the null space where roots are too close to
//! tell whether they are real (`five_point.rs`, which also says what becomes of more than five matches). Without
//! these, one true rotation in a thousand is off by more than 1e-6 rad in scenes without noise; with them one in 100,000.
//!
//! **Degenerate**: fewer than five independent constraints (all points on a line, repeated points); an exact pure
//! rotation. As the parallax vanishes the ten solutions run together: at a parallax of 0.01 one true rotation in a hundred is
//! lost, at 0.001 one in eleven, which is what [`quest`](crate::solver::quest) is for.
//!
//! **Solutions**: at most ten essential matrices, twenty motions.

use crate::algebra::polynomial::real_roots;
use crate::solver::published::five_point;
use crate::solver::published::trace_cubics::trace_cubics;
use crate::solver::shared::resultant::Resultant;
use crate::solver::{Kinds, PoseSolver};
use crate::{Candidates, Correspondence};

/// Nistér's five-point method; its steps stand at the head of the module.
#[derive(Clone, Copy, Debug, Default)]
pub struct Nister;

impl PoseSolver for Nister {
    const NAME: &'static str = "nister";
    const MIN_MATCHES: usize = five_point::MIN_MATCHES;

    fn solve(&self, matches: &[Correspondence], out: &mut Candidates) {
        five_point::solve(Kinds::Exact, matches, out, |solutions| {
            let (resultant, pivot) = Resultant::new(&mut trace_cubics(&solutions.basis));
            let roots = real_roots(&resultant.polynomial());
            for &z in roots.as_slice() {
                solutions.push_real(&resultant.point(z));
            }
            solutions.doubtful = roots.close || !roots.certain;
            pivot > 0.0
        });
    }
}
