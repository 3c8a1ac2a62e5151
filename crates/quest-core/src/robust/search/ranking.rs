//! Matches rank themselves: those that move as their neighbours do come first.
//!
//! Let `d1` and `d2` be the differences of two matches that are near each other in view 1, as complex numbers in thresholds. If
//! both matches are true, `d2` is about as long as `d1` and turned as the whole image is, by `z` with `|z| = 1`; if one is false, `d2`
//! is anywhere in the image, of area `A`. With a heavy-tailed density around `z d1` the likelihood ratio is
//!
//! ```text
//! Λ = A V / (π (V + |d2 − z d1|²)²),    V = σ² |d1||d2| + ν²
//! ```
//!
//! and a match is worth `Σ log2(1 + ω Λ)` over its neighbours, with `ω` the share of true matches. A shorter pair counts for more,
//! so neither a number of neighbours nor a distance has to be chosen: far neighbours count next to nothing.
//!
//! # Neighbours
//! The matches stand on a snake through strips of view 1, once along `x` and once along `y`; neighbours are those that follow
//! each other there. That takes no search, `O(n log n)` for the order and `O(n)` for the pairs, all of it in loops for vectors.
//!
//! The idea that true matches keep their neighbours is that of GMS (J. Bian et al., *GMS: Grid-based Motion Statistics*, CVPR 2017).

use crate::algebra::vectors::widest::{Simd, Work, widest};
use crate::robust::search::chart::Chart;

/// Followers on a snake that a match is compared with. On recorded pairs diluted to 3 % the samples that the best pool
/// needs fall from 890 to 210 and to 90 (geometric means) with 24, 48 and 96; the time grows with it.
const WINDOW: usize = 96;

/// Matches in a square of the strips' width: about half of the window, so that it reaches as far along a strip as across. Not
/// sensitive within a factor of two.
const SQUARE: f32 = 48.0;

/// Followers that the common turn is measured from.
const NEAR: usize = 48;

/// `σ²`: how far true pairs are from the common turn and from equal lengths. Not sensitive between 0.1 and 0.4.
const SPREAD: f32 = 0.2;

/// `ω`. Not sensitive between 0.03 and 0.3.
const SHARE: f32 = 0.1;

/// `ν²`: the noise of the difference of two points, in squares of the threshold. Not sensitive between 1 and 4.
const SQUARE_NOISE: f32 = 4.0;

/// A pair nearer than this in both views, in squares of the threshold, is one match that was found twice, and no evidence.
const SAME: f32 = 1.0;

/// Matches whose pairs are looked at together: their columns stay in the cache.
const BLOCK: usize = 1024;

/// Lanes of a sum.
const LANES: usize = 8;

/// The matches from the most coherent to the least; those of equal rank in the order of their indices.
pub(crate) fn order(chart: &Chart) -> Vec<u32> {
    let mut order: Vec<u32> = indices(chart[0].len()).collect();
    let coherence = coherence(chart);
    order.sort_unstable_by(|&i, &j| {
        coherence[j as usize].total_cmp(&coherence[i as usize]).then_with(|| i.cmp(&j))
    });
    order
}

/// How coherent every match is with its neighbours: higher is better.
fn coherence(chart: &Chart) -> Vec<f32> {
    let n = chart[0].len();
    let mut all = vec![0.0; n];
    if n < 2 {
        return all;
    }
    // The geometric mean of both views: that of rectangles, evenly filled, with their second moments.
    let area = 12.0 * chart.each_ref().map(|column| moments(column)[1].sqrt().sqrt()).iter().product::<f32>();
    let snakes = [snake(&chart[0], &chart[1]), snake(&chart[1], &chart[0])];
    let along = snakes.each_ref().map(|snake| -> Chart {
        chart.each_ref().map(|column| snake.iter().map(|&i| column[i as usize]).collect())
    });
    let turn = widest(Turn { along: &along[0], area });
    for (snake, along) in snakes.iter().zip(&along) {
        let mut sums = vec![0.0; n];
        widest(Pairs { along, area, turn, sums: &mut sums });
        for (&i, sum) in snake.iter().zip(&sums) {
            all[i as usize] += sum;
        }
    }
    all
}

/// Mean and variance, the latter not zero. In twice the digits: they do not depend on the order of the matches.
fn moments(values: &[f32]) -> [f32; 2] {
    let n = values.len() as f64;
    let mean = values.iter().map(|x| f64::from(*x)).sum::<f64>() / n;
    let variance = values.iter().map(|x| (f64::from(*x) - mean).powi(2)).sum::<f64>() / n;
    #[expect(clippy::cast_possible_truncation, reason = "coordinates have no more digits")]
    [mean as f32, variance.max(f64::from(f32::MIN_POSITIVE)) as f32]
}

