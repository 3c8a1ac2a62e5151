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

use nalgebra::{Matrix6, SMatrix, SVector, UnitQuaternion, Vector2, Vector3, Vector6};

use crate::robust::conclude::evidence::{Explained, Likelihood, without_two};
use crate::robust::conclude::length::{FARTHEST, UNKNOWN};
use crate::robust::data::point_transfer::Displacement;

/// Polynomials of two variables up to the fourth degree, but for the constant.
const TERMS: usize = 14;
const DEGREE: usize = 4;
const PARAMETERS: usize = 6 + TERMS;

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

/// This share of the diagonal is added to the normal equations, which are singular without a translation: the field moves no point.
const RIDGE: f64 = 1e-9;

pub(crate) type Field = SVector<f64, TERMS>;
type Parameters = SVector<f64, PARAMETERS>;
type Equations = SMatrix<f64, PARAMETERS, PARAMETERS>;
type Factor = nalgebra::Cholesky<f64, nalgebra::Const<PARAMETERS>>;

/// Where a fit begins and what it finds.
#[derive(Clone, Debug)]
pub(crate) struct DepthField {
    pub(crate) q_21: UnitQuaternion<f64>,
    /// In units of the inverse of the mean inverse depth.
    pub(crate) t_21: Vector3<f64>,
    field: Field,
    /// `s²`.
    square_spread: f64,
    near: f64,
}

/// The logarithm of the likelihood over that without a translation, in nats, and the covariance of `(ω, t_21)`.
#[derive(Clone, Debug)]
pub(crate) struct Fit {
    pub(crate) at: DepthField,
    pub(crate) nats: f64,
    pub(crate) covariance: Matrix6<f64>,
    /// The mean depth in the unit of the translation, and the covariance with the translation in units of the mean depth.
    pub(crate) mean_depth: f64,
    pub(crate) covariance_by_depth: Matrix6<f64>,
}

/// A match under a motion with a field of depths.
struct Placed {
    /// By how much the match moves along its epipolar line, by a unit of inverse depth, and in which direction.
    length: f64,
    u: [f64; 2],
    /// What the field says of its inverse depth, and what the match says.
    mean: f64,
    depth: f64,
    across: f64,
    away: f64,
    /// The part of what the match says in what is known of its inverse depth.
    share: f64,
    explained: Explained,
}

impl Placed {
    /// The inverse depth that the match is likeliest to have, as a point of the field.
    fn rho(&self) -> f64 {
        self.mean + self.share * (self.depth - self.mean)
    }
}

/// The mean depth, its derivative by the parameters, and the variance of what no match says of it.
struct MeanDepth {
    value: f64,
    slope: Parameters,
    variance: f64,
}

