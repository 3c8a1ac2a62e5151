//! How well a motion explains all matches: one number, zero for perfect and one a match at worst.
//!
//! The loss of a residual `r` is one of
//!
//! ```text
//! ρ(u) = 2u − u²    marginalised        ρ(u) = u²    truncated,        u = min(|r| / T, 1)
//! ```
//!
//! The first is the second averaged over all thresholds up to `T`, so that it does not hang on one of them (the idea of MAGSAC:
//! D. Barath, J. Matas, J. Noskova, CVPR 2019, in one dimension). The second is that of MSAC (P. H. S. Torr, A. Zisserman,
//! *MLESAC*, CVIU 2000).

use nalgebra::Matrix3;

use crate::lanes::{self, BearingMatches, ImageMatches, SearchScore, Stop};
use crate::robust::data::observations::Observations;
use crate::robust::data::point_transfer::rows;
use crate::robust::refine::epipolar::fundamental;

/// The loss reaches one at this multiple of the inlier threshold.
pub(crate) const REACH: f64 = 2.5;

/// The mean score of a match that a hypothesis has to be likely to reach, where none is known yet.
const LEAST_MEAN: f64 = 0.03;

/// With fewer matches the loss is the truncated square: of eight matches five are fitted by any motion, and what is left must
/// not be rewarded for being small.
pub(crate) const MANY: usize = 10;

/// The loss of a residual in units of the reach.
pub(crate) fn cost(loss: SearchScore, u: f64) -> f64 {
    let u = u.abs().min(1.0);
    match loss {
        SearchScore::Truncated => u * u,
        SearchScore::Marginalised => u * (2.0 - u),
    }
}

/// The matches as the kernels take them.
#[derive(Debug)]
enum Columns {
    Plane(ImageMatches<f32>),
    Sphere(BearingMatches<f32>),
}

/// The search's score of essential matrices.
#[derive(Debug)]
pub(crate) struct Scorer<'a> {
    observations: &'a Observations,
    kernel: lanes::Scorer,
    loss: SearchScore,
    columns: Columns,
    /// `T` in the unit of the columns.
    reach: f64,
}

impl<'a> Scorer<'a> {
    /// `threshold` in pixels.
    pub(crate) fn new(observations: &'a Observations, loss: SearchScore) -> Self {
        let reach = REACH * observations.columns.threshold();
        let matches = &observations.matches;
        let kernel = lanes::Scorer::new();
        if observations.is_sphere() {
            let mut columns = BearingMatches::new();
            for m in matches {
                columns.push((*m.bearing1()).into(), (*m.bearing2()).into());
            }
            // One angle for both views: an exact weight would have to know which view a residual comes from.
            let angle = (0.5 * observations.columns.square_angle_of_pixel()).sqrt();
            let (columns, reach) = (Columns::Sphere(columns), reach * angle);
            return Self { observations, kernel, loss, columns, reach };
        }
        let mut columns = ImageMatches::new();
        let [x1, y1, _, x2, y2, _] = observations.columns.all();
        for i in 0..matches.len() {
            columns.push([x1[i], y1[i]], [x2[i], y2[i]]);
        }
        Self { observations, kernel, loss, columns: Columns::Plane(columns), reach }
    }

    /// The summed loss of an essential matrix, `None` where it is not below `best`, or most likely is not.
    pub(crate) fn score(&self, e: &Matrix3<f64>, best: f64) -> Option<f64> {
        let count = self.observations.len() as f64;
        let stop = Stop::Unlikely((1.0 - best / count).max(LEAST_MEAN));
        let score = match &self.columns {
            Columns::Plane(columns) => {
                let [d1, d2] = self.observations.columns.inverse_scales();
                let f = fundamental(e, &d1, &d2);
                self.kernel.score(columns, &f, self.reach, self.loss, stop)
            }
            Columns::Sphere(columns) => self.kernel.score(columns, &rows(e), self.reach, self.loss, stop),
        };
        let loss = count - score.sum;
        (score.visited == self.observations.len() && loss < best).then_some(loss)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_number_and_the_vectors_have_the_same_formula() {
        // A shift along x takes a point to its line y2 = y1; the residual is half of the difference, in both views.
        let e = [0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0];
        let kernel = lanes::Scorer::new();
        for kind in SearchScore::CHOICES {
            for k in 0..=120 {
                let u = f64::from(k) / 100.0;
                let mut matches = ImageMatches::<f64>::new();
                matches.push([0.1, 0.2], [0.4, 0.2 + u * 2.0_f64.sqrt() * 1e-3]);
                let found = kernel.score(&matches, &e, 1e-3, kind, Stop::Never);
                assert!((1.0 - found.sum - cost(kind, u)).abs() < 1e-9, "{kind:?} {u}: {found:?}");
            }
        }
    }
}
