//! What the solvers share that refine their solutions: everything around the way from matches to motions.

use super::Kinds;
use super::aligned::Alignment;
use super::shortlist::{Shortlist, pure_rotation, rotation_only};
use crate::{Candidates, Correspondence, Degeneracy};

/// The smallest number of matches of every solver here.
pub(crate) const MIN_MATCHES: usize = 5;

/// Fills `out` with the motions that the solver finds for five matches, or for more, and with the rotation alone; what
/// cannot be solved is answered with its reason.
pub(crate) fn solve(
    kinds: Kinds,
    matches: &[Correspondence],
    out: &mut Candidates,
    from_five: impl FnOnce(Kinds, &Alignment, &[Correspondence; 5]) -> Result<Shortlist, Degeneracy>,
    from_many: impl FnOnce(&Alignment, &[Correspondence]) -> Result<Shortlist, Degeneracy>,
) {
    out.clear();
    if matches.len() < MIN_MATCHES {
        return out.set_degeneracy(Degeneracy::TooFewMatches);
    }
    let alignment = Alignment::new(matches);
    if alignment.is_pure_rotation() {
        return pure_rotation(&alignment, matches, out);
    }
    let found = match matches.try_into() {
        Ok(five) => from_five(kinds, &alignment, five),
        Err(_) => from_many(&alignment, matches),
    };
    match found {
        Err(degeneracy) => out.set_degeneracy(degeneracy),
        Ok(shortlist) => {
            if kinds == Kinds::All {
                out.push(rotation_only(&alignment, matches));
            }
            shortlist.write(kinds, matches, out);
        }
    }
}
