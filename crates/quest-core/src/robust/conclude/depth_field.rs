//! The pose of a camera that hardly moves, by the likelihood of all matches with the depths of the points integrated out.
//!
//! An essential matrix gives every point a depth of its own. Where the parallax is about the noise, what that finds is far from
//! linear in the noise, and its first-order covariance is too small (J. Neyman, E. L. Scott, *Consistent estimates based on
//! partially consistent observations*, Econometrica 1948). Here the inverse depths are a smooth function of the image and a
//! spread around that:
//!
//! ```text
//! ρ = 1 + Σj cj φj(x) + s ξ,   cj ~ N(0, gj²),   ξ ~ N(0, 1)
//! ```
//!
//! The unit of length is the mean inverse depth, `φj` are polynomials up to the fourth degree and `s` is estimated. The displacement
//! of a match then has the mean `−ρ̄ b` and the variance `k² σ² I + s² b bᵀ`, with `b` the displacement by a unit of inverse depth
//! and `k` one of the widths of the noise ([`evidence`](crate::robust::conclude::evidence) has the densities of near points and
//! of false matches beside it). The model is regular where there is no translation. Where the parallax is well above the noise
//! `s |b|` is as well, what lies along the epipolar line counts for nothing, and what is left are the equations of an essential
//! matrix.
//!
//! Each round holds the variances, takes the expected share of each explanation of each match, and makes a Gauss–Newton step of
//! the rotation, the translation and the field together.

use nalgebra::{Matrix6, SMatrix, SVector, UnitQuaternion, Vector3};

use crate::algebra::vectors::widest::{Simd, Work, add_product, widest};
use crate::robust::conclude::evidence::{Explained, Likelihood, Places, without_two};
use crate::robust::data::point_transfer::{Block, Lanes, WIDTH, Whitened, rows, whitened};

/// Polynomials of two variables up to the fourth degree, but for the constant.
pub(crate) const TERMS: usize = 14;
const DEGREE: usize = 4;
pub(crate) const PARAMETERS: usize = 6 + TERMS;

/// The deviation of a coefficient of the first degree; its square halves with each further degree. A corridor that is twice as near
/// at its sides as in the middle has 0.3.
const RELIEF: f64 = 0.3;

/// The deviation of all inverse depths over their mean is about the first, and its logarithm is known to the second. Depths that are uniform
/// from 4 to 9 have 0.24, logarithms of depths that are uniform from 2 to 40 have 0.8. Measured, lengths at a parallax of 0.01:
/// with 0.7 in place of 0.5 they are a twentieth worse.
const USUAL_SPREAD: f64 = 0.32;
const FACTOR: f64 = 0.5;

/// The field is constant beyond this many deviations from the middle of the points, where polynomials would grow. Points that are
/// uniform in the image end at 1.73.
const EDGE: f64 = 1.8;

/// The least spread of the inverse depths, squared.
const LEAST_SPREAD: f64 = 1e-8;

/// A round changes the square of the spread by what EM says, to this power: that goes nearly twice as fast to the same limit, and
/// any power below two converges. What EM says counts as at most this factor.
const RELAXED: f64 = 1.8;
const MOST_CHANGE: f64 = 3.0;

/// A displacement by a unit of inverse depth that is shorter than this, in pixels, has no direction.
const LEAST_LENGTH: f64 = 1e-9;

/// The share of near points to begin with, and its bounds, which keep both explanations possible.
const NEAR: f64 = 0.02;
const LEAST_NEAR: f64 = 1e-6;
const MOST_NEAR: f64 = 0.9;

/// So many near points are chance: the direction of the translation is free to fit two false matches, and among thirty false matches
/// a third and a fourth agree with some two.
const FREE: f64 = 4.0;

/// A step may lower the likelihood by so many nats: one that is longer than that of EM overshoots a little near the limit.
const LOST: f64 = 1.0;

