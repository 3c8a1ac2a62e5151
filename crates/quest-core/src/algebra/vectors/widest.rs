//! Loops for the widest vectors of the processor.
//!
//! The compiler makes the vectors; as no product is fused with a sum, results are the same on every processor.

pub(crate) use pulp::Simd;
use pulp::{Arch, WithSimd};

/// Work in loops. What [`run`](Self::run) calls, and itself, has to be inlined: a function of its own, as a closure is, would be
/// compiled for the instructions that every processor has.
pub(crate) trait Work {
    type Output;

    /// `simd` proves what the processor has, for loops of which the compiler makes other vectors than it should.
    fn run<S: Simd>(self, simd: S) -> Self::Output;
}

/// `sum += a b` in each lane. In a loop over rows of lanes the compiler would rather gather a vector across the rows.
#[inline(always)]
pub(crate) fn add_product<S: Simd>(simd: S, sum: &mut [f64; 8], a: &[f64; 8], b: &[f64; 8]) {
    let (sums, (a, _), (b, _)) = (S::as_mut_simd_f64s(sum).0, S::as_simd_f64s(a), S::as_simd_f64s(b));
    for ((sum, &a), &b) in sums.iter_mut().zip(a).zip(b) {
        *sum = simd.add_f64s(*sum, simd.mul_f64s(a, b));
    }
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
    fn with_simd<S: Simd>(self, simd: S) -> W::Output {
        self.0.run(simd)
    }
}
