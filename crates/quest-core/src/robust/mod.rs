//! One honest pose from matches with outliers.
//!
//! ```
//! use quest_core::robust::{self, Options};
//! use quest_core::simulate::{FOCAL_LENGTH, Scene, SceneOptions};
//!
//! let options = SceneOptions { points: 100, noise_px: 0.5, ..SceneOptions::realistic() };
//! let scene = Scene::generate(&options, 2018, 1)?;
//! let focal_lengths = [[FOCAL_LENGTH; 2]; 2];
//! let options = Options { threshold: 1.5, focal_lengths, ..Options::default() };
//! let estimate = robust::estimate(&scene.matches, &options)?;
//! assert!(estimate.pose.rotation_error(&scene.truth) < 0.01);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Steps
//! 1. The matches are permuted once and written in columns of pixels (`data`). Where matches share a keypoint, of which at most one
//!    is true, one of them is kept: for the search any, after it the one that agrees best. A group of matches that did not move at
//!    all is set aside where the others agree with a pose (`pipeline`).
//! 2. Random samples are drawn, more of them from matches that move as their neighbours do (`search::guide`, `search::ranking`), and solved
//!    (`search::hypotheses`). Their essential matrices are scored over all matches and dropped as soon as they are most likely worse
//!    than the best (`search::search_score`); the best are scored as poses, with the depths of their points
//!    (`search::pose_score`), and refined over their inliers, until the best would have been found again, and any other as
//!    good (`search::guide`, `search::stopping`). A few that are nearly as good are refined too (`search::contenders`).
//!    Where many inliers of the best are in one place, another is looked for that explains clearly more of the rest of the image
//!    (`search::crowds`).
//! 3. The best pose is refined over all of its inliers with the noise that they show (`conclude::final_refinement`, `refine`), and
//!    gives way to another minimum that explains the same matches and is likelier (`conclude::minima`).
//! 4. A plane is fitted to its points, and the two motions of the plane tried as well (`conclude::plane`). The best is refined once
//!    more without the matches that agree with it by chance (`conclude::chance_inliers`).
//! 5. Whether chance explains the inliers (`conclude::false_alarms`). Where a rotation alone leaves little, the likelihood of all
//!    matches decides which minimum is right, which matches agree by chance and whether there is a translation
//!    (`conclude::small_motion`); the model is a description of that (`conclude::model`).
//! 6. The length of the translation and the covariance (`conclude::length`, `conclude::covariance`); of a small motion both are those
//!    of a mixture (`conclude::mixture`).
//!
//! # Noise
//! Points that were given on the plane `z = 1` have the same noise everywhere in the image; bearings that were given otherwise,
//! as fisheye cameras do, the same angle. Residuals are Sampson errors in pixels of the focal lengths.
#![expect(
    clippy::inline_always,
    reason = "a call would leave the instructions that a loop was dispatched to (`widest`)"
)]

mod batch;
mod conclude;
mod data;
mod estimate;
mod options;
mod pipeline;
mod refine;
mod search;
#[cfg(test)]
mod tests;
mod third_view;

pub use batch::{Batch, Problem, STACK_SIZE, estimate_batch};
pub use estimate::{Estimate, Evidence, Model, RunnerUp};
pub use options::{EstimateError, KnownDirection, Options, Priors};
pub use third_view::{ThirdView, estimate_with_third_view};

use crate::degeneracy::diagnose;
use crate::{Correspondence, Degeneracy, InputError};
use conclude::Answer;
use data::observations::Observations;
use pipeline::Task;

/// Fewer matches than this have no pose.
pub const MIN_MATCHES: usize = 5;

/// Matches that are looked at for the reason why there is no hypothesis.
const DIAGNOSED: usize = 300;

/// The pose that most of the matches agree with, and what is known of it.
///
/// # Errors
/// [`EstimateError::Option`] for an impossible option, [`EstimateError::Input`] for fewer than [`MIN_MATCHES`] matches (or
/// than the solver takes) and for matches that determine no pose, or leave its rotation open, [`EstimateError::NoPose`] where
/// the best pose agrees with no more matches than chance explains ([`Options::max_false_alarms`]). With fewer than ten matches,
/// of which that cannot be said, the best pose is returned where five of them agree with it.
pub fn estimate(matches: &[Correspondence], options: &Options) -> Result<Estimate, EstimateError> {
    estimate_with(matches, options, &Priors::default())
}

/// As [`estimate`], with what is known beside the matches.
///
/// # Errors
/// Those of [`estimate`], [`EstimateError::Option`] for a prior that is not finite, and [`EstimateError::Direction`] where no pose
/// turns the known direction as told.
pub fn estimate_with(
    matches: &[Correspondence],
    options: &Options,
    priors: &Priors,
) -> Result<Estimate, EstimateError> {
    answer(matches, options, priors, Answer::Best, &|| false)
}

/// As [`estimate_with`], with a question that is asked every few samples: once `is_cancelled` says yes, the search ends.
///
/// # Errors
/// Those of [`estimate_with`], and [`EstimateError::Cancelled`].
pub fn estimate_until(
    matches: &[Correspondence],
    options: &Options,
    priors: &Priors,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Estimate, EstimateError> {
    answer(matches, options, priors, Answer::Best, is_cancelled)
}

fn answer(
    matches: &[Correspondence],
    options: &Options,
    priors: &Priors,
    answer: Answer,
    is_cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Estimate, EstimateError> {
    options.check()?;
    priors.check(matches.len())?;
    Task { matches, options, priors, answer, is_cancelled }.run()
}

/// Why there is no pose, when the best one has so many inliers and so large a share of false matches: what is wrong with the
/// matches, if anything is.
fn no_pose(observations: &Observations, inliers: usize, false_share: f64) -> EstimateError {
    // Within a threshold as wide as the image all points are on a line.
    let some = observations.first(DIAGNOSED);
    let is_usual = false_share < options::UNUSUAL;
    let otherwise = if observations.is_line(&some) && (is_usual || observations.is_long(&some)) {
        InputError::Degenerate(Degeneracy::Collinear).into()
    } else {
        EstimateError::NoPose { inliers, matches: observations.given.len(), false_share }
    };
    degenerate(observations, otherwise)
}

/// What is exactly wrong with the matches, or something else.
fn degenerate(observations: &Observations, otherwise: EstimateError) -> EstimateError {
    match diagnose(&observations.first(DIAGNOSED)) {
        Degeneracy::RankDeficient => otherwise,
        reason => InputError::Degenerate(reason).into(),
    }
}
