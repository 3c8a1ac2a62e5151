//! What `estimate` returns: `Estimate`, with the `RunnerUp` where there is one.

use nalgebra::Matrix6;
use numpy::{PyArray1, PyArray2, ToPyArray};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use quest_core::robust::{self, Evidence, Model};

use crate::arrays;
use crate::pose::{Pose, PoseState};

/// Another pose that the matches of an estimate may mean: ``X2 = R @ X1 + t``.
#[pyclass(frozen, eq, module = "quest_pose")]
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct RunnerUp {
    pose: Pose,
    /// float : How well the pose explains all matches, from 0 to 1.
    #[pyo3(get)]
    score: f64,
    /// int : How many matches are within the threshold and in front of both cameras.
    #[pyo3(get)]
    inlier_count: usize,
}

type RunnerUpState = (PoseState, f64, usize);

/// The runner-up that ``RunnerUp.__reduce__`` took apart.
#[pyfunction]
pub(crate) fn _runner_up(state: RunnerUpState) -> RunnerUp {
    RunnerUp { pose: Pose::from_state(state.0), score: state.1, inlier_count: state.2 }
}

impl RunnerUp {
    fn state(&self) -> RunnerUpState {
        (self.pose.state(), self.score, self.inlier_count)
    }
}

#[pymethods]
impl RunnerUp {
    /// numpy.ndarray of shape (3, 3) : The rotation from the frame of camera 1 to that of camera 2.
    #[getter]
    #[pyo3(name = "R")]
    fn r<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        self.pose.r(py)
    }

    /// numpy.ndarray of shape (3,) : The origin of camera 1 in the frame of camera 2; its length is the parallax.
    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.pose.t(py)
    }

    /// numpy.ndarray of shape (4,) : The rotation as a unit quaternion, scalar first and not negative.
    #[getter]
    fn quat_wxyz<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.pose.quat_wxyz(py)
    }

    /// numpy.ndarray of shape (4,) : The same quaternion scalar last.
    #[getter]
    fn quat_xyzw<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.pose.quat_xyzw(py)
    }

    /// float : The length of ``t``.
    #[getter]
    fn parallax(&self) -> f64 {
        self.pose.parallax()
    }

    /// The runner-up as plain numbers and lists, ready for ``json.dumps``.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        self.pose.write_to(&dict)?;
        dict.set_item("parallax", self.parallax())?;
        dict.set_item("score", self.score)?;
        dict.set_item("inlier_count", self.inlier_count)?;
        Ok(dict)
    }

    fn __repr__(&self) -> String {
        let Self { pose, inlier_count, score } = self;
        format!("<RunnerUp: {}, inlier_count={inlier_count}, score={score:.3}>", pose.text())
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (RunnerUpState,))> {
        Ok((py.import("quest_pose._core")?.getattr("_runner_up")?, (self.state(),)))
    }
}

/// One pose from matches with outliers, as ``estimate`` returns it: ``X2 = R @ X1 + t``.
///
/// The mean absolute depth of the inliers over both views is 1, so that the length of ``t`` is the parallax. An estimate never
/// changes: its arrays are fresh copies at each access.
#[pyclass(frozen, eq, module = "quest_pose")]
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Estimate {
    /// str : Which model the matches support.
    ///
    /// ``"general"``, ``"planar"`` or ``"pure_rotation"`` (no translation that stands clear of the noise: ``t`` is the small
    /// vector that is left). Of a plane, and where the camera hardly moved, there may be a second pose, the runner-up.
    #[pyo3(get)]
    model: String,
    pose: Pose,
    covariance: Matrix6<f64>,
    inliers: Vec<bool>,
    /// float : How well the pose explains all matches, from 0 to 1.
    #[pyo3(get)]
    score: f64,
    /// int : Samples drawn.
    #[pyo3(get)]
    iterations: usize,
    /// RunnerUp or None : The pose that explains the matches nearly as well, where there is one.
    #[pyo3(get)]
    runner_up: Option<RunnerUp>,
    evidence: [f64; 3],
    /// float : The standard deviation of the inliers' Sampson errors, in the unit of the threshold.
    #[pyo3(get)]
    noise_px: f64,
}

type State = (String, PoseState, Vec<f64>, Vec<bool>, f64, usize, Option<RunnerUpState>, [f64; 3], f64);

/// The estimate that ``Estimate.__reduce__`` took apart.
#[pyfunction]
pub(crate) fn _estimate(state: State) -> Estimate {
    let (model, pose, covariance, inliers, score, iterations, runner_up, evidence, noise_px) = state;
    Estimate {
        model,
        pose: Pose::from_state(pose),
        covariance: Matrix6::from_iterator(covariance),
        inliers,
        score,
        iterations,
        runner_up: runner_up.map(_runner_up),
        evidence,
        noise_px,
    }
}

