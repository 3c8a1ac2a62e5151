//! `_third_view`: one pose of two that a third view decides.

use pyo3::prelude::*;
use quest_core::robust::{self, Options};

use crate::errors;
use crate::estimate::threshold_for;
use crate::estimate_result::Estimate;
use crate::solve::Views;

/// The disagreement of the depths, that with the other pose, and the ratio of the lengths of the translations.
type Decision = (f64, f64, f64);

/// What `quest_pose.third_view` names: the estimates of views 1 and 2 and of views 1 and 3, and what decided.
#[pyfunction]
#[pyo3(signature = (x1, x2, x3, cameras, threshold, confidence, max_iterations, seed))]
#[expect(clippy::too_many_arguments, reason = "the keywords of its wrapper")]
#[expect(clippy::needless_pass_by_value, reason = "pyo3 hands arrays over")]
pub(crate) fn _third_view(
    py: Python<'_>,
    x1: &Bound<'_, PyAny>,
    x2: &Bound<'_, PyAny>,
    x3: &Bound<'_, PyAny>,
    cameras: [Option<Bound<'_, PyAny>>; 3],
    threshold: Option<f64>,
    confidence: f64,
    max_iterations: usize,
    seed: u64,
) -> PyResult<(Estimate, Estimate, Option<Decision>)> {
    let [camera1, camera2, camera3] = cameras.each_ref().map(Option::as_ref);
    let pairs = [Views::new(x1, x2, camera1, camera2)?, Views::new(x1, x3, camera1, camera3)?];
    let threshold = threshold_for(pairs[0].cameras().is_some(), threshold)?;
    let [first, second] = [0, 1].map(|index| {
        let options = Options { threshold, confidence, max_iterations, seed, index, ..Options::default() };
        match pairs[usize::from(index == 1)].cameras() {
            Some([camera1, camera2]) => options.with_cameras(camera1, camera2),
            None => options,
        }
    });
    let found = py.detach(|| {
        let matches = |views: &Views| views.matches().map_err(|error| errors::input(&error));
        let (matches_21, matches_31) = (matches(&pairs[0])?, matches(&pairs[1])?);
        robust::estimate_with_third_view(&matches_21, &first, &matches_31, &second)
            .map_err(|error| errors::estimate(&error))
    })?;
    let decision = found.choice.map(|c| (c.disagreement, c.next_best, c.ratio));
    Ok((Estimate::new(&found.estimate_21), Estimate::new(&found.estimate_31), decision))
}
