//! A few numbers of one problem abreast: as many as the widest registers hold where these have fused products, else two.
//!
//! SSE2 gains nothing from more than two: what does not fit into its registers goes to memory.

use std::sync::LazyLock;

use crate::algebra::vectors::instructions::{Instructions, Task, Token};
use crate::algebra::vectors::lane::{Lanes, WordLanes};
use crate::algebra::vectors::two::TwoLanes;

/// Work on numbers abreast. As of a [`Task`], what it calls has to be inlined.
pub(crate) trait Work {
    type Output;

    fn run<L: Lanes<f64>>(self, lanes: L) -> Self::Output;
}

/// Whether more than two numbers are taken abreast.
pub(crate) fn is_wide() -> bool {
    wide().is_some()
}

/// Does the work.
#[inline]
pub(crate) fn abreast<W: Work>(work: W) -> W::Output {
    match wide() {
        Some(token) => token.run(Wide(work)),
        None => work.run(TwoLanes),
    }
}

/// Work as a task.
pub(crate) struct Wide<W>(pub(crate) W);

impl<W: Work> Task for Wide<W> {
    type Output = W::Output;

    #[inline(always)]
    fn run<L: WordLanes + Lanes<f32>>(self, lanes: L) -> W::Output {
        self.0.run(lanes)
    }
}

/// The instructions that were chosen, where they take more than two numbers at once.
fn wide() -> Option<Token> {
    static WIDE: LazyLock<Option<Token>> =
        LazyLock::new(|| Some(Token::chosen()).filter(|token| token.instructions() >= Instructions::Avx2));
    *WIDE
}
