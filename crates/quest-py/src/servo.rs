//! `quest_pose.servo`: one image in, one command out.

use nalgebra::Matrix3;
use numpy::{PyArray1, PyArray2, ToPyArray};
use pyo3::prelude::*;
use quest_core::servo::{
    Border, ControlLaw, DepthFilter, DifferentialDriveLaw, FilterOptions, FreeCameraLaw, Limits, Plane,
    Safety, Servo, Step,
};
use quest_core::solver::SolverName;

use crate::errors::{NotFinite, QuestError, ShapeMismatch, TooFewMatches};
use crate::{arrays, camera};

/// What one image led to. It never changes: its arrays are fresh copies at each access.
///
/// While the loop holds, the velocities are zero and ``state`` says why.
#[pyclass(frozen, module = "quest_pose.servo")]
#[derive(Debug)]
pub(crate) struct Command(Step);

#[pymethods]
impl Command {
    /// numpy.ndarray of shape (3,) : The velocity in m/s, in the camera's frame: x to the right, y down, z forward.
    #[getter]
    fn linear<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.0.command.linear.as_slice().to_pyarray(py)
    }

    /// numpy.ndarray of shape (3,) : The angular velocity in rad/s, in the camera's frame.
    #[getter]
    fn angular<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.0.command.angular.as_slice().to_pyarray(py)
    }

    /// float : The speed of a robot, ``linear[2]``.
    #[getter]
    fn speed(&self) -> f64 {
        self.0.command.linear.z
    }

    /// float : The turn rate of a robot, ``angular[1]``, positive to the right. ROS counts it positive to the left.
    #[getter]
    fn turn_rate(&self) -> f64 {
        self.0.command.angular.y
    }

    /// str : ``"tracking"``, or why the loop holds.
    ///
    /// ``"starting"``: the first images are being averaged, and their candidates tried. ``"too_few_features"``, ``"degenerate"``: the features
    /// determine no pose. ``"inconsistent"``: no pose explains them. ``"jump"``: the pose is further from the last
    /// one than the camera can have moved. ``"uncertain"``: its covariance is too large.
    #[getter]
    fn state(&self) -> &'static str {
        self.0.estimate.as_ref().map_or_else(|reason| reason.name(), |_| "tracking")
    }

    /// numpy.ndarray of shape (3, 3) or None : The rotation from the goal's frame to the camera's.
    #[getter]
    #[pyo3(name = "R")]
    fn r<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        let estimate = self.0.estimate.as_ref().ok()?;
        // nalgebra keeps columns, NumPy rows.
        let rows: [[f64; 3]; 3] = Matrix3::transpose(&estimate.pose.r_21()).into();
        Some(arrays::to_numpy(py, rows.to_vec()))
    }

    /// numpy.ndarray of shape (3,) or None : The goal's origin in the camera's frame.
    ///
    /// Its unit is the same in the whole run: the harmonic mean of the features' depths at the goal.
    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        let estimate = self.0.estimate.as_ref().ok()?;
        Some(estimate.pose.t_21.as_slice().to_pyarray(py))
    }

    /// int : How many features the pose rests on; 0 while the loop holds.
    #[getter]
    fn inliers(&self) -> usize {
        self.0.estimate.as_ref().map_or(0, |e| e.inliers)
    }

    fn __repr__(&self) -> String {
        let (v, w) = (self.0.command.linear.as_slice(), self.0.command.angular.as_slice());
        format!("<Command {}: linear={v:.4?}, angular={w:.4?}>", self.state())
    }
}

/// What both controllers are made of.
#[derive(Debug)]
struct Loop<L> {
    camera: Option<quest_core::Camera>,
    features: usize,
    servo: Servo<DepthFilter<SolverName>, L>,
}

/// What both controllers are told.
struct Given<'a, 'py> {
    goal: &'a Bound<'py, PyAny>,
    camera: Option<&'a Bound<'py, PyAny>>,
    limits: (f64, f64),
    noise: f64,
    goal_images: u32,
    period: f64,
    unit: f64,
    depths: Option<&'a Bound<'py, PyAny>>,
    solver: Option<&'a str>,
    plane: Option<Plane>,
    border: f64,
}

/// A positive number of the argument `name`.
fn positive(name: &str, value: f64) -> PyResult<f64> {
    if value > 0.0 && value.is_finite() {
        return Ok(value);
    }
    Err(QuestError::new_err(format!("{name} is {value}, expected a positive number")))
}

