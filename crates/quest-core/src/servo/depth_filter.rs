//! The estimator of the loop: candidates start it, a filter on the goal's inverse depths carries it on.
//!
//! 1. The first image gives candidates (`source`), each with its inverse goal depths: the hypotheses.
//! 2. Every further image is fitted by every hypothesis (`fit.rs`). What a wrong one calls the goal's depths does not fit
//!    the images from elsewhere: its costs add up, and it is dropped. The one with the smallest sum gives the pose.
//! 3. A pose passes the gate where its cost is what noise explains, and where the camera can have come there since the last one.
//!    Otherwise features are left out one at a time, then new candidates are tried with the old depths.
//! 4. An accepted image adds to the depths, with a small weight: the noise of the goal image is in all of them.
//!
//! Choosing anew in every frame, as section 10.1 does, is in [`PerFrame`](super::PerFrame).

use super::estimate::{Estimate, HoldReason, PoseEstimator};
use super::fit::{Fitted, Plane, Problem, Workspace};
use super::reference::DepthReference;
use super::source::PoseSource;
use nalgebra::Vector3;

use crate::{Candidate, CandidateKind, Candidates, Correspondence, RelativePose};

/// How many answers to the first image are kept apart.
const MAX_HYPOTHESES: usize = 8;
/// A hypothesis with so much more χ² than the best is dropped: odds of 1 to 3e6.
const HOPELESS: f64 = 30.0;
/// No single image counts for more than this: the odds of 1 to 300,000 that a false one may cost the truth.
const MOST_OF_ONE_IMAGE: f64 = 25.0;

/// Two images that show the same features were taken in about the same direction: one standard deviation, in radians. It orders
/// the answers to the first image where nothing else tells them apart.
const LIKELY_TURN: f64 = 1.0;

/// What is known of the images and the motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterOptions {
    /// Standard deviation of the coordinates in the current image on the plane z = 1: pixels divided by the focal length.
    pub noise: f64,
    /// The same of the goal image: smaller by √k where k goal images are averaged.
    pub goal_noise: f64,
    /// Fewer features than this are not acted on.
    pub min_features: usize,
    /// How much the inverse depths of the features at the goal differ from their mean, before anything is known of them:
    /// one standard deviation, as a share of the mean.
    pub spread: f64,
    /// The weight of one image in the goal's depths.
    pub frame_weight: f64,
    /// How many standard deviations an image, a feature or a motion may be off.
    pub gate: f64,
    /// The largest rotation from one image to the next, in radians.
    pub largest_turn: f64,
    /// The largest change of t from one image to the next, in the unit of the goal's depths.
    pub largest_move: f64,
    /// The first so many images are averaged before the camera is told to move: the depths of the first pair decide the
    /// way, and the noise of these images can still be averaged away.
    pub first_images: usize,
    /// After so many images without a pose the candidates are asked again.
    pub patience: usize,
    /// For a robot that moves on a plane with a level camera: how exactly.
    pub plane: Option<Plane>,
}

impl Default for FilterOptions {
    /// Half a pixel at a focal length of 500, a free camera.
    fn default() -> Self {
        Self {
            noise: 1e-3,
            goal_noise: 1e-3,
            min_features: 5,
            spread: 0.3,
            frame_weight: 0.05,
            gate: 5.0,
            largest_turn: 0.1,
            largest_move: 0.1,
            first_images: 10,
            patience: 5,
            plane: None,
        }
    }
}

/// One answer to the first image, and what has become of it.
#[derive(Clone, Debug)]
struct Hypothesis {
    reference: DepthReference,
    pose: RelativePose,
    /// The sum of its costs.
    score: f64,
}

/// The estimator described at the head of the module.
#[derive(Clone, Debug)]
pub struct DepthFilter<S> {
    goal: Vec<[f64; 2]>,
    source: S,
    options: FilterOptions,
    sigma: f64,
    /// The first `count` are alive, the best first.
    hypotheses: Vec<Hypothesis>,
    count: usize,
    spare: Hypothesis,
    workspace: Workspace,
    frame: Vec<Option<[f64; 2]>>,
    proposed: Vec<f64>,
    /// Of each feature, its places in the first images: so many that are set, in a list long enough for all.
    first: Vec<(usize, Vec<[f64; 2]>)>,
    first_seen: usize,
    matches: Vec<Correspondence>,
    candidates: Candidates,
    /// Images since the last accepted pose.
    missed: usize,
}

