//! One damped step of the adjustment of a map: the poses of the key images, the plane and the features together.
//!
//! ```text
//! Σ_k Σ_i bounded(|π(R_k m_i + ρ_i t_k) − z_ki|² / σ_k²) + Σ_i |(u, v)_i − goal_i|² / σ_g² + Σ_i (ρ_i − n·m_i)² / τ² + prior of n
//! ```
//!
//! The goal image is an observation of the features' places, so that its noise is no longer a bias that has to be weighed down. A feature
//! is eliminated by a 3 × 3 block; what is left are six numbers a key image and three of the plane. Levenberg and Marquardt's damping,
//! one step an image until the cost settles.

use nalgebra::{Matrix6, Vector3, Vector6};

use crate::RelativePose;
use crate::algebra::cholesky;
use crate::servo::estimators::tracker::map::{KeyImage, Known, Map, PLANE_SLOPE, PLANE_UNIT};
use crate::servo::estimators::tracker::resection::{
    Ground, KNEE, Point, add_ground, bounded, ground_residuals, moved, weight,
};

/// What all hypotheses are adjusted to.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Survey<'a> {
    pub(crate) goal: &'a [[f64; 2]],
    pub(crate) known: &'a [Option<Known>],
    pub(crate) keys: &'a [KeyImage],
    /// The variance of a coordinate of the goal's features.
    pub(crate) goal_variance: f64,
    pub(crate) ground: Option<Ground>,
    /// Only these features take part; all where it is empty.
    pub(crate) chosen: &'a [bool],
}

impl Survey<'_> {
    fn takes(&self, i: usize) -> bool {
        (self.chosen.is_empty() || self.chosen[i]) && self.keys.iter().any(|key| key.frame[i].is_some())
    }
}

/// A feature whose block is eliminated.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Eliminated {
    /// `V⁻¹` by rows of the lower triangle: 00, 10, 11, 20, 21, 22.
    pub(crate) inverse: [f64; 6],
    pub(crate) gradient: [f64; 3],
    pub(crate) is_used: bool,
}

impl Eliminated {
    pub(crate) fn solve(&self, b: [f64; 3]) -> [f64; 3] {
        let [a, d, e, f, g, h] = self.inverse;
        [a * b[0] + d * b[1] + f * b[2], d * b[0] + e * b[1] + g * b[2], f * b[0] + g * b[1] + h * b[2]]
    }
}

/// The working memory, for all maps.
#[derive(Clone, Debug)]
pub(crate) struct Workspace {
    /// Unknowns that are left once the features are eliminated.
    pub(crate) size: usize,
    pub(crate) features: Vec<Eliminated>,
    /// The mixed blocks: `size` rows of three for each feature.
    pub(crate) mixed: Vec<[f64; 3]>,
    pub(crate) schur: Vec<f64>,
    right: Vec<f64>,
    trial_points: Vec<Point>,
    trial_keys: Vec<RelativePose>,
    /// For [`adequacy`](super::adequacy): nine columns.
    pub(crate) columns: Vec<[f64; 9]>,
    pub(crate) adequacy_column: Vec<f64>,
}

impl Workspace {
    pub(crate) fn new(features: usize, most_keys: usize) -> Self {
        let size = 6 * most_keys + 3;
        let empty = Point { place: [0.0; 2], rho: 1.0, variance: 0.0, is_mapped: false };
        Self {
            size,
            features: vec![Eliminated::default(); features],
            mixed: vec![[0.0; 3]; features * size],
            schur: vec![0.0; size * size],
            right: vec![0.0; size],
            trial_points: vec![empty; features],
            trial_keys: Vec::with_capacity(most_keys),
            columns: vec![[0.0; 9]; size],
            adequacy_column: vec![0.0; size],
        }
    }

    /// One step; whether the cost fell. The variances of the depths are those at the start of the step.
    pub(crate) fn step(&mut self, map: &mut Map, survey: &Survey<'_>) -> bool {
        if map.cost.is_nan() {
            map.cost = cost(&map.points, &map.keys, &map.normal, map.relief, survey);
        }
        self.eliminate(map, survey, map.damping);
        let falls = self.try_step(map, survey).is_some_and(|new| {
            let falls = new < map.cost;
            if falls {
                std::mem::swap(&mut map.points, &mut self.trial_points);
                map.keys.copy_from_slice(&self.trial_keys);
                for k in 0..3 {
                    map.normal[k] += self.right[self.size - 3 + k];
                }
                map.cost = new;
            }
            falls
        });
        map.damping =
            if falls { (map.damping * 0.2).max(1e-7) } else { (map.damping * 10.0).clamp(1e-4, 1e6) };
        falls
    }