impl<L: ControlLaw> Loop<L> {
    fn new(given: &Given<'_, '_>, law: L) -> PyResult<Self> {
        let camera = given.camera.map(|c| camera::from_argument("camera", c)).transpose()?;
        let solver = given.solver.map_or(Ok(SolverName::default()), str::parse);
        let solver = solver.map_err(|error| QuestError::new_err(error.to_string()))?;
        let points: Vec<[f64; 2]> = arrays::rows("goal", given.goal)?;
        let needed = solver.info().min_matches;
        if points.len() < needed {
            let found = points.len();
            return Err(TooFewMatches::new_err(format!(
                "goal has {found} features, expected at least {needed}"
            )));
        }
        let goal: Option<Vec<[f64; 2]>> = points.iter().map(|&p| on_plane(camera.as_ref(), p)).collect();
        let goal = goal.ok_or_else(|| {
            NotFinite::new_err("a feature of goal is not finite or has no viewing ray, expected one in front")
        })?;
        let limits = Limits {
            speed: positive("max_speed", given.limits.0)?,
            turn_rate: positive("max_turn_rate", given.limits.1)?,
        };
        let focal = camera.as_ref().map_or(1.0, |c| c.focal_lengths().0);
        let noise = positive("noise", given.noise)? / focal;
        let (period, unit) = (positive("period", given.period)?, positive("unit", given.unit)?);
        let options = FilterOptions {
            noise,
            goal_noise: noise / f64::from(given.goal_images.max(1)).sqrt(),
            largest_turn: 1.5 * limits.turn_rate * period,
            largest_move: 1.5 * limits.speed * period / unit,
            plane: given.plane,
            ..FilterOptions::default()
        };
        let mut filter = DepthFilter::new(&goal, solver, options);
        if let Some(depths) = given.depths {
            let depths = arrays::vector("depths", depths)?;
            if depths.len() != goal.len() || !depths.iter().all(|z| *z > 0.0) {
                let (found, expected) = (depths.len(), goal.len());
                return Err(ShapeMismatch::new_err(format!(
                    "depths has {found} numbers, expected {expected} that are positive"
                )));
            }
            filter.set_depths(&depths, 0.02);
        }
        let mut safety = Safety::new(limits);
        safety.border = camera.as_ref().and_then(|c| {
            let (width, height) = c.size()?;
            let at = |u: f64| on_plane(Some(c), [u, 0.5 * f64::from(height)]).map(|m| m[0]);
            Some(Border { left: at(given.border)?, right: at(f64::from(width) - 1.0 - given.border)? })
        });
        safety.border = safety.border.filter(|_| given.plane.is_some());
        Ok(Self { camera, features: goal.len(), servo: Servo::new(&goal, filter, law, safety) })
    }

    fn step(&mut self, points: &Bound<'_, PyAny>) -> PyResult<Command> {
        let points: Vec<[f64; 2]> = arrays::rows("points", points)?;
        if points.len() != self.features {
            let (found, expected) = (points.len(), self.features);
            return Err(ShapeMismatch::new_err(format!(
                "points has {found} rows, expected {expected} as goal, NaN for features that are not seen"
            )));
        }
        let features: Vec<_> = points.iter().map(|&p| on_plane(self.camera.as_ref(), p)).collect();
        Ok(Command(self.servo.step(&features)))
    }
}

/// A pixel, or a point given so, on the plane z = 1.
fn on_plane(camera: Option<&quest_core::Camera>, point: [f64; 2]) -> Option<[f64; 2]> {
    let Some(camera) = camera else { return Some(point).filter(|p| p.iter().all(|c| c.is_finite())) };
    let ray = camera.bearing(point).ok()?;
    (ray.z > 0.0).then(|| [ray.x / ray.z, ray.y / ray.z])
}

/// A controller that moves a free camera, on an arm or a quadrotor, to where the goal image was taken.
///
/// Parameters
/// ----------
/// goal : array_like of shape (N, 2)
///     The features in the goal image, at least five: pixels where a camera is given, otherwise points on the plane
///     z = 1.
/// camera : Camera or array_like of shape (3, 3), optional
///     The camera, or its matrix K.
/// max_speed, max_turn_rate : float
///     Limits of the commands in m/s and rad/s. Both parts are slowed alike, so that the path stays the same.
/// noise : float
///     Standard deviation of the coordinates of a feature: in pixels, or on the plane z = 1 without a camera.
/// goal_images : int
///     How many images the goal's features are the mean of.
/// period : float
///     Seconds from one call of ``step`` to the next.
/// unit : float
///     About how far the features are from the goal, in metres. A wrong guess makes the translation faster or
///     slower than the rotation, no more.
/// rate : float
///     How fast both errors decay, in 1/s.
/// depths : array_like of shape (N,), optional
///     The depths of the features at the goal where they are known, in any unit.
/// solver : str, optional
///     One of the names in ``solvers()``.
///
/// Raises
/// ------
/// TooFewMatches, ShapeMismatch, NotFinite, BadCamera, QuestError
///     For too few features, arrays of other shapes, features without a viewing ray, impossible cameras, and numbers
///     that are not positive.
#[pyclass(module = "quest_pose.servo")]
#[derive(Debug)]
pub(crate) struct CameraServo(Loop<FreeCameraLaw>);

