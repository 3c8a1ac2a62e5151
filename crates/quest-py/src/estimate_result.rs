//! What `estimate` returns: `Estimate`, with the `RunnerUp` where there is one.

use nalgebra::Matrix6;
use numpy::{PyArray1, PyArray2, ToPyArray};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use quest_core::correspondence::Usable;
use quest_core::robust::{self, Evidence, Model};
use quest_core::tangent::Tangent;

use crate::errors::{self, QuestError, ShapeMismatch};
use crate::pose::{Pose, PoseState, RelativePose, with_base};
use crate::solve::Views;
use crate::{arrays, html};

/// Another pose that the matches of an estimate may mean: ``X2 = R @ X1 + t``.
#[pyclass(frozen, eq, extends = RelativePose, module = "quest_pose")]
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct RunnerUp {
    pub(crate) pose: Pose,
    /// float : How well the pose explains all matches, from 0 to 1.
    #[pyo3(get)]
    pub(crate) score: f64,
    /// int : How many matches are within the threshold and in front of both cameras.
    #[pyo3(get)]
    inlier_count: usize,
}

type RunnerUpState = (PoseState, f64, usize);

/// The runner-up that ``RunnerUp.__reduce__`` took apart.
#[pyfunction]
pub(crate) fn _runner_up(py: Python<'_>, state: RunnerUpState) -> PyResult<Py<RunnerUp>> {
    RunnerUp::from_state(state).into_python(py)
}

impl RunnerUp {
    fn from_state((pose, score, inlier_count): RunnerUpState) -> Self {
        Self { pose: Pose::from_state(pose), score, inlier_count }
    }

    fn into_python(self, py: Python<'_>) -> PyResult<Py<Self>> {
        with_base(py, self.pose, self)
    }

    fn state(&self) -> RunnerUpState {
        (self.pose.state(), self.score, self.inlier_count)
    }
}

