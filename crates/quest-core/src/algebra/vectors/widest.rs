//! Loops for the widest vectors of the processor.
//!
//! The compiler makes the vectors; as no product is fused with a sum, results are the same on every processor.

use pulp::{Arch, Simd, WithSimd};

/// Work in loops. What [`run`](Self::run) calls, and itself, has to be inlined: a function of its own, as a closure is, would be
/// compiled for the instructions that every processor has.
pub(crate) trait Work {
    type Output;

    fn run(self) -> Self::Output;
}

/// Does the work.
pub(crate) fn widest<W: Work>(work: W) -> W::Output {
    Arch::new().dispatch(Adapter(work))
}

/// Work in the form that pulp runs.
struct Adapter<W>(W);

impl<W: Work> WithSimd for Adapter<W> {
    type Output = W::Output;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> W::Output {
        self.0.run()
    }
}
