//! The way back after a loss, and the start from depths that are known: candidates of one image on a map that is there.

use nalgebra::Vector3;

use crate::RelativePose;
use crate::servo::estimators::estimate::{Motion, PoseEstimator};
use crate::servo::estimators::source::PoseSource;
use crate::servo::estimators::tracker::resection::{Point, Task, resect, residuals};
use crate::servo::estimators::tracker::{FEW, Phase, Tracker};

/// After so many searches for a lost pose the estimator begins anew.
const MOST_SEARCHES: usize = 6;
/// Samples of a search: it comes again.
const SAMPLES: usize = 32;
/// Poses of a plane that are fitted: there are two that see it in front, and their mirror images.
const MOST_PLANES: usize = 4;
/// Depths known better than this, relative to the mean, are good enough to begin with.
const KNOWN: f64 = 0.1;
/// A second pose with so much more than the first is none: odds of 1 to 300,000.
const TWIN: f64 = 25.0;

impl<S: PoseSource> Tracker<S> {
    /// Looks for the pose anew, now and then, where there was none for some images.
    pub(super) fn relocate(&mut self) {
        let every = self.options.patience + 1;
        if self.missed % every != self.options.patience || self.phase == Phase::Starting {
            return;
        }
        if self.missed / every >= MOST_SEARCHES || self.phase == Phase::Rotation {
            self.restart();
            return;
        }
        if let Some((_, pose)) = self.locate()[0] {
            self.hypotheses[0].pose = pose;
            self.hypotheses[0].track.clear();
            self.count = 1;
        }
    }

    /// Begins with the depths that were given, if there are enough of them in this image and a pose fits.
    pub(super) fn start_from_known_depths(&mut self) -> bool {
        let least = self.least_inliers().max(self.source.min_matches());
        let known = self.known.iter().zip(&self.frame);
        let known =
            known.filter(|(k, f)| f.is_some() && k.is_some_and(|k| k.variance < KNOWN * KNOWN)).count();
        if known < least {
            return false;
        }
        let first = &mut self.hypotheses[0];
        first.map.forget(&self.goal, &self.known, self.options.spread);
        first.track.clear();
        (first.score, first.off_map, first.is_relief) = (0.0, 0.0, true);
        let located = self.locate();
        let Some((least, _)) = located[0] else { return false };
        self.count = 0;
        for (cost, pose) in located.into_iter().flatten() {
            if cost > least + TWIN || self.count == self.hypotheses.len() {
                continue;
            }
            let h = &mut self.hypotheses[self.count];
            h.map.forget(&self.goal, &self.known, self.options.spread);
            h.track.clear();
            (h.pose, h.score, h.off_map, h.is_relief) = (pose, cost - least, 0.0, true);
            h.map.keys.push(pose);
            (h.map.steps_left, h.map.cost) = (5, f64::NAN);
            self.count += 1;
        }
        self.keys[0].frame.copy_from_slice(&self.frame);
        self.keys[0].variance = self.options.noise.powi(2);
        (self.key_count, self.phase) = (1, Phase::Mapped);
        (self.missed, self.dull, self.contradicted) = (0, 0, 0);
        (self.best_mean, self.worse) = (f64::INFINITY, 0);
        self.trust.fill(1.0);
        self.doubt.begin();
        self.motion = Motion { linear: Vector3::zeros(), angular: Vector3::zeros() };
        true
    }

    /// The pose of this image on the map of the best hypothesis, from the candidates of samples, with its cost; and a second one,
    /// of a plane its twin.
    fn locate(&mut self) -> [Option<(f64, RelativePose)>; 2] {
        let task = Task { mapped_only: true, ..self.task() };
        let sigma = (task.variance + task.place_variance).sqrt();
        let points = &self.hypotheses[0].map.points;
        let mapped = points.iter().zip(&self.frame).filter(|(p, f)| p.is_mapped && f.is_some()).count();
        let stride = mapped.div_ceil(100).max(1);
        let consensus = &mut self.start.consensus;
        consensus.begin(&self.goal, &self.frame, |i| points[i].is_mapped && i % stride == 0);
        if consensus.matches.len() < self.source.min_matches() {
            return [None; 2];
        }
        consensus.draw(&mut self.source, SAMPLES, sigma, &mut self.start.rng);
        let mut all = consensus.candidates_of_inliers(&mut self.source, false, sigma).clone();
        let planes = consensus.candidates_of_inliers(&mut self.source, true, sigma).clone();
        if consensus.matches.len() >= FEW {
            // A fit of hundreds of features takes a tenth of a millisecond: the best of the candidates alone are fitted.
            all.iter().for_each(|candidate| consensus.offer(candidate.pose, sigma));
            all.clear();
        }
        let sampled = consensus.best.into_iter().flatten().map(|scored| scored.pose);
        let others = all.iter().chain(planes.iter().take(MOST_PLANES)).map(|c| c.pose);
        let old = std::iter::once(self.hypotheses[0].pose);
        let least = self.least_inliers();
        let mut best = [None; 2];
        for candidate in sampled.chain(others).chain(old) {
            let points = &self.hypotheses[0].map.points;
            let start = scaled(&candidate, &self.start.consensus, points);
            residuals(points, &self.frame, &start, &task, &mut self.squares);
            let fit = resect(points, &self.frame, &start, &task, &mut self.squares, &mut self.scratch);
            if let Some(fit) = fit.filter(|fit| fit.inliers >= least && 2 * fit.inliers >= mapped) {
                rank(&mut best, fit.cost, &fit.pose);
            }
        }
        best
    }
}

/// Takes a pose in among the best two, unless a better one like it is there.
fn rank(best: &mut [Option<(f64, RelativePose)>; 2], cost: f64, pose: &RelativePose) {
    let is_like =
        |other: &RelativePose| other.rotation_error(pose) < 1e-2 && (other.t_21 - pose.t_21).norm() < 2e-2;
    match best {
        [Some((first, like)), _] if is_like(like) => {
            if cost < *first {
                best[0] = Some((cost, *pose));
            }
        }
        [Some((first, _)), _] if *first <= cost => {
            if best[1].is_none_or(|(second, _)| cost < second) {
                best[1] = Some((cost, *pose));
            }
        }
        [first, second] => {
            *second = *first;
            *first = Some((cost, *pose));
        }
    }
}

/// A candidate with its translation in the unit of the map.
fn scaled(
    candidate: &RelativePose,
    consensus: &crate::servo::estimators::tracker::consensus::Consensus,
    points: &[Point],
) -> RelativePose {
    let (mut sum, mut count) = (0.0, 0.0);
    for (m, &i) in consensus.matches.iter().zip(&consensus.features) {
        if let Some((z1, z2)) = candidate.depths(m)
            && z1 > 0.0
            && z2 > 0.0
        {
            // ln z ρ: the mean of the logarithms is not carried away by a wrong match.
            sum += (z1 * points[i].rho.max(1e-3)).ln();
            count += 1.0;
        }
    }
    let scale = if count > 0.0 { f64::exp(-sum / count) } else { 0.0 };
    let scale = if scale.is_finite() { scale } else { 0.0 };
    RelativePose::new(candidate.q_21, candidate.t_21 * scale)
}
