//! What JavaScript gets: poses, estimates and candidates as plain objects.

use quest_core::robust::{Estimate, Evidence, RunnerUp};
use quest_core::{Candidate, Correspondence, RelativePose};
use serde::Serialize;
use wasm_bindgen::{JsError, JsValue};

/// A pose, `X2 = R X1 + t`.
#[derive(Serialize)]
pub(crate) struct PoseObject {
    quaternion: [f64; 4],
    #[serde(rename = "R")]
    r: [[f64; 3]; 3],
    t: [f64; 3],
    parallax: f64,
}

/// As `Estimate` of the core.
#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct EstimateObject {
    model: &'static str,
    #[serde(flatten)]
    pose: PoseObject,
    covariance: [[f64; 6]; 6],
    inliers: Vec<bool>,
    inlier_count: usize,
    score: f64,
    iterations: usize,
    runner_up: Option<RunnerUpObject>,
    evidence: EvidenceObject,
    noise_px: f64,
    normal: Option<[f64; 3]>,
    false_share: f64,
    unmoved: usize,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct RunnerUpObject {
    #[serde(flatten)]
    pose: PoseObject,
    score: f64,
    inlier_count: usize,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct EvidenceObject {
    rotation_px: Option<f64>,
    planar_px: Option<f64>,
    general_px: Option<f64>,
}

/// As `Candidate` of the core, with the depths of the matches.
#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct CandidateObject {
    kind: &'static str,
    #[serde(flatten)]
    pose: PoseObject,
    /// In both views, a pair a match; null where undetermined.
    depths: Vec<Option<(f64, f64)>>,
    residual: f64,
    in_front: usize,
    feasible: bool,
}

/// A plain object of JavaScript: maps are objects, what is missing is null.
pub(crate) fn object<T: Serialize>(value: &T) -> Result<JsValue, JsError> {
    let serializer =
        serde_wasm_bindgen::Serializer::new().serialize_maps_as_objects(true).serialize_missing_as_null(true);
    value.serialize(&serializer).map_err(|error| JsError::new(&error.to_string()))
}

impl From<&RelativePose> for PoseObject {
    fn from(pose: &RelativePose) -> Self {
        // nalgebra keeps columns: those of the transpose are rows.
        let r = pose.r_21().transpose().into();
        Self { quaternion: pose.wxyz(), r, t: pose.t_21.into(), parallax: pose.t_21.norm() }
    }
}

impl From<&Estimate> for EstimateObject {
    fn from(found: &Estimate) -> Self {
        Self {
            model: found.model.name(),
            pose: (&found.pose).into(),
            covariance: found.covariance.transpose().into(),
            inliers: found.inliers.clone(),
            inlier_count: found.inlier_count,
            score: found.score,
            iterations: found.iterations,
            runner_up: found.runner_up.as_ref().map(RunnerUpObject::from),
            evidence: found.evidence.into(),
            noise_px: found.noise_px,
            normal: found.normal,
            false_share: found.false_share,
            unmoved: found.unmoved,
        }
    }
}

impl From<&RunnerUp> for RunnerUpObject {
    fn from(other: &RunnerUp) -> Self {
        Self { pose: (&other.pose).into(), score: other.score, inlier_count: other.inlier_count }
    }
}

impl From<Evidence> for EvidenceObject {
    fn from(evidence: Evidence) -> Self {
        let finite = |x: f64| x.is_finite().then_some(x);
        Self {
            rotation_px: finite(evidence.rotation_px),
            planar_px: finite(evidence.planar_px),
            general_px: finite(evidence.general_px),
        }
    }
}

impl CandidateObject {
    /// A candidate of the core for these matches.
    pub(crate) fn new(candidate: &Candidate, matches: &[Correspondence]) -> Self {
        let finite = |&(z1, z2): &(f64, f64)| z1.is_finite() && z2.is_finite();
        Self {
            kind: candidate.kind.name(),
            pose: (&candidate.pose).into(),
            depths: matches.iter().map(|m| candidate.depths(m).filter(finite)).collect(),
            residual: candidate.residual,
            in_front: candidate.in_front,
            feasible: candidate.in_front == matches.len(),
        }
    }
}