impl<S: PoseSource> DepthFilter<S> {
    /// The estimator for this goal image: its features on the plane z = 1.
    #[must_use]
    pub fn new(goal: &[[f64; 2]], source: S, options: FilterOptions) -> Self {
        let n = goal.len();
        let empty = Hypothesis {
            reference: DepthReference::flat(n, options.spread),
            pose: RelativePose::identity(),
            score: 0.0,
        };
        Self {
            goal: goal.to_vec(),
            source,
            options,
            sigma: options.noise.hypot(options.goal_noise),
            hypotheses: vec![empty.clone(); MAX_HYPOTHESES],
            count: 0,
            spare: empty,
            workspace: Workspace::new(n),
            frame: vec![None; n],
            proposed: vec![1.0; n],
            first: vec![(0, vec![[0.0; 2]; options.first_images.max(1)]); n],
            first_seen: 0,
            matches: Vec::with_capacity(n),
            candidates: Candidates::new(),
            missed: 0,
        }
    }

    /// Starts with goal depths that are known, in any unit: from a depth camera or an earlier run. `precision` is their
    /// relative standard deviation. `pose` is about where the camera is.
    ///
    /// What is not a positive number counts as infinitely far.
    pub fn set_depths(&mut self, depths: &[f64], precision: f64) {
        let first = &mut self.hypotheses[0];
        let inverse = depths.iter().map(|z| if *z > 0.0 { 1.0 / z } else { 0.0 });
        first.reference.set_flat(precision);
        for (rho, known) in first.reference.inverse_depths.iter_mut().zip(inverse) {
            *rho = known;
        }
        first.reference.normalise();
        first.reference.set_information(precision.powi(-2));
        (first.score, self.count, self.missed) = (0.0, 1, self.options.patience);
    }

    /// The goal's depths as they are known now, with a harmonic mean of 1; infinite where a feature is infinitely far.
    pub fn depths(&self) -> impl Iterator<Item = f64> {
        let known = self.hypotheses[..self.count].first();
        known.into_iter().flat_map(|h| h.reference.inverse_depths.iter().map(|rho| 1.0 / rho.max(0.0)))
    }

    /// Whether noise explains this cost of so many features, whose depths are known or not.
    fn passes(&self, cost: f64, features: usize) -> bool {
        let freedom = (2.0 * features as f64 - 6.0).max(1.0);
        cost <= freedom + self.options.gate * (2.0 * freedom).sqrt() + self.options.gate
    }

    /// Whether the camera can have come from the last pose to this one.
    fn is_reachable(&self, from: &RelativePose, to: &Fitted) -> bool {
        let images = (self.missed + 1) as f64;
        let deviation = |first: usize| {
            self.options.gate * (0..3).map(|k| to.covariance[(first + k, first + k)]).sum::<f64>().sqrt()
        };
        let turn = from.rotation_error(&to.pose);
        let way = (from.t_21 - to.pose.t_21).norm();
        turn <= images * self.options.largest_turn + deviation(0)
            && way <= images * self.options.largest_move + deviation(3)
    }
}

impl<S: PoseSource> PoseEstimator for DepthFilter<S> {
    fn estimate(&mut self, features: &[Option<[f64; 2]>]) -> Result<Estimate, HoldReason> {
        self.frame.iter_mut().for_each(|f| *f = None);
        for (kept, seen) in self.frame.iter_mut().zip(features) {
            *kept = seen.filter(|m| m.iter().all(|c| c.is_finite() && c.abs() < 1e3));
        }
        let result = self.estimate_checked();
        self.missed = if result.is_ok() { 0 } else { self.missed.saturating_add(1) };
        result
    }
}

impl<S: PoseSource> DepthFilter<S> {
    fn estimate_checked(&mut self) -> Result<Estimate, HoldReason> {
        if self.seen() < self.options.min_features {
            return Err(HoldReason::TooFewFeatures);
        }
        if self.count == 0 {
            self.average_first()?;
            self.sigma = self.sigma_of_mean(self.options.first_images);
            self.start()?;
        } else if self.missed > 0 && self.missed % (self.options.patience + 1) == self.options.patience {
            self.search()?;
        }
        let result = self.follow();
        self.sigma = self.sigma_of_mean(1);
        let (fitted, reachable) = result?;
        if !reachable && self.missed < 2 * self.options.patience {
            return Err(HoldReason::Jump);
        }
        Ok(self.accept(&fitted))
    }

    /// The noise of a difference between the goal and the mean of so many images.
    fn sigma_of_mean(&self, images: usize) -> f64 {
        (self.options.noise / (images.max(1) as f64).sqrt()).hypot(self.options.goal_noise)
    }