#[pymethods]
impl RunnerUp {
    /// The runner-up as plain numbers and lists, ready for ``json.dumps``.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        self.pose.write_to(&dict)?;
        dict.set_item("parallax", self.pose.parallax())?;
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
/// The mean absolute depth of the inliers over both views is 1, so that the length of ``t`` is the parallax.
#[pyclass(frozen, eq, extends = RelativePose, module = "quest_pose")]
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Estimate {
    /// str : Which model the matches support.
    ///
    /// ``"general"``, ``"planar"`` or ``"pure_rotation"`` (no translation that stands clear of the noise: ``t`` is the small
    /// vector that is left). A plane may have a second pose, the runner-up, and so may a camera that hardly moved.
    #[pyo3(get)]
    pub(crate) model: String,
    pose: Pose,
    covariance: Matrix6<f64>,
    inliers: Vec<bool>,
    /// float : How well the pose explains all matches, from 0 to 1.
    #[pyo3(get)]
    pub(crate) score: f64,
    /// int : Samples drawn.
    #[pyo3(get)]
    pub(crate) iterations: usize,
    runner_up: Option<RunnerUp>,
    evidence: [f64; 3],
    /// float : The standard deviation of the inliers' Sampson errors, in the unit of the threshold.
    #[pyo3(get)]
    pub(crate) noise_px: f64,
    /// int : How many matches have no bearing, such as pixels without a viewing ray; they are outliers.
    #[pyo3(get)]
    pub(crate) invalid_count: usize,
    normal: Option<[f64; 3]>,
    /// float : The share of false matches that the threshold accepts.
    ///
    /// It is measured on the points of view 1 with those of view 2 shifted against them. Above some tenths the threshold is far too
    /// wide: is it in the unit of the points?
    #[pyo3(get)]
    pub(crate) false_share: f64,
    /// int : How many matches were set aside because they did not move at all while the others did.
    ///
    /// They are of an overlay, or of dirt on the lens. The pose is that of the others.
    #[pyo3(get)]
    pub(crate) unmoved: usize,
}

/// An estimate as ``__reduce__`` takes it apart.
pub(crate) type State = (
    String,
    PoseState,
    Vec<f64>,
    Vec<bool>,
    (f64, usize, f64, usize),
    Option<RunnerUpState>,
    [f64; 3],
    (Option<[f64; 3]>, f64, usize),
);

/// The estimate that ``Estimate.__reduce__`` took apart.
#[pyfunction]
pub(crate) fn _estimate(py: Python<'_>, state: State) -> PyResult<Py<Estimate>> {
    Estimate::from_state(state).into_python(py)
}

impl Estimate {
    /// An estimate of the core, of the usable ones of the matches.
    pub(crate) fn of_usable(found: &robust::Estimate, usable: &Usable) -> Self {
        let inliers = usable.spread(&found.inliers);
        Self { inliers, invalid_count: usable.invalid.len(), ..Self::new(found) }
    }

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
            invalid_count: 0,
            normal: found.normal,
            false_share: found.false_share,
            unmoved: found.unmoved,
        }
    }

    pub(crate) fn into_python(self, py: Python<'_>) -> PyResult<Py<Self>> {
        with_base(py, self.pose, self)
    }

    pub(crate) fn pose(&self) -> &Pose {
        &self.pose
    }

    pub(crate) fn covariance_matrix(&self) -> &Matrix6<f64> {
        &self.covariance
    }

    pub(crate) fn inlier_flags(&self) -> &[bool] {
        &self.inliers
    }

    pub(crate) fn evidence_px(&self) -> [f64; 3] {
        self.evidence
    }

    /// The normal of the plane over its distance, where there is one.
    pub(crate) fn plane(&self) -> Option<[f64; 3]> {
        self.normal
    }

    pub(crate) fn other(&self) -> Option<&RunnerUp> {
        self.runner_up.as_ref()
    }

    /// The depths of the inliers in views 1 and 2, and their rays in view 1; NaN for the other matches.
    fn depths_and_rays(&self, views: &Views) -> PyResult<Vec<([f64; 2], [f64; 3])>> {
        let usable = views.usable().map_err(|error| errors::input(&error))?;
        if usable.given() != self.inliers.len() {
            return Err(ShapeMismatch::new_err(format!(
                "x1 and x2 have {} points, expected the {} of the estimate",
                usable.given(),
                self.inliers.len()
            )));
        }
        let mut matches = usable.matches.iter();
        let mut invalid = usable.invalid.iter().map(|(place, _)| *place).peekable();
        let pose = self.pose.relative();
        Ok(self
            .inliers
            .iter()
            .enumerate()
            .map(|(place, &is_inlier)| {
                let m = if invalid.next_if_eq(&place).is_some() { None } else { matches.next() };
                let m = m.filter(|_| is_inlier);
                let found = m.and_then(|m| Some((m, pose.depths(m)?)));
                found.map_or(([f64::NAN; 2], [f64::NAN; 3]), |(m, (z1, z2))| {
                    ([z1, z2], (m.bearing1() * m.length1()).into())
                })
            })
            .collect())
    }

    pub(crate) fn state(&self) -> State {
        (
            self.model.clone(),
            self.pose.state(),
            self.covariance.iter().copied().collect(),
            self.inliers.clone(),
            (self.score, self.iterations, self.noise_px, self.invalid_count),
            self.runner_up.as_ref().map(RunnerUp::state),
            self.evidence,
            (self.normal, self.false_share, self.unmoved),
        )
    }

    pub(crate) fn from_state(state: State) -> Self {
        let (model, pose, covariance, inliers, numbers, runner_up, evidence, about_matches) = state;
        let (score, iterations, noise_px, invalid_count) = numbers;
        let (normal, false_share, unmoved) = about_matches;
        Self {
            model,
            pose: Pose::from_state(pose),
            covariance: Matrix6::from_iterator(covariance),
            inliers,
            score,
            iterations,
            runner_up: runner_up.map(RunnerUp::from_state),
            evidence,
            noise_px,
            invalid_count,
            normal,
            false_share,
            unmoved,
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
    /// numpy.ndarray of shape (N,) of bool : Which matches are within the threshold and in front of both cameras.
    #[getter]
    fn inliers<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        self.inliers.to_pyarray(py)
    }

    /// int : How many matches are inliers.
    #[getter]
    pub(crate) fn inlier_count(&self) -> usize {
        self.inliers.iter().filter(|inlier| **inlier).count()
    }

    /// RunnerUp or None : The pose that explains the matches nearly as well, where there is one.
    #[getter]
    fn runner_up(&self, py: Python<'_>) -> PyResult<Option<Py<RunnerUp>>> {
        self.runner_up.clone().map(|other| other.into_python(py)).transpose()
    }

    /// numpy.ndarray of shape (3,) or None : The normal of the plane in view 1 over its distance, in the unit of ``t``.
    ///
    /// ``R + outer(t, normal)`` takes points of view 1 to view 2. None where the model is not ``"planar"``.
    #[getter]
    fn normal<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        self.normal.map(|normal| normal.to_pyarray(py))
    }

    /// numpy.ndarray of shape (6, 6) : The covariance of the rotation vector of the rotation's error and of ``t``.
    ///
    /// The true rotation is ``exp([w]x) @ R`` with w in radians, in the frame of camera 2.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        arrays::to_numpy(py, self.covariance_rows())
    }

    /// float : The part of the matches that are inliers; 0 of none.
    #[getter]
    fn inlier_ratio(&self) -> f64 {
        self.inlier_count() as f64 / self.inliers.len().max(1) as f64
    }

    /// The points of the inliers, triangulated.
    ///
    /// Parameters
    /// ----------
    /// x1, x2, camera1, camera2
    ///     What ``estimate`` was called with.
    ///
    /// Returns
    /// -------
    /// numpy.ndarray of shape (N, 3)
    ///     In the frame of camera 1 and in the unit of ``t``, on the ray of view 1; NaN for matches that are no inliers or
    ///     whose rays are parallel.
    ///
    /// Raises
    /// ------
    /// ShapeMismatch
    ///     For another number of points than the estimate is of.
    #[pyo3(signature = (x1, x2, camera1=None, camera2=None))]
    fn points<'py>(
        &self,
        py: Python<'py>,
        x1: &Bound<'py, PyAny>,
        x2: &Bound<'py, PyAny>,
        camera1: Option<&Bound<'py, PyAny>>,
        camera2: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let found = self.depths_and_rays(&Views::new(x1, x2, camera1, camera2)?)?;
        let points = found.iter().map(|([z, _], ray)| ray.map(|x| x * z)).collect();
        Ok(arrays::to_numpy::<3>(py, points))
    }

    /// The depths of the inliers in both views.
    ///
    /// Parameters
    /// ----------
    /// x1, x2, camera1, camera2
    ///     What ``estimate`` was called with.
    ///
    /// Returns
    /// -------
    /// numpy.ndarray of shape (N, 2)
    ///     In the unit of ``t``: z in the frame of each camera, or the distance along the ray for fisheye cameras and
    ///     bearings of length one; NaN as for ``points``.
    ///
    /// Raises
    /// ------
    /// ShapeMismatch
    ///     For another number of points than the estimate is of.
    #[pyo3(signature = (x1, x2, camera1=None, camera2=None))]
    fn depths<'py>(
        &self,
        py: Python<'py>,
        x1: &Bound<'py, PyAny>,
        x2: &Bound<'py, PyAny>,
        camera1: Option<&Bound<'py, PyAny>>,
        camera2: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let found = self.depths_and_rays(&Views::new(x1, x2, camera1, camera2)?)?;
        Ok(arrays::to_numpy::<2>(py, found.into_iter().map(|(depths, _)| depths).collect()))
    }

    /// The covariance in the convention of another library; rotation first, as in ``covariance``.
    ///
    /// Parameters
    /// ----------
    /// convention : {"additive", "gtsam", "se3_left", "se3_right"}
    ///     ``"additive"``: that of ``covariance``. ``"se3_left"``: ``T' = exp(xi) T``. ``"se3_right"`` and ``"gtsam"`` (its
    ///     ``Pose3``): ``T' = T exp(xi)``. xi is (rotation vector, translation).
    ///
    /// Returns
    /// -------
    /// numpy.ndarray of shape (6, 6)
    ///
    /// Raises
    /// ------
    /// QuestError
    ///     For another convention.
    #[pyo3(signature = (convention, /))]
    fn covariance_as<'py>(&self, py: Python<'py>, convention: &str) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let tangent = match convention {
            "additive" => Tangent::Additive,
            "se3_left" => Tangent::Se3Left,
            "gtsam" | "se3_right" => Tangent::Se3Right,
            _ => {
                return Err(QuestError::new_err(format!(
                    "the convention is {convention:?}, expected \"additive\", \"gtsam\", \"se3_left\" or \"se3_right\""
                )));
            }
        };
        let changed = self.pose.relative().covariance_in(&self.covariance, tangent);
        let columns: [[f64; 6]; 6] = changed.transpose().into();
        Ok(arrays::to_numpy(py, columns.to_vec()))
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
    pub(crate) fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        dict.set_item("model", &self.model)?;
        self.pose.write_to(&dict)?;
        dict.set_item("parallax", self.pose.parallax())?;
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
        dict.set_item("normal", self.normal.map(|normal| normal.to_vec()))?;
        dict.set_item("false_share", self.false_share)?;
        dict.set_item("unmoved", self.unmoved)?;
        if self.invalid_count > 0 {
            dict.set_item("invalid_count", self.invalid_count)?;
        }
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

    fn _repr_html_(&self) -> String {
        html::estimate(self)
    }

    /// Inliers and outliers over both images, and the ellipses of the covariance. Needs matplotlib.
    ///
    /// Parameters
    /// ----------
    /// x1, x2 : array_like of shape (N, 2)
    ///     The matches that were given to ``estimate``.
    /// image1, image2 : array_like, optional
    ///     The images, to be drawn below the matches.
    /// figure : matplotlib.figure.Figure, optional
    ///     Where to draw; a new figure of pyplot where not given.
    ///
    /// Returns
    /// -------
    /// matplotlib.figure.Figure
    ///
    /// Raises
    /// ------
    /// ImportError
    ///     Where matplotlib is not installed.
    /// ShapeMismatch
    ///     For another number of matches.
    #[pyo3(signature = (x1, x2, *, image1=None, image2=None, figure=None))]
    fn plot<'py>(
        slf: &Bound<'py, Self>,
        x1: &Bound<'py, PyAny>,
        x2: &Bound<'py, PyAny>,
        image1: Option<&Bound<'py, PyAny>>,
        image2: Option<&Bound<'py, PyAny>>,
        figure: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let module = slf.py().import("quest_pose._plot")?;
        module.call_method1("estimate", (slf, x1, x2, image1, image2, figure))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (State,))> {
        Ok((py.import("quest_pose._core")?.getattr("_estimate")?, (self.state(),)))
    }
}