/// A fit is at its end when its step gains about this many nats. That step is made.
const NEGLIGIBLE: f64 = 0.01;

/// This share of the diagonal is added to the normal equations, which are singular without a translation: the field moves no point.
const RIDGE: f64 = 1e-9;

/// The polynomials at the points of a few matches.
pub(crate) type Terms = [Lanes; TERMS];
type Field = SVector<f64, TERMS>;
pub(crate) type Parameters = SVector<f64, PARAMETERS>;
pub(crate) type Equations = SMatrix<f64, PARAMETERS, PARAMETERS>;
type Factor = nalgebra::Cholesky<f64, nalgebra::Const<PARAMETERS>>;

/// Where a fit begins and what it finds.
#[derive(Clone, Debug)]
pub(crate) struct DepthField {
    pub(crate) q_21: UnitQuaternion<f64>,
    /// In units of the inverse of the mean inverse depth.
    pub(crate) t_21: Vector3<f64>,
    field: Field,
    /// `s²`.
    pub(crate) square_spread: f64,
    pub(crate) near: f64,
}

/// The logarithm of the likelihood over that without a translation, in nats, and the covariance of all parameters: the turn, the
/// translation and the field.
#[derive(Clone, Debug)]
pub(crate) struct Fit {
    pub(crate) at: DepthField,
    pub(crate) nats: f64,
    pub(crate) covariance: Equations,
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
    /// The inverse depth that match `j` is likeliest to have, as a point of the field.
    #[inline(always)]
    pub(crate) fn rho(&self, j: usize) -> f64 {
        self.mean[j] + self.share[j] * (self.depth[j] - self.mean[j])
    }
}

/// What a round sums up.
struct Sums {
    /// Of what lies across the epipolar lines, which no depth changes, and of what lies along them.
    across: Matrix6<f64>,
    along: Equations,
    gradient: Parameters,
    usual: f64,
    near: f64,
    square_spread: f64,
    /// Summed shares of the spread in what is left along the lines.
    share: f64,
    nats: Vec<f64>,
}

/// The polynomials at the points of the matches of a likelihood.
pub(crate) fn terms(likelihood: &Likelihood) -> Vec<Terms> {
    let places: Vec<[Lanes; 2]> = likelihood.blocks().iter().map(place).collect();
    let count = likelihood.len().max(1) as f64;
    let axis = |k: usize| {
        let each = || places.iter().flat_map(move |place| place[k]).take(likelihood.len());
        let mean = each().sum::<f64>() / count;
        let square = each().map(|x| (x - mean).powi(2)).sum::<f64>() / count;
        (mean, 1.0 / square.sqrt().max(1e-9))
    };
    let axes = [axis(0), axis(1)];
    let of_block = |place: &[Lanes; 2]| {
        let mut terms = [[0.0; WIDTH]; TERMS];
        for j in 0..WIDTH {
            let at = [0, 1].map(|k| (place[k][j] - axes[k].0) * axes[k].1);
            for (lanes, term) in terms.iter_mut().zip(polynomials(at)) {
                lanes[j] = term;
            }
        }
        terms
    };
    places.iter().map(of_block).collect()
}

/// Where the points are seen in view 1, in the plane.
fn place(block: &Block) -> [Lanes; 2] {
    let [x, y, z] = &block.x1;
    let depth = z.map(|z| if z.abs() > 1e-3 { z } else { 1e-3 });
    [x, y].map(|x| std::array::from_fn(|j| x[j] / depth[j]))
}

/// The degree of each term.
fn degrees() -> impl Iterator<Item = [usize; 2]> {
    (0..=DEGREE).flat_map(|i| (0..=DEGREE - i).map(move |j| [i, j])).filter(|[i, j]| i + j > 0)
}

