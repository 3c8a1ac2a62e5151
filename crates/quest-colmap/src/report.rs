//! What a run found, pair by pair and in sum.

use std::collections::BTreeMap;

use quest_core::robust::Estimate;
use serde::Serialize;

use crate::Config;

/// What was found of a pair.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PairReport {
    /// COLMAP's key of the pair.
    pub pair_id: i64,
    /// The name of the image with the smaller number.
    pub image1: String,
    /// The name of the other image.
    pub image2: String,
    /// How many matches it has.
    pub matches: usize,
    /// How many of them have a keypoint without a viewing ray.
    pub invalid: usize,
    /// How many of them are inliers of what was found.
    pub inliers: usize,
    /// What its row says; `None` where no row was written.
    pub config: Option<Config>,
    /// Why there is no pose, or no row.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// The model of the estimate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<&'static str>,
    /// The pose `w, x, y, z` from image 1 to image 2.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub q_21: Option<[f64; 4]>,
    /// Its translation, the mean depth being one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub t_21: Option<[f64; 3]>,
    /// The standard deviation of the inliers, in pixels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_px: Option<f64>,
    /// Samples drawn.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub iterations: Option<usize>,
}

impl PairReport {
    /// What is said of the estimate.
    pub(crate) fn tell(&mut self, estimate: &Estimate) {
        self.model = Some(estimate.model.name());
        self.q_21 = Some(estimate.pose.wxyz());
        self.t_21 = Some(estimate.pose.t_21.into());
        self.noise_px = Some(estimate.noise_px);
        self.iterations = Some(estimate.iterations);
    }
}

/// What a run found in sum.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Summary {
    /// Pairs that were asked for.
    pub pairs: usize,
    /// Pairs with a pose or a homography.
    pub verified: usize,
    /// Pairs without.
    pub rejected: usize,
    /// Pairs that have a row, which was left (`--resume`).
    pub resumed: usize,
    /// Pairs that were left because a focal length is a guess.
    pub uncalibrated: usize,
    /// Pairs that cannot be read, or have no matches.
    pub unreadable: usize,
    /// How many rows say what, by COLMAP's names.
    pub configs: BTreeMap<&'static str, usize>,
    /// Matches of the pairs that were worked on.
    pub matches: usize,
    /// Inliers of the pairs with a pose or a homography.
    pub inliers: usize,
    /// Matches with a keypoint without a viewing ray.
    pub invalid: usize,
    /// How long it took, in seconds.
    pub elapsed_s: f64,
    /// Whether nothing was written because nothing was to be.
    pub dry_run: bool,
}

/// What a run found.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Report {
    /// In sum.
    pub summary: Summary,
    /// Pair by pair, by their keys; without those that were left as they are.
    pub pairs: Vec<PairReport>,
}

impl Report {
    /// Adds a pair.
    pub(crate) fn push(&mut self, pair: PairReport) {
        let summary = &mut self.summary;
        summary.matches += pair.matches;
        summary.invalid += pair.invalid;
        match pair.config {
            None => summary.unreadable += 1,
            Some(config) => {
                *summary.configs.entry(config.name()).or_default() += 1;
                if matches!(config, Config::Undefined | Config::Watermark) {
                    summary.rejected += 1;
                } else {
                    summary.verified += 1;
                    summary.inliers += pair.inliers;
                }
            }
        }
        self.pairs.push(pair);
    }
}