    /// The normal equations with the features eliminated, in `schur` and `right`.
    pub(crate) fn eliminate(&mut self, map: &Map, survey: &Survey<'_>, damping: f64) {
        self.size = 6 * map.keys.len() + 3;
        let size = self.size;
        self.schur[..size * size].fill(0.0);
        self.right[..size].fill(0.0);
        self.begin_with_priors(map, survey);
        for i in 0..map.points.len() {
            self.features[i].is_used = survey.takes(i);
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
        for (key, (image, pose)) in survey.keys.iter().zip(&map.keys).enumerate() {
            let Some(z) = image.frame[i] else { continue };
            let Some((by_pose, by_point, error)) = derivatives(&map.points[i], pose, z, image.variance)
            else {
                continue;
            };
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
        let place = 1.0 / survey.goal_variance;
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

    /// The cost after the step, left in `trial_points`, `trial_keys` and the end of `right`.
    fn try_step(&mut self, map: &Map, survey: &Survey<'_>) -> Option<f64> {
        let size = self.size;
        if !cholesky::factor(&mut self.schur[..size * size], size) {
            return None;
        }
        self.right[..size].iter_mut().for_each(|b| *b = -*b);
        solve(&self.schur[..size * size], &mut self.right[..size]);
        self.trial_keys.clear();
        for (key, pose) in map.keys.iter().enumerate() {
            let step = Vector6::from_row_slice(&self.right[6 * key..6 * key + 6]);
            let length = step.norm();
            if length.is_nan() || length >= 2.0 {
                return None;
            }
            self.trial_keys.push(moved(pose, &step));
        }
        let normal = map.normal + Vector3::from_row_slice(&self.right[size - 3..size]);
        let stride = self.mixed.len() / self.features.len().max(1);
        for (i, point) in map.points.iter().enumerate() {
            let feature = &self.features[i];
            let mut new = *point;
            if feature.is_used {
                let mut b = feature.gradient;
                for (w, step) in self.mixed[i * stride..i * stride + size].iter().zip(&self.right) {
                    (0..3).for_each(|k| b[k] += w[k] * step);
                }
                let by = feature.solve(b);
                new.place = [point.place[0] - by[0], point.place[1] - by[1]];
                new.rho -= by[2];
                new.variance = feature.inverse[5];
                new.is_mapped = true;
            } else if survey.known[i].is_none() {
                new.rho = normal.x * survey.goal[i][0] + normal.y * survey.goal[i][1] + normal.z;
            }
            self.trial_points[i] = new;
        }
        let cost = cost(&self.trial_points, &self.trial_keys, &normal, map.relief, survey);
        cost.is_finite().then_some(cost)
    }
}

/// `L Lᵀ x = b` in place.
pub(crate) fn solve(l: &[f64], b: &mut [f64]) {
    let n = b.len();
    for i in 0..n {
        let done: f64 = l[i * n..i * n + i].iter().zip(&*b).map(|(l, x)| l * x).sum();
        b[i] = (b[i] - done) / l[i * n + i];
    }
    cholesky::solve_upper(l, b);
}

/// The inverse of a symmetric 3 × 3 matrix, both by the lower triangle. Positive definite by its priors.
fn inverse(v: &[f64; 6]) -> [f64; 6] {
    let [a, d, e, f, g, h] = *v;
    let (c00, c10, c20) = (e * h - g * g, f * g - d * h, d * g - e * f);
    let det = 1.0 / (a * c00 + d * c10 + f * c20);
    [c00, c10, a * h - f * f, c20, d * f - a * g, a * e - d * d].map(|c| c * det)
}

/// The whitened and weighted derivatives of one observation by the pose and the feature, and the error.
#[expect(clippy::type_complexity, reason = "two rows each")]
fn derivatives(
    point: &Point,
    pose: &RelativePose,
    z: [f64; 2],
    variance: f64,
) -> Option<([[f64; 6]; 2], [[f64; 3]; 2], [f64; 2])> {
    let r_21 = pose.r_21();
    let turned = r_21 * Vector3::new(point.place[0], point.place[1], 1.0);
    let x2 = turned + pose.t_21 * point.rho;
    if x2.z.is_nan() || x2.z <= 0.02 {
        return None;
    }
    let inv = 1.0 / x2.z;
    let u = [x2.x * inv, x2.y * inv];
    let e = [u[0] - z[0], u[1] - z[1]];
    let w = (weight((e[0] * e[0] + e[1] * e[1]) / variance, KNEE) / variance).sqrt();
    let rows = [Vector3::new(inv * w, 0.0, -u[0] * inv * w), Vector3::new(0.0, inv * w, -u[1] * inv * w)];
    let by_pose = rows.map(|row| {
        let turn = turned.cross(&row);
        [turn.x, turn.y, turn.z, row.x * point.rho, row.y * point.rho, row.z * point.rho]
    });
    let by_point = rows.map(|row| [row.dot(&r_21.column(0)), row.dot(&r_21.column(1)), row.dot(&pose.t_21)]);
    Some((by_pose, by_point, e.map(|e| e * w)))
}

/// The whole cost.
fn cost(
    points: &[Point],
    keys: &[RelativePose],
    normal: &Vector3<f64>,
    relief: f64,
    survey: &Survey<'_>,
) -> f64 {
    let slope = (normal.x.powi(2) + normal.y.powi(2)) / PLANE_SLOPE.powi(2);
    let mut sum = slope + ((normal.z - 1.0) / PLANE_UNIT).powi(2);
    for (image, pose) in survey.keys.iter().zip(keys) {
        if let Some(ground) = &survey.ground {
            sum += ground_residuals(ground, pose).0.norm_squared();
        }
        let r_21 = pose.r_21();
        for (i, (point, z)) in points.iter().zip(&image.frame).enumerate() {
            let Some(z) = z else { continue };
            if !(survey.chosen.is_empty() || survey.chosen[i]) {
                continue;
            }
            let x2 = r_21 * Vector3::new(point.place[0], point.place[1], 1.0) + pose.t_21 * point.rho;
            let square = if x2.z > 0.02 {
                ((x2.x / x2.z - z[0]).powi(2) + (x2.y / x2.z - z[1]).powi(2)) / image.variance
            } else {
                f64::MAX
            };
            sum += bounded(square, KNEE);
        }
    }
    for (i, point) in points.iter().enumerate() {
        if !survey.takes(i) {
            continue;
        }
        let goal = survey.goal[i];
        sum +=
            ((point.place[0] - goal[0]).powi(2) + (point.place[1] - goal[1]).powi(2)) / survey.goal_variance;
        sum += match survey.known[i] {
            Some(known) => (point.rho - known.rho).powi(2) / known.variance,
            None => ((point.rho - normal.x * goal[0] - normal.y * goal[1] - normal.z) / relief).powi(2),
        };
    }
    sum
}
