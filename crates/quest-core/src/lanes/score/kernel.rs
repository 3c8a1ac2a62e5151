//! The loops over all matches.

use super::columns::{BLOCK, MatchColumns, Real};
use super::{Loss, Score, Stop};
use crate::lanes::lane::{F, Float, Lanes, MAX_LANES};

/// Work that can be done with any lanes of `T`.
pub trait Kernel<T> {
    /// What comes out.
    type Output;

    /// Does it.
    fn run<L: Lanes<T>>(self, lanes: L) -> Self::Output;
}

/// The score of one matrix.
pub(super) struct Sum<'a, T, C> {
    pub(super) matches: &'a C,
    pub(super) e: [T; 9],
    pub(super) threshold: f64,
    pub(super) loss: Loss,
    pub(super) stop: Stop,
}

impl<T: Real, C: MatchColumns<T>> Kernel<T> for Sum<'_, T, C> {
    type Output = Score;

    #[inline(always)]
    fn run<L: Lanes<T>>(self, lanes: L) -> Score {
        match self.loss {
            Loss::Truncated => self.sum(lanes, truncated::<T, L>),
            Loss::Marginalised => self.sum(lanes, marginalised::<T, L>),
        }
    }
}

impl<T: Real, C: MatchColumns<T>> Sum<'_, T, C> {
    #[inline(always)]
    fn sum<L: Lanes<T>>(&self, lanes: L, count: impl Fn(L, F<L, T>) -> F<L, T>) -> Score {
        let zero = lanes.splat(T::from_f64(0.0));
        let one = lanes.splat(T::from_f64(1.0));
        let square = lanes.splat(T::from_f64(self.threshold * self.threshold));
        let e = splat::<T, L>(lanes, &self.e);
        let all = self.matches.len();
        let mut score = Score { sum: 0.0, visited: 0 };
        while score.visited < all {
            let mut sum = zero;
            let mut k = score.visited;
            while k < score.visited + BLOCK {
                let (error, gradient) = self.matches.constraint(lanes, &e, k);
                let ratio = error / (gradient * square);
                // False for the NaN that fill the last block.
                sum = sum + count(lanes, ratio).select(ratio.less(one), zero);
                k += L::COUNT;
            }
            score.sum += total::<T, L>(sum);
            score.visited = all.min(score.visited + BLOCK);
            if self.stop.is_reached(score.sum, score.visited, all) {
                break;
            }
        }
        score
    }
}

/// `1 − u²`, by `u²`.
#[inline(always)]
fn truncated<T: Real, L: Lanes<T>>(lanes: L, square: F<L, T>) -> F<L, T> {
    lanes.splat(T::from_f64(1.0)) - square
}

/// `(1 − u)²`, by `u²`.
#[inline(always)]
fn marginalised<T: Real, L: Lanes<T>>(lanes: L, square: F<L, T>) -> F<L, T> {
    let rest = lanes.splat(T::from_f64(1.0)) - square.sqrt();
    rest * rest
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
        for (block, word) in self.mask.iter_mut().enumerate() {
            for k in (0..BLOCK).step_by(L::COUNT) {
                let (error, gradient) = self.matches.constraint(lanes, &e, block * BLOCK + k);
                let is_inlier = error.less(gradient * square);
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

/// The sum over the lanes.
#[inline(always)]
fn total<T: Real, L: Lanes<T>>(sum: F<L, T>) -> f64 {
    let mut parts = [T::from_f64(0.0); MAX_LANES];
    sum.store(&mut parts);
    let mut total = 0.0;
    for part in &parts[..L::COUNT] {
        total += (*part).into();
    }
    total
}