#[expect(clippy::cast_possible_truncation, reason = "matches are counted by u32")]
fn indices(count: usize) -> std::ops::Range<u32> {
    0..count as u32
}

/// The matches in the order of a snake through strips along `v`.
fn snake(u: &[f32], v: &[f32]) -> Vec<u32> {
    let strips = (u.len() as f32 / SQUARE).sqrt().ceil();
    let ([mean_u, variance_u], [mean_v, _]) = (moments(u), moments(v));
    // Two standard deviations to either side hold nearly all; the others are in the outermost strips.
    let per_unit = 0.25 * strips / variance_u.sqrt();
    let key = |i: u32| {
        let strip = ((u[i as usize] - mean_u) * per_unit + 0.5 * strips).floor().clamp(0.0, strips - 1.0);
        let along = v[i as usize] - mean_v;
        (strip, if strip % 2.0 > 0.5 { -along } else { along })
    };
    let mut keyed: Vec<(u64, u32)> = indices(u.len())
        .map(|i| {
            let (strip, along) = key(i);
            (u64::from(sortable(strip)) << 32 | u64::from(sortable(along)), i)
        })
        .collect();
    keyed.sort_unstable();
    keyed.into_iter().map(|(_, i)| i).collect()
}

/// Bits that are ordered as the numbers are.
fn sortable(x: f32) -> u32 {
    let bits = x.to_bits();
    if bits >> 31 == 0 { bits | 1 << 31 } else { !bits }
}

/// The logarithm by the bits: exact at powers of two and at most 0.09 too small elsewhere.
#[inline(always)]
fn log2(x: f32) -> f32 {
    x.to_bits() as f32 * (1.0 / 8_388_608.0) - 127.0
}

/// The differences of a match and one that follows it, as complex numbers.
#[inline(always)]
fn differences(a: [f32; 4], b: [f32; 4]) -> [[f32; 2]; 2] {
    [[b[0] - a[0], b[1] - a[1]], [b[2] - a[2], b[3] - a[3]]]
}

/// The squares of their lengths, and `d2 / d1` times `|d1|²`.
#[inline(always)]
fn compared([[p, q], [r, s]]: [[f32; 2]; 2]) -> [f32; 4] {
    [p * p + q * q, r * r + s * s, p * r + q * s, p * s - q * r]
}

/// Finds the turn that all differences have in common. Each counts by the probability that its pair is true.
struct Turn<'a> {
    along: &'a Chart,
    area: f32,
}

impl Work for Turn<'_> {
    type Output = [f32; 2];

    #[inline(always)]
    #[expect(clippy::needless_bitwise_bool, reason = "lazy operators branch, which no vector can")]
    fn run<S: Simd>(self, _: S) -> [f32; 2] {
        let n = self.along[0].len();
        let mut sums = [[0.0_f32; LANES]; 2];
        for o in 1..=NEAR.min(n - 1) {
            let [x1, y1, x2, y2] = self.along.each_ref().map(|column| &column[..n - o]);
            let [u1, v1, u2, v2] = self.along.each_ref().map(|column| &column[o..]);
            for i in 0..n - o {
                let d = differences([x1[i], y1[i], x2[i], y2[i]], [u1[i], v1[i], u2[i], v2[i]]);
                let [d1, d2, dot, across] = compared(d);
                let length = (d1 * d2).sqrt();
                // A neighbour at any turn: the densest that V allows over the lengths alone.
                let odds = SHARE * self.area / (12.0 * (length + SQUARE_NOISE));
                let is_like = (d1 < 9.0 * d2) & (d2 < 9.0 * d1) & (d1 + d2 > SAME);
                let weight = if is_like { odds / ((1.0 + odds) * (length + 1.0)) } else { 0.0 };
                sums[0][i % LANES] += weight * dot;
                sums[1][i % LANES] += weight * across;
            }
        }
        let [x, y] = sums.map(|lanes| lanes.iter().sum::<f32>());
        let length = x.hypot(y);
        if length > 0.0 && length.is_finite() { [x / length, y / length] } else { [1.0, 0.0] }
    }
}

/// Adds what every pair counts to both of its matches.
struct Pairs<'a> {
    along: &'a Chart,
    area: f32,
    turn: [f32; 2],
    sums: &'a mut [f32],
}

