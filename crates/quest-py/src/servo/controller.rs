//! `Controller`: what both controllers can do, whatever their law.

use std::fmt::Debug;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use numpy::{PyArray1, ToPyArray};
use pyo3::prelude::*;
use quest_core::servo::{Acceleration, Rig, Safety, Twist};

use super::command::Command;
use super::given::{self, not_negative, positive};
use crate::arrays;
use crate::errors::ShapeMismatch;

/// A loop whose law is not known here.
pub(super) trait AnyLoop: Debug + Send {
    /// How many features the goal has.
    fn features(&self) -> usize;
    /// The command for one image.
    fn step(&mut self, points: &[[f64; 2]], stamp: Option<f64>, now: Option<f64>) -> Command;
    /// The command where no image comes.
    fn idle(&mut self, now: f64) -> Twist;
    /// Forgets all but the goal.
    fn reset(&mut self);
    /// The depths in metres with their relative precision; NaN where nothing is known.
    fn depths(&mut self) -> (Vec<f64>, Vec<f64>);
    /// Starts anew with known depths.
    fn set_depths(&mut self, depths: &[f64], precision: &[f64]);
    /// Limits and guards.
    fn safety(&mut self) -> &mut Safety;
    /// How the loop is built.
    fn rig(&mut self) -> &mut Rig;
}

/// The loop that a controller and its base class share.
///
/// Python's lock is held wherever this one is taken, and nothing of Python is called meanwhile: no thread waits for the other lock.
pub(super) fn locked<T: ?Sized>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What every controller can do: ``CameraServo`` and ``RobotServo`` are made, this one is not.
///
/// All its settings are numbers that can be set at any time, between two images.
#[pyclass(subclass, frozen, module = "quest_pose.servo")]
#[derive(Debug)]
pub(crate) struct Controller(Arc<Mutex<dyn AnyLoop>>);

impl Controller {
    /// The base of the controller that has this loop.
    pub(super) fn new(shared: Arc<Mutex<dyn AnyLoop>>) -> Self {
        Self(shared)
    }

    fn get<T>(&self, setting: impl FnOnce(&mut Safety) -> T) -> T {
        setting(locked(&self.0).safety())
    }

    /// Changes a setting to a value that was looked at.
    fn set<T>(&self, value: PyResult<T>, setting: impl FnOnce(&mut Safety) -> &mut T) -> PyResult<()> {
        let value = value?;
        *setting(locked(&self.0).safety()) = value;
        Ok(())
    }
}

/// The limits of the acceleration, to be changed: none is infinite.
fn acceleration(safety: &mut Safety) -> &mut Acceleration {
    safety.acceleration.get_or_insert(Acceleration { linear: f64::INFINITY, angular: f64::INFINITY })
}

#[pymethods]
impl Controller {
    /// The command for one image.
    ///
    /// Parameters
    /// ----------
    /// points : array_like of shape (N, 2)
    ///     The same features now, in the order of ``goal``; NaN for those that are not seen.
    /// stamp : float, optional
    ///     When the image was taken, in seconds; one period after the last one where not given. An image that is not later
    ///     than the last one is stale.
    /// now : float, optional
    ///     The present on the same clock, to see whether the image is too old.
    ///
    /// Returns
    /// -------
    /// Command
    ///     Velocities within the limits; towards zero while the loop holds.
    ///
    /// Raises
    /// ------
    /// ShapeMismatch
    ///     For another number of features than the goal has.
    #[pyo3(signature = (points, /, stamp=None, now=None))]
    fn step(&self, points: &Bound<'_, PyAny>, stamp: Option<f64>, now: Option<f64>) -> PyResult<Command> {
        let points: Vec<[f64; 2]> = arrays::rows("points", points)?;
        let mut shared = locked(&self.0);
        let (found, expected) = (points.len(), shared.features());
        if found != expected {
            return Err(ShapeMismatch::new_err(format!(
                "points has {found} rows, expected {expected} as goal, NaN for features that are not seen"
            )));
        }
        Ok(shared.step(&points, stamp, now))
    }

