//! What one image led to, as Python sees it.

use nalgebra::Matrix3;
use numpy::{PyArray1, PyArray2, ToPyArray};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use quest_core::servo::{Status, Step};

use crate::arrays;

/// The velocities and the state, as `__reduce__` takes them apart.
type Motion = ([f64; 3], [f64; 3], String, String);
/// The pose: rotation, translation, covariance, residual.
type Pose = Option<([[f64; 3]; 3], [f64; 3], Option<[[f64; 6]; 6]>, f64)>;
/// The counters in the order of [`Status`].
type Counters = (u64, f64, usize, usize, usize, usize, f64, usize, bool, bool);
/// All of it, with the inlier mask.
pub(super) type CommandState = (Motion, Pose, Counters, Vec<bool>);

/// What one image led to. It never changes: its arrays are fresh copies at each access.
///
/// ``state`` says what the loop does, ``advice`` says it in a sentence with numbers.
#[pyclass(frozen, module = "quest_pose.servo")]
#[derive(Clone, Debug)]
pub(crate) struct Command {
    linear: [f64; 3],
    angular: [f64; 3],
    /// str : What the loop does.
    ///
    /// ``"tracking"``: the command follows the pose. ``"rotation_only"``: the images show no parallax, so that only the
    /// rotation is commanded. ``"exploring"``: a small motion to the side to see parallax. ``"confirming"``: the command
    /// follows the pose slowly until the camera has been seen to go where it is sent. ``"ambiguous"``: several poses
    /// are alive that command different things; the likeliest is followed slowly. ``"coasting"``: this image gave no pose,
    /// the last command goes on. Everything else is a reason to hold: ``"starting"``, ``"too_few_features"``,
    /// ``"degenerate"`` (the features determine no pose), ``"inconsistent"`` (no pose explains them), ``"jump"`` (the pose
    /// is further from the last one than the camera can have moved), ``"uncertain"``, ``"diverging"`` (the distance does
    /// not fall although motion is commanded), ``"stale"``.
    #[pyo3(get)]
    state: String,
    /// str : What the loop does and why, with numbers, and what helps.
    #[pyo3(get)]
    advice: String,
    pose: Pose,
    status: Status,
    mask: Vec<bool>,
}

/// The command that ``Command.__reduce__`` took apart.
#[pyfunction]
pub(crate) fn _command(state: CommandState) -> Command {
    let ((linear, angular, name, advice), pose, c, mask) = state;
    let status = Status {
        images: c.0,
        time: c.1,
        seen: c.2,
        inliers: c.3,
        hypotheses: c.4,
        holding_images: c.5,
        holding_seconds: c.6,
        restarts: c.7,
        arrived: c.8,
        border_limits: c.9,
    };
    Command { linear, angular, state: name, advice, pose, status, mask }
}

impl Command {
    /// The step of `features` features, of which `inliers` agreed.
    pub(super) fn new(step: &Step, inliers: &[bool], features: usize) -> Self {
        let mut mask = vec![false; features];
        let pose = step.estimate.as_ref().ok().map(|e| {
            mask.iter_mut().zip(inliers).for_each(|(m, i)| *m = *i);
            // nalgebra keeps columns, NumPy rows; a covariance is the same either way.
            let r: [[f64; 3]; 3] = Matrix3::transpose(&e.pose.r_21()).into();
            (r, e.pose.t_21.into(), e.covariance.map(Into::into), e.residual)
        });
        Self {
            linear: step.command.linear.into(),
            angular: step.command.angular.into(),
            state: step.state.name().to_owned(),
            advice: step.advice().to_string(),
            pose,
            status: step.status,
            mask,
        }
    }

    fn state_tuple(&self) -> CommandState {
        let s = &self.status;
        let counters = (
            s.images,
            s.time,
            s.seen,
            s.inliers,
            s.hypotheses,
            s.holding_images,
            s.holding_seconds,
            s.restarts,
            s.arrived,
            s.border_limits,
        );
        let motion = (self.linear, self.angular, self.state.clone(), self.advice.clone());
        (motion, self.pose, counters, self.mask.clone())
    }
}