/// Products of Hermite polynomials of mean zero and unit variance.
fn polynomials(at: [f64; 2]) -> impl Iterator<Item = f64> {
    let hermite = at.map(|x| {
        let x = x.clamp(-EDGE, EDGE);
        let square = x * x;
        [
            1.0,
            x,
            (square - 1.0) / 2_f64.sqrt(),
            (square - 3.0) * x / 6_f64.sqrt(),
            ((square - 6.0) * square + 3.0) / 24_f64.sqrt(),
        ]
    });
    degrees().map(move |[i, j]| hermite[0][i] * hermite[1][j])
}

/// `1/gj²`.
fn precisions() -> Field {
    let of_degree = |[i, j]: [usize; 2]| {
        let halvings = i32::try_from(i + j).map_or(0, |degree| degree - 1);
        2_f64.powi(halvings) / (RELIEF * RELIEF)
    };
    Field::from_iterator(degrees().map(of_degree))
}

impl DepthField {
    /// A pose whose translation is in units of the mean depth, of points whose inverse depths spread by a share of their mean.
    pub(crate) fn start(q_21: UnitQuaternion<f64>, t_21: Vector3<f64>, spread: f64) -> Self {
        Self { q_21, t_21, field: Field::zeros(), square_spread: spread * spread, near: NEAR }
    }

    /// By what share of their mean inverse depths differ from those of a plane, which are linear in the image.
    pub(crate) fn off_plane(&self) -> f64 {
        let linear = degrees().zip(&self.field).filter(|([i, j], _)| i + j == 1).map(|(_, c)| c * c);
        (self.square_spread + self.field.norm_squared() - linear.sum::<f64>()).max(0.0).sqrt()
    }

    /// Whether two are the same as far as the covariance of one tells.
    pub(crate) fn is_near(&self, other: &Fit) -> bool {
        const NEAR: f64 = 0.5;
        let turn = (self.q_21 * other.at.q_21.inverse()).scaled_axis();
        let by = self.t_21 - other.at.t_21;
        let apart = |x: f64, k: usize| x * x / other.covariance[(k, k)];
        let sum: f64 = (0..3).map(|k| apart(turn[k], k) + apart(by[k], k + 3)).sum();
        sum < NEAR * NEAR
    }

    /// So many rounds, and the likelihood of what they lead to. `None` where the matches do not determine the rotation.
    ///
    /// A step that lowers the likelihood is halved: behind the translation without length lies the one of the opposite sign,
    /// which puts near points behind the cameras.
    pub(crate) fn fit(mut self, terms: &[Terms], likelihood: &Likelihood, rounds: usize) -> Option<Fit> {
        let precisions = precisions();
        let (mut sums, mut from) = (self.round(terms, likelihood), None);
        for _ in 0..rounds {
            let worth = self.worth(&sums, &precisions);
            let mut gain = f64::INFINITY;
            match from.take() {
                Some((before, step, before_worth)) if worth < before_worth - LOST => {
                    let step: Parameters = step * 0.5;
                    self = Self::stepped(&before, &step);
                    from = Some((before, step, before_worth));
                }
                _ => {
                    let factor = regularised(&sums, &precisions)?;
                    let step = self.step(&sums, &precisions, &factor)?;
                    let next = Self::stepped(&self, &step).with_shares(&sums, &factor);
                    let spread = (next.square_spread / self.square_spread).ln();
                    gain =
                        0.5 * factor.l().tr_mul(&step).norm_squared() + 0.25 * sums.usual * spread * spread;
                    from = Some((std::mem::replace(&mut self, next), step, worth));
                }
            }
            sums = self.round(terms, likelihood);
            if gain < NEGLIGIBLE {
                break;
            }
        }
        if let Some((before, ..)) = from.filter(|from| self.worth(&sums, &precisions) < from.2 - LOST) {
            self = before;
            sums = self.round(terms, likelihood);
        }
        let covariance = regularised(&sums, &precisions)?.inverse();
        let nats = without_two(&sums.nats) - self.surprise(&precisions);
        let is_finite = nats.is_finite() && covariance.iter().all(|x| x.is_finite());
        is_finite.then_some(Fit { at: self, nats, covariance })
    }

