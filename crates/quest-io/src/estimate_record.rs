//! The result of a robust estimate as it stands in files.

use quest_core::disambiguation::Choice;
use quest_core::robust::{Estimate, EstimateError, Evidence, RunnerUp, ThirdView};
use quest_core::{InputError, RelativePose};
use serde::Serialize;

use crate::Truth;
use crate::record::{rows, unsigned_zero};

/// The result of one estimate.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EstimateRecord {
    /// The key of the pair, which seeds its search: that of its file, else its number. Only Parquet has it.
    #[serde(skip)]
    pub key: u64,
    /// How many matches were read. Files have one of `inliers` for each where a pose was found.
    #[serde(skip)]
    pub match_count: usize,
    /// What the input calls the pair.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// A name of [`quest_core::robust::Model`]; `degenerate` where the matches determine no pose, `None` where none could be
    /// found.
    pub model: Option<&'static str>,
    /// Why there is no pose.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// How many matches have no bearing, such as pixels without a viewing ray, and were taken for outliers.
    #[serde(skip_serializing_if = "is_zero")]
    pub invalid_count: usize,
    /// What was found.
    #[serde(flatten)]
    pub found: Option<FoundRecord>,
    /// What a third view says, where it was asked.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub third_view: Option<ThirdViewRecord>,
    /// How long it took, in milliseconds.
    pub elapsed_ms: f64,
    /// The angle in degrees to the true rotation, where it is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rotation_error_deg: Option<f64>,
    /// The angle in degrees to the true direction of translation, where it is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub translation_error_deg: Option<f64>,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes fields by reference")]
fn is_zero(count: &usize) -> bool {
    *count == 0
}

/// What an estimate found. Fields as those of [`Estimate`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FoundRecord {
    /// The pose.
    #[serde(flatten)]
    pub pose: PoseRecord,
    /// The rows of the covariance of rotation vector (radians) and translation.
    pub covariance: [[f64; 6]; 6],
    /// One a match.
    pub inliers: Vec<bool>,
    /// How many are inliers.
    pub inlier_count: usize,
    /// From zero to one.
    pub score: f64,
    /// Samples drawn.
    pub iterations: usize,
    /// The other pose that the matches may mean.
    pub runner_up: Option<RunnerUpRecord>,
    /// How well each model fits.
    pub evidence: EvidenceRecord,
    /// The noise of the inliers, in pixels (without cameras, in units of the plane `z = 1`).
    pub noise_px: f64,
    /// The normal of the plane in view 1 over its distance: `R_21 + t_21 normalᵀ` is its homography. `None` where the model is no
    /// plane.
    pub normal: Option<[f64; 3]>,
    /// The share of false matches that the threshold accepts.
    pub false_share: f64,
    /// Matches that were set aside because they did not move at all.
    pub unmoved: usize,
}

/// A pose, `X2 = R_21 X1 + t_21`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PoseRecord {
    /// The rotation as a unit quaternion `w, x, y, z` with `w >= 0`.
    pub q_21: [f64; 4],
    /// The rows of the rotation matrix.
    #[serde(rename = "R_21")]
    pub r_21: [[f64; 3]; 3],
    /// The translation; the mean absolute depth over both views is 1.
    pub t_21: [f64; 3],
    /// Its length.
    pub parallax: f64,
}

/// Another pose that the matches may mean.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunnerUpRecord {
    /// The pose.
    #[serde(flatten)]
    pub pose: PoseRecord,
    /// From zero to one.
    pub score: f64,
    /// Its inliers.
    pub inlier_count: usize,
    /// The angle in degrees to the true rotation, where it is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rotation_error_deg: Option<f64>,
    /// The angle in degrees to the true direction of translation, where it is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub translation_error_deg: Option<f64>,
}

/// The median residual of the inliers under each model, in pixels; `None` where the model could not be fitted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct EvidenceRecord {
    /// A rotation without translation.
    pub rotation_px: Option<f64>,
    /// A plane.
    pub planar_px: Option<f64>,
    /// The essential matrix.
    pub general_px: Option<f64>,
}

/// The pose of a third view, `X3 = R_31 X1 + t_31`, and how well its depths agree with those of the pair.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ThirdViewRecord {
    /// The rotation as a unit quaternion `w, x, y, z` with `w >= 0`.
    pub q_31: [f64; 4],
    /// The rows of the rotation matrix.
    #[serde(rename = "R_31")]
    pub r_31: [[f64; 3]; 3],
    /// The translation; the mean absolute depth over views 1 and 3 is 1.
    pub t_31: [f64; 3],
    /// How far the depths are apart, in units of the noise; `None` where too few points are common.
    pub disagreement: Option<f64>,
    /// The same for the other pose of the pair; `None` where there is no other.
    pub next_best: Option<f64>,
    /// The length of `t_31` over that of `t_21`, in one common scale.
    pub ratio: Option<f64>,
}

