//! Whether a translation is evident: the likelihood of all matches with one, over that without.
//!
//! With `d` the whitened displacement of a match from where the best rotation takes it, and `r` and `a` the parts across and
//! along the epipolar line of its displacement from where a motion's rotation takes it (`a = ρ |b|` of a point with the inverse
//! depth `ρ`), the densities of a match are
//!
//! ```text
//! p0 = (1 − ε) Σk ck N2(d; k²σ²) + ε/A
//! p1 = (1 − ε) Σk ck N(r; k²σ²) [(1 − π) N(a − m |b|; k²σ² + s² |b|²) + π q(a)] + ε/A
//! ```
//!
//! The noise, a normal one with the tails of keypoints, is the same in both. `m ± s` is where the inverse depths of most points
//! are; `q`, uniform in the logarithm and in front of the cameras, is for near points. `m`, `s` and `π` have their
//! likeliest values (EM); with all of them zero there is no translation. `ε` is the share of false matches, `A` the
//! area they are spread over. The evidence is `Λ = Σ ln p1/p0`, less its two largest terms: the direction of the translation is
//! free, which lets it fit any two matches. For a rotation in place `Λ` falls as matches become more; one near point counts as much
//! among many distant ones as among few.
//!
//! Sums of squared Sampson errors do not decide this: every match brings an inverse depth of its own, so that differences of such
//! sums scatter as the root of the number of matches (J. Neyman, E. L. Scott, *Consistent estimates based on partially
//! consistent observations*, Econometrica 1948).

use std::f64::consts::PI;

use nalgebra::UnitQuaternion;

use crate::algebra::vectors::exponential::{exp, ln};
use crate::algebra::vectors::widest::{Simd, Work, widest};
use crate::robust::conclude::length::median;
use crate::robust::data::observations::Observations;
use crate::robust::data::point_transfer::{Block, Framed, Lanes, WIDTH, Whitened, rows, whitened};
use crate::solver::shared::motion::Motion;

/// The shares and the widths of the noise: one keypoint in ten is three times less sharp. The decisions are not sensitive to them
/// between 5 and 20 % and between two and five times.
pub(crate) const TAILS: [[f64; 2]; 2] = [[0.9, 1.0], [0.1, 3.0]];

/// The density of near points is flat below this multiple of the noise, where they cannot be told from others.
const NEAREST: f64 = 3.0;

/// The share of near points to begin with. EM changes it.
const NEAR: f64 = 0.05;

/// A match counts as a near point where at least this much of its probability says so. A false match that lies near its epipolar line
/// by chance looks like a near point, and has the lever of one.
const BELIEVED: f64 = 0.9;

/// Rounds of EM. Twelve leave Λ within a tenth of its limit.
pub(crate) const ROUNDS: usize = 12;

/// The exponents of densities end here: the product of two of them is still a normal number, and nothing beside the density of false
/// matches.
const LEAST_EXPONENT: f64 = -300.0;

/// A displacement by a unit of inverse depth is not shorter than this.
const SHORTEST: f64 = 1e-12;

/// What the matches say of a motion beside the best rotation.
#[derive(Clone, Debug)]
pub(crate) struct Evidence {
    /// `Λ`, in nats.
    pub(crate) nats: f64,
    /// The probability of each match that it is true.
    pub(crate) is_true: Vec<f64>,
    /// The mean inverse depth in units of the motion's translation.
    pub(crate) mean_depth: f64,
}

/// The likelihood of some of the matches, given the best rotation without translation.
#[derive(Debug)]
pub(crate) struct Likelihood {
    framed: Framed,
    /// `1/p0` of each match, in the blocks of `framed`.
    still: Vec<Lanes>,
    densities: Densities,
}

/// What the densities of all matches have in common.
#[derive(Clone, Copy, Debug)]
struct Densities {
    sigma: f64,
    tails: [Tail; 2],
    /// `ε` and `ε/A`.
    outliers: f64,
    floor: f64,
    /// The normalisation of `q`.
    near_norm: f64,
}

