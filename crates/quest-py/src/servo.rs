//! `quest_pose.servo`: one image in, one command out.

mod command;
mod controller;
mod given;
mod joints;

use std::sync::{Arc, Mutex};

use pyo3::prelude::*;
use quest_core::servo::{Axes, DifferentialDriveLaw, FreeCameraLaw, Mount, Plane};

pub(crate) use self::command::{_command, Command};
pub(crate) use self::controller::Controller;
use self::controller::locked;
use self::given::{Given, Loop, positive};
pub(crate) use self::joints::joint_velocities;
use crate::arrays;
use crate::errors::QuestError;

/// A controller that moves a free camera, on an arm or a quadrotor, to where the goal image was taken.
///
/// Parameters
/// ----------
/// goal : array_like of shape (N, 2)
///     The features in the goal image, at least five and none of them NaN: pixels where a camera is given, otherwise points
///     on the plane z = 1.
/// camera : Camera or array_like of shape (3, 3), optional
///     The camera, or its matrix K.
/// max_speed, max_turn_rate : float
///     Limits of the commands in m/s and rad/s. Both parts are slowed alike, so that the path stays the same.
/// max_acceleration, max_turn_acceleration : float, optional
///     How fast the commands may change, in m/s² and rad/s²: twice the limits where not given, so that full speed comes after
///     half a second. ``inf`` for at once.
/// noise : float
///     Standard deviation of the coordinates of a feature: in pixels, or on the plane z = 1 without a camera.
/// goal_images : int
///     How many images the goal's features are the mean of.
/// period : float
///     Seconds from one call of ``step`` to the next.
/// unit : float, optional
///     About how far the features are from the goal, in metres: 1 where neither it nor depths are given. A wrong guess makes the translation faster or
///     slower than the rotation, no more.
/// rate : float
///     How fast both errors decay, in 1/s.
/// depths : array_like of shape (N,), optional
///     The depths of the features at the goal, NaN where one is not known. In metres they set ``unit`` where it is not given;
///     with a ``unit`` they may be in any unit.
/// depth_precision : float or array_like of shape (N,), optional
///     The relative standard deviation of the depths, one for all or one each; 0.02 where not given.
/// explore : float
///     How far the loop may move to the side where the images show no parallax, as a share of the depth: 0.04 suits most
///     scenes. Without it a start next to the goal only turns, and ``advice`` says why.
/// tolerance, angle_tolerance, arrival_time : float
///     ``arrived`` is true within so many metres (with ``unit``) and degrees, after so many seconds there.
/// coasting_images : int
///     For so many images without a pose the last command goes on.
/// largest_gap : float
///     An image that is older than so many seconds, by ``now`` of ``step``, is stale. ``idle`` stops after as long.
/// axes : sequence of str, optional
///     Which motions of the camera are free: ``"x"``, ``"y"``, ``"z"`` along its axes and ``"rx"``, ``"ry"``, ``"rz"`` about
///     them. All six where not given.
/// camera_in_hand : array_like of shape (4, 4), optional
///     Takes points of the camera's frame to the hand's, in metres. Commands are then for the hand's frame.
/// solver : str, optional
///     One of the names in ``solvers()``.
///
/// Raises
/// ------
/// TooFewMatches, ShapeMismatch, NotFinite, BadCamera, QuestError
///     For too few features, arrays of other shapes, features without a viewing ray, impossible cameras, and numbers
///     that are not positive.
#[pyclass(extends = Controller, frozen, module = "quest_pose.servo")]
#[derive(Debug)]
pub(crate) struct CameraServo(Arc<Mutex<Loop<FreeCameraLaw>>>);

