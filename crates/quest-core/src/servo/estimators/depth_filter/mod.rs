//! The estimator of the loop: candidates start it, a filter on the goal's inverse depths carries it on.
//!
//! 1. The mean of the first images gives candidates (`source`), each with its inverse goal depths: the hypotheses. They are
//!    fitted over the next images, a few in each, so that no image takes long (`search.rs`).
//! 2. Every further image is fitted by every hypothesis (`fit.rs`). What a wrong one calls the goal's depths does not fit
//!    the images from elsewhere: its costs add up, and it is dropped. The one with the smallest sum gives the pose.
//! 3. A pose passes the gate where its cost is what noise explains, and where the camera can have come there since the last one.
//!    Otherwise features are left out one at a time, then new candidates are tried with the old depths.
//! 4. An accepted image adds to the depths, with a small weight: the noise of the goal image is in all of them.
//!
//! Choosing anew in every frame, as section 10.1 does, is in [`PerFrame`](crate::servo::PerFrame).

pub(crate) mod first_images;
pub(crate) mod fit;
pub(crate) mod options;
mod reference;
mod search;

use nalgebra::Matrix6;

use crate::servo::FilterOptions;
use crate::servo::estimators::depth_filter::first_images::FirstImages;
use crate::servo::estimators::depth_filter::fit::{Fitted, MAX_STEPS, Problem, Workspace};
use crate::servo::estimators::depth_filter::reference::DepthReference;
use crate::servo::estimators::depth_filter::search::Search;
use crate::servo::estimators::estimate::{Estimate, HoldReason, PoseEstimator, Support};
use crate::servo::estimators::source::PoseSource;
use crate::{Candidates, Correspondence, RelativePose};

/// How many answers to the first image are kept apart.
pub(crate) const MAX_HYPOTHESES: usize = 8;
/// A hypothesis with so much more χ² than the best is dropped: odds of 1 to 3e6.
const HOPELESS: f64 = 30.0;
/// No single image counts for more than this: the odds of 1 to 300,000 that a false one may cost the truth.
pub(crate) const MOST_OF_ONE_IMAGE: f64 = 25.0;
/// Steps of a fit that is only to be compared: of the rivals of the best hypothesis, and with a feature left out. The last pose is one
/// image's motion away; two or three steps lead from there to the minimum where depths and features are right.
const FEW_STEPS: usize = 5;

/// One answer to the first image, and what has become of it.
#[derive(Clone, Debug)]
pub(crate) struct Hypothesis {
    pub(crate) reference: DepthReference,
    pub(crate) pose: RelativePose,
    /// The sum of its costs.
    pub(crate) score: f64,
    pub(crate) workspace: Workspace,
    /// Its fit of the current image, which is still in its workspace.
    fitted: Option<Fitted>,
}