/// A part of the noise: `ck N(x; k²σ²) = height exp(−x²/(2 variance))`.
#[derive(Clone, Copy, Debug)]
struct Tail {
    variance: f64,
    inverse: f64,
    height: f64,
}

/// The explanations of a few matches: their probabilities, and the sums of these over the variances across and along the epipolar
/// lines.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Explained {
    pub(crate) usual: Lanes,
    pub(crate) near: Lanes,
    pub(crate) across: Lanes,
    pub(crate) along: Lanes,
    /// The part of near points in `across`.
    pub(crate) near_across: Lanes,
    /// The logarithm of the likelihood over that without a translation.
    pub(crate) nats: Lanes,
}

/// How far a few matches are across their epipolar lines and from their expected places along them, how far they have moved along
/// them, and the variances that depths add there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Places {
    pub(crate) across: Lanes,
    pub(crate) away: Lanes,
    pub(crate) along: Lanes,
    pub(crate) spread: Lanes,
    pub(crate) is_in_front: [bool; WIDTH],
}

/// A few matches under one motion.
#[derive(Clone, Copy, Debug)]
struct Split {
    /// The densities `ck N(r; k²σ²)`, zero behind a camera.
    across: [Lanes; 2],
    along: Lanes,
    /// `|b|`, by how much a unit of inverse depth moves them.
    by_depth: Lanes,
    /// `q(a)`.
    near: Lanes,
}

/// What most inverse depths are.
#[derive(Clone, Copy, Debug)]
struct Depths {
    mean: f64,
    square_spread: f64,
    near: f64,
}

impl Tail {
    #[inline(always)]
    fn density(&self, square: f64) -> f64 {
        self.height * decay(square, self.inverse)
    }
}

impl Densities {
    /// The density of a match whose point is known, by its squared distance from there.
    fn of_known(&self, square: f64) -> f64 {
        let of_tail = |[share, width]: [f64; 2]| {
            let variance = (width * self.sigma).powi(2);
            share * exp(-0.5 * square / variance) / (2.0 * PI * variance)
        };
        (1.0 - self.outliers) * TAILS.into_iter().map(of_tail).sum::<f64>() + self.floor
    }

    /// `q(a)`.
    #[inline(always)]
    fn near(&self, along: f64) -> f64 {
        let density = self.near_norm / along.max(NEAREST * self.sigma);
        if along > 0.0 { density } else { 0.0 }
    }

    #[inline(always)]
    fn split(&self, w: &Whitened, t_21: &[f64; 3]) -> Split {
        let mut out = Split {
            across: [[0.0; WIDTH]; 2],
            along: [0.0; WIDTH],
            by_depth: [0.0; WIDTH],
            near: [0.0; WIDTH],
        };
        for j in 0..WIDTH {
            let along =
                |slope: &[Lanes; 3]| slope[0][j] * t_21[0] + slope[1][j] * t_21[1] + slope[2][j] * t_21[2];
            let b = [along(&w.slope[0]), along(&w.slope[1])];
            let length = (b[0] * b[0] + b[1] * b[1]).sqrt().max(SHORTEST);
            let r = [w.residual[0][j], w.residual[1][j]];
            let inverse = 1.0 / length;
            let across = (r[0] * b[1] - r[1] * b[0]) * inverse;
            let along = -(r[0] * b[0] + r[1] * b[1]) * inverse;
            let is_in_front = if w.is_in_front[j] { 1.0 } else { 0.0 };
            for (out, tail) in out.across.iter_mut().zip(&self.tails) {
                out[j] = is_in_front * tail.density(across * across);
            }
            out.along[j] = along;
            out.by_depth[j] = length;
            out.near[j] = is_in_front * self.near(along);
        }
        out
    }

