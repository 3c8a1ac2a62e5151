//! What is found of a system, and how.

use faer::c64;

use super::rank::RankDecision;

/// One solution of a system.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// The values of the unknowns. In a homogeneous system of norm 1 with the largest one real and positive; in a system
    /// whose solutions may be multiplied by a root of unity, with the largest one real and positive where that can be.
    pub x: Vec<c64>,
    /// The largest [`Polynomial::relative_residual`](super::Polynomial::relative_residual) of an equation.
    pub residual: f64,
    /// How many solutions run together here: 1 for a simple one.
    pub multiplicity: usize,
}

/// An imaginary part below this, relative to the size of the solution, is rounding: polished simple solutions have
/// 1e-12 or less, those that nearly run together with another 1e-8.
const REAL: f64 = 1e-7;

impl Solution {
    /// Whether all unknowns are real, to rounding.
    #[must_use]
    pub fn is_real(&self) -> bool {
        let size = self.x.iter().map(|x| x.norm()).fold(1.0, f64::max);
        self.x.iter().all(|x| x.im.abs() <= REAL * size)
    }

    /// The real parts of the unknowns.
    #[must_use]
    pub fn real(&self) -> Vec<f64> {
        self.x.iter().map(|x| x.re).collect()
    }
}

/// Every solution of a system, with how the number of them was decided.
#[derive(Clone, Debug)]
pub struct Solutions {
    /// The solutions, those that run together once: the real ones first. Empty where the equations contradict each
    /// other.
    pub all: Vec<Solution>,
    /// How many solutions lie at infinity and are left out, counted with multiplicity.
    pub at_infinity: usize,
    /// The sizes and ranks on the way.
    pub report: Report,
}

impl Solutions {
    /// The real solutions.
    pub fn real(&self) -> impl Iterator<Item = &Solution> {
        self.all.iter().filter(|solution| solution.is_real())
    }
}

/// The sizes of the matrices of section 4.2, their ranks, and the singular values that decided on these.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// The unknowns.
    pub unknowns: usize,
    /// `d`, the degree of the monomials that are unknowns of the linear system.
    pub degree: usize,
    /// `g`: solutions times a `g`-th root of unity are solutions, of which one is returned. 1 in general, 0 in a homogeneous
    /// system, whose solutions may be multiplied by anything.
    pub grading: usize,
    /// `[C −c]` of (6), its last column left out where the system is homogeneous. The nullity is the number of
    /// directions: of the `v_i` of (8) and one for `x_p`.
    pub linearized: RankDecision,
    /// How many rounds of relinearisation there were; each takes products of one more factor `s_i`.
    pub rounds: usize,
    /// The rows and columns of `D̄` of (16) in the last round.
    pub d_bar: (usize, usize),
    /// The matrix that has the null space of `D̄`: the equations times monomials. Its nullity is the number of solutions,
    /// those at infinity and multiple ones counted.
    pub relinearized: RankDecision,
    /// `W_0` of (20).
    pub w_0: RankDecision,
}