#[pymethods]
impl CameraServo {
    #[new]
    #[pyo3(signature = (goal, camera=None, *, max_speed, max_turn_rate, max_acceleration=None, max_turn_acceleration=None, noise, goal_images=1, period=0.1, unit=None, rate=0.5, depths=None, depth_precision=None, explore=0.0, tolerance=0.01, angle_tolerance=0.5, arrival_time=0.5, coasting_images=1, largest_gap=0.5, axes=None, camera_in_hand=None, solver=None))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn new(
        goal: &Bound<'_, PyAny>,
        camera: Option<&Bound<'_, PyAny>>,
        max_speed: f64,
        max_turn_rate: f64,
        max_acceleration: Option<f64>,
        max_turn_acceleration: Option<f64>,
        noise: f64,
        goal_images: i128,
        period: f64,
        unit: Option<f64>,
        rate: f64,
        depths: Option<&Bound<'_, PyAny>>,
        depth_precision: Option<&Bound<'_, PyAny>>,
        explore: f64,
        tolerance: f64,
        angle_tolerance: f64,
        arrival_time: f64,
        coasting_images: i128,
        largest_gap: f64,
        axes: Option<Vec<String>>,
        camera_in_hand: Option<&Bound<'_, PyAny>>,
        solver: Option<&str>,
    ) -> PyResult<PyClassInitializer<Self>> {
        let mount = camera_in_hand.map(|m| given::transform("camera_in_hand", m)).transpose()?;
        let mount = mount.map_or(Mount::Camera, Mount::Hand);
        let axes = axes.map_or(Ok(Axes::default()), |names| named_axes(&names))?;
        let given = Given {
            goal,
            camera,
            limits: (max_speed, max_turn_rate),
            acceleration: (max_acceleration, max_turn_acceleration),
            noise,
            goal_images: arrays::whole("goal_images", goal_images)?,
            period,
            unit,
            depths,
            depth_precision,
            solver,
            plane: None,
            border: 0.0,
            explore,
            coasting_images: arrays::whole("coasting_images", coasting_images)?,
            largest_gap,
            arrival: (tolerance, angle_tolerance, arrival_time),
            mount,
            axes,
        };
        let rate = positive("rate", rate)?;
        let shared = Loop::shared(&given, |unit| Ok(FreeCameraLaw { rate, unit }))?;
        Ok(PyClassInitializer::from(Controller::new(Arc::clone(&shared) as _)).add_subclass(Self(shared)))
    }

    /// float : How fast both errors decay, in 1/s. It can be set.
    #[getter]
    fn get_rate(&self) -> f64 {
        locked(&self.0).servo.law().rate
    }

    #[setter]
    fn set_rate(&self, value: f64) -> PyResult<()> {
        let value = positive("rate", value)?;
        locked(&self.0).servo.law_mut().rate = value;
        Ok(())
    }
}

/// Axes by their names.
fn named_axes(names: &[String]) -> PyResult<Axes> {
    Axes::from_names(names.iter().map(String::as_str)).map_err(|name| {
        QuestError::new_err(format!("axes has {name:?}, expected one of {}", Axes::NAMES.join(", ")))
    })
}

/// A controller that drives a robot with two driven wheels to where the goal image was taken.
///
/// The camera looks ahead, levelled, above the axle, unless ``camera_in_base`` says otherwise.
///
/// Parameters
/// ----------
/// goal : array_like of shape (N, 2)
///     The features in the goal image, at least five and none of them NaN: pixels where a camera is given, otherwise points
///     on the plane z = 1.
/// camera : Camera or array_like of shape (3, 3), optional
///     The camera, or its matrix K. With the size of its image the robot keeps features inside.
/// max_speed, max_turn_rate : float
///     Limits of the commands in m/s and rad/s.
/// max_acceleration, max_turn_acceleration : float, optional
///     How fast the commands may change, in m/s² and rad/s²: twice the limits where not given, so that full speed comes after
///     half a second. ``inf`` for at once.
/// noise : float
///     Standard deviation of the coordinates of a feature: in pixels, or on the plane z = 1 without a camera.
/// goal_images : int
///     How many images the goal's features are the mean of.
/// period : float
///     Seconds from one call of ``step`` to the next.
/// unit : float, optional
///     About how far the features are from the goal, in metres: 1 where neither it nor depths are given.
/// speed_gain, turn_gain : float
///     The gains k1 in m/s and k2 in rad/s of the paper's appendix C; ``turn_gain > speed_gain / unit`` makes the
///     law converge, twice as much is well.
/// tilt : float
///     How exactly the camera is level, one standard deviation in radians.
/// border : float
///     Features within so many pixels of the left and right border are brought back.
/// depths : array_like of shape (N,), optional
///     The depths of the features at the goal, NaN where one is not known. In metres they set ``unit`` where it is not given;
///     with a ``unit`` they may be in any unit.
/// depth_precision : float or array_like of shape (N,), optional
///     The relative standard deviation of the depths, one for all or one each; 0.02 where not given.
/// explore : float
///     How far the loop may move to the side where the images show no parallax, as a share of the depth: 0.04 suits most
///     scenes. Without it a start next to the goal only turns, and ``advice`` says why.
/// tolerance, angle_tolerance, arrival_time : float
///     ``arrived`` is true within so many metres (with ``unit``) and degrees, after so many seconds there.
/// coasting_images : int
///     For so many images without a pose the last command goes on.
/// largest_gap : float
///     An image that is older than so many seconds, by ``now`` of ``step``, is stale. ``idle`` stops after as long.
/// camera_in_base : (forward, height, tilt) or array_like of shape (4, 4), optional
///     Where the camera is: metres ahead of the axle and above it, radians by which it looks down; or the matrix that takes
///     points of the camera's frame to the base's (x to the right, y down, z forward).
/// solver : str, optional
///     One of the names in ``solvers()``.
///
/// Raises
/// ------
/// TooFewMatches, ShapeMismatch, NotFinite, BadCamera, QuestError
///     As ``CameraServo``.
#[pyclass(extends = Controller, frozen, module = "quest_pose.servo")]
#[derive(Debug)]
pub(crate) struct RobotServo(Arc<Mutex<Loop<DifferentialDriveLaw>>>);

