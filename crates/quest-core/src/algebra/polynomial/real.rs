//! All real roots: where the line is divided first, and what is known of those that were found.

use super::bracket::{Brackets, RealRoots};
use super::sturm::Chain;

/// Where trisection gives up on telling two roots apart: at a third of a third of an interval, and so on.
const MAX_DEPTH: u32 = 28;

/// Where the line is first divided, by even angles on the circle that it closes to at infinity. None of these is a likely root,
/// as zero is where a basis vector is itself a solution: there rounding decides the sign.
const SPLITS: [[f64; 2]; 4] = [[-4.7, -1.53], [-0.66, -0.19], [0.21, 0.69], [1.48, 5.1]];

/// All real roots of `p`, in increasing order.
pub(crate) fn real_roots<const N: usize>(p: &[f64; N]) -> RealRoots<N> {
    let Some(chain) = Chain::new(p) else {
        return RealRoots { values: [0.0; N], len: 0, certain: false, close: false };
    };
    let mut brackets = Brackets::new();
    let ends = SPLITS.map(|x| chain.ends(x));
    let ends = ends.as_flattened();
    let (first, last) = (ends[0], ends[ends.len() - 1]);
    if let Some(below) = chain.bound(-1.0, first) {
        brackets.isolate(&chain, below, first, MAX_DEPTH);
    }
    for pair in ends.windows(2) {
        brackets.isolate(&chain, pair[0], pair[1], MAX_DEPTH);
    }
    if let Some(above) = chain.bound(1.0, last) {
        brackets.isolate(&chain, last, above, MAX_DEPTH);
    }
    RealRoots { close: chain.is_doubtful(), ..brackets.refined(&chain.p) }
}