#[pymethods]
impl CameraServo {
    #[new]
    #[pyo3(signature = (goal, camera=None, *, max_speed, max_turn_rate, noise, goal_images=1, period=0.1, unit=1.0, rate=0.5, depths=None, solver=None))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn new(
        goal: &Bound<'_, PyAny>,
        camera: Option<&Bound<'_, PyAny>>,
        max_speed: f64,
        max_turn_rate: f64,
        noise: f64,
        goal_images: u32,
        period: f64,
        unit: f64,
        rate: f64,
        depths: Option<&Bound<'_, PyAny>>,
        solver: Option<&str>,
    ) -> PyResult<Self> {
        let limits = (max_speed, max_turn_rate);
        let given = Given {
            goal,
            camera,
            limits,
            noise,
            goal_images,
            period,
            unit,
            depths,
            solver,
            plane: None,
            border: 0.0,
        };
        Loop::new(&given, FreeCameraLaw { rate: positive("rate", rate)?, unit }).map(Self)
    }

    /// The command for one image.
    ///
    /// Parameters
    /// ----------
    /// points : array_like of shape (N, 2)
    ///     The same features now, in the order of ``goal``; NaN for those that are not seen.
    ///
    /// Returns
    /// -------
    /// Command
    ///     Velocities within the limits; zero while the loop holds.
    #[pyo3(signature = (points, /))]
    fn step(&mut self, points: &Bound<'_, PyAny>) -> PyResult<Command> {
        self.0.step(points)
    }
}

/// A controller that drives a robot with two driven wheels to where the goal image was taken.
///
/// The camera looks ahead, levelled, above the axle.
///
/// Parameters
/// ----------
/// goal : array_like of shape (N, 2)
///     The features in the goal image, at least five: pixels where a camera is given, otherwise points on the plane
///     z = 1.
/// camera : Camera or array_like of shape (3, 3), optional
///     The camera, or its matrix K. With the size of its image the robot keeps features inside.
/// max_speed, max_turn_rate : float
///     Limits of the commands in m/s and rad/s.
/// noise : float
///     Standard deviation of the coordinates of a feature: in pixels, or on the plane z = 1 without a camera.
/// goal_images : int
///     How many images the goal's features are the mean of.
/// period : float
///     Seconds from one call of ``step`` to the next.
/// unit : float
///     About how far the features are from the goal, in metres.
/// speed_gain, turn_gain : float
///     The gains k1 in m/s and k2 in rad/s of the paper's appendix C; ``turn_gain > speed_gain / unit`` makes the
///     law converge, twice as much is well.
/// tilt : float
///     How exactly the camera is level, one standard deviation in radians.
/// border : float
///     Features within so many pixels of the left and right border are brought back.
/// depths : array_like of shape (N,), optional
///     The depths of the features at the goal where they are known, in any unit.
/// solver : str, optional
///     One of the names in ``solvers()``.
///
/// Raises
/// ------
/// TooFewMatches, ShapeMismatch, NotFinite, BadCamera, QuestError
///     As ``CameraServo``.
#[pyclass(module = "quest_pose.servo")]
#[derive(Debug)]
pub(crate) struct RobotServo(Loop<DifferentialDriveLaw>);

#[pymethods]
impl RobotServo {
    #[new]
    #[pyo3(signature = (goal, camera=None, *, max_speed, max_turn_rate, noise, goal_images=1, period=0.1, unit=1.0, speed_gain=0.5, turn_gain=1.0, tilt=0.01, border=40.0, depths=None, solver=None))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn new(
        goal: &Bound<'_, PyAny>,
        camera: Option<&Bound<'_, PyAny>>,
        max_speed: f64,
        max_turn_rate: f64,
        noise: f64,
        goal_images: u32,
        period: f64,
        unit: f64,
        speed_gain: f64,
        turn_gain: f64,
        tilt: f64,
        border: f64,
        depths: Option<&Bound<'_, PyAny>>,
        solver: Option<&str>,
    ) -> PyResult<Self> {
        let limits = (max_speed, max_turn_rate);
        let (k1, k2) = (positive("speed_gain", speed_gain)?, positive("turn_gain", turn_gain)?);
        if k2 <= k1 / positive("unit", unit)? {
            let least = k1 / unit;
            return Err(QuestError::new_err(format!(
                "turn_gain is {k2}, expected more than speed_gain / unit = {least}: the law would not converge"
            )));
        }
        let tilt = positive("tilt", tilt)?;
        let plane = Some(Plane { tilt, height: 0.5 * tilt });
        let given =
            Given { goal, camera, limits, noise, goal_images, period, unit, depths, solver, plane, border };
        Loop::new(&given, DifferentialDriveLaw::new(k1, k2)).map(Self)
    }

    /// The command for one image; see ``CameraServo.step``.
    #[pyo3(signature = (points, /))]
    fn step(&mut self, points: &Bound<'_, PyAny>) -> PyResult<Command> {
        self.0.step(points)
    }

    /// bool : Whether the robot has arrived, and only turns to the goal's heading.
    #[getter]
    fn has_arrived(&self) -> bool {
        self.0.servo.law().has_arrived()
    }
}
