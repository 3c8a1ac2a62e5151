//! What the solvers share that refine their solutions: everything around the way from matches to motions.
//!
//! For more than five matches:
//! 1. All constraints become one matrix in the frame of the best alignment (`gram.rs`).
//! 2. The solver finds the solutions of the few constraints that stand for all.
//! 3. Each leads to a local minimum: of the squared Sampson errors for few matches, else of a cost near them that does not
//!    depend on the number of matches. Of these minima the ones stay that the noise may have made.
//! 4. The squared Sampson errors over all matches decide the rest.
//! 5. Where no candidate fits, the motion on which most matches agree is added (`consensus.rs`).
//!
//! Where they are asked for, the motions of a plane are added: that of the homography with the least squares, if it explains the
//! matches much better than the best alignment does. Five points that lie on a plane leave two equations to spare, which
//! solutions of the epipolar constraints make nothing of.

use nalgebra::{UnitQuaternion, Vector3};

use crate::solver::Kinds;
use crate::solver::many_matches::{collinear_view, consensus};
use crate::solver::published::homography::motions_of_plane;
use crate::solver::shared::gram::Gram;
use crate::solver::shared::parallax_frame::{Alignment, Coordinates};
use crate::solver::shared::shortlist::{Shortlist, pure_rotation, rotation_only};
use crate::structure::translation_direction;
use crate::{CandidateKind, Candidates, Correspondence, Degeneracy};

/// The smallest number of matches of every solver here.
pub(crate) const MIN_MATCHES: usize = 5;

/// A plane explains matches if it misses each of them by less than this part of the parallax. Noise alone, without
/// parallax, comes so close in one of fifty cases; five general points, to which a plane is an accident, in one of ten.
const FLAT: f64 = 0.1;

/// As many essential matrices as five matches have. The descents from one solution and from its twisted partner, or from the real
/// part of a complex one, may end in minima of their own where the matches contradict each other, and make more of them.
const MOST_ESSENTIALS: usize = 10;

/// Fills `out` with the motions that the solver finds for five matches, or with the local minima that are reached from its
/// `starts` for more, and with the rotation alone; what cannot be solved is answered with its reason.
///
/// `starts` are found by the constraints of all matches and their [`principal_basis`](Gram::principal_basis).
pub(crate) fn solve(
    kinds: Kinds,
    matches: &[Correspondence],
    out: &mut Candidates,
    from_five: impl FnOnce(Kinds, &Alignment, &[Correspondence; 5], &mut Shortlist) -> Result<(), Degeneracy>,
    starts: impl FnOnce(&Gram, &[Coordinates; 9]) -> Shortlist,
) {
    out.clear();
    if matches.len() < MIN_MATCHES {
        return out.set_degeneracy(Degeneracy::TooFewMatches);
    }
    let Ok(five) = matches.try_into() else { return solve_many(kinds, matches, out, starts) };
    let alignment = Alignment::new(matches);
    if alignment.is_pure_rotation() {
        return pure_rotation(&alignment, matches, out);
    }
    if Alignment::all_but_one_turn(five) {
        return out.set_degeneracy(Degeneracy::RankDeficient);
    }
    let mut shortlist = Shortlist::of_five(&alignment);
    let found = match collinear_view::essential_matrices(five) {
        Some(pair) => {
            shortlist.push_essential(&pair, &alignment, five);
            Ok(())
        }
        None => from_five(kinds.without_plane(), &alignment, five, &mut shortlist),
    };
    if let Err(degeneracy) = found {
        return out.set_degeneracy(degeneracy);
    }
    shortlist.keep_motions_of_five(matches);
    write(kinds, &mut shortlist, &alignment, |q0_21| translation_direction(q0_21, matches), matches, out);
}

fn solve_many(
    kinds: Kinds,
    matches: &[Correspondence],
    out: &mut Candidates,
    starts: impl FnOnce(&Gram, &[Coordinates; 9]) -> Shortlist,
) {
    let mut gram = Gram::aligned(matches);
    if gram.alignment.is_pure_rotation() {
        return pure_rotation(&gram.alignment, matches, out);
    }
    let basis = match gram.principal_basis(matches) {
        Err(degeneracy) => return out.set_degeneracy(degeneracy),
        Ok(basis) => basis,
    };
    let (mut minima, smallest) = starts(&gram, &basis).refined(&gram, matches);
    // No match is far off where even their sum is small.
    if smallest > matches.len() as f64 * consensus::AGREEMENT.powi(2) {
        minima.keep_best(MOST_ESSENTIALS - 1, &gram);
        consensus::add(&mut minima, matches);
    }
    minima.keep_best(MOST_ESSENTIALS, &gram);
    write(kinds, &mut minima, &gram.alignment, |q0_21| gram.direction(q0_21), matches, out);
}

/// Fills `out` with the motions found and, as far as they are asked for, those of a plane and the rotation alone with the
/// direction that fits it.
fn write(
    kinds: Kinds,
    shortlist: &mut Shortlist,
    alignment: &Alignment,
    direction: impl FnOnce(&UnitQuaternion<f64>) -> Vector3<f64>,
    matches: &[Correspondence],
    out: &mut Candidates,
) {
    if kinds == Kinds::Planar {
        for motion in motions_of_plane(matches, FLAT * alignment.parallax).into_iter().flatten() {
            shortlist.push_pair(CandidateKind::Planar, motion);
        }
    }
    if kinds != Kinds::Exact {
        let q0_21 = alignment.q0_21;
        out.push(rotation_only(q0_21, &direction(&q0_21), matches));
    }
    shortlist.write(kinds.without_plane(), matches, out);
}
