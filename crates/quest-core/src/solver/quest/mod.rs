//! `quest`: the default solver, right at every parallax.
//!
//! **Problem.** Rotation, translation and depths from five or more matches, also where the translation is so small against
//! the depths that the essential matrix, divided by its own norm, no longer holds the rotation.
//!
//! **Steps** for five matches:
//! 1. The rotation `R0` that best aligns the bearings, and the parallax `p` that it leaves (`parallax_frame.rs`). With none
//!    left the motion is a pure rotation.
//! 2. The null space of the five rows `[n/p, sym(b cᵀ)]`: the essential matrix is `[t]× + p S`, `S` symmetric.
//! 3. Ten cubics without the factor `p`, a polynomial of degree ten, its real roots by Sturm's theorem
//!    (`cubics.rs`, `resultant.rs`).
//! 4. Each root gives an essential matrix, two rotations and a translation; Newton's iteration on the five
//!    parameters of the motion brings the constraints to zero, which it knows to twice the digits (`double_residual.rs`).
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

pub(crate) mod cubics;
pub(crate) mod five_matches;

use crate::solver::many_matches::driver;
use crate::solver::quest::five_matches::{MIXINGS, Roots, from_five, mixed};
use crate::solver::shared::gram::Gram;
use crate::solver::shared::motion::Motion;
use crate::solver::shared::newton_pair::apart;
use crate::solver::shared::parallax_frame::Coordinates;
use crate::solver::shared::shortlist::Shortlist;
use crate::solver::{Kinds, PoseSolver};
use crate::{CandidateKind, Candidates, Correspondence};

/// The default solver; its steps stand at the head of the module.
#[derive(Clone, Copy, Debug, Default)]
pub struct Quest {
    /// Which candidates are returned.
    pub kinds: Kinds,
}

impl PoseSolver for Quest {
    const NAME: &'static str = "quest";
    const MIN_MATCHES: usize = driver::MIN_MATCHES;

    fn solve(&self, matches: &[Correspondence], out: &mut Candidates) {
        driver::solve(self.kinds, matches, out, from_five, starts);
    }
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
