//! More than five matches: the local minima of their errors, shared by the solvers that refine.
//!
//! 1. All constraints become one matrix in the frame of the best alignment (`gram.rs`).
//! 2. A solver finds the solutions of the five constraints that stand for all.
//! 3. Each leads to a local minimum of the summed squares of the constraints, at a cost that does not depend on the number of
//!    matches; of these the ones that the noise may have made are kept.
//! 4. The squared Sampson errors over all matches decide the rest.
//! 5. Where no minimum fits, the motion on which most matches agree is added (`consensus.rs`).

use super::aligned::Coordinates;
use super::gram::Gram;
use super::shortlist::{Shortlist, pure_rotation, rotation_only};
use super::{Kinds, consensus};
use crate::{Candidates, Correspondence};

/// Fills `out` with the local minima that are reached from `starts`, a function of the constraints and of their
/// [`principal_basis`](Gram::principal_basis).
pub(crate) fn solve(
    kinds: Kinds,
    matches: &[Correspondence],
    starts: impl FnOnce(&Gram, &[Coordinates; 9]) -> Shortlist,
    out: &mut Candidates,
) {
    let mut gram = Gram::aligned(matches);
    if gram.alignment.is_pure_rotation() {
        return pure_rotation(&gram.alignment, matches, out);
    }
    let basis = match gram.principal_basis(matches) {
        Err(degeneracy) => return out.set_degeneracy(degeneracy),
        Ok(basis) => basis,
    };
    let mut refined = starts(&gram, &basis).refined(&gram, matches);
    consensus::add(&mut refined, matches);
    if kinds == Kinds::All {
        out.push(rotation_only(&gram.alignment, matches));
    }
    refined.write(kinds, matches, out);
}
