//! `quest`: the default solver, right at every parallax.
//!
//! **Problem.** Rotation, translation and depths from five or more matches, also where the translation is so small against
//! the depths that the essential matrix, divided by its own norm, no longer holds the rotation.
//!
//! **Steps** for five matches:
//! 1. The rotation `R0` that best aligns the bearings, and the parallax `p` that it leaves (`aligned.rs`). With none
//!    left the motion is a pure rotation.
//! 2. The null space of the five rows `[n/p, sym(b cᵀ)]`: the essential matrix is `[t]× + p S`, `S` symmetric.
//! 3. Ten cubics without the factor `p`, a polynomial of degree ten, its real roots by Sturm's theorem
//!    (`cubics.rs`, `resultant.rs`).
//! 4. Each root gives an essential matrix, two rotations and a translation; Newton's iteration on the five
//!    parameters of the motion brings the constraints to zero, which it knows to twice the digits (`split.rs`).
//! 5. A complex pair of roots gives two complex quaternions: their real parts. Under noise the true pose often hides there.
//! 6. Translation and depths with one scale: [`structure`](crate::structure).
//!
//! For more matches the null space is that of all rows in the least-squares sense, and every solution is refined over
//! all matches. Where none fits, the motion on which most matches agree is added (`consensus.rs`).
//!
//! **Degenerate**: fewer than five independent constraints (all points on a line, repeated points).
//! **Solutions**: at most ten essential matrices, twenty rotations, and the rotation-only candidate.
//!
//! The parallax-safe form is this project's; the elimination to degree ten is Nistér's (PAMI 2004).

use nalgebra::Complex;

use super::aligned::{Alignment, Coordinates};
use super::cubics::{combine, ten_cubics};
use super::essential::{decomposed, real_part, twisted};
use super::gram::Gram;
use super::motion::Motion;
use super::resultant::Resultant;
use super::shortlist::Shortlist;
use super::two_motions::{TwoMotions, after, apart, normalized};
use super::{Kinds, PoseSolver, refining};
use crate::algebra::number::TwoComplex;
use crate::algebra::polynomial::{RealRoots, complex_roots, real_roots};
use crate::algebra::two::{Two, TwoQuaternions};
use crate::{CandidateKind, Candidates, Correspondence, Degeneracy};

/// The default solver; its steps stand at the head of the module.
#[derive(Clone, Copy, Debug, Default)]
pub struct Quest {
    /// Which candidates are returned.
    pub kinds: Kinds,
}

impl PoseSolver for Quest {
    const NAME: &'static str = "quest";
    const MIN_MATCHES: usize = refining::MIN_MATCHES;

    fn solve(&self, matches: &[Correspondence], out: &mut Candidates) {
        refining::solve(self.kinds, matches, out, from_five, starts);
    }
}

/// Adds the solutions of five matches.
fn from_five(
    kinds: Kinds,
    alignment: &Alignment,
    matches: &[Correspondence; 5],
    shortlist: &mut Shortlist,
) -> Result<(), Degeneracy> {
    let mut basis = alignment.null_space(matches)?;
    for mixing in MIXINGS {
        shortlist.retain(CandidateKind::Exact);
        let roots = Roots::new(&basis, alignment);
        let complete = roots.real(|two, count| shortlist.push_solutions(two, count, alignment, matches));
        // Where the roots are in doubt, two real ones may have become complex.
        if kinds == Kinds::All || !complete {
            roots.complex(|q_21, nearly_real| {
                let two = TwoMotions::of_rotations(q_21, matches);
                if nearly_real {
                    shortlist.push_solutions(&two, 2, alignment, matches);
                } else if kinds == Kinds::All {
                    for motion in two.apart().into_iter().flatten() {
                        shortlist.push(CandidateKind::FromComplex, motion);
                    }
                }
            });
        }
        // Every real root is an essential matrix of its own.
        if complete && shortlist.count(CandidateKind::Exact) >= 2 * roots.real.as_slice().len() {
            break;
        }
        basis = mixed(&basis, &mixing);
    }
    Ok(())
}

/// The solutions of the five constraints that stand for all matches.
fn starts(gram: &Gram, [.., n1, n2, n3, n4]: &[Coordinates; 9]) -> Shortlist {
    let mut basis = [*n1, *n2, *n3, *n4];
    let mut starts = Shortlist::new();
    for mixing in MIXINGS {
        let roots = Roots::new(&basis, &gram.alignment);
        let complete = roots.real(|two, count| {
            let motions = two.apart().into_iter().take(count);
            motions
                .map(|motion| motion.map(|motion| starts.push_pair(CandidateKind::Exact, motion)))
                .all(|m| m.is_some())
        });
        roots.complex(|q_21, _| {
            for q_21 in apart(q_21).into_iter().flatten() {
                let direction = gram.direction(&q_21);
                starts.push(CandidateKind::FromComplex, Motion { q_21, direction });
            }
        });
        if complete {
            break;
        }
        basis = mixed(&basis, &mixing);
    }
    starts
}

