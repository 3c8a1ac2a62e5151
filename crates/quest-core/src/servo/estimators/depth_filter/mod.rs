//! The estimator of the loop: candidates start it, a filter on the goal's inverse depths carries it on.
//!
//! 1. *Average.* The first images are averaged (`first_images.rs`).
//! 2. *Search.* The source gives candidates for their mean. A candidate with its inverse depths at the goal is a hypothesis. The
//!    hypotheses are fitted over the next images, a few in each, so that no image takes long (`search.rs`).
//! 3. *Follow.* Every further image is fitted by every hypothesis (`fit.rs`, `hypotheses.rs`). The depths of a wrong hypothesis do
//!    not fit images from elsewhere: its costs add up, and it is dropped. The hypothesis with the smallest sum gives the pose.
//!    Noise has to explain its cost; where the cost is more, features are left out one at a time.
//! 4. *Gate.* A pose counts if the camera can have come there since the last one. After several images without a pose the source
//!    gives candidates again, which are first tried with the old depths.
//! 5. *Learn.* An accepted image adds to what is known of the depths. Its weight is small, for all images share the noise of the
//!    goal image.
//!
//! Choosing anew in every frame, as section 10.1 does, is in [`PerFrame`](crate::servo::PerFrame).

pub(crate) mod first_images;
pub(crate) mod fit;
mod hypotheses;
pub(crate) mod options;
mod reference;
mod search;
mod setting;

use nalgebra::Matrix6;

use crate::RelativePose;
use crate::servo::FilterOptions;
use crate::servo::estimators::depth_filter::first_images::FirstImages;
use crate::servo::estimators::depth_filter::fit::Fitted;
use crate::servo::estimators::depth_filter::hypotheses::Hypotheses;
use crate::servo::estimators::depth_filter::search::Search;
use crate::servo::estimators::depth_filter::setting::{Image, Setting};
use crate::servo::estimators::estimate::{Estimate, HoldReason, PoseEstimator, Support};
use crate::servo::estimators::source::PoseSource;

/// The estimator described at the head of the module.
#[derive(Clone, Debug)]
pub struct DepthFilter<S> {
    setting: Setting,
    source: S,
    first_images: FirstImages,
    search: Search,
    hypotheses: Hypotheses,
    /// The depths that were given, with their precisions.
    given: Option<(Vec<f64>, Vec<f64>)>,
    image: Image,
    /// Which features agreed with the last pose.
    inliers: Vec<bool>,
    /// Images since the last accepted pose, without those that a search takes.
    missed: usize,
    /// Whether there has been a pose.
    has_started: bool,
    restarts: usize,
}

impl<S: PoseSource> DepthFilter<S> {
    /// The estimator for this goal image: its features on the plane z = 1.
    #[must_use]
    pub fn new(goal: &[[f64; 2]], source: S, options: FilterOptions) -> Self {
        let n = goal.len();
        Self {
            setting: Setting { goal: goal.to_vec(), options },
            source,
            first_images: FirstImages::new(n, options.first_images),
            search: Search::new(n),
            hypotheses: Hypotheses::new(n, options.spread),
            given: None,
            image: Image::new(n),
            inliers: vec![false; n],
            missed: 0,
            has_started: false,
            restarts: 0,
        }
    }

    /// Starts with goal depths that are known, in any unit: from a depth camera or an earlier run. `precision` is their
    /// relative standard deviation.
    ///
    /// What is not a positive number counts as infinitely far.
    pub fn set_depths(&mut self, depths: &[f64], precision: f64) {
        let precisions = vec![precision; self.setting.goal.len()];
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
        let Self { given, hypotheses, setting, .. } = self;
        let Some((depths, precisions)) = given else { return };
        if hypotheses.set_depths(depths, precisions, setting.options.spread) {
            self.missed = setting.options.patience;
        }
    }

    /// The relative standard deviation of each of the goal's depths.
    pub fn depth_precisions(&self) -> impl Iterator<Item = f64> {
        self.hypotheses.best().into_iter().flat_map(|best| best.reference.precisions())
    }

    /// The goal's depths as they are known now, with a harmonic mean of 1; infinite where a feature is infinitely far.
    pub fn depths(&self) -> impl Iterator<Item = f64> {
        let known = self.hypotheses.best();
        known.into_iter().flat_map(|best| best.reference.inverse_depths.iter().map(|rho| 1.0 / rho.max(0.0)))
    }
}

