//! Every solution of a system of polynomial equations, by the relinearisation of section 4.2.
//!
//! Systems of any number of unknowns and any degrees, homogeneous or not, with at least as many equations as unknowns. The
//! method is that of
//!
//! K. Fathian, J. Jin, S.-G. Wee, D.-H. Lee, Y.-G. Kim, N. R. Gans, *Camera relative pose estimation for visual
//! servoing using quaternions*, Robotics and Autonomous Systems (2018), doi 10.1016/j.robot.2018.05.014, after
//! A. Kipnis, A. Shamir, *Cryptanalysis of the HFE public key cryptosystem by relinearization*, CRYPTO 1999,
//!
//! with its extension to systems that have more than one solution:
//!
//! 1. *Linearise.* The monomials of the degree of the system are unknowns `x` themselves: `C x = c`, whose solutions are
//!    `x = x_p + s_1 v_1 + … + s_n v_n`, (8).
//! 2. *Relinearise.* That monomials commute, `x_a x_b = x_c x_d` (11), gives equations in the products of `s`, which are
//!    linear in `y = (s_i s_j, s_i)`: `D̄ ȳ = 0` with `D̄ = [D −d]`, (14) to (17).
//! 3. `D̄` has as many null vectors as the system has solutions, complex ones, multiple ones and those at infinity counted:
//!    `ȳ = W r`, (19).
//! 4. Rows of `W` give `s = W_0 r` and `s_l s = W_l r`, (20) to (22). The matrices `W_l W_0†` commute, and the solutions are their
//!    common eigenvectors, (24), (25). Here those of a random combination, as one matrix alone may have an eigenvalue twice.
//! 5. Where one round leaves more solutions than it can tell apart, the next takes products of one more factor `s_i s_j s_k`,
//!    as Kipnis and Shamir do.
//! 6. *Polish.* Newton's iteration on the equations; not in the paper.
//!
//! The null space of `D̄` is computed without `D̄` (`moments.rs`): for the pose of five matches in 396 × 201 numbers
//! instead of 465 × 325.
//!
//! # Example 1 of the paper
//! With the two entries in their places that (4) exchanges in print: (1, −2) and (1, −1/2).
//! ```
//! use quest_core::polynomial_system::{Options, System, solve};
//!
//! let monomials = [[4, 0], [3, 1], [2, 2], [1, 3], [0, 4], [0, 0]];
//! let equations = [
//!     [2.0, 5.0, 6.0, 10.0, 4.0, 0.0],
//!     [2.0, 1.0, -2.0, 11.0, 6.0, 0.0],
//!     [5.0, 8.0, 1.0, 3.0, 2.0, -1.0],
//! ];
//! let system = System::new(2, equations.map(|c| c.into_iter().zip(monomials)))?;
//! let solutions = solve(&system, &Options::default())?;
//!
//! assert_eq!(solutions.report.d_bar, (6, 6));
//! assert_eq!(solutions.report.relinearized.nullity(), 2);
//! // q and −q, i q, −i q are solutions alike, and count as one: the one with q1 ≥ 0.
//! let found = solutions.real().map(|s| s.real());
//! let mut found: Vec<_> = found.map(|q| [q[0] * q[0].signum(), q[1] * q[0].signum()]).collect();
//! found.sort_by(|a, b| a[1].total_cmp(&b[1]));
//! assert_eq!(found.len(), 2);
//! for (q, expected) in found.iter().zip([[1.0, -2.0], [1.0, -0.5]]) {
//!     assert!((q[0] - expected[0]).abs() < 1e-12 && (q[1] - expected[1]).abs() < 1e-12, "{q:?}");
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Three quadrics
//! A sphere, an ellipsoid and a hyperboloid meet in eight points, complex ones counted.
//! ```
//! use quest_core::polynomial_system::{Options, System, solve};
//!
//! let squares = [[2, 0, 0], [0, 2, 0], [0, 0, 2], [1, 1, 0], [1, 0, 0], [0, 0, 0]];
//! let quadrics = [
//!     [1.0, 1.0, 1.0, 0.0, 0.0, -4.0],
//!     [1.0, 2.0, 3.0, 0.0, -1.0, -6.0],
//!     [1.0, 1.0, -1.0, 1.0, 0.0, -1.0],
//! ];
//! let system = System::new(3, quadrics.map(|c| c.into_iter().zip(squares)))?;
//! let solutions = solve(&system, &Options::default())?;
//!
//! let counted: usize = solutions.all.iter().map(|s| s.multiplicity).sum();
//! assert_eq!(counted + solutions.at_infinity, 8);
//! assert!(solutions.all.iter().all(|s| s.residual < 1e-12));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod error;
mod moments;
mod monomials;
mod newton;
mod rank;
mod rounds;
mod solution;
mod spectrum;
mod system;
#[cfg(test)]
mod tests;

pub use error::SolveError;
pub use rank::RankDecision;
pub use solution::{Report, Solution, Solutions};
pub use system::{Polynomial, System, SystemError};

use moments::{Functionals, multiples};
use monomials::{Grading, Table, binomial};
use rank::{Ranked, Rule};
use rounds::{Outcome, outcome};

