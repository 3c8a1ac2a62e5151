//! `estimate`: one pose from matches with outliers.

use quest_core::Camera;
use quest_core::robust::{self, Options, Priors};
use serde::Deserialize;
use wasm_bindgen::prelude::*;

use crate::input;
use crate::output::{self, EstimateObject};

/// The names of the options.
const NAMES: [&str; 11] = [
    "camera1",
    "camera2",
    "threshold",
    "confidence",
    "minIterations",
    "maxIterations",
    "maxFalseAlarms",
    "seed",
    "solver",
    "loss",
    "scores",
];

#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct Given {
    camera1: Option<Camera>,
    camera2: Option<Camera>,
    threshold: Option<f64>,
    confidence: Option<f64>,
    min_iterations: Option<usize>,
    max_iterations: Option<usize>,
    max_false_alarms: Option<f64>,
    seed: Option<u64>,
    solver: Option<String>,
    loss: Option<String>,
    scores: Option<Vec<f64>>,
}

/// One pose from matches of which some are wrong.
///
/// `matches` are rows `u1, v1, u2, v2`, one after the other: pixels where `camera1` is given, otherwise points on the planes
/// `z = 1` of the cameras. It throws an `Error` where the matches or options are unusable, or no pose explains more of the matches than
/// chance does.
///
/// # Errors
/// Those of the core, with their text.
#[wasm_bindgen(unchecked_return_type = "Estimate")]
pub fn estimate(
    matches: &[f64],
    #[wasm_bindgen(unchecked_optional_param_type = "EstimateOptions")] options: JsValue,
) -> Result<JsValue, JsError> {
    let given: Given = input::options(options, &NAMES)?;
    let rows = input::rows("matches", matches)?;
    let cameras = input::cameras(given.camera1, given.camera2)?;
    let options = core_options(&given, cameras.as_ref())?;
    let matches = input::matches(&rows, cameras.as_ref())?;
    let priors = Priors { scores: given.scores.as_deref(), ..Priors::default() };
    let found = robust::estimate_with(&matches, &options, &priors)?;
    output::object(&EstimateObject::from(&found))
}

fn core_options(given: &Given, cameras: Option<&[Camera; 2]>) -> Result<Options, JsError> {
    let default = Options::default();
    // One pixel where there are cameras.
    let threshold = given.threshold.or(cameras.map(|_| 1.0)).ok_or_else(|| {
        JsError::new(
            "neither cameras nor a threshold are given, expected cameras, or a threshold in units of the plane z = 1",
        )
    })?;
    let options = Options {
        threshold,
        confidence: given.confidence.unwrap_or(default.confidence),
        min_iterations: given.min_iterations.unwrap_or(default.min_iterations),
        max_iterations: given.max_iterations.unwrap_or(default.max_iterations),
        max_false_alarms: given.max_false_alarms.unwrap_or(default.max_false_alarms),
        seed: given.seed.unwrap_or(default.seed),
        solver: input::solver(given.solver.as_deref())?,
        loss: given.loss.as_deref().map_or(Ok(default.loss), str::parse)?,
        ..default
    };
    Ok(match cameras {
        Some([camera1, camera2]) => options.with_cameras(camera1, camera2),
        None => options,
    })
}
