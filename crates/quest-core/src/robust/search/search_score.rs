//! How well a motion explains all matches: one number, zero for perfect and one a match at worst.
//!
//! The loss `ρ(u)` of a residual `r` is that of the [`SearchScore`], with `u = min(|r| / T, 1)`.

use nalgebra::Matrix3;

use crate::lanes::{self, BearingMatches, ImageMatches, SearchScore, Stop};
use crate::robust::data::observations::Observations;
use crate::robust::data::point_transfer::rows;
use crate::robust::refine::epipolar::fundamental;

/// The loss reaches one at this multiple of the inlier threshold.
pub(crate) const REACH: f64 = 2.5;

/// The mean score of a match that a hypothesis must be likely to reach while no other hypothesis is known.
const LEAST_MEAN: f64 = 0.03;

/// With fewer matches the loss is the truncated square: of eight matches five are fitted by any motion, and what is left must
/// not be rewarded for being small.
pub(crate) const MANY: usize = 10;

/// The matches as the kernels take them.
#[derive(Debug)]
enum Columns {
    Plane(ImageMatches<f32>),
    Sphere(BearingMatches<f32>),
}

/// The search's score of essential matrices.
#[derive(Debug)]
pub(crate) struct Scorer<'a> {
    observations: &'a Observations<'a>,
    kernel: lanes::Scorer,
    loss: SearchScore,
    columns: Columns,
    /// `T` in the unit of the columns.
    reach: f64,
}

impl<'a> Scorer<'a> {
    /// `threshold` in pixels.
    pub(crate) fn new(observations: &'a Observations<'a>, loss: SearchScore) -> Self {
        let reach = REACH * observations.columns.threshold();
        let kernel = lanes::Scorer::new();
        if observations.is_sphere() {
            let mut columns = BearingMatches::new();
            for &i in &observations.order {
                let m = &observations.given[i as usize];
                columns.push((*m.bearing1()).into(), (*m.bearing2()).into());
            }
            // One angle for both views: an exact weight would have to know which view a residual comes from.
            let angle = (0.5 * observations.columns.square_angle_of_pixel()).sqrt();
            let (columns, reach) = (Columns::Sphere(columns), reach * angle);
            return Self { observations, kernel, loss, columns, reach };
        }
        let mut columns = ImageMatches::new();
        let [x1, y1, _, x2, y2, _] = observations.columns.all();
        for i in 0..observations.len() {
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
