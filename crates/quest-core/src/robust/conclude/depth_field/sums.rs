//! What a round of a [fit](super::fit) sums up over all matches, a few of them at a time in lanes.

use nalgebra::Matrix6;

use crate::algebra::number::cross;
use crate::algebra::symmetric::symmetric;
use crate::algebra::vectors::widest::{Simd, Work, add_product, widest};
use crate::robust::conclude::depth_field::field::{DepthField, Equations, PARAMETERS, Parameters, Terms};
use crate::robust::conclude::evidence::{Explained, Likelihood, Places};
use crate::robust::data::point_transfer::{Lanes, WIDTH, Whitened, rows, whitened};

/// A displacement by a unit of inverse depth that is shorter than this, in pixels, has no direction.
const LEAST_LENGTH: f64 = 1e-9;

/// Entries of the upper triangles of symmetric matrices.
const POSE_ENTRIES: usize = 6 * 7 / 2;
const ENTRIES: usize = PARAMETERS * (PARAMETERS + 1) / 2;

const ZERO: Lanes = [0.0; WIDTH];

/// The sums over all matches.
pub(crate) struct Sums {
    /// The normal equations of what lies across the epipolar lines, which depends on the pose alone, and of what lies along them.
    pub(crate) across: Matrix6<f64>,
    pub(crate) along: Equations,
    pub(crate) gradient: Parameters,
    /// Of the probabilities that a match is a point of the field, and that it is a near one.
    pub(crate) usual: f64,
    pub(crate) near: f64,
    /// Of what the matches say of `s²`.
    pub(crate) square_spread: f64,
    /// Of the parts of the spread in what is left along the lines.
    pub(crate) share: f64,
    /// The logarithm of each likelihood over that without a translation.
    pub(crate) nats: Vec<f64>,
}

impl Sums {
    /// Of a pose with a field; `terms` are the polynomials at the points of the matches of the likelihood.
    pub(crate) fn new(at: &DepthField, terms: &[Terms], likelihood: &Likelihood) -> Self {
        widest(Round { at, terms, likelihood })
    }
}

/// A few matches under a motion with a field of depths.
pub(crate) struct Placed {
    /// By how much they move along their epipolar lines, by a unit of inverse depth, and in which direction.
    length: Lanes,
    pub(crate) inverse_length: Lanes,
    u: [Lanes; 2],
    /// What the field says of their inverse depths, and what the matches say.
    pub(crate) mean: Lanes,
    pub(crate) depth: Lanes,
    across: Lanes,
    away: Lanes,
    /// The part of what the matches say in what is known of their inverse depths.
    pub(crate) share: Lanes,
    /// By how much they move along their epipolar lines with a turn and with a translation.
    pub(crate) by_turn: [Lanes; 3],
    pub(crate) by_unit: [Lanes; 3],
    pub(crate) explained: Explained,
}

impl Placed {
    /// The matches of block `index`.
    #[inline(always)]
    pub(crate) fn new(
        at: &DepthField,
        w: &Whitened,
        terms: &Terms,
        likelihood: &Likelihood,
        index: usize,
    ) -> Self {
        let [mut length, mut inverse_length, mut mean, mut depth, mut share] = [ZERO; 5];
        let mut u = [ZERO; 2];
        let [mut by_turn, mut by_unit] = [[ZERO; 3]; 2];
        let mut places =
            Places { across: ZERO, away: ZERO, along: ZERO, spread: ZERO, is_in_front: w.is_in_front };
        for (terms, coefficient) in terms.iter().zip(&at.field) {
            for j in 0..WIDTH {
                mean[j] += terms[j] * coefficient;
            }
        }
        let variance = likelihood.variance();
        for j in 0..WIDTH {
            let unit = |s: &[Lanes; 3]| s[0][j] * at.t_21.x + s[1][j] * at.t_21.y + s[2][j] * at.t_21.z;
            let b = [unit(&w.slope[0]), unit(&w.slope[1])];
            let norm = (b[0] * b[0] + b[1] * b[1]).sqrt();
            let is_long = norm > LEAST_LENGTH;
            let norm = if is_long { norm } else { LEAST_LENGTH };
            let inverse = 1.0 / norm;
            // Without a translation any two directions do.
            let (u0, u1) = if is_long { (b[0] * inverse, b[1] * inverse) } else { (1.0, 0.0) };
            let along = -(w.residual[0][j] * u0 + w.residual[1][j] * u1);
            mean[j] += 1.0;
            length[j] = norm;
            depth[j] = along * inverse;
            inverse_length[j] = inverse;
            places.across[j] = w.residual[0][j] * u1 - w.residual[1][j] * u0;
            places.along[j] = along;
            places.away[j] = mean[j] * norm - along;
            places.spread[j] = at.square_spread * norm * norm;
            share[j] = places.spread[j] / (variance + places.spread[j]);
            u[0][j] = u0;
            u[1][j] = u1;
            let slope = [0, 1, 2].map(|k| w.slope[0][k][j] * u0 + w.slope[1][k][j] * u1);
            let y = [w.y[0][j], w.y[1][j], w.y[2][j]];
            for (k, turn) in cross(&y, &slope).into_iter().enumerate() {
                by_turn[k][j] = turn;
                by_unit[k][j] = slope[k];
            }
        }
        let explained = likelihood.explain(index, &places, at.near);
        let Places { across, away, .. } = places;
        Self { length, inverse_length, u, mean, depth, across, away, share, by_turn, by_unit, explained }
    }