/// What a round sums up.
struct Sums {
    /// Of what lies across the epipolar lines, and of what lies along them.
    across: Equations,
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
pub(crate) fn terms(likelihood: &Likelihood, still: &UnitQuaternion<f64>) -> Vec<Field> {
    let at: Vec<Vector2<f64>> = likelihood.displacements(still).iter().map(place).collect();
    let count = at.len().max(1) as f64;
    let mean = at.iter().sum::<Vector2<f64>>() / count;
    let square = at.iter().map(|p| (p - mean).component_mul(&(p - mean))).sum::<Vector2<f64>>() / count;
    let scale = square.map(|square| 1.0 / square.sqrt().max(1e-9));
    at.iter().map(|p| polynomials((p - mean).component_mul(&scale))).collect()
}

/// Where the point is seen in view 1, in the plane.
fn place(d: &Displacement) -> Vector2<f64> {
    let depth = if d.x1.z.abs() > 1e-3 { d.x1.z } else { 1e-3 };
    d.x1.xy() / depth
}

/// The degree of each term.
fn degrees() -> impl Iterator<Item = [usize; 2]> {
    (0..=DEGREE).flat_map(|i| (0..=DEGREE - i).map(move |j| [i, j])).filter(|[i, j]| i + j > 0)
}

/// Products of Hermite polynomials of mean zero and unit variance.
fn polynomials(at: Vector2<f64>) -> Field {
    let powers = at.map(|x| x.clamp(-EDGE, EDGE));
    let hermite = [powers.x, powers.y].map(|x| {
        let square = x * x;
        [
            1.0,
            x,
            (square - 1.0) / 2_f64.sqrt(),
            (square - 3.0) * x / 6_f64.sqrt(),
            ((square - 6.0) * square + 3.0) / 24_f64.sqrt(),
        ]
    });
    Field::from_iterator(degrees().map(|[i, j]| hermite[0][i] * hermite[1][j]))
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
    pub(crate) fn fit(mut self, terms: &[Field], likelihood: &Likelihood, rounds: usize) -> Option<Fit> {
        let precisions = precisions();
        let (mut sums, mut from) = (self.round(terms, likelihood), None);
        for _ in 0..rounds {
            let worth = self.worth(&sums, &precisions);
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
                    from = Some((std::mem::replace(&mut self, next), step, worth));
                }
            }
            sums = self.round(terms, likelihood);
        }
        if let Some((before, ..)) = from.filter(|from| self.worth(&sums, &precisions) < from.2 - LOST) {
            self = before;
            sums = self.round(terms, likelihood);
        }
        let all = regularised(&sums, &precisions)?.inverse();
        let covariance: Matrix6<f64> = all.fixed_view::<6, 6>(0, 0).into_owned();
        let depth = self.mean_depth(terms, likelihood)?;
        let by_depth = self.by_depth(&depth);
        let mut covariance_by_depth = by_depth * all * by_depth.transpose();
        let mut block = covariance_by_depth.fixed_view_mut::<3, 3>(3, 3);
        block += self.t_21 * self.t_21.transpose() * (depth.variance / depth.value.powi(4));
        let nats = without_two(sums.nats) - self.surprise(&precisions);
        let is_finite =
            nats.is_finite() && covariance_by_depth.iter().chain(&covariance).all(|x| x.is_finite());
        is_finite.then_some(Fit { at: self, nats, covariance, mean_depth: depth.value, covariance_by_depth })
    }

    /// The derivative of the pose, with its translation in units of the mean depth, by all parameters.
    fn by_depth(&self, depth: &MeanDepth) -> SMatrix<f64, 6, PARAMETERS> {
        let mut derivative = SMatrix::<f64, 6, PARAMETERS>::identity();
        derivative.fixed_view_mut::<3, 3>(3, 3).fill_diagonal(1.0 / depth.value);
        let mut of_length = derivative.fixed_view_mut::<3, PARAMETERS>(3, 0);
        of_length -= self.t_21 * depth.slope.transpose() / (depth.value * depth.value);
        derivative
    }

    /// The mean depth of the points of the field and of near points. The mean of `1/ρ`, of a normal variable with the mean `m` and the
    /// variance `v`, is `(1 + v/m²)/m` to second order; of depths whose logarithms are normal it is that exactly. Depths of
    /// other shapes have about `(v/m²)²` more or less.
    fn mean_depth(&self, terms: &[Field], likelihood: &Likelihood) -> Option<MeanDepth> {
        let (mut sum, mut weights, mut slope) = (0.0, 0.0, Parameters::zeros());
        let (mut unknown, mut of_each) = (0.0, 0.0);
        for (index, (d, terms)) in likelihood.displacements(&self.q_21).iter().zip(terms).enumerate() {
            let placed = self.place(d, terms, likelihood, index);
            let Explained { usual, near, .. } = placed.explained;
            let variance = self.square_spread * (1.0 - placed.share);
            let rho = placed.rho().max(variance.sqrt()).max(1.0 / FARTHEST);
            let square = if rho > placed.rho() { 2.0 } else { variance / (rho * rho) };
            sum += usual * (1.0 + square.min(1.0)) / rho + near / placed.depth.max(1.0);
            unknown += usual * square / rho;
            of_each += usual * square / (rho * rho);
            weights += usual + near;
            let by_rho = -usual * (1.0 + 3.0 * square) / (rho * rho);
            let [turn, unit] = [turn(d), d.slope].map(|v| v[0] * placed.u[0] + v[1] * placed.u[1]);
            let by_match = by_rho * placed.share / placed.length;
            let mut head = slope.fixed_rows_mut::<3>(0);
            head -= turn * by_match;
            let mut head = slope.fixed_rows_mut::<3>(3);
            head -= unit * (by_match * placed.depth);
            let mut tail = slope.fixed_rows_mut::<TERMS>(6);
            tail += terms * (by_rho * (1.0 - placed.share));
        }
        (weights > 0.0).then(|| MeanDepth {
            value: sum / weights,
            slope: slope / weights,
            variance: (UNKNOWN * (unknown / weights + self.near)).powi(2) + of_each / (weights * weights),
        })
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

    fn round(&self, terms: &[Field], likelihood: &Likelihood) -> Sums {
        let mut sums = Sums {
            across: Equations::zeros(),
            along: Equations::zeros(),
            gradient: Parameters::zeros(),
            usual: 0.0,
            near: 0.0,
            square_spread: 0.0,
            share: 0.0,
            nats: Vec::with_capacity(terms.len()),
        };
        let all = likelihood.displacements(&self.q_21);
        for (index, (d, terms)) in all.iter().zip(terms).enumerate() {
            self.add(&mut sums, d, terms, likelihood, index);
        }
        sums
    }

    /// Where a match is.
    fn place(&self, d: &Displacement, terms: &Field, likelihood: &Likelihood, index: usize) -> Placed {
        let b = [0, 1].map(|k| d.slope[k].dot(&self.t_21));
        let length = b[0].hypot(b[1]).max(LEAST_LENGTH);
        // Without a translation any two directions do.
        let u = if length > LEAST_LENGTH { b.map(|x| x / length) } else { [1.0, 0.0] };
        let mean = 1.0 + terms.dot(&self.field);
        let across = d.residual[0] * u[1] - d.residual[1] * u[0];
        let along = -(d.residual[0] * u[0] + d.residual[1] * u[1]);
        let away = mean * length - along;
        let spread = self.square_spread * length * length;
        let share = spread / (likelihood.variance() + spread);
        let explained = likelihood.explain(index, [across, away], along, spread, self.near, d.is_in_front);
        Placed { length, u, mean, depth: along / length, across, away, share, explained }
    }

    /// Adds what a match says.
    fn add(&self, sums: &mut Sums, d: &Displacement, terms: &Field, likelihood: &Likelihood, index: usize) {
        let placed = self.place(d, terms, likelihood, index);
        let Placed { length, u, mean, depth, across, away, share, .. } = placed;
        let Explained {
            usual,
            near,
            across: across_weight,
            near_across: near_weight,
            along: along_weight,
            nats,
        } = placed.explained;
        sums.nats.push(nats);
        sums.usual += usual;
        sums.near += near;
        if across_weight <= 0.0 {
            return;
        }
        let deviation = placed.rho() - mean;
        sums.share += usual * share;
        sums.square_spread +=
            usual * (deviation * deviation + share * likelihood.variance() / (length * length));
        let turn = turn(d);
        let side = [turn, d.slope].map(|v| v[0] * u[1] - v[1] * u[0]);
        // The lever of a near point is its own depth.
        for (weight, rho) in [(across_weight - near_weight, placed.rho()), (near_weight, depth)] {
            let [by_turn, by_unit] = side;
            let row = Vector6::from_fn(|k, _| if k < 3 { by_turn[k] } else { by_unit[k - 3] * rho });
            sums.across.fixed_view_mut::<6, 6>(0, 0).ger(weight, &row, &row, 1.0);
            let mut head = sums.gradient.fixed_rows_mut::<6>(0);
            head += row * (weight * across);
        }
        let mut row = Parameters::zeros();
        row.fixed_rows_mut::<3>(0).copy_from(&(turn[0] * u[0] + turn[1] * u[1]));
        row.fixed_rows_mut::<3>(3).copy_from(&((d.slope[0] * u[0] + d.slope[1] * u[1]) * mean));
        row.fixed_rows_mut::<TERMS>(6).copy_from(&(terms * length));
        sums.along.ger(along_weight, &row, &row, 1.0);
        sums.gradient += row * (along_weight * away);
    }
}

/// By how much a match moves with a turn.
fn turn(d: &Displacement) -> [Vector3<f64>; 2] {
    d.slope.map(|slope| d.y.cross(&slope))
}

/// The normal equations with what is known of the field before any match is seen, factored.
fn regularised(sums: &Sums, precisions: &Field) -> Option<Factor> {
    let mut equations = sums.across + sums.along;
    for (k, precision) in precisions.iter().enumerate() {
        equations[(6 + k, 6 + k)] += precision;
    }
    for k in 0..PARAMETERS {
        equations[(k, k)] *= 1.0 + RIDGE;
    }
    equations.cholesky()
}
