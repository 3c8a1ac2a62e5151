//! The points of both views on flat charts, on which neighbours can be looked for.

use nalgebra::Vector3;

use crate::epipolar_frame::tangent_basis;
use crate::robust::data::observations::Observations;

/// Coordinates are cut off here: squares of their differences stay far from the largest `f32`.
const FAR: f64 = 1e6;

/// A mean bearing shorter than this has no direction: bearings all about.
const NO_MEAN: f64 = 1e-3;

/// The points `x1, y1, x2, y2` of all matches in thresholds.
pub(crate) type Chart = [Vec<f32>; 4];

/// The image itself, or Lambert's equal-area chart of the sphere around the mean bearing of each view.
pub(crate) fn chart(observations: &Observations) -> Chart {
    let columns = &observations.columns;
    let (all, count) = (columns.all(), observations.len());
    let unit = 1.0 / columns.threshold();
    if !observations.is_sphere() {
        return [0, 1, 3, 4].map(|k| all[k].iter().map(|x| cut(unit * x)).collect());
    }
    let mut chart = Chart::default();
    for (view, image) in columns.images().into_iter().enumerate() {
        let f = image.square_focal_length().sqrt();
        let points = || (0..count).map(|i| Vector3::from(std::array::from_fn(|k| all[3 * view + k][i])));
        let mean = points().sum::<Vector3<f64>>() / (f * count as f64);
        let z = mean.try_normalize(NO_MEAN).unwrap_or_else(Vector3::z);
        let [x, y] = tangent_basis(&z);
        for p in points() {
            let scale = unit * (2.0 / (1.0 + p.dot(&z) / f).max(f64::EPSILON)).sqrt();
            chart[2 * view].push(cut(scale * p.dot(&x)));
            chart[2 * view + 1].push(cut(scale * p.dot(&y)));
        }
    }
    chart
}

/// The rows of some matches.
pub(crate) fn part(chart: &Chart, indices: &[u32]) -> Chart {
    chart.each_ref().map(|column| indices.iter().map(|&i| column[i as usize]).collect())
}

#[expect(clippy::cast_possible_truncation, reason = "neighbours need no more digits")]
fn cut(x: f64) -> f32 {
    x.clamp(-FAR, FAR) as f32
}
