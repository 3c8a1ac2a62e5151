//! `_choose`: of several poses the one that a third view agrees with.

use pyo3::prelude::*;
use quest_core::RelativePose;
use quest_core::disambiguation::choose;

use crate::errors::{self, QuestError};
use crate::estimate::pose;
use crate::solve::Views;

/// A rotation matrix and a translation.
type Given<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>);

/// The indices of the poses, the disagreement, that of the next best, and the ratio of the lengths.
type Choice = (usize, usize, f64, f64, f64);

/// What `quest_pose.choose` names.
#[pyfunction]
#[pyo3(signature = (x1, x2, x3, poses_21, poses_31, cameras, noise))]
#[expect(clippy::too_many_arguments, reason = "the keywords of its wrapper")]
#[expect(clippy::needless_pass_by_value, reason = "pyo3 hands lists over")]
pub(crate) fn _choose(
    py: Python<'_>,
    x1: &Bound<'_, PyAny>,
    x2: &Bound<'_, PyAny>,
    x3: &Bound<'_, PyAny>,
    poses_21: Vec<Given<'_>>,
    poses_31: Vec<Given<'_>>,
    cameras: [Option<Bound<'_, PyAny>>; 3],
    noise: f64,
) -> PyResult<Option<Choice>> {
    if !(noise > 0.0 && noise.is_finite()) {
        return Err(QuestError::new_err(format!("noise is {noise}, expected a positive number of radians")));
    }
    let [camera1, camera2, camera3] = cameras.each_ref().map(Option::as_ref);
    let pairs = [Views::new(x1, x2, camera1, camera2)?, Views::new(x1, x3, camera1, camera3)?];
    let poses = |name: &str, given: &[Given<'_>]| -> PyResult<Vec<RelativePose>> {
        given.iter().enumerate().map(|(i, one)| pose(&format!("{name}[{i}]"), one)).collect()
    };
    let (poses_21, poses_31) = (poses("poses_21", &poses_21)?, poses("poses_31", &poses_31)?);
    let choice = py.detach(|| {
        let matches = |views: &Views| views.matches().map_err(|error| errors::input(&error));
        let (matches_21, matches_31) = (matches(&pairs[0])?, matches(&pairs[1])?);
        choose(&matches_21, &poses_21, &matches_31, &poses_31, noise).map_err(|error| errors::input(&error))
    })?;
    Ok(choice.map(|c| (c.pose_21, c.pose_31, c.disagreement, c.next_best, c.ratio)))
}