/// The exact motions of five matches on their own.
pub(crate) fn motions_of_five(matches: &[Correspondence; 5]) -> Option<Shortlist> {
    let alignment = Alignment::new(matches);
    if alignment.is_pure_rotation() {
        return None;
    }
    let mut shortlist = Shortlist::of_five(&alignment);
    from_five(Kinds::Exact, &alignment, matches, &mut shortlist).ok().map(|()| shortlist)
}

/// A double root is known to the square root of rounding; times what the elimination loses. With little parallax rounding is that
/// of the direction of the translation.
const NEARLY_REAL: f64 = 1e-4;

/// With less parallax than this the rounding of the bearings leaves the direction of the translation open to 1e-7, and decides
/// more often what is real.
const SMALL_PARALLAX: f64 = 1e-6;

/// An elimination that comes this close to singular has lost five digits; clusters of roots lose the others. One noisy problem in
/// five hundred is.
const SMALL_PIVOT: f64 = 2e-5;

/// Orthogonal changes of the null space's basis, for another attempt where the first did badly: the last
/// basis vector may be absent from a solution, which puts its root at infinity.
const MIXINGS: [[[f64; 4]; 4]; 2] = [
    [[0.5, 0.5, 0.5, 0.5], [0.5, -0.5, 0.5, -0.5], [0.5, 0.5, -0.5, -0.5], [0.5, -0.5, -0.5, 0.5]],
    [[0.8, 0.0, 0.6, 0.0], [0.0, 0.28, 0.0, 0.96], [-0.6, 0.0, 0.8, 0.0], [0.0, -0.96, 0.0, 0.28]],
];

fn mixed(basis: &[Coordinates; 4], mixing: &[[f64; 4]; 4]) -> [Coordinates; 4] {
    mixing.map(|row| combine(basis, &row))
}

/// The essential matrices of a null space, as roots of its polynomial.
struct Roots<'a> {
    basis: &'a [Coordinates; 4],
    alignment: &'a Alignment,
    resultant: Resultant,
    polynomial: [f64; 11],
    real: RealRoots<11>,
}

impl<'a> Roots<'a> {
    fn new(basis: &'a [Coordinates; 4], alignment: &'a Alignment) -> Self {
        let (resultant, pivot) = Resultant::new(&mut ten_cubics(basis, alignment.parallax));
        let polynomial = resultant.polynomial();
        let mut real = real_roots(&polynomial);
        real.certain &= pivot > SMALL_PIVOT && !real.close && alignment.parallax > SMALL_PARALLAX;
        Self { basis, alignment, resultant, polynomial, real }
    }

    /// Hands over the motions of the real roots, with one of the two rotations of each: two at a time, and how many of them
    /// count. Whether every root was found and `accept` took all its motions.
    fn real(&self, mut accept: impl FnMut(&TwoMotions, usize) -> bool) -> bool {
        let mut complete = self.real.certain;
        for roots in self.real.as_slice().chunks(2) {
            let z = Two::new([roots[0], roots[roots.len() - 1]]);
            let coordinates = combine(self.basis, &self.resultant.point(z));
            let motions = TwoMotions::of_essential(&self.alignment.essential(&coordinates));
            complete &= accept(&motions.after(&self.alignment.q0_21), roots.len());
        }
        complete
    }

    /// Hands over the real parts of both rotations of each complex pair of roots, and whether the pair may be two real
    /// ones that rounding has joined.
    fn complex(&self, mut accept: impl FnMut(&TwoQuaternions, bool)) {
        let nearly_real = NEARLY_REAL.max((10.0 * self.alignment.direction_resolution()).sqrt());
        let mut roots = [Complex::from(0.0); 11];
        let count = complex_roots(&self.polynomial, self.real.as_slice(), &mut roots);
        for roots in roots[..count].chunks(2) {
            let z = TwoComplex::new([roots[0], roots[roots.len() - 1]]);
            let coordinates = combine(self.basis, &self.resultant.point(z));
            let (q, t) = decomposed(&self.alignment.essential(&coordinates));
            let twins = [real_part(q), real_part(twisted(&q, &t))].map(|q| q.map(Two::to_array));
            for (k, z) in roots.iter().enumerate() {
                let q = std::array::from_fn(|i| Two::new([twins[0][i][k], twins[1][i][k]]));
                let q_21 = after(&normalized(&q), &self.alignment.q0_21);
                accept(&q_21, z.im < nearly_real * (1.0 + z.re.abs()));
            }
        }
    }
}
