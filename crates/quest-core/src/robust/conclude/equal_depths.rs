//! The pose of a camera that hardly moves, as a linear regression: with all points at one depth a displacement is linear in the
//! rotation and in the translation, and regular where there is no translation.
//!
//! ```text
//! d = J ω + B t + ε
//! ```
//!
//! The covariance says what the depths, which are not equal, may do to that: a depth that varies over the image as a quadratic
//! polynomial, of which each term has the deviation [`SYSTEMATIC`] of the mean, adds `v vᵀ` for each, with
//! `v = (Σ [J B]ᵀ [J B])⁻¹ Σ [J B]ᵀ B t φ`.

use nalgebra::{Matrix6, Vector6};

use crate::robust::data::point_transfer::Displacement;

/// The deviation of each term of a systematic depth, as a share of the mean: a corridor that is twice as near at its
/// sides as in the middle has 0.3.
const SYSTEMATIC: f64 = 0.3;

/// Matches weigh as in a t distribution of this scale, in standard deviations.
const SCALE: f64 = 4.0;

/// Rounds of weighing and solving.
const ROUNDS: usize = 4;

/// A rotation after another, a translation in units of the mean depth, and their covariance.
#[derive(Clone, Debug)]
pub(crate) struct EqualDepths {
    pub(crate) parameters: Vector6<f64>,
    pub(crate) covariance: Matrix6<f64>,
    rows: Vec<Row>,
}

/// A match: its displacement, and the derivatives of that by the six parameters.
#[derive(Clone, Debug)]
struct Row {
    displacement: [f64; 2],
    by: [Vector6<f64>; 2],
    at: [f64; 2],
}

impl Row {
    fn new(d: &Displacement) -> Self {
        let by = d.slope.map(|slope| {
            let turn = d.y.cross(&slope);
            Vector6::new(turn.x, turn.y, turn.z, slope.x, slope.y, slope.z)
        });
        let depth = if d.x1.z.abs() > 1e-3 { d.x1.z } else { 1e-3 };
        Self { displacement: d.residual, by, at: [d.x1.x / depth, d.x1.y / depth] }
    }

    /// The squared displacement that some parameters leave.
    fn square(&self, parameters: &Vector6<f64>) -> f64 {
        (0..2).map(|k| (self.displacement[k] + self.by[k].dot(parameters)).powi(2)).sum()
    }
}

fn weight(square: f64, sigma: f64) -> f64 {
    (1.0 + square / (2.0 * sigma * sigma * SCALE * SCALE)).powf(-1.5)
}

impl EqualDepths {
    /// The regression over displacements from where a rotation takes the points, with noise of `sigma` pixels.
    pub(crate) fn fit(displacements: &[Displacement], sigma: f64) -> Option<Self> {
        let rows: Vec<Row> = displacements.iter().map(Row::new).collect();
        let mut parameters = Vector6::zeros();
        let mut inverse = Matrix6::zeros();
        for _ in 0..ROUNDS {
            let (mut hessian, mut gradient) = (Matrix6::zeros(), Vector6::zeros());
            for row in &rows {
                let weight = weight(row.square(&parameters), sigma);
                for k in 0..2 {
                    hessian += row.by[k] * row.by[k].transpose() * weight;
                    gradient += row.by[k] * (weight * row.displacement[k]);
                }
            }
            inverse = hessian.cholesky()?.inverse();
            parameters = -inverse * gradient;
        }
        let mut covariance = inverse * (sigma * sigma);
        for v in systematic(&rows, &parameters, sigma) {
            let v = inverse * v * SYSTEMATIC;
            covariance += v * v.transpose();
        }
        covariance.iter().all(|x| x.is_finite()).then_some(Self { parameters, covariance, rows })
    }

    /// The squared displacement of each match, and what is left of it.
    pub(crate) fn squares(&self) -> impl Iterator<Item = [f64; 2]> {
        self.rows.iter().map(|row| [row.square(&Vector6::zeros()), row.square(&self.parameters)])
    }
}

/// `Σ [J B]ᵀ B t φ` for the five terms of a polynomial with mean zero and unit variance.
fn systematic(rows: &[Row], parameters: &Vector6<f64>, sigma: f64) -> [Vector6<f64>; 5] {
    let count = rows.len() as f64;
    let mean = [0, 1].map(|k| rows.iter().map(|row| row.at[k]).sum::<f64>() / count);
    let spread = [0, 1].map(|k| {
        let variance = rows.iter().map(|row| (row.at[k] - mean[k]).powi(2)).sum::<f64>() / count;
        variance.sqrt().max(1e-9)
    });
    let t_21 = parameters.fixed_rows::<3>(3);
    let mut sums = [Vector6::zeros(); 5];
    for row in rows {
        let weight = weight(row.square(parameters), sigma);
        let [a, b] = [0, 1].map(|k| (row.at[k] - mean[k]) / spread[k]);
        let terms = [a, b, (a * a - 1.0) / 2_f64.sqrt(), a * b, (b * b - 1.0) / 2_f64.sqrt()];
        for k in 0..2 {
            let moved = row.by[k].fixed_rows::<3>(3).dot(&t_21);
            for (sum, term) in sums.iter_mut().zip(terms) {
                *sum += row.by[k] * (weight * moved * term);
            }
        }
    }
    sums
}