    /// The logarithm of the likelihood and of what is known of the field before any match is seen, which the rounds increase.
    fn worth(&self, sums: &Sums, precisions: &Field) -> f64 {
        sums.nats.iter().sum::<f64>() - self.surprise(precisions)
    }

    /// By how many nats the field is less likely than a flat one, before any match is seen.
    fn surprise(&self, precisions: &Field) -> f64 {
        0.5 * (0..TERMS).map(|k| precisions[k] * self.field[k] * self.field[k]).sum::<f64>()
    }

    /// The step of Gauss and Newton.
    ///
    /// The matches tell the product of the translation and the spread of the inverse depths better than either. What is known of the
    /// field beforehand says nothing of the length of the translation, but a flat field, which is likelier, would make it longer.
    /// This is taken back: the derivative by the length is that with the product held. What is known of the spread is put in its place.
    fn step(&self, sums: &Sums, precisions: &Field, factor: &Factor) -> Option<Parameters> {
        let mut gradient = sums.gradient;
        for (k, precision) in precisions.iter().enumerate() {
            gradient[6 + k] += precision * self.field[k];
        }
        let mut by_length = Parameters::zeros();
        let square = self.t_21.norm_squared();
        if square > 0.0 {
            by_length.fixed_rows_mut::<3>(3).copy_from(&(self.t_21 / square));
            let all = self.square_spread + self.field.norm_squared();
            let pull =
                2.0 * self.surprise(precisions) - 0.5 * (all / USUAL_SPREAD.powi(2)).ln() / FACTOR.powi(2);
            // A translation that is about its noise changes by less, or it would turn around.
            let variance = by_length.dot(&factor.solve(&by_length));
            gradient += by_length * (pull / (1.0 + pull.abs() * variance));
        }
        let step = -factor.solve(&gradient);
        step.iter().all(|x| x.is_finite()).then_some(step)
    }

    fn stepped(&self, step: &Parameters) -> Self {
        Self {
            q_21: UnitQuaternion::new(step.fixed_rows::<3>(0).into_owned()) * self.q_21,
            t_21: self.t_21 + step.fixed_rows::<3>(3),
            field: self.field + step.fixed_rows::<TERMS>(6),
            ..*self
        }
    }

    /// The same with the spread and the share of near points that a round of EM says. The field and the pose have taken up a part of
    /// the spread, `tr(H⁻¹ A)` of its squares where `A` are the equations along the lines: 20 parameters of 70 matches would make
    /// the spread 15 % too small, and so the translation, of which often only its product with the spread is known, too long.
    fn with_shares(mut self, sums: &Sums, factor: &Factor) -> Self {
        if sums.usual > 0.0 {
            let taken = factor.solve(&sums.along).trace() * sums.share / sums.usual;
            let ratio = (sums.square_spread / self.square_spread + taken) / sums.usual;
            let ratio = ratio.clamp(1.0 / MOST_CHANGE, MOST_CHANGE).powf(RELAXED);
            self.square_spread = (self.square_spread * ratio).max(LEAST_SPREAD);
            let near = (sums.near - FREE).max(0.0);
            self.near = (near / (sums.usual + near)).clamp(LEAST_NEAR, MOST_NEAR);
        }
        self
    }

    fn round(&self, terms: &[Terms], likelihood: &Likelihood) -> Sums {
        widest(Round { at: self, r_21: self.rows(), terms, likelihood })
    }

    /// The rotation as the kernels take it.
    pub(crate) fn rows(&self) -> [f64; 9] {
        rows(&self.q_21.to_rotation_matrix().into_inner())
    }

