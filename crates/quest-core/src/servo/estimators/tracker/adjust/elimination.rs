//! The normal equations of a map with its features eliminated.

use nalgebra::{Matrix6, Vector3, Vector6};

use super::{Survey, Workspace};
use crate::RelativePose;
use crate::servo::estimators::tracker::map::{Map, PLANE_SLOPE, PLANE_UNIT};
use crate::servo::estimators::tracker::resection::{KNEE, Point, add_ground, weight};

/// A feature whose block is eliminated.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Eliminated {
    /// `V⁻¹` by rows of the lower triangle: 00, 10, 11, 20, 21, 22.
    pub(crate) inverse: [f64; 6],
    pub(crate) gradient: [f64; 3],
    pub(crate) is_used: bool,
    /// The largest weight of an observation of it: near zero where all of them are wrong matches.
    pub(crate) weight: f64,
}

impl Eliminated {
    pub(crate) fn solve(&self, b: [f64; 3]) -> [f64; 3] {
        let [a, d, e, f, g, h] = self.inverse;
        [a * b[0] + d * b[1] + f * b[2], d * b[0] + e * b[1] + g * b[2], f * b[0] + g * b[1] + h * b[2]]
    }
}

impl Workspace {
    /// The normal equations with the features eliminated, in `schur` and `right`.
    pub(crate) fn eliminate(&mut self, map: &Map, survey: &Survey<'_>, damping: f64) {
        self.size = 6 * map.keys.len() + 3;
        let size = self.size;
        self.schur[..size * size].fill(0.0);
        self.right[..size].fill(0.0);
        self.begin_with_priors(map, survey);
        for i in 0..map.points.len() {
            self.features[i].is_used = survey.takes(i, &map.points[i]);
            if self.features[i].is_used {
                self.eliminate_feature(map, survey, i, damping);
            }
        }
        for k in 0..size {
            let diagonal = &mut self.schur[k * size + k];
            *diagonal += damping * diagonal.abs().max(1e-3) + 1e-9;
        }
    }

    /// The plane's prior, the robot's ground.
    fn begin_with_priors(&mut self, map: &Map, survey: &Survey<'_>) {
        let (size, first) = (self.size, self.size - 3);
        let sigmas = [PLANE_SLOPE, PLANE_SLOPE, PLANE_UNIT];
        for k in 0..3 {
            let information = sigmas[k].powi(-2);
            self.schur[(first + k) * size + first + k] += information;
            self.right[first + k] += (map.normal[k] - if k == 2 { 1.0 } else { 0.0 }) * information;
        }
        for (key, pose) in map.keys.iter().enumerate() {
            let (mut information, mut gradient) = (Matrix6::identity() * 1e-6, Vector6::zeros());
            if let Some(ground) = &survey.ground {
                add_ground(ground, pose, &mut information, &mut gradient);
            }
            for r in 0..6 {
                self.right[6 * key + r] += gradient[r];
                for c in 0..6 {
                    self.schur[(6 * key + r) * size + 6 * key + c] += information[(r, c)];
                }
            }
        }
    }

    fn eliminate_feature(&mut self, map: &Map, survey: &Survey<'_>, i: usize, damping: f64) {
        let size = self.size;
        let stride = self.mixed.len() / self.features.len().max(1);
        self.mixed[i * stride..i * stride + size].fill([0.0; 3]);
        let (mut v, mut g) = self.add_observations(map, survey, i);
        self.add_feature_priors(map, survey, i, &mut v, &mut g);
        for k in [0, 2, 5] {
            v[k] *= 1.0 + damping;
        }
        let feature = &mut self.features[i];
        (feature.inverse, feature.gradient) = (inverse(&v), g);
        let solved = feature.solve(g);
        let mixed = &self.mixed[i * stride..i * stride + size];
        for (r, w) in mixed.iter().enumerate() {
            let y = feature.solve(*w);
            self.right[r] -= w[0] * solved[0] + w[1] * solved[1] + w[2] * solved[2];
            let row = &mut self.schur[r * size..=r * size + r];
            for (s, w) in row.iter_mut().zip(mixed) {
                *s -= y[0] * w[0] + y[1] * w[1] + y[2] * w[2];
            }
        }
    }

