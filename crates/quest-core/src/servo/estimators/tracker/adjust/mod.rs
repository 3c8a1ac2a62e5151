//! One damped step of the adjustment of a map: the poses of the key images, the plane and the features together.
//!
//! ```text
//! Σ_k Σ_i bounded(|π(R_k m_i + ρ_i t_k) − z_ki|² / σ_k²) + Σ_i |(u, v)_i − goal_i|² / σ_g² + Σ_i (ρ_i − n·m_i)² / τ² + prior of n
//! ```
//!
//! The goal image is an observation of the features' places, so that its noise is no longer a bias that has to be weighed down. A feature
//! is eliminated by a 3 × 3 block; what is left are six numbers a key image and three of the plane. Levenberg and Marquardt's damping,
//! one step an image until the cost settles.

mod cost;
mod elimination;

use nalgebra::{Vector3, Vector6};

use crate::RelativePose;
use crate::algebra::cholesky;
use crate::servo::estimators::tracker::map::{KeyImage, Known, Map};
use crate::servo::estimators::tracker::resection::{Ground, Point, moved};
use cost::cost;
pub(crate) use cost::disagreement;
use elimination::Eliminated;

/// What all hypotheses are adjusted to.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Survey<'a> {
    pub(crate) goal: &'a [[f64; 2]],
    pub(crate) known: &'a [Option<Known>],
    pub(crate) keys: &'a [KeyImage],
    /// The variance of a coordinate of the goal's features.
    pub(crate) goal_variance: f64,
    pub(crate) ground: Option<Ground>,
    /// The share of all variances that the matches show.
    pub(crate) noise: f64,
    /// Only these features take part; all where it is empty.
    pub(crate) chosen: &'a [bool],
}

impl Survey<'_> {
    /// Whether this feature takes part, which is the `i`th.
    fn takes(&self, i: usize, point: &Point) -> bool {
        self.wants(i, point) && self.keys.iter().any(|key| key.frame[i].is_some())
    }

    fn wants(&self, i: usize, point: &Point) -> bool {
        !point.is_wrong && (self.chosen.is_empty() || self.chosen[i])
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
        let empty = Point { place: [0.0; 2], rho: 1.0, variance: 0.0, is_mapped: false, is_wrong: false };
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

    /// One step; whether the map has settled: the cost fell, and by next to nothing.
    pub(crate) fn settle(&mut self, map: &mut Map, survey: &Survey<'_>) -> bool {
        let before = map.cost;
        self.step(map, survey) && before - map.cost < 1e-3 * map.cost + 1e-3
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
                // No key image shows it any more: it lies on the plane, or keeps what was learnt of its depth.
                let on_plane = normal.x * survey.goal[i][0] + normal.y * survey.goal[i][1] + normal.z;
                match (map.is_planar(), point.is_mapped) {
                    (true, true) => (new.rho, new.variance) = (on_plane, map.relief * map.relief),
                    (false, true) => {}
                    (_, false) => new.rho = on_plane,
                }
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

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;
    use crate::servo::estimators::tracker::map::PLANE_RELIEF;

    /// The goal's features of a scene with relief, one key image of all but the first, and the map that the truth is.
    fn scene(relief: f64) -> (Vec<[f64; 2]>, KeyImage, Map) {
        let goal: Vec<[f64; 2]> =
            (0..16).map(f64::from).map(|k| [0.4 * (2.1 * k).sin(), 0.3 * (3.7 * k).cos()]).collect();
        let pose = RelativePose::new(
            UnitQuaternion::new(Vector3::new(0.02, -0.05, 0.03)),
            Vector3::new(0.1, -0.04, 0.06),
        );
        let mut map = Map::new(&goal, 1, relief);
        map.keys.push(pose);
        for (k, point) in map.points.iter_mut().enumerate() {
            point.rho = 1.0 + 0.1 * (1.9 * k as f64).sin();
            (point.variance, point.is_mapped) = (1e-4, true);
        }
        let seen = |point: &Point| {
            let x2 = pose.q_21 * Vector3::new(point.place[0], point.place[1], 1.0) + pose.t_21 * point.rho;
            Some([x2.x / x2.z, x2.y / x2.z])
        };
        let mut frame: Vec<_> = map.points.iter().map(seen).collect();
        frame[0] = None;
        (goal, KeyImage { frame, variance: 1e-6 }, map)
    }

    fn stepped(relief: f64, learnt: impl Fn(&mut Point)) -> Map {
        let (goal, key, mut map) = scene(relief);
        learnt(&mut map.points[0]);
        // Away from the minimum, so that the step falls.
        map.keys[0].t_21.x += 1e-3;
        let known = vec![None; goal.len()];
        let survey = Survey {
            goal: &goal,
            known: &known,
            keys: &[key],
            goal_variance: 1e-6,
            ground: None,
            chosen: &[],
            noise: 1.0,
        };
        assert!(Workspace::new(goal.len(), 1).step(&mut map, &survey));
        map
    }

    fn assert_is(point: &Point, rho: f64, variance: f64) {
        assert!((point.rho - rho).abs() < 1e-15 && (point.variance - variance).abs() < 1e-15, "{point:?}");
    }

    /// Three key images do not show all features at once: what an earlier one told stays.
    #[test]
    fn a_feature_that_no_key_image_shows_any_more_keeps_its_depth() {
        let map = stepped(0.3, |point| point.rho = 0.7);
        assert_is(&map.points[0], 0.7, 1e-4);
    }

    /// It was seen as a wrong match once; the plane knows better where it is.
    #[test]
    fn on_a_plane_it_lies_on_the_plane() {
        let map = stepped(PLANE_RELIEF, |point| (point.rho, point.variance) = (0.7, 0.09));
        assert_is(&map.points[0], map.on_plane(map.points[0].place), PLANE_RELIEF * PLANE_RELIEF);
    }

    #[test]
    fn one_that_was_never_seen_lies_on_the_plane_and_is_as_uncertain_as_before() {
        let map = stepped(0.3, |point| (point.variance, point.is_mapped) = (0.09, false));
        assert_is(&map.points[0], map.on_plane(map.points[0].place), 0.09);
        assert!(!map.points[0].is_mapped);
    }
}