    /// Where the matches of a block are.
    #[inline(always)]
    pub(crate) fn place(&self, w: &Whitened, terms: &Terms, likelihood: &Likelihood, block: usize) -> Placed {
        let [mut length, mut inverse_length, mut mean, mut depth, mut share] = [[0.0; WIDTH]; 5];
        let mut u = [[0.0; WIDTH]; 2];
        let [mut by_turn, mut by_unit] = [[[0.0; WIDTH]; 3]; 2];
        let zero = [0.0; WIDTH];
        let mut at =
            Places { across: zero, away: zero, along: zero, spread: zero, is_in_front: w.is_in_front };
        for (terms, coefficient) in terms.iter().zip(&self.field) {
            for j in 0..WIDTH {
                mean[j] += terms[j] * coefficient;
            }
        }
        let variance = likelihood.variance();
        for j in 0..WIDTH {
            let unit = |s: &[Lanes; 3]| s[0][j] * self.t_21.x + s[1][j] * self.t_21.y + s[2][j] * self.t_21.z;
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
            at.across[j] = w.residual[0][j] * u1 - w.residual[1][j] * u0;
            at.along[j] = along;
            at.away[j] = mean[j] * norm - along;
            at.spread[j] = self.square_spread * norm * norm;
            share[j] = at.spread[j] / (variance + at.spread[j]);
            u[0][j] = u0;
            u[1][j] = u1;
            let slope = [0, 1, 2].map(|k| w.slope[0][k][j] * u0 + w.slope[1][k][j] * u1);
            let y = [w.y[0][j], w.y[1][j], w.y[2][j]];
            for (k, turn) in cross(y, slope).into_iter().enumerate() {
                by_turn[k][j] = turn;
                by_unit[k][j] = slope[k];
            }
        }
        let explained = likelihood.explain(block, &at, self.near);
        let Places { across, away, .. } = at;
        Placed { length, inverse_length, u, mean, depth, across, away, share, by_turn, by_unit, explained }
    }
}

#[inline(always)]
fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Entries of the upper triangles of symmetric matrices.
const POSE_ENTRIES: usize = 6 * 7 / 2;
const ENTRIES: usize = PARAMETERS * (PARAMETERS + 1) / 2;

/// The sums of a round over all matches.
struct Round<'a> {
    at: &'a DepthField,
    r_21: [f64; 9],
    terms: &'a [Terms],
    likelihood: &'a Likelihood,
}