    /// The densities of a few matches as most points and as near ones.
    #[inline(always)]
    fn parts(&self, split: &Split, depths: &Depths) -> [Lanes; 2] {
        let mut out = [[0.0; WIDTH]; 2];
        for j in 0..WIDTH {
            let away = split.along[j] - depths.mean * split.by_depth[j];
            let spread = depths.square_spread * split.by_depth[j] * split.by_depth[j];
            let (mut usual, mut near) = (0.0, 0.0);
            for (across, tail) in split.across.iter().zip(&self.tails) {
                usual += across[j] * normal(away * away, 1.0 / (tail.variance + spread));
                near += across[j];
            }
            out[0][j] = (1.0 - depths.near) * usual;
            out[1][j] = depths.near * near * split.near[j];
        }
        out
    }

    /// How likely each explanation of a few matches is; `near_share` is the share of near points.
    #[inline(always)]
    #[expect(clippy::needless_bitwise_bool, reason = "lazy operators branch, which no vector can")]
    fn explain(&self, still: &Lanes, at: &Places, near_share: f64) -> Explained {
        let zero = [0.0; WIDTH];
        let mut out =
            Explained { usual: zero, near: zero, across: zero, along: zero, near_across: zero, nats: zero };
        let share = 1.0 - self.outliers;
        for j in 0..WIDTH {
            let (mut usual, mut across, mut along, mut sides) = (0.0, 0.0, 0.0, 0.0);
            for tail in &self.tails {
                let side = tail.density(at.across[j] * at.across[j]);
                let inverse = 1.0 / (tail.variance + at.spread[j]);
                let all = (1.0 - near_share) * side * normal(at.away[j] * at.away[j], inverse);
                usual += all;
                across += all * tail.inverse;
                along += all * inverse;
                sides += side;
            }
            let mut near = near_share * sides * self.near(at.along[j]);
            let is_in_front = if at.is_in_front[j] { 1.0 } else { 0.0 };
            usual *= is_in_front;
            near *= is_in_front;
            let sum = share * (usual + near) + self.floor;
            out.nats[j] = ln(sum * still[j]);
            let is_doubtful = (near > usual) & (share * near < BELIEVED * sum);
            near = if is_doubtful { 0.0 } else { near };
            let scale = share / sum;
            let near_across = near * self.tails[0].inverse;
            out.usual[j] = usual * scale;
            out.near[j] = near * scale;
            out.across[j] = (across * is_in_front + near_across) * scale;
            out.near_across[j] = near_across * scale;
            out.along[j] = along * is_in_front * scale;
        }
        out
    }
}

/// `exp(−x²/(2 variance))`, by the square and the inverse of the variance.
#[inline(always)]
fn decay(square: f64, inverse: f64) -> f64 {
    exp((-0.5 * square * inverse).max(LEAST_EXPONENT))
}

/// The density of a normal variable.
#[inline(always)]
fn normal(square: f64, inverse: f64) -> f64 {
    decay(square, inverse) * (inverse * (0.5 / PI)).sqrt()
}

impl Likelihood {
    /// Of these matches, of which about so large a share is true, with noise of `sigma` pixels.
    pub(crate) fn new(
        observations: &Observations,
        indices: &[u32],
        still: &UnitQuaternion<f64>,
        sigma: f64,
        share: f64,
    ) -> Self {
        let framed = observations.framed(indices);
        let outliers = (1.0 - share).clamp(0.01, 0.99);
        let area = observations.area_of_view2().max((NEAREST * sigma).powi(2)).max(f64::MIN_POSITIVE);
        let span = ln((area.sqrt() / (NEAREST * sigma)).max(3.0));
        let tails = TAILS.map(|[share, width]| {
            let variance = (width * sigma).powi(2).max(f64::MIN_POSITIVE);
            Tail { variance, inverse: 1.0 / variance, height: share / (2.0 * PI * variance).sqrt() }
        });
        let densities =
            Densities { sigma, tails, outliers, floor: outliers / area, near_norm: 1.0 / (1.0 + span) };
        let squares = framed.square_errors(&still.to_rotation_matrix().into_inner());
        let still = squares
            .chunks(WIDTH)
            .map(|some| {
                std::array::from_fn(|j| some.get(j).map_or(1.0, |square| 1.0 / densities.of_known(*square)))
            })
            .collect();
        Self { framed, still, densities }
    }

