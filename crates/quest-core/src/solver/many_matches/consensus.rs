//! One more candidate where the matches cannot all be correct: that of the five that most of the others agree with.
//!
//! The solvers take matches to be correct, and fit all of them. A few false ones among ten or twenty then spoil every
//! candidate. Where no candidate fits, some fives of the matches are solved as well, and the motion with the
//! smallest truncated error is refined over the matches that agree with it. It is a help against an accident, not
//! a robust estimator: with a third of the matches false it finds the true motion in nine of ten cases.

use rand::seq::index::sample_array;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use crate::solver::quest::five_matches::motions_of_five;
use crate::solver::shared::motion::{FINE, Motion, Until};
use crate::solver::shared::shortlist::Shortlist;
use crate::{CandidateKind, Correspondence};

/// No correct match is further than this from its epipolar plane: four pixels at a focal length of a thousand.
pub(crate) const AGREEMENT: f64 = 4e-3;

/// How many fives are tried. With 70 % correct matches one of them is all correct in 99 of 100 cases.
const FIVES: usize = 24;

/// Adds the motion on which most matches agree.
pub(crate) fn add(shortlist: &mut Shortlist, matches: &[Correspondence]) {
    let cost = |motion: &Motion| motion.truncated_cost(matches, AGREEMENT);
    // The same fives for the same matches, every time.
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut best: Option<(f64, Motion)> = None;
    for _ in 0..FIVES {
        let Some(indices) = sample_array::<_, 5>(&mut rng, matches.len()) else { return };
        let five = indices.map(|index| matches[index]);
        for item in motions_of_five(&five).iter().flat_map(Shortlist::iter) {
            let cost = cost(&item.motion);
            if best.is_none_or(|(smallest, _)| cost < smallest) {
                best = Some((cost, item.motion));
            }
        }
    }
    if let Some((_, mut motion)) = best {
        motion.minimise_sampson(matches, AGREEMENT, &Until { steps: 30, ..FINE });
        shortlist.push_pair(CandidateKind::Exact, motion);
    }
}