    /// Collects the first images, and replaces the last of them by their mean.
    fn average_first(&mut self) -> Result<(), HoldReason> {
        for ((count, places), seen) in self.first.iter_mut().zip(&self.frame) {
            if let (Some(seen), Some(place)) = (seen, places.get_mut(*count)) {
                (*place, *count) = (*seen, *count + 1);
            }
        }
        self.first_seen += 1;
        if self.first_seen < self.options.first_images {
            return Err(HoldReason::Starting);
        }
        let reach = self.options.gate * self.options.noise;
        for (seen, (count, places)) in self.frame.iter_mut().zip(&mut self.first) {
            let found = std::mem::take(count);
            *seen = mean_around_median(&mut places[..found], reach).filter(|_| 2 * found > self.first_seen);
        }
        self.first_seen = 0;
        if self.seen() < self.options.min_features { Err(HoldReason::TooFewFeatures) } else { Ok(()) }
    }

    fn seen(&self) -> usize {
        self.frame.iter().flatten().count()
    }

    /// Fits the image by every hypothesis and puts the best first.
    fn follow(&mut self) -> Result<(Fitted, bool), HoldReason> {
        if self.count > 1 {
            for k in 0..self.count {
                let cost = self.fit(k).map_or(f64::INFINITY, |fitted| fitted.cost);
                self.hypotheses[k].score += cost.min(MOST_OF_ONE_IMAGE);
            }
            self.hypotheses[..self.count].sort_by(|a, b| a.score.total_cmp(&b.score));
            let last = self.hypotheses[0].score + HOPELESS;
            self.count = self.hypotheses[..self.count].iter().take_while(|h| h.score <= last).count();
        }
        let fitted = self.fit(0).filter(|fitted| self.passes(fitted.cost, self.seen()));
        let fitted = fitted.or_else(|| self.leave_out()).ok_or(HoldReason::Inconsistent)?;
        let reachable = self.is_reachable(&self.hypotheses[0].pose, &fitted);
        Ok((fitted, reachable))
    }

    /// Fits the image by one hypothesis, from its last pose.
    fn fit(&mut self, hypothesis: usize) -> Option<Fitted> {
        let start = self.hypotheses[hypothesis].pose;
        self.fit_at(hypothesis, start)
    }

    /// The same from another pose.
    fn fit_at(&mut self, hypothesis: usize, start: RelativePose) -> Option<Fitted> {
        let problem = Problem {
            goal: &self.goal,
            frame: &self.frame,
            reference: &self.hypotheses[hypothesis].reference,
            sigma: self.sigma,
            plane: self.options.plane,
        };
        self.workspace.fit(&problem, start)
    }

    /// Leaves out the feature that disturbs most, until the rest passes or too little is left.
    fn leave_out(&mut self) -> Option<Fitted> {
        while self.seen() > self.options.min_features.saturating_sub(1).max(4) {
            let mut best: Option<(f64, usize)> = None;
            for i in 0..self.frame.len() {
                let Some(image) = self.frame[i].take() else { continue };
                if let Some(fitted) = self.fit(0)
                    && best.is_none_or(|(cost, _)| fitted.cost < cost)
                {
                    best = Some((fitted.cost, i));
                }
                self.frame[i] = Some(image);
            }
            let (cost, worst) = best?;
            self.frame[worst] = None;
            if self.passes(cost, self.seen()) {
                return self.fit(0);
            }
        }
        None
    }

    /// Takes over the pose, and lets the image add to the depths of every hypothesis that it fits.
    fn accept(&mut self, fitted: &Fitted) -> Estimate {
        let (inliers, weight) = (self.seen(), self.options.frame_weight);
        let squares: f64 = self.workspace.squares.iter().filter(|s| s.is_finite()).sum();
        let estimate = Estimate {
            pose: fitted.pose,
            covariance: fitted.covariance,
            inliers,
            residual: self.sigma * (squares / (2 * inliers) as f64).sqrt(),
            alternatives: self.count,
        };
        // The workspace still holds the fit of the best hypothesis.
        self.hypotheses[0].pose = fitted.pose;
        self.workspace.update(&mut self.hypotheses[0].reference, weight);
        for k in 1..self.count {
            let Some(fitted) = self.fit(k) else { continue };
            self.hypotheses[k].pose = fitted.pose;
            if self.passes(fitted.cost, inliers) {
                self.workspace.update(&mut self.hypotheses[k].reference, weight);
            }
        }
        estimate
    }

    /// The candidates of this image.
    fn solve(&mut self) -> Result<(), HoldReason> {
        self.matches.clear();
        for (goal, image) in self.goal.iter().zip(&self.frame) {
            let Some(image) = image else { continue };
            if let Ok(m) = Correspondence::from_image_points(*goal, *image) {
                self.matches.push(m);
            }
        }
        if self.matches.len() < self.source.min_matches() {
            return Err(HoldReason::TooFewFeatures);
        }
        self.source.candidates(&self.matches, &mut self.candidates);
        if self.candidates.is_empty() { Err(HoldReason::Degenerate) } else { Ok(()) }
    }