    /// The number of matches.
    pub(crate) fn len(&self) -> usize {
        self.framed.len()
    }

    pub(crate) fn blocks(&self) -> &[Block] {
        &self.framed.blocks
    }

    /// The variance of the noise.
    pub(crate) fn variance(&self) -> f64 {
        self.densities.tails[0].variance
    }

    /// How likely each explanation of the matches of a block is.
    #[inline(always)]
    pub(crate) fn explain(&self, block: usize, at: &Places, near_share: f64) -> Explained {
        self.densities.explain(&self.still[block], at, near_share)
    }

    /// The evidence for a motion, with so many rounds of EM.
    pub(crate) fn of(&self, motion: &Motion, rounds: usize) -> Evidence {
        let r_21 = rows(&motion.q_21.to_rotation_matrix().into_inner());
        let all = widest(Splitting { likelihood: self, r_21, t_21: motion.direction.into() });
        let mut depths = self.first_depths(&all);
        for _ in 0..rounds {
            depths = self.next_depths(&all, &depths);
        }
        let [is_true, nats] = widest(Probabilities { likelihood: self, all: &all, depths });
        let of_each = |lanes: Vec<Lanes>| {
            let mut values = lanes.into_flattened();
            values.truncate(self.len());
            values
        };
        Evidence { nats: without_two(&of_each(nats)), is_true: of_each(is_true), mean_depth: depths.mean }
    }

    /// Where most inverse depths seem to be, of the matches that are near their epipolar lines.
    fn first_depths(&self, all: &[Split]) -> Depths {
        let sigma = self.densities.sigma;
        let least = self.densities.tails[0].density((NEAREST * sigma).powi(2));
        let near: Vec<[f64; 2]> = all
            .iter()
            .flat_map(|split| {
                (0..WIDTH).map(move |j| (split.across[0][j], [split.along[j], split.by_depth[j]]))
            })
            .take(self.len())
            .filter_map(|(across, at)| (across > least).then_some(at))
            .collect();
        let value = |[along, by_depth]: &[f64; 2]| along / by_depth;
        let median_of =
            |value: &dyn Fn(&[f64; 2]) -> f64| median(&mut near.iter().map(value).collect::<Vec<_>>());
        let mean = median_of(&value);
        let spread = 1.48 * median_of(&|at| (value(at) - mean).abs());
        let noise = median_of(&|[_, by_depth]| sigma / by_depth);
        let square_spread = (spread * spread - noise * noise).max(0.04 * noise * noise).max(1e-30);
        Depths { mean, square_spread, near: NEAR }
    }

    /// A round of EM.
    fn next_depths(&self, all: &[Split], depths: &Depths) -> Depths {
        let Round { usual, near, first, second, noise } =
            widest(Rounding { likelihood: self, all, depths: *depths });
        if usual <= 0.0 {
            return *depths;
        }
        let mean = first / usual;
        Depths {
            mean,
            square_spread: (second / usual - mean * mean).max(1e-6 * noise / usual),
            near: (near / (usual + near)).clamp(1e-6, 0.9),
        }
    }
}

/// All matches under one motion.
struct Splitting<'a> {
    likelihood: &'a Likelihood,
    r_21: [f64; 9],
    t_21: [f64; 3],
}

impl Work for Splitting<'_> {
    type Output = Vec<Split>;

    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> Vec<Split> {
        let Self { likelihood, r_21, t_21 } = self;
        let mut all = Vec::with_capacity(likelihood.blocks().len());
        for block in likelihood.blocks() {
            all.push(likelihood.densities.split(&whitened(&r_21, block), &t_21));
        }
        all
    }
}