impl ThirdViewRecord {
    /// The record of a pose of view 3 and the choice that led to it.
    #[must_use]
    pub fn chosen(pose_31: &RelativePose, choice: &Choice) -> Self {
        let PoseRecord { q_21, r_21, t_21, .. } = PoseRecord::new(pose_31);
        Self {
            q_31: q_21,
            r_31: r_21,
            t_31: t_21,
            disagreement: Some(choice.disagreement),
            next_best: Some(choice.next_best).filter(|x| x.is_finite()),
            ratio: Some(choice.ratio),
        }
    }

    /// The record of a third view.
    #[must_use]
    pub fn new(found: &ThirdView) -> Self {
        let PoseRecord { q_21, r_21, t_21, .. } = PoseRecord::new(&found.estimate_31.pose);
        Self {
            q_31: q_21,
            r_31: r_21,
            t_31: t_21,
            disagreement: found.choice.map(|c| c.disagreement),
            next_best: found.choice.map(|c| c.next_best).filter(|x| x.is_finite()),
            ratio: found.choice.map(|c| c.ratio),
        }
    }
}

impl EstimateRecord {
    /// The record of an estimate.
    #[must_use]
    pub fn new(name: Option<String>, estimate: &Estimate, truth: &Truth, elapsed_ms: f64) -> Self {
        let pose = &estimate.pose;
        Self {
            key: 0,
            match_count: estimate.inliers.len(),
            name,
            model: Some(estimate.model.name()),
            reason: None,
            invalid_count: 0,
            found: Some(FoundRecord::new(estimate, truth)),
            third_view: None,
            elapsed_ms,
            rotation_error_deg: truth.rotation_error_deg(pose),
            translation_error_deg: truth.translation_error_deg(pose),
        }
    }

    /// The record of matches that gave no pose.
    #[must_use]
    pub fn no_pose(name: Option<String>, error: &EstimateError, elapsed_ms: f64) -> Self {
        let is_degenerate = matches!(error, EstimateError::Input(InputError::Degenerate(_)));
        let model = is_degenerate.then_some("degenerate");
        Self { model, elapsed_ms, ..Self::unanswered(name, error.to_string()) }
    }

    /// The record of a pair that could not be read, or not be used, and why.
    #[must_use]
    pub fn unanswered(name: Option<String>, reason: String) -> Self {
        Self {
            key: 0,
            match_count: 0,
            name,
            model: None,
            reason: Some(reason),
            invalid_count: 0,
            found: None,
            third_view: None,
            elapsed_ms: 0.0,
            rotation_error_deg: None,
            translation_error_deg: None,
        }
    }
}

impl FoundRecord {
    fn new(estimate: &Estimate, truth: &Truth) -> Self {
        let covariance = &estimate.covariance;
        Self {
            pose: PoseRecord::new(&estimate.pose),
            covariance: std::array::from_fn(|i| std::array::from_fn(|j| unsigned_zero(covariance[(i, j)]))),
            inliers: estimate.inliers.clone(),
            inlier_count: estimate.inlier_count,
            score: estimate.score,
            iterations: estimate.iterations,
            runner_up: estimate.runner_up.as_ref().map(|other| RunnerUpRecord::new(other, truth)),
            evidence: EvidenceRecord::new(&estimate.evidence),
            noise_px: estimate.noise_px,
            normal: estimate.normal.map(|normal| normal.map(unsigned_zero)),
            false_share: estimate.false_share,
            unmoved: estimate.unmoved,
        }
    }
}

impl PoseRecord {
    /// The record of a pose.
    #[must_use]
    pub fn new(pose: &RelativePose) -> Self {
        Self {
            q_21: pose.wxyz().map(unsigned_zero),
            r_21: rows(&pose.r_21()),
            t_21: <[f64; 3]>::from(pose.t_21).map(unsigned_zero),
            parallax: pose.t_21.norm(),
        }
    }
}

impl RunnerUpRecord {
    fn new(other: &RunnerUp, truth: &Truth) -> Self {
        Self {
            pose: PoseRecord::new(&other.pose),
            score: other.score,
            inlier_count: other.inlier_count,
            rotation_error_deg: truth.rotation_error_deg(&other.pose),
            translation_error_deg: truth.translation_error_deg(&other.pose),
        }
    }
}

impl EvidenceRecord {
    fn new(evidence: &Evidence) -> Self {
        let finite = |x: f64| x.is_finite().then_some(x);
        Self {
            rotation_px: finite(evidence.rotation_px),
            planar_px: finite(evidence.planar_px),
            general_px: finite(evidence.general_px),
        }
    }
}