    /// What to do where no image comes: the linear and the angular velocity, which go to zero once the last image is
    /// ``largest_gap`` old.
    ///
    /// Parameters
    /// ----------
    /// now : float
    ///     The present, on the clock of the stamps.
    #[pyo3(signature = (now, /))]
    fn idle<'py>(&self, py: Python<'py>, now: f64) -> (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>) {
        let twist = locked(&self.0).idle(now);
        (twist.linear.as_slice().to_pyarray(py), twist.angular.as_slice().to_pyarray(py))
    }

    /// Forgets everything but the goal and the depths that were given.
    fn reset(&self) {
        locked(&self.0).reset();
    }

    /// The depths of the features at the goal as they are known now.
    ///
    /// Returns
    /// -------
    /// depths, precision : numpy.ndarray of shape (N,)
    ///     In metres if ``unit`` is exact, and their relative standard deviations; NaN for what is not known. What
    ///     ``set_depths`` takes.
    fn depths<'py>(&self, py: Python<'py>) -> (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>) {
        let (depths, precision) = locked(&self.0).depths();
        (depths.to_pyarray(py), precision.to_pyarray(py))
    }

    /// Starts anew with depths that are known: from an earlier run, or another sensor.
    ///
    /// Parameters
    /// ----------
    /// depths : array_like of shape (N,)
    ///     In the unit of those given at the start, NaN where one is not known.
    /// precision : float or array_like of shape (N,)
    ///     Their relative standard deviations.
    #[pyo3(signature = (depths, /, precision=None))]
    fn set_depths(&self, depths: &Bound<'_, PyAny>, precision: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        let features = locked(&self.0).features();
        let (depths, precision) = given::depths(depths, precision, features)?;
        locked(&self.0).set_depths(&depths, &precision);
        Ok(())
    }

    /// float : The unit of ``t`` in metres: as given, or the harmonic mean of the depths.
    #[getter]
    fn unit(&self) -> f64 {
        locked(&self.0).rig().unit
    }

    /// float : Seconds from one image to the next, where images have no stamps.
    #[getter]
    fn period(&self) -> f64 {
        locked(&self.0).rig().period
    }

    /// float : The largest speed, in m/s. It can be set.
    #[getter]
    fn get_max_speed(&self) -> f64 {
        self.get(|s| s.limits.speed)
    }

    #[setter]
    fn set_max_speed(&self, value: f64) -> PyResult<()> {
        self.set(positive("max_speed", value), |s| &mut s.limits.speed)
    }

    /// float : The largest turn rate, in rad/s. It can be set.
    #[getter]
    fn get_max_turn_rate(&self) -> f64 {
        self.get(|s| s.limits.turn_rate)
    }

    #[setter]
    fn set_max_turn_rate(&self, value: f64) -> PyResult<()> {
        self.set(positive("max_turn_rate", value), |s| &mut s.limits.turn_rate)
    }

    /// float : How fast the speed may change, in m/s². It can be set.
    #[getter]
    fn get_max_acceleration(&self) -> f64 {
        self.get(|s| acceleration(s).linear)
    }

    #[setter]
    fn set_max_acceleration(&self, value: f64) -> PyResult<()> {
        self.set(not_negative("max_acceleration", value), |s| &mut acceleration(s).linear)
    }

    /// float : How fast the turn rate may change, in rad/s². It can be set.
    #[getter]
    fn get_max_turn_acceleration(&self) -> f64 {
        self.get(|s| acceleration(s).angular)
    }

    #[setter]
    fn set_max_turn_acceleration(&self, value: f64) -> PyResult<()> {
        self.set(not_negative("max_turn_acceleration", value), |s| &mut acceleration(s).angular)
    }

    /// float : How far the loop may move to the side to see parallax, as a share of the depth. It can be set.
    #[getter]
    fn get_explore(&self) -> f64 {
        self.get(|s| s.explore)
    }

    #[setter]
    fn set_explore(&self, value: f64) -> PyResult<()> {
        self.set(not_negative("explore", value), |s| &mut s.explore)
    }

    /// float : Within so many metres of the goal the camera has arrived. It can be set.
    #[getter]
    fn get_tolerance(&self) -> f64 {
        self.get(|s| s.arrival.distance)
    }

    #[setter]
    fn set_tolerance(&self, value: f64) -> PyResult<()> {
        self.set(not_negative("tolerance", value), |s| &mut s.arrival.distance)
    }

    /// float : Within so many degrees of the goal the camera has arrived. It can be set.
    #[getter]
    fn get_angle_tolerance(&self) -> f64 {
        self.get(|s| s.arrival.angle).to_degrees()
    }

    #[setter]
    fn set_angle_tolerance(&self, value: f64) -> PyResult<()> {
        self.set(not_negative("angle_tolerance", value).map(f64::to_radians), |s| &mut s.arrival.angle)
    }

    /// float : After so many seconds at the goal the camera has arrived. It can be set.
    #[getter]
    fn get_arrival_time(&self) -> f64 {
        self.get(|s| s.arrival.seconds)
    }

    #[setter]
    fn set_arrival_time(&self, value: f64) -> PyResult<()> {
        self.set(not_negative("arrival_time", value), |s| &mut s.arrival.seconds)
    }

    /// int : For so many images without a pose the last command goes on. It can be set.
    #[getter]
    fn get_coasting_images(&self) -> usize {
        self.get(|s| s.coasting_images)
    }

    #[setter]
    fn set_coasting_images(&self, value: i128) -> PyResult<()> {
        self.set(arrays::whole("coasting_images", value), |s| &mut s.coasting_images)
    }

    /// float : An image that is older than so many seconds is stale. It can be set.
    #[getter]
    fn get_largest_gap(&self) -> f64 {
        self.get(|s| s.largest_gap)
    }

    #[setter]
    fn set_largest_gap(&self, value: f64) -> PyResult<()> {
        self.set(not_negative("largest_gap", value), |s| &mut s.largest_gap)
    }

    /// float : Where the rotation's standard deviation is larger, in degrees, the loop holds as ``"uncertain"``. It can be set.
    #[getter]
    fn get_rotation_uncertainty(&self) -> f64 {
        self.get(|s| s.rotation_uncertainty).to_degrees()
    }

    #[setter]
    fn set_rotation_uncertainty(&self, value: f64) -> PyResult<()> {
        self.set(positive("rotation_uncertainty", value).map(f64::to_radians), |s| {
            &mut s.rotation_uncertainty
        })
    }

    /// float : The same of the translation, as a share of ``unit``. It can be set.
    #[getter]
    fn get_translation_uncertainty(&self) -> f64 {
        self.get(|s| s.translation_uncertainty)
    }

    #[setter]
    fn set_translation_uncertainty(&self, value: f64) -> PyResult<()> {
        self.set(positive("translation_uncertainty", value), |s| &mut s.translation_uncertainty)
    }

    /// bool : Whether the loop holds, as ``"diverging"``, where the distance does not fall although motion is commanded. It can
    /// be set.
    #[getter]
    fn get_watchdog(&self) -> bool {
        self.get(|s| s.watchdog)
    }

    #[setter]
    fn set_watchdog(&self, value: bool) -> PyResult<()> {
        self.set(Ok(value), |s| &mut s.watchdog)
    }
}