impl Work for Pairs<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        let Self { along, area, turn: [cosine, sine], sums } = self;
        let n = sums.len();
        let scale = SHARE * area / std::f32::consts::PI;
        let mut worth = [0.0_f32; BLOCK];
        for begin in (0..n).step_by(BLOCK) {
            for o in 1..=WINDOW {
                let end = (begin + BLOCK).min(n.saturating_sub(o));
                if end <= begin {
                    break;
                }
                let worth = &mut worth[..end - begin];
                let [x1, y1, x2, y2] = along.each_ref().map(|column| &column[begin..end]);
                let [u1, v1, u2, v2] = along.each_ref().map(|column| &column[begin + o..end + o]);
                for i in 0..worth.len() {
                    let d = differences([x1[i], y1[i], x2[i], y2[i]], [u1[i], v1[i], u2[i], v2[i]]);
                    let [d1, d2, dot, across] = compared(d);
                    let v = SPREAD * (d1 * d2).sqrt() + SQUARE_NOISE;
                    // |d2 − z d1|², which rounding must not make negative.
                    let off = (d1 + d2 - 2.0 * (cosine * dot + sine * across)).max(0.0);
                    let ratio = scale * v / ((v + off) * (v + off));
                    worth[i] = if d1 + d2 > SAME { log2(1.0 + ratio) } else { 0.0 };
                }
                for (sum, worth) in sums[begin..end].iter_mut().zip(&*worth) {
                    *sum += worth;
                }
                for (sum, worth) in sums[begin + o..end + o].iter_mut().zip(&*worth) {
                    *sum += worth;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::seq::SliceRandom;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const SEED: u64 = 2018;

    /// The first `true_count` of `count` matches move as a smooth field does, which turns by `turn` radians; the others anyhow.
    fn field(count: usize, true_count: usize, turn: f32) -> Chart {
        let mut rng = ChaCha8Rng::seed_from_u64(SEED);
        let mut chart = Chart::default();
        for i in 0..count {
            let [x, y]: [f32; 2] = std::array::from_fn(|_| rng.random_range(0.0..1000.0));
            let wave = 30.0 * (x / 150.0).sin();
            let [u, v] = if i < true_count {
                [turn.cos() * x - turn.sin() * y + wave, turn.sin() * x + turn.cos() * y + 0.3 * wave]
            } else {
                std::array::from_fn(|_| rng.random_range(0.0..1000.0))
            };
            for (column, x) in chart.iter_mut().zip([x, y, u, v]) {
                column.push(x);
            }
        }
        chart
    }

    /// The share of true ones among the first `first` of the order.
    fn precision(order: &[u32], first: usize, true_count: u32) -> f32 {
        order[..first].iter().filter(|&&i| i < true_count).count() as f32 / first as f32
    }

    #[test]
    fn what_moves_together_comes_first() {
        for turn in [0.0, 0.5, 3.0] {
            let order = order(&field(2000, 200, turn));
            // One in ten of all are true; measured 0.7 and more.
            assert!(precision(&order, 100, 200) > 0.5, "{turn}: {}", precision(&order, 100, 200));
        }
    }

    #[test]
    fn every_match_has_one_place() {
        for count in [0, 1, 2, 5, 95, 96, 97, 1023, 1024, 1025, 3000] {
            let mut order = order(&field(count, count / 3, 0.0));
            order.sort_unstable();
            assert!(order.into_iter().eq(indices(count)), "{count}");
        }
    }

    #[test]
    fn the_order_of_the_caller_does_not_matter() {
        let chart = field(700, 100, 0.3);
        let mut shuffled: Vec<u32> = (0..700).collect();
        shuffled.shuffle(&mut ChaCha8Rng::seed_from_u64(SEED));
        let other = crate::robust::search::chart::part(&chart, &shuffled);
        let again: Vec<u32> = order(&other).into_iter().map(|k| shuffled[k as usize]).collect();
        assert_eq!(order(&chart), again);
    }

    #[test]
    fn a_match_that_was_found_many_times_is_no_evidence() {
        let mut chart = field(1000, 300, 0.0);
        for (column, x) in chart.iter_mut().zip([500.0, 500.0, 100.0, 900.0]) {
            column.extend([x; 200]);
        }
        let order = order(&chart);
        assert!(precision(&order, 100, 300) > 0.9);
    }

    #[test]
    fn points_at_one_place_are_ranked_too() {
        let chart: Chart = std::array::from_fn(|_| vec![7.0; 100]);
        assert!(order(&chart).into_iter().eq(0..100));
    }
}