/// The estimator described at the head of the module.
#[derive(Clone, Debug)]
pub struct DepthFilter<S> {
    pub(crate) goal: Vec<[f64; 2]>,
    pub(crate) source: S,
    pub(crate) options: FilterOptions,
    pub(crate) sigma: f64,
    /// The first `count` are alive, the best first.
    pub(crate) hypotheses: Vec<Hypothesis>,
    pub(crate) count: usize,
    pub(crate) spare: Hypothesis,
    pub(crate) frame: Vec<Option<[f64; 2]>>,
    pub(crate) first_images: FirstImages,
    pub(crate) search: Search,
    pub(crate) matches: Vec<Correspondence>,
    pub(crate) candidates: Candidates,
    /// Images since the last accepted pose, but for those that a search takes.
    missed: usize,
    /// Whether there has been a pose.
    has_started: bool,
    /// The depths that were given, with their precisions.
    given: Option<(Vec<f64>, Vec<f64>)>,
    /// Which features agreed with the last pose.
    inliers: Vec<bool>,
    restarts: usize,
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
            workspace: Workspace::new(n),
            fitted: None,
        };
        Self {
            goal: goal.to_vec(),
            source,
            options,
            sigma: options.noise.hypot(options.goal_noise),
            hypotheses: vec![empty.clone(); MAX_HYPOTHESES],
            count: 0,
            spare: empty,
            frame: vec![None; n],
            first_images: FirstImages::new(n, options.first_images),
            search: Search::new(n),
            matches: Vec::with_capacity(n),
            candidates: Candidates::new(),
            missed: 0,
            has_started: false,
            given: None,
            inliers: vec![false; n],
            restarts: 0,
        }
    }

    /// Starts with goal depths that are known, in any unit: from a depth camera or an earlier run. `precision` is their
    /// relative standard deviation.
    ///
    /// What is not a positive number counts as infinitely far.
    pub fn set_depths(&mut self, depths: &[f64], precision: f64) {
        let precisions = vec![precision; self.goal.len()];
        let depths: Vec<f64> = depths.iter().map(|z| if *z > 0.0 { *z } else { f64::INFINITY }).collect();
        self.set_depths_each(&depths, &precisions);
    }

    /// As [`set_depths`](Self::set_depths), with a precision for each depth; NaN where a depth is not known.
    pub fn set_depths_each(&mut self, depths: &[f64], precisions: &[f64]) {
        self.given = Some((depths.to_vec(), precisions.to_vec()));
        self.take_given_depths();
    }

    /// Begins with the depths that were given.
    fn take_given_depths(&mut self) {
        let Some((depths, precisions)) = &self.given else { return };
        let reference = &mut self.hypotheses[0].reference;
        reference.set_flat(self.options.spread);
        let known = || depths.iter().filter(|z| !z.is_nan());
        let mean = known().map(|z| 1.0 / z).sum::<f64>() / known().count().max(1) as f64;
        if !(mean > 0.0 && mean.is_finite()) {
            return;
        }
        let n = reference.len();
        for (i, (z, precision)) in depths.iter().zip(precisions).enumerate().take(n) {
            if !z.is_nan() {
                reference.inverse_depths[i] = 1.0 / (z * mean);
                reference.information[i * n + i] = precision.powi(-2);
            }
        }
        reference.normalise();
        (self.hypotheses[0].score, self.count, self.missed) = (0.0, 1, self.options.patience);
    }

    /// How exactly the goal's depths are known, relative to each: one standard deviation.
    pub fn depth_precisions(&self) -> impl Iterator<Item = f64> {
        let n = self.goal.len();
        let known = self.hypotheses[..self.count].first();
        let of = move |h: &Hypothesis, i: usize| {
            h.reference.information[i * n + i].max(f64::MIN_POSITIVE).sqrt().recip()
                / h.reference.inverse_depths[i].abs().max(1e-3)
        };
        known.into_iter().flat_map(move |h| (0..n).map(move |i| of(h, i)))
    }

    /// The goal's depths as they are known now, with a harmonic mean of 1; infinite where a feature is infinitely far.
    pub fn depths(&self) -> impl Iterator<Item = f64> {
        let known = self.hypotheses[..self.count].first();
        known.into_iter().flat_map(|h| h.reference.inverse_depths.iter().map(|rho| 1.0 / rho.max(0.0)))
    }

    /// Whether noise explains this cost of so many features, whose depths are known or not.
    pub(crate) fn passes(&self, cost: f64, features: usize) -> bool {
        let freedom = (2.0 * features as f64 - 6.0).max(1.0);
        cost <= freedom + self.options.gate * (2.0 * freedom).sqrt() + self.options.gate
    }

    /// Whether the camera can have come from the last pose to this one.
    fn is_reachable(&self, to: &RelativePose, covariance: &Matrix6<f64>) -> bool {
        let from = &self.hypotheses[0].pose;
        let images = (self.missed + 1) as f64;
        let deviation = |first: usize| {
            self.options.gate * (0..3).map(|k| covariance[(first + k, first + k)]).sum::<f64>().sqrt()
        };
        let turn = from.rotation_error(to);
        let way = (from.t_21 - to.t_21).norm();
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
        if result.is_ok() {
            (self.missed, self.has_started) = (0, true);
        } else if !self.search.is_running() {
            self.missed = self.missed.saturating_add(1);
        }
        for (inlier, kept) in self.inliers.iter_mut().zip(&self.frame) {
            *inlier = result.is_ok() && kept.is_some();
        }
        result
    }

    fn restart(&mut self) {
        self.restarts += 1;
        (self.count, self.missed) = (0, 0);
        self.search = Search::new(self.goal.len());
        self.first_images.clear();
    }

    fn reset(&mut self) {
        self.restart();
        (self.restarts, self.has_started) = (0, false);
        self.take_given_depths();
    }

    fn inliers(&self) -> &[bool] {
        &self.inliers
    }

    fn hypotheses(&self) -> usize {
        self.count
    }

    fn restarts(&self) -> usize {
        self.restarts
    }
}