impl Work for Round<'_> {
    type Output = Sums;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Sums {
        let Self { at, r_21, terms, likelihood } = self;
        let variance = likelihood.variance();
        let mut along = [[0.0; WIDTH]; ENTRIES];
        let mut across = [[0.0; WIDTH]; POSE_ENTRIES];
        let mut gradient = [[0.0; WIDTH]; PARAMETERS];
        let [mut usual, mut near, mut square_spread, mut share] = [[0.0; WIDTH]; 4];
        let mut nats = Vec::with_capacity(terms.len());
        for (index, (block, terms)) in likelihood.blocks().iter().zip(terms).enumerate() {
            let w = whitened(&r_21, block);
            let placed = at.place(&w, terms, likelihood, index);
            let of_block = &placed.explained;
            let mut row = [[0.0; WIDTH]; PARAMETERS];
            let mut weight = [0.0; WIDTH];
            // Across the lines: the derivatives of points of the field and of near points, whose lever is their own depth, differ by
            // the inverse depth in those by the translation.
            let mut side = [[0.0; WIDTH]; 6];
            let mut weights = [[0.0; WIDTH]; 3];
            let mut of_block_nats = [0.0; WIDTH];
            for j in 0..WIDTH {
                let live = if block.is_live[j] { 1.0 } else { 0.0 };
                of_block_nats[j] = live * of_block.nats[j];
                let (rho, own) = (placed.rho(j), placed.depth[j]);
                let deviation = rho - placed.mean[j];
                let inverse = placed.inverse_length[j];
                let usual_share = live * of_block.usual[j];
                usual[j] += usual_share;
                near[j] += live * of_block.near[j];
                share[j] += usual_share * placed.share[j];
                square_spread[j] +=
                    usual_share * (deviation * deviation + placed.share[j] * variance * inverse * inverse);
                let of_near = live * of_block.near_across[j];
                let of_field = live * of_block.across[j] - of_near;
                weights[0][j] = of_field + of_near;
                weights[1][j] = of_field * rho + of_near * own;
                weights[2][j] = of_field * rho * rho + of_near * own * own;
                weight[j] = live * of_block.along[j];
                let (u0, u1) = (placed.u[0][j], placed.u[1][j]);
                let slope = [0, 1, 2].map(|k| w.slope[0][k][j] * u1 - w.slope[1][k][j] * u0);
                let turn = cross([w.y[0][j], w.y[1][j], w.y[2][j]], slope);
                for k in 0..3 {
                    side[k][j] = turn[k];
                    side[k + 3][j] = slope[k];
                    row[k][j] = placed.by_turn[k][j];
                    row[k + 3][j] = placed.by_unit[k][j] * placed.mean[j];
                }
            }
            nats.push(of_block_nats);
            for (row, terms) in row[6..].iter_mut().zip(terms) {
                for j in 0..WIDTH {
                    row[j] = terms[j] * placed.length[j];
                }
            }
            let mut entry = 0;
            for a in 0..6 {
                // By the squares of the inverse depth that the two derivatives have.
                let weighted = [0, 1].map(|k| times(&side[a], &weights[k + usize::from(a > 2)]));
                add_product(simd, &mut gradient[a], &weighted[0], &placed.across);
                for b in a..6 {
                    add_product(simd, &mut across[entry], &weighted[usize::from(b > 2)], &side[b]);
                    entry += 1;
                }
            }
            let mut entry = 0;
            for a in 0..PARAMETERS {
                let weighted = times(&row[a], &weight);
                add_product(simd, &mut gradient[a], &weighted, &placed.away);
                for row in &row[a..] {
                    add_product(simd, &mut along[entry], &weighted, row);
                    entry += 1;
                }
            }
        }
        let sum = |lanes: &Lanes| lanes.iter().sum::<f64>();
        let [usual, near, square_spread, share] =
            [usual, near, square_spread, share].map(|lanes| sum(&lanes));
        Sums {
            across: symmetric(&across.map(|lanes| sum(&lanes))),
            along: symmetric(&along.map(|lanes| sum(&lanes))),
            gradient: Parameters::from_fn(|k, _| sum(&gradient[k])),
            usual,
            near,
            square_spread,
            share,
            nats: nats.into_flattened(),
        }
    }
}

#[inline(always)]
fn times(a: &Lanes, b: &Lanes) -> Lanes {
    std::array::from_fn(|j| a[j] * b[j])
}

/// A symmetric matrix by the rows of its upper triangle.
fn symmetric<const N: usize>(upper: &[f64]) -> SMatrix<f64, N, N> {
    let mut matrix = SMatrix::zeros();
    let entries = (0..N).flat_map(|a| (a..N).map(move |b| (a, b)));
    for ((a, b), &entry) in entries.zip(upper) {
        matrix[(a, b)] = entry;
        matrix[(b, a)] = entry;
    }
    matrix
}

/// The normal equations with what is known of the field before any match is seen, factored.
fn regularised(sums: &Sums, precisions: &Field) -> Option<Factor> {
    let mut equations = sums.along;
    let mut pose = equations.fixed_view_mut::<6, 6>(0, 0);
    pose += sums.across;
    for (k, precision) in precisions.iter().enumerate() {
        equations[(6 + k, 6 + k)] += precision;
    }
    for k in 0..PARAMETERS {
        equations[(k, k)] *= 1.0 + RIDGE;
    }
    equations.cholesky()
}