#[pymethods]
impl RobotServo {
    #[new]
    #[pyo3(signature = (goal, camera=None, *, max_speed, max_turn_rate, max_acceleration=None, max_turn_acceleration=None, noise, goal_images=1, period=0.1, unit=None, speed_gain=0.5, turn_gain=1.0, tilt=0.01, border=40.0, depths=None, depth_precision=None, explore=0.0, tolerance=0.01, angle_tolerance=0.5, arrival_time=0.5, coasting_images=1, largest_gap=0.5, camera_in_base=None, solver=None))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn new(
        goal: &Bound<'_, PyAny>,
        camera: Option<&Bound<'_, PyAny>>,
        max_speed: f64,
        max_turn_rate: f64,
        max_acceleration: Option<f64>,
        max_turn_acceleration: Option<f64>,
        noise: f64,
        goal_images: i128,
        period: f64,
        unit: Option<f64>,
        speed_gain: f64,
        turn_gain: f64,
        tilt: f64,
        border: f64,
        depths: Option<&Bound<'_, PyAny>>,
        depth_precision: Option<&Bound<'_, PyAny>>,
        explore: f64,
        tolerance: f64,
        angle_tolerance: f64,
        arrival_time: f64,
        coasting_images: i128,
        largest_gap: f64,
        camera_in_base: Option<&Bound<'_, PyAny>>,
        solver: Option<&str>,
    ) -> PyResult<PyClassInitializer<Self>> {
        let (k1, k2) = (positive("speed_gain", speed_gain)?, positive("turn_gain", turn_gain)?);
        let tilt = positive("tilt", tilt)?;
        let plane = Some(Plane { tilt, height: 0.5 * tilt });
        let mount = camera_in_base.map_or(Ok(Mount::Camera), base_mount)?;
        let axes = Axes::default();
        let given = Given {
            goal,
            camera,
            limits: (max_speed, max_turn_rate),
            acceleration: (max_acceleration, max_turn_acceleration),
            noise,
            goal_images: arrays::whole("goal_images", goal_images)?,
            period,
            unit,
            depths,
            depth_precision,
            solver,
            plane,
            border,
            explore,
            coasting_images: arrays::whole("coasting_images", coasting_images)?,
            largest_gap,
            arrival: (tolerance, angle_tolerance, arrival_time),
            mount,
            axes,
        };
        let law = |unit: f64| converging(k1, k2, unit).map(|(k1, k2)| DifferentialDriveLaw::new(k1, k2));
        let shared = Loop::shared(&given, law)?;
        Ok(PyClassInitializer::from(Controller::new(Arc::clone(&shared) as _)).add_subclass(Self(shared)))
    }

    /// float : The gain k1, in m/s. It can be set.
    #[getter]
    fn get_speed_gain(&self) -> f64 {
        locked(&self.0).servo.law().speed_gain
    }

    #[setter]
    fn set_speed_gain(&self, value: f64) -> PyResult<()> {
        self.set_gains(positive("speed_gain", value)?, self.get_turn_gain())
    }

    /// float : The gain k2, in rad/s. It can be set.
    #[getter]
    fn get_turn_gain(&self) -> f64 {
        locked(&self.0).servo.law().turn_gain
    }

    #[setter]
    fn set_turn_gain(&self, value: f64) -> PyResult<()> {
        self.set_gains(self.get_speed_gain(), positive("turn_gain", value)?)
    }

    /// float : The robot stops within so many metres of its goal, with ``unit``. It can be set.
    #[getter]
    fn get_stop_distance(&self) -> f64 {
        self.distance(|law| law.stop_distance)
    }

    #[setter]
    fn set_stop_distance(&self, value: f64) -> PyResult<()> {
        self.set_distance("stop_distance", value, |law| &mut law.stop_distance)
    }

    /// float : It also stops within so many metres where the goal lies sideways, which driving cannot mend. It can be set.
    #[getter]
    fn get_sideways_distance(&self) -> f64 {
        self.distance(|law| law.sideways_distance)
    }

    #[setter]
    fn set_sideways_distance(&self, value: f64) -> PyResult<()> {
        self.set_distance("sideways_distance", value, |law| &mut law.sideways_distance)
    }

    /// float : Once stopped it starts again beyond so many metres, more than both others. It can be set.
    #[getter]
    fn get_start_distance(&self) -> f64 {
        self.distance(|law| law.start_distance)
    }

    #[setter]
    fn set_start_distance(&self, value: f64) -> PyResult<()> {
        self.set_distance("start_distance", value, |law| &mut law.start_distance)
    }

    /// bool : Whether the robot has arrived, and only turns to the goal's heading.
    #[getter]
    fn has_arrived(&self) -> bool {
        locked(&self.0).servo.law().has_arrived()
    }
}