/// What a round of EM sums up, of the matches that are no false ones: their shares as most points and as near ones, and of the
/// former the inverse depths, their squares and their variances.
struct Round {
    usual: f64,
    near: f64,
    first: f64,
    second: f64,
    noise: f64,
}

struct Rounding<'a> {
    likelihood: &'a Likelihood,
    all: &'a [Split],
    depths: Depths,
}

impl Work for Rounding<'_> {
    type Output = Round;

    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> Round {
        let Self { likelihood, all, depths } = self;
        let densities = &likelihood.densities;
        let false_ones = densities.floor / (1.0 - densities.outliers);
        let variance = likelihood.variance();
        let mut sums = [[0.0; WIDTH]; 5];
        for (split, block) in all.iter().zip(likelihood.blocks()) {
            let [usual, near] = densities.parts(split, &depths);
            for j in 0..WIDTH {
                let is_live = if block.is_live[j] { 1.0 } else { 0.0 };
                let inverse = is_live / (usual[j] + near[j] + false_ones);
                // The inverse depth that a point has, given where it is seen, mostly of the narrow part of the noise.
                let by_length = 1.0 / split.by_depth[j];
                let square = split.by_depth[j] * split.by_depth[j];
                let share = depths.square_spread * square / (variance + depths.square_spread * square);
                let rho = depths.mean + share * (split.along[j] * by_length - depths.mean);
                let of_match = variance * by_length * by_length;
                let weight = usual[j] * inverse;
                sums[0][j] += weight;
                sums[1][j] += near[j] * inverse;
                sums[2][j] += weight * rho;
                sums[3][j] += weight * (share * of_match + rho * rho);
                sums[4][j] += weight * of_match;
            }
        }
        let [usual, near, first, second, noise] = sums.map(|sum| sum.iter().sum());
        Round { usual, near, first, second, noise }
    }
}

/// The probability of each match that it is true, and the logarithms of the likelihoods over those without a translation.
struct Probabilities<'a> {
    likelihood: &'a Likelihood,
    all: &'a [Split],
    depths: Depths,
}

impl Work for Probabilities<'_> {
    type Output = [Vec<Lanes>; 2];

    #[inline(always)]
    #[expect(clippy::needless_bitwise_bool, reason = "lazy operators branch, which no vector can")]
    fn run<S: Simd>(self, _: S) -> [Vec<Lanes>; 2] {
        let Self { likelihood: Likelihood { still, densities, .. }, all, depths } = self;
        let [mut is_true, mut nats] = [Vec::with_capacity(all.len()), Vec::with_capacity(all.len())];
        for (split, still) in all.iter().zip(still) {
            let [usual, near] = densities.parts(split, &depths);
            let (mut probability, mut logarithm) = ([0.0; WIDTH], [0.0; WIDTH]);
            for j in 0..WIDTH {
                let [usual, near] =
                    [(1.0 - densities.outliers) * usual[j], (1.0 - densities.outliers) * near[j]];
                let sum = usual + near + densities.floor;
                let is_doubtful = (near > usual) & (near < BELIEVED * sum);
                probability[j] = if is_doubtful { 0.0 } else { 1.0 - densities.floor / sum };
                logarithm[j] = ln(sum * still[j]);
            }
            is_true.push(probability);
            nats.push(logarithm);
        }
        [is_true, nats]
    }
}

/// The sum of what the matches say without its two largest terms, where they are positive: the direction of the translation is free,
/// which explains any two.
pub(crate) fn without_two(all: &[f64]) -> f64 {
    let mut largest = [0.0_f64; 2];
    for &x in all {
        largest = if x > largest[0] { [x, largest[0]] } else { [largest[0], largest[1].max(x)] };
    }
    all.iter().sum::<f64>() - largest[0] - largest[1]
}

#[cfg(test)]
mod tests;