    /// The inverse depth that match `j` is likeliest to have, as a point of the field.
    #[inline(always)]
    pub(crate) fn rho(&self, j: usize) -> f64 {
        self.mean[j] + self.share[j] * (self.depth[j] - self.mean[j])
    }
}

#[inline(always)]
fn times(a: &Lanes, b: &Lanes) -> Lanes {
    std::array::from_fn(|j| a[j] * b[j])
}

/// A round over all matches.
struct Round<'a> {
    at: &'a DepthField,
    terms: &'a [Terms],
    likelihood: &'a Likelihood,
}

impl Work for Round<'_> {
    type Output = Sums;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Sums {
        let Self { at, terms, likelihood } = self;
        let r_21 = rows(&at.q_21.to_rotation_matrix().into_inner());
        let mut sums = InLanes {
            across: [ZERO; POSE_ENTRIES],
            along: [ZERO; ENTRIES],
            gradient: [ZERO; PARAMETERS],
            shares: [ZERO; 4],
        };
        let mut nats = Vec::with_capacity(terms.len());
        for (index, (block, terms)) in likelihood.blocks().iter().zip(terms).enumerate() {
            let w = whitened(&r_21, block);
            let placed = Placed::new(at, &w, terms, likelihood, index);
            let live = block.is_live.map(|is_live| if is_live { 1.0 } else { 0.0 });
            nats.push(times(&live, &placed.explained.nats));
            sums.add_shares(&placed, &live, likelihood.variance());
            sums.add_across(simd, &placed, &w, &live);
            sums.add_along(simd, &placed, terms, &live);
        }
        sums.total(nats.into_flattened())
    }
}

/// The sums in lanes.
struct InLanes {
    across: [Lanes; POSE_ENTRIES],
    along: [Lanes; ENTRIES],
    gradient: [Lanes; PARAMETERS],
    /// `usual`, `near`, `square_spread` and `share`.
    shares: [Lanes; 4],
}

impl InLanes {
    #[inline(always)]
    fn add_shares(&mut self, placed: &Placed, live: &Lanes, variance: f64) {
        let [usual, near, square_spread, share] = &mut self.shares;
        for j in 0..WIDTH {
            let deviation = placed.rho(j) - placed.mean[j];
            let of_noise = placed.share[j] * variance * placed.inverse_length[j] * placed.inverse_length[j];
            let probability = live[j] * placed.explained.usual[j];
            usual[j] += probability;
            near[j] += live[j] * placed.explained.near[j];
            square_spread[j] += probability * (deviation * deviation + of_noise);
            share[j] += probability * placed.share[j];
        }
    }

    /// Adds what the distances from the epipolar lines say of the pose. The derivatives of points of the field and of near points, whose
    /// lever is their own depth, differ by the inverse depth in those by the translation.
    #[inline(always)]
    fn add_across<S: Simd>(&mut self, simd: S, placed: &Placed, w: &Whitened, live: &Lanes) {
        let mut side = [ZERO; 6];
        // Summed with the inverse depths to the powers 0, 1 and 2.
        let mut weights = [ZERO; 3];
        for j in 0..WIDTH {
            let (rho, own) = (placed.rho(j), placed.depth[j]);
            let of_near = live[j] * placed.explained.near_across[j];
            let of_field = live[j] * placed.explained.across[j] - of_near;
            weights[0][j] = of_field + of_near;
            weights[1][j] = of_field * rho + of_near * own;
            weights[2][j] = of_field * rho * rho + of_near * own * own;
            let (u0, u1) = (placed.u[0][j], placed.u[1][j]);
            let slope = [0, 1, 2].map(|k| w.slope[0][k][j] * u1 - w.slope[1][k][j] * u0);
            let turn = cross(&[w.y[0][j], w.y[1][j], w.y[2][j]], &slope);
            for k in 0..3 {
                side[k][j] = turn[k];
                side[k + 3][j] = slope[k];
            }
        }
        let mut entry = 0;
        for a in 0..6 {
            let weighted = [0, 1].map(|k| times(&side[a], &weights[k + usize::from(a > 2)]));
            add_product(simd, &mut self.gradient[a], &weighted[0], &placed.across);
            for b in a..6 {
                add_product(simd, &mut self.across[entry], &weighted[usize::from(b > 2)], &side[b]);
                entry += 1;
            }
        }
    }

