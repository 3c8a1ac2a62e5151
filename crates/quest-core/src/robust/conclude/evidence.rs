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

use crate::robust::data::observations::Observations;
use crate::robust::data::point_transfer::{Displacement, Framed};
use crate::solver::shared::motion::Motion;

/// The shares and the widths of the noise: one keypoint in ten is three times less sharp. The decisions are not sensitive to them
/// between 5 and 20 % and between two and five times.
const TAILS: [[f64; 2]; 2] = [[0.9, 1.0], [0.1, 3.0]];

/// The density of near points is flat below this multiple of the noise, where they cannot be told from others.
const NEAREST: f64 = 3.0;

/// The share of near points to begin with. EM changes it.
const NEAR: f64 = 0.05;

/// A match counts as a near point where at least this much of its probability says so. A false match that lies near its epipolar line
/// by chance looks like a near point, and has the lever of one.
const BELIEVED: f64 = 0.9;

/// Rounds of EM. Twelve leave Λ within a tenth of its limit.
pub(crate) const ROUNDS: usize = 12;

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
    /// `p0` of each match.
    still: Vec<f64>,
    sigma: f64,
    /// `ε` and `ε/A`.
    outliers: f64,
    floor: f64,
    /// The normalisation of `q`.
    near_norm: f64,
}

/// The explanations of a match: their probabilities, and the sums of these over the variances across and along its epipolar line.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Explained {
    pub(crate) usual: f64,
    pub(crate) near: f64,
    pub(crate) across: f64,
    pub(crate) along: f64,
    /// The part of near points in `across`.
    pub(crate) near_across: f64,
    /// The logarithm of its likelihood over that without a translation.
    pub(crate) nats: f64,
}

/// A match under one motion.
struct Split {
    /// The densities `ck N(r; k²σ²)`.
    across: [f64; 2],
    along: f64,
    /// `|b|`, by how much a unit of inverse depth moves it.
    by_depth: f64,
    /// `q(a)`.
    near: f64,
}

/// What most inverse depths are.
struct Depths {
    mean: f64,
    square_spread: f64,
    near: f64,
}

fn normal(square: f64, variance: f64) -> f64 {
    (-0.5 * square / variance).exp() / (2.0 * PI * variance).sqrt()
}

fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
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
        let span = (area.sqrt() / (NEAREST * sigma)).max(3.0).ln();
        let mut all = Self {
            framed,
            still: Vec::new(),
            sigma,
            outliers,
            floor: outliers / area,
            near_norm: 1.0 / (1.0 + span),
        };
        let squares = all.framed.square_errors(&still.to_rotation_matrix().into_inner());
        all.still = squares.into_iter().map(|square| all.density(square)).collect();
        all
    }

    /// The density of a match whose point is known, by its squared distance from there.
    fn density(&self, square: f64) -> f64 {
        let of_tail = |[share, width]: [f64; 2]| {
            let variance = (width * self.sigma).powi(2);
            share * (-0.5 * square / variance).exp() / (2.0 * PI * variance)
        };
        (1.0 - self.outliers) * TAILS.into_iter().map(of_tail).sum::<f64>() + self.floor
    }

    /// The variance of the noise.
    pub(crate) fn variance(&self) -> f64 {
        (self.sigma * self.sigma).max(f64::MIN_POSITIVE)
    }

    /// How far each explanation of a match is likely, which is so far across its epipolar line and from its expected place along
    /// it; `along` is how far it has moved there, `spread` the variance that depths add, `near_share` the share of near points.
    pub(crate) fn explain(
        &self,
        index: usize,
        [across, away]: [f64; 2],
        along: f64,
        spread: f64,
        near_share: f64,
        is_in_front: bool,
    ) -> Explained {
        let mut found =
            Explained { usual: 0.0, near: 0.0, across: 0.0, along: 0.0, near_across: 0.0, nats: 0.0 };
        let mut near = 0.0;
        if is_in_front {
            for [share, width] in TAILS {
                let variance = (width * self.sigma).powi(2);
                let side = share * normal(across * across, variance);
                let all = (1.0 - near_share) * side * normal(away * away, variance + spread);
                found.usual += all;
                found.across += all / variance;
                found.along += all / (variance + spread);
                near += side;
            }
            let is_near = along > 0.0;
            near *= if is_near { near_share * self.near_norm / along.max(NEAREST * self.sigma) } else { 0.0 };
        }
        let share = 1.0 - self.outliers;
        let sum = share * (found.usual + near) + self.floor;
        found.nats = (sum / self.still[index]).ln();
        if near > found.usual && share * near < BELIEVED * sum {
            near = 0.0;
        }
        found.near_across = near / self.variance();
        found.across += found.near_across;
        let scale = share / sum;
        found.usual *= scale;
        found.near = near * scale;
        found.across *= scale;
        found.near_across *= scale;
        found.along *= scale;
        found
    }

    /// The displacements of the matches from where a rotation takes them.
    pub(crate) fn displacements(&self, q_21: &UnitQuaternion<f64>) -> Vec<Displacement> {
        self.framed.displacements(&q_21.to_rotation_matrix().into_inner())
    }

    /// The evidence for a motion, with so many rounds of EM.
    pub(crate) fn of(&self, motion: &Motion, rounds: usize) -> Evidence {
        let all: Vec<Split> =
            self.displacements(&motion.q_21).iter().map(|d| self.split(d, motion)).collect();
        let mut depths = self.first_depths(&all);
        for _ in 0..rounds {
            depths = self.next_depths(&all, &depths);
        }
        let (mut is_true, mut nats) = (Vec::with_capacity(all.len()), Vec::with_capacity(all.len()));
        for (split, p0) in all.iter().zip(&self.still) {
            let [usual, near] = self.parts(split, &depths).map(|p| (1.0 - self.outliers) * p);
            let p1 = usual + near + self.floor;
            let is_doubtful = near > usual && near < BELIEVED * p1;
            is_true.push(if is_doubtful { 0.0 } else { 1.0 - self.floor / p1 });
            nats.push((p1 / p0).ln());
        }
        Evidence { nats: without_two(nats), is_true, mean_depth: depths.mean }
    }

    fn split(&self, d: &Displacement, motion: &Motion) -> Split {
        let b = [0, 1].map(|k| d.slope[k].dot(&motion.direction));
        let length = b[0].hypot(b[1]).max(1e-12);
        let [r0, r1] = d.residual;
        let across = (r0 * b[1] - r1 * b[0]) / length;
        let along = -(r0 * b[0] + r1 * b[1]) / length;
        let of_tail =
            |[share, width]: [f64; 2]| share * normal(across * across, (width * self.sigma).powi(2));
        let is_near = d.is_in_front && along > 0.0;
        Split {
            across: if d.is_in_front { TAILS.map(of_tail) } else { [0.0; 2] },
            along,
            by_depth: length,
            near: if is_near { self.near_norm / along.max(NEAREST * self.sigma) } else { 0.0 },
        }
    }

    /// The densities of a match as one of most points and as a near one.
    fn parts(&self, split: &Split, depths: &Depths) -> [f64; 2] {
        let away = split.along - depths.mean * split.by_depth;
        let spread = depths.square_spread * split.by_depth * split.by_depth;
        let of_tail = |(across, [_, width]): (f64, [f64; 2])| {
            let variance = (width * self.sigma).powi(2) + spread;
            across * normal(away * away, variance)
        };
        let usual: f64 = split.across.into_iter().zip(TAILS).map(of_tail).sum();
        let near = split.across.iter().sum::<f64>() * split.near;
        [(1.0 - depths.near) * usual, depths.near * near]
    }

    /// Where most inverse depths seem to be, of the matches that are near their epipolar lines.
    fn first_depths(&self, all: &[Split]) -> Depths {
        let least = TAILS[0][0] * normal((NEAREST * self.sigma).powi(2), self.sigma * self.sigma);
        let near: Vec<_> = all.iter().filter(|split| split.across[0] > least).collect();
        let value = |split: &&Split| split.along / split.by_depth;
        let mean = median(near.iter().map(value).collect());
        let spread = 1.48 * median(near.iter().map(|split| (value(split) - mean).abs()).collect());
        let noise = median(near.iter().map(|split| self.sigma / split.by_depth).collect());
        let square_spread = (spread * spread - noise * noise).max(0.04 * noise * noise).max(1e-30);
        Depths { mean, square_spread, near: NEAR }
    }

    /// A round of EM.
    fn next_depths(&self, all: &[Split], depths: &Depths) -> Depths {
        let (mut usual_sum, mut near_sum, mut first, mut second, mut noise) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for split in all {
            let [usual, near] = self.parts(split, depths);
            if usual + near <= 0.0 {
                continue;
            }
            let all = usual + near + self.floor / (1.0 - self.outliers);
            near_sum += near / all;
            // The inverse depth that a point has, given where it is seen, mostly of the narrow part of the noise.
            let square = split.by_depth * split.by_depth;
            let variance = self.variance();
            let share = depths.square_spread * square / (variance + depths.square_spread * square);
            let rho = depths.mean + share * (split.along / split.by_depth - depths.mean);
            let weight = usual / all;
            usual_sum += weight;
            first += weight * rho;
            second += weight * (share * variance / square + rho * rho);
            noise += weight * variance / square;
        }
        if usual_sum <= 0.0 {
            return Depths { ..*depths };
        }
        let mean = first / usual_sum;
        Depths {
            mean,
            square_spread: (second / usual_sum - mean * mean).max(1e-6 * noise / usual_sum),
            near: (near_sum / (usual_sum + near_sum)).clamp(1e-6, 0.9),
        }
    }
}

/// The sum of what the matches say without its two largest terms, where they are positive: the direction of the translation is free,
/// which explains any two.
pub(crate) fn without_two(mut all: Vec<f64>) -> f64 {
    let sum: f64 = all.iter().sum();
    all.sort_unstable_by(|a, b| b.total_cmp(a));
    sum - all.iter().take(2).map(|x| x.max(0.0)).sum::<f64>()
}