/// How a system is solved; [`Options::default`] serves for exact coefficients.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Singular values above this part of the largest one never count as zero; below it a rank is decided at their largest drop.
    /// Default 1e-7.
    pub zero: f64,
    /// How many solutions there are, those at infinity counted. Where it is given no rank is decided, and the null space is
    /// that of the smallest singular values: for coefficients with noise, which leave an overdetermined system without
    /// solutions. Default `None`.
    pub solutions: Option<usize>,
    /// How many rounds of relinearisation there may be. Default 8.
    pub max_rounds: usize,
    /// How many monomials a round may have: time grows with the third power, one second for 700. Default 1,000.
    pub max_monomials: usize,
    /// The seed of the random combinations.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self { zero: 1e-7, solutions: None, max_rounds: 8, max_monomials: 1_000, seed: SEED }
    }
}

/// The seed of the random combinations of commuting matrices.
const SEED: u64 = 42;

/// Every solution of a system, real and complex.
///
/// Equations that contradict each other have no solutions: the list is empty.
///
/// # Errors
/// [`SolveError`] where the solutions are not isolated points, and wherever the list would not be complete: it is never a part
/// of the solutions.
pub fn solve(system: &System, options: &Options) -> Result<Solutions, SolveError> {
    let grading = Grading { unknowns: system.unknowns(), step: system.grading() };
    enough_equations(system, grading)?;
    let degree = system.degree().next_multiple_of(grading.rise());
    let (mut degrees, mut nullities, mut curves) = (Vec::new(), Vec::new(), 0);
    let mut left = None;
    for round in 1..=options.max_rounds {
        let highest = (round + 1) * degree;
        let monomials = grading.count(highest);
        if monomials > options.max_monomials || highest > usize::from(u8::MAX) {
            left = left.or(Some(SolveError::TooLarge { monomials, limit: options.max_monomials }));
            break;
        }
        let (functionals, relinearized) = Functionals::of_system(system, grading, highest, options)?;
        degrees.push(highest);
        nullities.push(functionals.count());
        match outcome(system, &functionals, options)? {
            Outcome::Found { all, at_infinity, w_0 } => {
                let report = Report {
                    unknowns: grading.unknowns,
                    degree,
                    grading: grading.step,
                    linearized: linearized(system, grading, degree, options)?,
                    rounds: round,
                    d_bar: d_bar(system, grading, degree, round, options)?,
                    relinearized,
                    w_0,
                };
                return Ok(Solutions { all: sorted(all), at_infinity, report });
            }
            Outcome::NotToldApart { told_apart, full_rank } => {
                let found = functionals.count();
                left =
                    Some(SolveError::TooManySolutions { rounds: round, degree: highest, found, told_apart });
                curves += usize::from(!full_rank && highest > highest_of_points(grading, degree));
            }
        }
        // Once more, as a curve at infinity may leave the points that are not at the next degree.
        if curves > 1 {
            return Err(SolveError::NotZeroDimensional { degrees, nullities });
        }
    }
    Err(match left {
        Some(SolveError::TooManySolutions { .. }) if curves > 0 => {
            SolveError::NotZeroDimensional { degrees, nullities }
        }
        Some(error) => error,
        None => SolveError::TooManySolutions { rounds: 0, degree, found: 0, told_apart: 0 },
    })
}

/// Points need as many equations as there are unknowns.
fn enough_equations(system: &System, grading: Grading) -> Result<(), SolveError> {
    let homogeneous = grading.step == 0;
    let unknowns = grading.unknowns - usize::from(homogeneous);
    let equations = system.equations().len();
    if equations < unknowns {
        return Err(SolveError::NotOverdetermined { equations, unknowns, homogeneous });
    }
    Ok(())
}

/// The degree from which on as many functionals as there are points vanish on equations that only points satisfy, those at
/// infinity included: Macaulay's bound, in homogeneous coordinates.
fn highest_of_points(grading: Grading, degree: usize) -> usize {
    let unknowns = grading.unknowns - usize::from(grading.step == 0);
    unknowns * (degree - 1) + 1 + grading.rise()
}

/// `[C −c]`: the equations with the multiples of those of lower degree, over all monomials.
fn linearized(
    system: &System,
    grading: Grading,
    degree: usize,
    options: &Options,
) -> Result<RankDecision, SolveError> {
    let table = Table::new(grading, degree);
    let c = multiples(system, grading, &table, degree);
    Ok(Ranked::new(c.as_ref(), Rule::drop_below(options.zero))?.decision)
}

/// The rows and columns of `D̄` in a round: the relations between products of `round + 1` monomials, and the products of as many
/// directions.
fn d_bar(
    system: &System,
    grading: Grading,
    degree: usize,
    round: usize,
    options: &Options,
) -> Result<(usize, usize), SolveError> {
    let multisets = |n: usize| if n == 0 { 0 } else { binomial(n + round, round + 1) };
    let directions = linearized(system, grading, degree, options)?.nullity();
    let products = multisets(grading.count(degree));
    Ok((products.saturating_sub(grading.count((round + 1) * degree)), multisets(directions)))
}

/// The real ones first, then by the unknowns.
fn sorted(mut all: Vec<Solution>) -> Vec<Solution> {
    all.sort_by(|a, b| {
        let unknowns = || {
            let pairs = a.x.iter().zip(&b.x);
            pairs.map(|(a, b)| a.re.total_cmp(&b.re).then(a.im.total_cmp(&b.im)))
        };
        let by_unknowns = unknowns().find(|order| order.is_ne()).unwrap_or(std::cmp::Ordering::Equal);
        b.is_real().cmp(&a.is_real()).then(by_unknowns)
    });
    all
}