impl<S: PoseSource> PoseEstimator for DepthFilter<S> {
    fn estimate(&mut self, features: &[Option<[f64; 2]>]) -> Result<Estimate, HoldReason> {
        self.image.take(features, &self.setting.goal);
        let result = self.estimated();
        if result.is_ok() {
            (self.missed, self.has_started) = (0, true);
        } else if !self.search.is_running() {
            self.missed = self.missed.saturating_add(1);
        }
        for (inlier, kept) in self.inliers.iter_mut().zip(&self.image.frame) {
            *inlier = result.is_ok() && kept.is_some();
        }
        result
    }

    fn restart(&mut self) {
        self.restarts += 1;
        self.missed = 0;
        self.hypotheses.clear();
        self.search.stop();
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
        self.hypotheses.len()
    }

    fn restarts(&self) -> usize {
        self.restarts
    }
}

impl<S: PoseSource> DepthFilter<S> {
    /// The steps at the head of the module.
    fn estimated(&mut self) -> Result<Estimate, HoldReason> {
        if self.image.seen() < self.setting.options.min_features {
            return Err(HoldReason::TooFewFeatures);
        }
        if self.has_to_search() {
            let is_new = !self.search.is_running();
            if is_new {
                self.average()?;
                let has_depths = self.hypotheses.len() > 0;
                self.search.begin(&self.image, &mut self.source, &self.setting, has_depths)?;
            }
            self.search.go_on(&mut self.hypotheses, &self.setting, is_new)?;
            return Err(if self.has_started { HoldReason::Inconsistent } else { HoldReason::Starting });
        }
        self.image.sigma = self.setting.sigma_of_mean(1);
        let fitted = self.hypotheses.follow(&self.setting, &mut self.image)?;
        let covariance = self.gate(&fitted)?;
        self.hypotheses.learn(&self.setting, &self.image);
        Ok(self.told(&fitted, &covariance))
    }

    /// Whether the image is for a search: one is running, there is no hypothesis, or there was no pose for as many images as
    /// `patience` says.
    fn has_to_search(&self) -> bool {
        let patience = self.setting.options.patience;
        let is_lost = self.missed > 0 && self.missed % (patience + 1) == patience;
        self.search.is_running() || self.hypotheses.len() == 0 || is_lost
    }

    /// What a search looks at: the first takes the mean of the first images, a later one the current image.
    fn average(&mut self) -> Result<(), HoldReason> {
        let Self { setting, image, hypotheses, first_images, .. } = self;
        let options = &setting.options;
        let mut images = 1;
        if hypotheses.len() == 0 {
            images = options.first_images;
            if !first_images.average(&mut image.frame, options.gate * options.noise) {
                return Err(HoldReason::Starting);
            }
            if image.seen() < options.min_features {
                return Err(HoldReason::TooFewFeatures);
            }
        }
        image.sigma = setting.sigma_of_mean(images);
        Ok(())
    }

    /// The covariance of a pose, if the camera can have come there from the last one.
    fn gate(&mut self, fitted: &Fitted) -> Result<Matrix6<f64>, HoldReason> {
        let covariance = self.hypotheses.covariance().ok_or(HoldReason::Inconsistent)?;
        let is_reachable = |from: &RelativePose| {
            let options = &self.setting.options;
            let images = (self.missed + 1) as f64;
            let deviation = |first: usize| {
                options.gate * (0..3).map(|k| covariance[(first + k, first + k)]).sum::<f64>().sqrt()
            };
            let turn = from.rotation_error(&fitted.pose);
            let way = (from.t_21 - fitted.pose.t_21).norm();
            turn <= images * options.largest_turn + deviation(0)
                && way <= images * options.largest_move + deviation(3)
        };
        let is_near = self.hypotheses.best().is_some_and(|best| is_reachable(&best.pose));
        if !is_near && self.missed < 2 * self.setting.options.patience {
            return Err(HoldReason::Jump);
        }
        Ok(covariance)
    }

    /// The estimate of an accepted image.
    fn told(&self, fitted: &Fitted, covariance: &Matrix6<f64>) -> Estimate {
        let inliers = self.image.seen();
        Estimate {
            pose: fitted.pose,
            covariance: Some(*covariance),
            inliers,
            residual: self.image.sigma * (self.hypotheses.squares() / (2 * inliers) as f64).sqrt(),
            alternatives: self.hypotheses.len(),
            support: Support::Full,
        }
    }
}