impl Estimate {
    /// An estimate of the core.
    pub(crate) fn new(found: &robust::Estimate) -> Self {
        let Evidence { rotation_px, planar_px, general_px } = found.evidence;
        Self {
            model: Model::name(found.model).to_owned(),
            pose: Pose::new(&found.pose),
            covariance: found.covariance,
            inliers: found.inliers.clone(),
            score: found.score,
            iterations: found.iterations,
            runner_up: found.runner_up.map(|other| RunnerUp {
                pose: Pose::new(&other.pose),
                score: other.score,
                inlier_count: other.inlier_count,
            }),
            evidence: [rotation_px, planar_px, general_px],
            noise_px: found.noise_px,
        }
    }

    fn covariance_rows(&self) -> Vec<[f64; 6]> {
        // Symmetric: columns are rows.
        let columns: [[f64; 6]; 6] = self.covariance.into();
        columns.to_vec()
    }
}

#[pymethods]
impl Estimate {
    /// numpy.ndarray of shape (3, 3) : The rotation from the frame of camera 1 to that of camera 2.
    #[getter]
    #[pyo3(name = "R")]
    fn r<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        self.pose.r(py)
    }

    /// numpy.ndarray of shape (3,) : The origin of camera 1 in the frame of camera 2; its length is the parallax.
    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.pose.t(py)
    }

    /// numpy.ndarray of shape (4,) : The rotation as a unit quaternion, scalar first and not negative.
    #[getter]
    fn quat_wxyz<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.pose.quat_wxyz(py)
    }

    /// numpy.ndarray of shape (4,) : The same quaternion scalar last, as SciPy and ROS have it.
    #[getter]
    fn quat_xyzw<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.pose.quat_xyzw(py)
    }

    /// float : The length of ``t``.
    #[getter]
    fn parallax(&self) -> f64 {
        self.pose.parallax()
    }

    /// numpy.ndarray of shape (N,) of bool : Which matches are within the threshold and in front of both cameras.
    #[getter]
    fn inliers<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        self.inliers.to_pyarray(py)
    }

    /// int : How many matches are inliers.
    #[getter]
    fn inlier_count(&self) -> usize {
        self.inliers.iter().filter(|inlier| **inlier).count()
    }

    /// numpy.ndarray of shape (6, 6) : The covariance of the rotation vector of the rotation's error and of ``t``.
    ///
    /// The true rotation is ``exp([w]x) @ R`` with w in radians, in the frame of camera 2.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        arrays::to_numpy(py, self.covariance_rows())
    }

    /// dict of str to float : The median residual of the inliers under each model, in the unit of the threshold.
    ///
    /// ``rotation_px`` under a rotation without translation (infinite where that leaves most of the points behind camera 2),
    /// ``planar_px`` under a plane (infinite where none was found),
    /// ``general_px`` under the essential matrix.
    #[getter]
    fn evidence<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        for (name, value) in ["rotation_px", "planar_px", "general_px"].into_iter().zip(self.evidence) {
            dict.set_item(name, value)?;
        }
        Ok(dict)
    }

    /// The estimate as plain numbers and lists, ready for ``json.dumps``.
    ///
    /// Returns
    /// -------
    /// dict
    ///     The keys of the command line's JSON.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        dict.set_item("model", &self.model)?;
        self.pose.write_to(&dict)?;
        dict.set_item("parallax", self.parallax())?;
        let covariance: Vec<_> = self.covariance_rows().into_iter().map(Vec::from).collect();
        dict.set_item("covariance", covariance)?;
        dict.set_item("inliers", &self.inliers)?;
        dict.set_item("inlier_count", self.inlier_count())?;
        dict.set_item("score", self.score)?;
        dict.set_item("iterations", self.iterations)?;
        dict.set_item("runner_up", self.runner_up.as_ref().map(|other| other.to_dict(py)).transpose()?)?;
        let evidence = PyDict::new(py);
        for (name, value) in ["rotation_px", "planar_px", "general_px"].into_iter().zip(self.evidence) {
            evidence.set_item(name, value.is_finite().then_some(value))?;
        }
        dict.set_item("evidence", evidence)?;
        dict.set_item("noise_px", self.noise_px)?;
        Ok(dict)
    }

    fn __repr__(&self) -> String {
        format!(
            "<Estimate {}: {}, inliers={} of {}, score={:.3}>",
            self.model,
            self.pose.text(),
            self.inlier_count(),
            self.inliers.len(),
            self.score
        )
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (State,))> {
        let state = (
            self.model.clone(),
            self.pose.state(),
            self.covariance.iter().copied().collect(),
            self.inliers.clone(),
            self.score,
            self.iterations,
            self.runner_up.as_ref().map(RunnerUp::state),
            self.evidence,
            self.noise_px,
        );
        Ok((py.import("quest_pose._core")?.getattr("_estimate")?, (state,)))
    }
}