#[pymethods]
impl Command {
    /// numpy.ndarray of shape (3,) : The velocity in m/s: x to the right, y down, z forward.
    ///
    /// In the camera's frame, or that of the hand or base where ``camera_in_hand`` or ``camera_in_base`` was given.
    #[getter]
    fn linear<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.linear.to_pyarray(py)
    }

    /// numpy.ndarray of shape (3,) : The angular velocity in rad/s, in the same frame.
    #[getter]
    fn angular<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.angular.to_pyarray(py)
    }

    /// float : The speed of a robot, ``linear[2]``.
    #[getter]
    fn speed(&self) -> f64 {
        self.linear[2]
    }

    /// float : The turn rate of a robot, ``angular[1]``, positive to the right. ROS counts it positive to the left.
    #[getter]
    fn turn_rate(&self) -> f64 {
        self.angular[1]
    }

    /// numpy.ndarray of shape (3, 3) or None : The rotation from the goal's frame to the camera's.
    #[getter]
    #[pyo3(name = "R")]
    fn r<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        Some(arrays::to_numpy(py, self.pose?.0.to_vec()))
    }

    /// numpy.ndarray of shape (3,) or None : The goal's origin in the camera's frame.
    ///
    /// Its unit is the same in the whole run: the harmonic mean of the features' depths at the goal.
    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        Some(self.pose?.1.to_pyarray(py))
    }

    /// numpy.ndarray of shape (6, 6) or None : The covariance of a small rotation in radians and of ``t``.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        Some(arrays::to_numpy(py, self.pose?.2?.to_vec()))
    }

    /// float or None : The root mean square of the inliers' residuals, on the plane z = 1.
    #[getter]
    fn residual(&self) -> Option<f64> {
        Some(self.pose?.3)
    }

    /// int : How many features the pose rests on; 0 where there is none.
    #[getter]
    fn inliers(&self) -> usize {
        self.status.inliers
    }

    /// numpy.ndarray of shape (N,) : Which features agree with the pose, in the order of the goal.
    #[getter]
    fn inlier_mask<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        self.mask.to_pyarray(py)
    }

    /// int : How many features of the goal the image shows.
    #[getter]
    fn seen(&self) -> usize {
        self.status.seen
    }

    /// int : How many hypotheses about the goal's depths are alive; 0 before the start.
    #[getter]
    fn hypotheses(&self) -> usize {
        self.status.hypotheses
    }

    /// int : The number of this image, from 1.
    #[getter]
    fn image(&self) -> u64 {
        self.status.images
    }

    /// float : The time of this image in seconds.
    #[getter]
    fn time(&self) -> f64 {
        self.status.time
    }

    /// int : How many images in a row gave no command of their own.
    #[getter]
    fn holding_images(&self) -> usize {
        self.status.holding_images
    }

    /// float : For how many seconds the loop has been holding.
    #[getter]
    fn holding_seconds(&self) -> f64 {
        self.status.holding_seconds
    }

    /// int : How often the estimator has begun anew.
    #[getter]
    fn restarts(&self) -> usize {
        self.status.restarts
    }

    /// bool : Whether the camera is at the goal, within the tolerances and for the time that were given.
    #[getter]
    fn arrived(&self) -> bool {
        self.status.arrived
    }

    /// bool : Whether the border of the image changed the command.
    #[getter]
    fn border_limits(&self) -> bool {
        self.status.border_limits
    }

    /// All of it as plain numbers, lists and strings: what JSON takes. ``None`` where there is no pose.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        dict.set_item("linear", self.linear.to_vec())?;
        dict.set_item("angular", self.angular.to_vec())?;
        dict.set_item("state", &self.state)?;
        dict.set_item("advice", &self.advice)?;
        let rows = |m: &[[f64; 3]; 3]| m.map(|row| row.to_vec()).to_vec();
        dict.set_item("R", self.pose.map(|p| rows(&p.0)))?;
        dict.set_item("t", self.pose.map(|p| p.1.to_vec()))?;
        let covariance = self.pose.and_then(|p| p.2);
        dict.set_item("covariance", covariance.map(|m| m.map(|row| row.to_vec()).to_vec()))?;
        dict.set_item("residual", self.pose.map(|p| p.3))?;
        dict.set_item("inlier_mask", &self.mask)?;
        let s = &self.status;
        for (name, count) in [
            ("inliers", s.inliers),
            ("seen", s.seen),
            ("hypotheses", s.hypotheses),
            ("holding_images", s.holding_images),
            ("restarts", s.restarts),
        ] {
            dict.set_item(name, count)?;
        }
        dict.set_item("image", s.images)?;
        dict.set_item("time", s.time)?;
        dict.set_item("holding_seconds", s.holding_seconds)?;
        dict.set_item("arrived", s.arrived)?;
        dict.set_item("border_limits", s.border_limits)?;
        Ok(dict)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (CommandState,))> {
        Ok((py.import("quest_pose._core")?.getattr("_command")?, (self.state_tuple(),)))
    }

    fn __repr__(&self) -> String {
        format!("<Command {}: linear={:.4?}, angular={:.4?}>", self.state, self.linear, self.angular)
    }
}
