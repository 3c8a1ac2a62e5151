//! Whether the depths are known well enough to translate.
//!
//! Near the goal the loop is `ξ' = −λ Ĵ⁺ J ξ`, with Ĵ from the map's depths. Wrong depths can make the goal an unstable point. They
//! do in 85 to 91 % of general scenes where all depths are taken to be equal, in all scenes where they are reversed, and in less
//! than 1 % where they have half of the relief. By errors `δρ` of the inverse depths, a translation of any length changes by
//! `E = J_t⁺ diag(δρ) J_t`. A common scale is taken out of it, for that only changes the speed. The adequacy is the standard
//! deviation of `|E|`. Below 0.4 the loop is stable by two and a half standard deviations.

use nalgebra::Matrix6;

use crate::servo::estimators::tracker::adjust::{Survey, Workspace, solve};
use crate::servo::estimators::tracker::map::Map;
use crate::servo::estimators::tracker::resection::Point;

impl Workspace {
    /// Finds the adequacy of a map, infinite where its features do not determine a pose, and its information.
    ///
    /// Eliminates the map's features without damping: 9 (L + 3) products a feature, L the unknowns that are left.
    pub(crate) fn judge(&mut self, map: &mut Map, survey: &Survey<'_>) {
        map.adequacy = self.adequacy(map, survey);
        let diagonal = (0..self.size).map(|k| self.schur[k * self.size + k]);
        map.log_information = diagonal.map(|d| 2.0 * d.ln()).sum();
    }

    /// Whether a pose rests on this feature: a wrong match, whose depth nothing tells, has no say in a pose either.
    fn counts(&self, i: usize, point: &Point) -> bool {
        // The weight of a match that is 5.3 standard deviations off.
        const HARDLY: f64 = 0.1;
        let feature = &self.features[i];
        if point.is_wrong {
            return false;
        }
        if feature.is_used { feature.weight > HARDLY } else { point.is_mapped }
    }

    fn adequacy(&mut self, map: &Map, survey: &Survey<'_>) -> f64 {
        self.eliminate(map, survey, 0.0);
        let size = self.size;
        if !crate::algebra::cholesky::factor(&mut self.schur[..size * size], size) {
            return f64::INFINITY;
        }
        let mut normal = Matrix6::zeros();
        for (i, point) in map.points.iter().enumerate() {
            if self.counts(i, point) {
                for row in rows(point.place, point.rho) {
                    let row = nalgebra::Vector6::from(row);
                    normal.ger(1.0, &row, &row, 1.0);
                }
            }
        }
        let damping = 1e-12 * normal.trace();
        (0..6).for_each(|k| normal[(k, k)] += damping);
        let Some(inverse) = normal.cholesky().map(|factor| factor.inverse()) else { return f64::INFINITY };
        self.columns[..size].fill([0.0; 9]);
        let stride = self.mixed.len() / self.features.len().max(1);
        let mut variance = 0.0;
        for (i, point) in map.points.iter().enumerate() {
            if !self.counts(i, point) {
                continue;
            }
            let feature = &self.features[i];
            let influence = influence(point.place, point.rho, &inverse);
            let own = if feature.is_used { feature.inverse[5] } else { point.variance };
            variance += own * influence.iter().map(|c| c * c).sum::<f64>();
            if feature.is_used {
                for (r, w) in self.mixed[i * stride..i * stride + size].iter().enumerate() {
                    let y = feature.solve(*w)[2];
                    (0..9).for_each(|k| self.columns[r][k] += y * influence[k]);
                }
            }
        }
        // The poses' and the plane's own uncertainty moves all depths together.
        let mut column = std::mem::take(&mut self.adequacy_column);
        for k in 0..9 {
            (0..size).for_each(|r| column[r] = self.columns[r][k]);
            solve(&self.schur[..size * size], &mut column[..size]);
            variance += (0..size).map(|r| column[r] * self.columns[r][k]).sum::<f64>();
        }
        self.adequacy_column = column;
        if variance.is_finite() { variance.max(0.0).sqrt() } else { f64::INFINITY }
    }
}

/// The derivatives of a feature's place at the goal by a pose: rotation, translation.
fn rows([u, v]: [f64; 2], rho: f64) -> [[f64; 6]; 2] {
    [[-u * v, 1.0 + u * u, -v, rho, 0.0, -u * rho], [-1.0 - v * v, u * v, u, 0.0, rho, -v * rho]]
}

/// What an error of this feature's inverse depth does to a translation: a 3 × 3 matrix, less its part that is a multiple of one.
fn influence(place: [f64; 2], rho: f64, inverse: &Matrix6<f64>) -> [f64; 9] {
    let rows = rows(place, rho);
    let flat = [[1.0, 0.0, -place[0]], [0.0, 1.0, -place[1]]];
    let mut e = [0.0; 9];
    for (row, by_t) in rows.iter().zip(&flat) {
        for a in 0..3 {
            let gain: f64 = (0..6).map(|k| inverse[(3 + a, k)] * row[k]).sum();
            (0..3).for_each(|d| e[3 * a + d] += gain * by_t[d]);
        }
    }
    let mean = (e[0] + e[4] + e[8]) / 3.0;
    for k in [0, 4, 8] {
        e[k] -= mean;
    }
    e
}