    /// What the key images say of a feature: its block by the lower triangle, and its gradient.
    fn add_observations(&mut self, map: &Map, survey: &Survey<'_>, i: usize) -> ([f64; 6], [f64; 3]) {
        let size = self.size;
        let stride = self.mixed.len() / self.features.len().max(1);
        let mixed = &mut self.mixed[i * stride..i * stride + size];
        let (mut v, mut g) = ([0.0; 6], [0.0; 3]);
        let mut largest = 0.0_f64;
        for (key, (image, pose)) in survey.keys.iter().zip(&map.keys).enumerate() {
            let Some(z) = image.frame[i] else { continue };
            let Some((by_pose, by_point, error, weight)) =
                derivatives(&map.points[i], pose, z, survey.noise * image.variance)
            else {
                continue;
            };
            largest = largest.max(weight);
            for row in 0..2 {
                let (jp, jx, e) = (&by_pose[row], &by_point[row], error[row]);
                let products = [
                    jx[0] * jx[0],
                    jx[1] * jx[0],
                    jx[1] * jx[1],
                    jx[2] * jx[0],
                    jx[2] * jx[1],
                    jx[2] * jx[2],
                ];
                for (v, product) in v.iter_mut().zip(products) {
                    *v += product;
                }
                for k in 0..3 {
                    g[k] += jx[k] * e;
                }
                for r in 0..6 {
                    self.right[6 * key + r] += jp[r] * e;
                    for k in 0..3 {
                        mixed[6 * key + r][k] += jp[r] * jx[k];
                    }
                    for c in 0..=r {
                        self.schur[(6 * key + r) * size + 6 * key + c] += jp[r] * jp[c];
                    }
                }
            }
        }
        self.features[i].weight = largest;
        (v, g)
    }

    /// The goal image is an observation of a feature's place, the plane or what was given one of its depth.
    fn add_feature_priors(
        &mut self,
        map: &Map,
        survey: &Survey<'_>,
        i: usize,
        v: &mut [f64; 6],
        g: &mut [f64; 3],
    ) {
        let point = &map.points[i];
        let place = 1.0 / (survey.noise * survey.goal_variance);
        v[0] += place;
        v[2] += place;
        for k in 0..2 {
            g[k] += (point.place[k] - survey.goal[i][k]) * place;
        }
        if let Some(known) = survey.known[i] {
            v[5] += 1.0 / known.variance;
            g[2] += (point.rho - known.rho) / known.variance;
            return;
        }
        let (size, first) = (self.size, self.size - 3);
        let stride = self.mixed.len() / self.features.len().max(1);
        let information = map.relief.powi(-2);
        let m = [survey.goal[i][0], survey.goal[i][1], 1.0];
        let off = (point.rho - map.on_plane(survey.goal[i])) * information;
        v[5] += information;
        g[2] += off;
        for r in 0..3 {
            self.mixed[i * stride + first + r][2] = -m[r] * information;
            self.right[first + r] -= m[r] * off;
            for c in 0..=r {
                self.schur[(first + r) * size + first + c] += m[r] * m[c] * information;
            }
        }
    }
}

/// The inverse of a symmetric 3 × 3 matrix, both by the lower triangle. Positive definite by its priors.
fn inverse(v: &[f64; 6]) -> [f64; 6] {
    let [a, d, e, f, g, h] = *v;
    let (c00, c10, c20) = (e * h - g * g, f * g - d * h, d * g - e * f);
    let det = 1.0 / (a * c00 + d * c10 + f * c20);
    [c00, c10, a * h - f * f, c20, d * f - a * g, a * e - d * d].map(|c| c * det)
}

/// The whitened and weighted derivatives of one observation by the pose and the feature, the error, and the weight.
#[expect(clippy::type_complexity, reason = "two rows each")]
fn derivatives(
    point: &Point,
    pose: &RelativePose,
    z: [f64; 2],
    variance: f64,
) -> Option<([[f64; 6]; 2], [[f64; 3]; 2], [f64; 2], f64)> {
    let r_21 = pose.r_21();
    let turned = r_21 * Vector3::new(point.place[0], point.place[1], 1.0);
    let x2 = turned + pose.t_21 * point.rho;
    if x2.z.is_nan() || x2.z <= 0.02 {
        return None;
    }
    let inv = 1.0 / x2.z;
    let u = [x2.x * inv, x2.y * inv];
    let e = [u[0] - z[0], u[1] - z[1]];
    let weight = weight((e[0] * e[0] + e[1] * e[1]) / variance, KNEE);
    let w = (weight / variance).sqrt();
    let rows = [Vector3::new(inv * w, 0.0, -u[0] * inv * w), Vector3::new(0.0, inv * w, -u[1] * inv * w)];
    let by_pose = rows.map(|row| {
        let turn = turned.cross(&row);
        [turn.x, turn.y, turn.z, row.x * point.rho, row.y * point.rho, row.z * point.rho]
    });
    let by_point = rows.map(|row| [row.dot(&r_21.column(0)), row.dot(&r_21.column(1)), row.dot(&pose.t_21)]);
    Some((by_pose, by_point, e.map(|e| e * w), weight))
}