impl RobotServo {
    /// A distance of the law in metres.
    fn distance(&self, of: impl Fn(&DifferentialDriveLaw) -> f64) -> f64 {
        let mut shared = locked(&self.0);
        shared.servo.rig_mut().unit * of(shared.servo.law())
    }

    /// Sets a distance of the law, in metres, unless the robot would start again where it stops.
    fn set_distance(
        &self,
        name: &str,
        value: f64,
        of: impl Fn(&mut DifferentialDriveLaw) -> &mut f64,
    ) -> PyResult<()> {
        let value = positive(name, value)?;
        let mut shared = locked(&self.0);
        let unit = shared.servo.rig_mut().unit;
        let mut law = *shared.servo.law();
        *of(&mut law) = value / unit;
        let stops = law.stop_distance.max(law.sideways_distance);
        if stops >= law.start_distance {
            return Err(QuestError::new_err(format!(
                "{name} is {value}, expected start_distance ({} m) above stop_distance and sideways_distance ({} m)",
                unit * law.start_distance,
                unit * stops
            )));
        }
        *shared.servo.law_mut() = law;
        Ok(())
    }

    fn set_gains(&self, k1: f64, k2: f64) -> PyResult<()> {
        let mut shared = locked(&self.0);
        let gains = converging(k1, k2, shared.servo.rig_mut().unit)?;
        let law = shared.servo.law_mut();
        (law.speed_gain, law.turn_gain) = gains;
        Ok(())
    }
}

/// Both gains, with which the law of appendix C converges.
fn converging(k1: f64, k2: f64, unit: f64) -> PyResult<(f64, f64)> {
    let least = k1 / unit;
    if k2 > least {
        return Ok((k1, k2));
    }
    Err(QuestError::new_err(format!(
        "turn_gain is {k2}, expected more than speed_gain / unit = {least}: the law would not converge"
    )))
}

/// Three numbers, or a matrix.
fn base_mount(given: &Bound<'_, PyAny>) -> PyResult<Mount> {
    match given.extract::<(f64, f64, f64)>() {
        Ok((forward, height, tilt)) if [forward, height, tilt].iter().all(|x| x.is_finite()) => {
            Ok(Mount::ahead(forward, height, tilt))
        }
        Ok(numbers) => {
            Err(QuestError::new_err(format!("camera_in_base is {numbers:?}, expected finite numbers")))
        }
        Err(_) => given::transform("camera_in_base", given).map(Mount::Base),
    }
}