    /// Adds what the places along the epipolar lines say of the pose and the field.
    #[inline(always)]
    fn add_along<S: Simd>(&mut self, simd: S, placed: &Placed, terms: &Terms, live: &Lanes) {
        let mut row = [ZERO; PARAMETERS];
        for k in 0..3 {
            row[k] = placed.by_turn[k];
            row[k + 3] = times(&placed.by_unit[k], &placed.mean);
        }
        for (row, terms) in row[6..].iter_mut().zip(terms) {
            *row = times(terms, &placed.length);
        }
        let weight = times(live, &placed.explained.along);
        let mut entry = 0;
        for a in 0..PARAMETERS {
            let weighted = times(&row[a], &weight);
            add_product(simd, &mut self.gradient[a], &weighted, &placed.away);
            for row in &row[a..] {
                add_product(simd, &mut self.along[entry], &weighted, row);
                entry += 1;
            }
        }
    }

    #[inline(always)]
    fn total(&self, nats: Vec<f64>) -> Sums {
        let sum = |lanes: Lanes| lanes.iter().sum::<f64>();
        let [usual, near, square_spread, share] = self.shares.map(sum);
        Sums {
            across: symmetric(&self.across.map(sum)),
            along: symmetric(&self.along.map(sum)),
            gradient: self.gradient.map(sum).into(),
            usual,
            near,
            square_spread,
            share,
            nats,
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};

    use super::*;
    use crate::Correspondence;
    use crate::robust::conclude::depth_field::field::{Field, TERMS, terms};
    use crate::robust::conclude::depth_field::planted::moved;
    use crate::robust::data::observations::Observations;

    /// Where points are exactly as far away as the field says and none is near, the likelihood has no variance that depends on the pose,
    /// and its derivative is minus the gradient of the sums. Eleven matches leave lanes empty.
    #[test]
    fn the_gradient_is_the_derivative_of_the_likelihood() {
        let q_21 = UnitQuaternion::new(Vector3::new(0.02, -0.01, 0.03));
        let matches: Vec<Correspondence> = (0..11)
            .map(|k| {
                let k = f64::from(k);
                let x = Vector3::new((2.1 * k).sin(), (3.7 * k).cos(), 4.0 + (1.3 * k).sin());
                let moved = q_21 * x
                    + Vector3::new(0.02, -0.01, 0.03)
                    + Vector3::new((5.0 * k).sin(), k.cos(), 0.0) * 2e-3;
                Correspondence::from_bearings(x.into(), moved.into()).unwrap()
            })
            .collect();
        let observations = Observations::new(&matches, (0..11).collect(), [[500.0; 2]; 2], 1.0);
        let all: Vec<u32> = (0..11).collect();
        let likelihood = Likelihood::new(&observations, &all, &q_21, 0.7, 0.8);
        let terms = terms(&likelihood);
        let at = DepthField {
            q_21,
            t_21: Vector3::new(0.006, -0.002, 0.007),
            field: Field::from_fn(|k, _| 0.02 * (k as f64).cos()),
            square_spread: 0.0,
            near: 0.0,
        };
        let nats = |at: &DepthField| Sums::new(at, &terms, &likelihood).nats.iter().sum::<f64>();
        let sums = Sums::new(&at, &terms, &likelihood);
        for k in 0..6 + TERMS {
            // The error of a central difference is the third derivative times the square of the step, and rounding over the step.
            let step = if k < 6 { 1e-6 } else { 1e-4 };
            let derivative = (nats(&moved(&at, k, step)) - nats(&moved(&at, k, -step))) / (2.0 * step);
            // A turn also changes what whitens a residual, by about the residual over the focal length: a few pixels of 500.
            let tolerance = if k < 3 { 1e-2 } else { 1e-6 };
            let size = sums.gradient.norm().max(1.0);
            let error = derivative + sums.gradient[k];
            assert!(error.abs() < tolerance * size, "{k}: {derivative} {}", sums.gradient[k]);
        }
    }
}