    /// Makes hypotheses of the candidates.
    fn start(&mut self) -> Result<(), HoldReason> {
        self.solve()?;
        for k in 0..self.candidates.len() {
            let Candidate { kind, pose, .. } = self.candidates[k];
            if let Some(pose) = self.propose(&pose, kind == CandidateKind::RotationOnly) {
                self.adopt(pose);
            }
        }
        if self.count == 0 { Err(HoldReason::Inconsistent) } else { Ok(()) }
    }

    /// The inverse depths of a candidate, left in `proposed`, and its pose in their unit, where it is not absurd.
    fn propose(&mut self, candidate: &RelativePose, is_rotation: bool) -> Option<RelativePose> {
        if is_rotation {
            self.proposed.fill(1.0);
            return Some(RelativePose::new(candidate.q_21, Vector3::zeros()));
        }
        let (mut sum, mut behind) = (0.0, 0);
        for m in &self.matches {
            let depths = candidate.depths(m);
            sum += depths.map_or(0.0, |(z1, _)| 1.0 / z1);
            behind += usize::from(depths.is_some_and(|(z1, z2)| z1 <= 0.0 || z2 <= 0.0));
        }
        let mean = sum / self.matches.len() as f64;
        if behind * 4 > self.matches.len() || mean <= 0.0 || !mean.is_finite() {
            return None;
        }
        let mut matches = self.matches.iter();
        for (rho, image) in self.proposed.iter_mut().zip(&self.frame) {
            // A feature that is not seen is as far as the others.
            let depths = image.and_then(|_| matches.next()).map(|m| candidate.depths(m));
            *rho = depths.map_or(1.0, |depths| depths.map_or(0.0, |(z1, _)| 1.0 / (z1 * mean)));
        }
        Some(RelativePose::new(candidate.q_21, candidate.t_21 * mean))
    }

    /// Adds the hypothesis that is found from this pose and the proposed inverse depths, unless it explains nothing or is
    /// there already.
    fn adopt(&mut self, pose: RelativePose) {
        self.spare.reference.set_flat(self.options.spread);
        let problem = Problem {
            goal: &self.goal,
            frame: &self.frame,
            reference: &self.spare.reference,
            sigma: self.sigma,
            plane: self.options.plane,
        };
        let Some(fitted) = self.workspace.fit_from(&problem, pose, &self.proposed) else { return };
        let same = |h: &Hypothesis| {
            h.pose.rotation_error(&fitted.pose) < 1e-3 && (h.pose.t_21 - fitted.pose.t_21).norm() < 1e-3
        };
        let is_known = self.hypotheses[..self.count].iter().any(same);
        // The depths are not known yet: each may be off by its spread.
        let depths = self.goal.len() as f64;
        if is_known || !self.passes(fitted.cost - depths, self.seen()) || self.count == MAX_HYPOTHESES {
            return;
        }
        self.workspace.update(&mut self.spare.reference, 1.0);
        let turn = fitted.pose.q_21.angle() / LIKELY_TURN;
        (self.spare.score, self.spare.pose) = (fitted.cost + turn * turn, fitted.pose);
        std::mem::swap(&mut self.spare, &mut self.hypotheses[self.count]);
        self.count += 1;
    }

    /// Lost: the candidates of this image with the depths of the best hypothesis, and on their own.
    fn search(&mut self) -> Result<(), HoldReason> {
        self.solve()?;
        let mut best: Option<Fitted> = None;
        for k in 0..self.candidates.len() {
            if let Some(fitted) = self.fit_at(0, self.candidates[k].pose)
                && best.is_none_or(|b| fitted.cost < b.cost)
            {
                best = Some(fitted);
            }
        }
        self.count = 1;
        if let Some(fitted) = best {
            self.hypotheses[0].pose = fitted.pose;
            if self.passes(fitted.cost, self.seen()) {
                return Ok(());
            }
        }
        self.start()?;
        for h in &mut self.hypotheses[..self.count] {
            h.score = h.score.min(MOST_OF_ONE_IMAGE);
        }
        Ok(())
    }
}

/// The mean of the places that are not further than `reach` from their median, in each coordinate: a false match in some of the
/// images does not disturb it.
fn mean_around_median(places: &mut [[f64; 2]], reach: f64) -> Option<[f64; 2]> {
    let middle = places.len() / 2;
    let mut mean = [0.0; 2];
    for (k, mean) in mean.iter_mut().enumerate() {
        places.sort_unstable_by(|a, b| a[k].total_cmp(&b[k]));
        let median = places.get(middle)?[k];
        let near = places.iter().map(|p| p[k]).filter(|c| (c - median).abs() <= reach);
        let (sum, count) = near.fold((0.0, 0.0), |(sum, count), c| (sum + c, count + 1.0));
        *mean = sum / count;
    }
    Some(mean)
}
