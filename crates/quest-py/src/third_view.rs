//! `_third_view`: one pose of two that a third view decides.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use quest_core::robust::{self, Options};

use crate::estimate_result::Estimate;
use crate::solve::Views;
use crate::supervisor::apart;
use crate::{errors, options};

/// The disagreement of the depths, that with the other pose, and the ratio of the lengths of the translations.
type Decision = (f64, f64, f64);

/// What `quest_pose.third_view` names: the estimates of views 1 and 2 and of views 1 and 3, and what decided.
#[pyfunction]
#[pyo3(signature = (x1, x2, x3, cameras, options))]
#[expect(clippy::needless_pass_by_value, reason = "pyo3 hands arrays over")]
pub(crate) fn _third_view(
    py: Python<'_>,
    x1: &Bound<'_, PyAny>,
    x2: &Bound<'_, PyAny>,
    x3: &Bound<'_, PyAny>,
    cameras: [Option<Bound<'_, PyAny>>; 3],
    options: &Bound<'_, PyDict>,
) -> PyResult<(Py<Estimate>, Py<Estimate>, Option<Decision>)> {
    let [camera1, camera2, camera3] = cameras.each_ref().map(Option::as_ref);
    let pairs = [Views::new(x1, x2, camera1, camera2)?, Views::new(x1, x3, camera1, camera3)?];
    let has_cameras = pairs[0].cameras().is_some();
    let options = options::options("third_view", Some(options), &["index"], has_cameras)?;
    // Each pair has random numbers of its own.
    let [first, second] = [0, 1].map(|index| {
        let options = Options { index, ..options.clone() };
        match pairs[usize::from(index == 1)].cameras() {
            Some([camera1, camera2]) => options.with_cameras(camera1, camera2),
            None => options,
        }
    });
    let found = py.detach(|| {
        let matches = |views: &Views| views.matches().map_err(|error| errors::input(&error));
        let (matches_21, matches_31) = (matches(&pairs[0])?, matches(&pairs[1])?);
        apart(move || robust::estimate_with_third_view(&matches_21, &first, &matches_31, &second))?
            .map_err(|error| errors::estimate(&error))
    })?;
    let decision = found.choice.map(|c| (c.disagreement, c.next_best, c.ratio));
    let [first, second] =
        [&found.estimate_21, &found.estimate_31].map(|one| Estimate::new(one).into_python(py));
    Ok((first?, second?, decision))
}