impl<S: PoseSource> DepthFilter<S> {
    fn estimate_checked(&mut self) -> Result<Estimate, HoldReason> {
        if self.seen() < self.options.min_features {
            return Err(HoldReason::TooFewFeatures);
        }
        let is_lost = self.missed > 0 && self.missed % (self.options.patience + 1) == self.options.patience;
        if self.search.is_running() || self.count == 0 || is_lost {
            self.go_on_searching()?;
            return Err(if self.has_started { HoldReason::Inconsistent } else { HoldReason::Starting });
        }
        self.sigma = self.sigma_of_mean(1);
        let fitted = self.follow()?;
        let Hypothesis { workspace, reference, .. } = &mut self.hypotheses[0];
        let covariance = workspace.covariance(reference).ok_or(HoldReason::Inconsistent)?;
        if !self.is_reachable(&fitted.pose, &covariance) && self.missed < 2 * self.options.patience {
            return Err(HoldReason::Jump);
        }
        Ok(self.accept(&fitted, &covariance))
    }

    /// The noise of a difference between the goal and the mean of so many images.
    pub(crate) fn sigma_of_mean(&self, images: usize) -> f64 {
        (self.options.noise / (images.max(1) as f64).sqrt()).hypot(self.options.goal_noise)
    }

    pub(crate) fn seen(&self) -> usize {
        self.frame.iter().flatten().count()
    }

    /// Fits the image by every hypothesis and puts the best first.
    fn follow(&mut self) -> Result<Fitted, HoldReason> {
        for k in 0..self.count {
            let fitted = self.fit(k, if k == 0 { MAX_STEPS } else { FEW_STEPS });
            self.hypotheses[k].fitted = fitted;
            if self.count > 1 {
                let cost = fitted.map_or(f64::INFINITY, |fitted| fitted.cost);
                self.hypotheses[k].score += cost.min(MOST_OF_ONE_IMAGE);
            }
        }
        self.hypotheses[..self.count].sort_by(|a, b| a.score.total_cmp(&b.score));
        let last = self.hypotheses[0].score + HOPELESS;
        self.count = self.hypotheses[..self.count].iter().take_while(|h| h.score <= last).count();
        let fitted = self.hypotheses[0].fitted.filter(|fitted| self.passes(fitted.cost, self.seen()));
        fitted.or_else(|| self.leave_out()).ok_or(HoldReason::Inconsistent)
    }

    /// Fits the image by one hypothesis, from its last pose.
    fn fit(&mut self, hypothesis: usize, steps: usize) -> Option<Fitted> {
        let Hypothesis { reference, pose, workspace, .. } = &mut self.hypotheses[hypothesis];
        let problem = Problem {
            goal: &self.goal,
            frame: &self.frame,
            reference,
            sigma: self.sigma,
            plane: self.options.plane,
        };
        workspace.fit(&problem, *pose, &reference.inverse_depths, steps)
    }

    /// Leaves out the feature that disturbs most, until the rest passes or too little is left.
    fn leave_out(&mut self) -> Option<Fitted> {
        while self.seen() > self.options.min_features.saturating_sub(1).max(4) {
            let mut best: Option<(f64, usize)> = None;
            for i in 0..self.frame.len() {
                let Some(image) = self.frame[i].take() else { continue };
                if let Some(fitted) = self.fit(0, FEW_STEPS)
                    && best.is_none_or(|(cost, _)| fitted.cost < cost)
                {
                    best = Some((fitted.cost, i));
                }
                self.frame[i] = Some(image);
            }
            self.frame[best?.1] = None;
            if let Some(fitted) = self.fit(0, MAX_STEPS).filter(|f| self.passes(f.cost, self.seen())) {
                for k in 1..self.count {
                    self.hypotheses[k].fitted = self.fit(k, FEW_STEPS);
                }
                return Some(fitted);
            }
        }
        None
    }

    /// Takes over the pose, and lets the image add to the depths of every hypothesis that it fits.
    fn accept(&mut self, fitted: &Fitted, covariance: &Matrix6<f64>) -> Estimate {
        let (inliers, weight) = (self.seen(), self.options.frame_weight);
        let squares: f64 = self.hypotheses[0].workspace.squares.iter().filter(|s| s.is_finite()).sum();
        self.hypotheses[0].fitted = Some(*fitted);
        for k in 0..self.count {
            let Some(fitted) = self.hypotheses[k].fitted else { continue };
            let passes = k == 0 || self.passes(fitted.cost, inliers);
            let h = &mut self.hypotheses[k];
            h.pose = fitted.pose;
            if passes {
                h.workspace.update(&mut h.reference, weight);
            }
        }
        Estimate {
            pose: fitted.pose,
            covariance: Some(*covariance),
            inliers,
            residual: self.sigma * (squares / (2 * inliers) as f64).sqrt(),
            alternatives: self.count,
            support: Support::Full,
        }
    }
}
