//! The loops over all matches.

use super::columns::{BLOCK, Kernel, MatchColumns, Real};
use super::search_score::{WithWorth, Worth};
use super::{Score, SearchScore, Stop};
use crate::algebra::vectors::lane::{F, Float, Lanes, MAX_LANES};

/// The score of one matrix.
pub(super) struct Sum<'a, T, C> {
    pub(super) matches: &'a C,
    pub(super) e: [T; 9],
    pub(super) threshold: f64,
    pub(super) loss: SearchScore,
    pub(super) stop: Stop,
}

impl<T: Real, C: MatchColumns<T>> Kernel<T> for Sum<'_, T, C> {
    type Output = Score;

    #[inline(always)]
    fn run<L: Lanes<T>>(self, lanes: L) -> Score {
        self.loss.run_vectors(Summing { sum: &self, lanes })
    }
}

/// A score with these instructions.
struct Summing<'a, T, C, L> {
    sum: &'a Sum<'a, T, C>,
    lanes: L,
}

impl<T: Real, C: MatchColumns<T>, L: Lanes<T>> WithWorth for Summing<'_, T, C, L> {
    type Output = Score;

    #[inline(always)]
    fn run<W: Worth>(self) -> Score {
        let Self { sum: of, lanes } = self;
        let zero = lanes.splat(T::from_f64(0.0));
        let square = of.threshold * of.threshold;
        let (threshold, limit) = (lanes.splat(T::from_f64(of.threshold)), lanes.splat(T::from_f64(square)));
        let e = splat::<T, L>(lanes, &of.e);
        let (all, inverse) = (of.matches.len(), 1.0 / square);
        let mut score = Score { sum: 0.0, visited: 0 };
        for block in of.matches.blocks() {
            let mut sum = zero;
            for k in 0..BLOCK / L::COUNT {
                let (error, gradient) = C::constraint(lanes, &e, block, k * L::COUNT);
                // False for the NaN that fill the last block, and where there is no gradient.
                let is_inlier = (error * error).less(gradient * limit);
                sum = sum + W::of_inlier(threshold, error, gradient).select(is_inlier, zero);
            }
            score.sum += sum.sum().into() * inverse;
            score.visited = all.min(score.visited + BLOCK);
            if of.stop.is_reached(score.sum, score.visited, all) {
                break;
            }
        }
        score
    }
}

/// The inliers of one matrix.
pub(super) struct Inliers<'a, T, C> {
    pub(super) matches: &'a C,
    pub(super) e: [T; 9],
    pub(super) threshold: f64,
    pub(super) mask: &'a mut [u64],
}

impl<T: Real, C: MatchColumns<T>> Kernel<T> for Inliers<'_, T, C> {
    type Output = usize;

    #[inline(always)]
    fn run<L: Lanes<T>>(self, lanes: L) -> usize {
        let (zero, one) = (lanes.splat(T::from_f64(0.0)), lanes.splat(T::from_f64(1.0)));
        let square = lanes.splat(T::from_f64(self.threshold * self.threshold));
        let e = splat::<T, L>(lanes, &self.e);
        let mut count = 0;
        for (block, word) in self.matches.blocks().iter().zip(self.mask) {
            for k in (0..BLOCK).step_by(L::COUNT) {
                let (error, gradient) = C::constraint(lanes, &e, block, k);
                let is_inlier = (error * error).less(gradient * square);
                let mut flags = [T::from_f64(0.0); MAX_LANES];
                one.select(is_inlier, zero).store(&mut flags);
                for (lane, flag) in flags[..L::COUNT].iter().enumerate() {
                    *word |= u64::from((*flag).into() > 0.5) << (k + lane);
                }
            }
            count += word.count_ones() as usize;
        }
        count
    }
}

#[inline(always)]
fn splat<T: Real, L: Lanes<T>>(lanes: L, e: &[T; 9]) -> [F<L, T>; 9] {
    let mut out = [lanes.splat(e[0]); 9];
    for i in 1..9 {
        out[i] = lanes.splat(e[i]);
    }
    out
}
