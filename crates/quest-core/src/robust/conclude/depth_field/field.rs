//! A pose with the field of its depths.

use nalgebra::{SMatrix, SVector, UnitQuaternion, Vector3};

use crate::robust::conclude::evidence::Likelihood;
use crate::robust::data::point_transfer::{Block, Lanes, WIDTH};

/// Polynomials of two variables up to the fourth degree, but for the constant.
pub(crate) const TERMS: usize = 14;
const DEGREE: usize = 4;
pub(crate) const PARAMETERS: usize = 6 + TERMS;

/// The deviation of a coefficient of the first degree; its square halves with each further degree. A corridor that is twice as near
/// at its sides as in the middle has 0.3.
const RELIEF: f64 = 0.3;

/// The field is constant beyond this many deviations from the middle of the points, where polynomials would grow. Points that are
/// uniform in the image end at 1.73.
const EDGE: f64 = 1.8;

/// The share of near points to begin with.
const NEAR: f64 = 0.02;

/// The polynomials at the points of a few matches.
pub(crate) type Terms = [Lanes; TERMS];
pub(crate) type Field = SVector<f64, TERMS>;
pub(crate) type Parameters = SVector<f64, PARAMETERS>;
pub(crate) type Equations = SMatrix<f64, PARAMETERS, PARAMETERS>;

/// A pose and the depths of its points.
#[derive(Clone, Debug)]
pub(crate) struct DepthField {
    pub(crate) q_21: UnitQuaternion<f64>,
    /// In units of the inverse of the mean inverse depth.
    pub(crate) t_21: Vector3<f64>,
    pub(crate) field: Field,
    /// `s²`.
    pub(crate) square_spread: f64,
    pub(crate) near: f64,
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

    /// By how many nats the field is less likely than a flat one, before any match is seen.
    pub(crate) fn surprise(&self, precisions: &Field) -> f64 {
        0.5 * (0..TERMS).map(|k| precisions[k] * self.field[k] * self.field[k]).sum::<f64>()
    }
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
pub(crate) fn precisions() -> Field {
    let of_degree = |[i, j]: [usize; 2]| {
        let halvings = i32::try_from(i + j).map_or(0, |degree| degree - 1);
        2_f64.powi(halvings) / (RELIEF * RELIEF)
    };
    Field::from_iterator(degrees().map(of_degree))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_are_those_of_hermite_up_to_the_fourth_degree() {
        let all: Vec<[usize; 2]> = degrees().collect();
        let mut distinct = all.clone();
        distinct.sort_unstable();
        distinct.dedup();
        assert_eq!((all.len(), distinct.len()), (TERMS, TERMS));
        assert!(all.iter().all(|[i, j]| (1..=DEGREE).contains(&(i + j))));
        // He(n+1) = x He(n) − n He(n−1), over √n!.
        let hermite = |x: f64| {
            let mut all = [1.0, x, 0.0, 0.0, 0.0];
            for n in 1..DEGREE {
                all[n + 1] = x * all[n] - n as f64 * all[n - 1];
            }
            let norm = |n: usize| (1..=n).map(|k| k as f64).product::<f64>().sqrt();
            [0, 1, 2, 3, 4].map(|n: usize| all[n] / norm(n))
        };
        for at in [[0.7, -1.3], [-1.6, 0.4]] {
            let [first, second] = at.map(hermite);
            for ([i, j], found) in degrees().zip(polynomials(at)) {
                assert!((found - first[i] * second[j]).abs() < 1e-14, "{i} {j}: {found}");
            }
        }
        // Beyond the edge they are constant.
        assert!(polynomials([9.0, -0.3]).eq(polynomials([EDGE, -0.3])));
    }

    #[test]
    fn a_coefficient_at_its_deviation_costs_half_a_nat() {
        let precisions = precisions();
        for (k, [i, j]) in degrees().enumerate() {
            let mut at = DepthField::start(UnitQuaternion::identity(), Vector3::zeros(), 0.1);
            let degree = (i + j) as f64;
            let deviation = RELIEF * 0.5_f64.powf(0.5 * (degree - 1.0));
            for times in [1.0, -2.0] {
                at.field[k] = times * deviation;
                assert!((at.surprise(&precisions) - 0.5 * times * times).abs() < 1e-12, "{i} {j}");
                // What is linear in the image is a plane.
                let off = if i + j == 1 { 0.1 } else { (times * deviation).hypot(0.1) };
                assert!((at.off_plane() - off).abs() < 1e-12, "{i} {j}");
            }
        }
    }
}
