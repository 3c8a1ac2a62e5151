//! `joint_velocities`: from a command to the joints of an arm.

use nalgebra::Vector3;
use numpy::{PyArray1, ToPyArray};
use pyo3::prelude::*;
use quest_core::servo::{self, JointLimits, JointPosition, Twist};

use super::given::{not_negative, positive};
use crate::arrays;
use crate::errors::{NotFinite, ShapeMismatch};

/// The velocities of an arm's joints that make a command, by damped least squares.
///
/// All velocities are slowed by the same factor until each is within its limits, so that the hand keeps its direction.
///
/// Parameters
/// ----------
/// linear, angular : array_like of shape (3,)
///     The velocities of a ``Command``.
/// jacobian : array_like of shape (6, N)
///     What the hand does, linear part first, for each joint that moves with velocity one: in the frame of the command.
/// max_speeds : array_like of shape (N,)
///     The largest speed of each joint, in its unit per second.
/// damping : float
///     Keeps the joints slow where the arm is stretched out, at the price of some exactness elsewhere.
/// positions : array_like of shape (N,), optional
///     Where the joints are now; needed with ``ends``.
/// ends : array_like of shape (N, 2), optional
///     Between which positions each joint may be.
/// seconds : float
///     A joint comes no closer to its end than it would in so many seconds.
///
/// Returns
/// -------
/// velocities : numpy.ndarray of shape (N,)
///     One a joint.
/// factor : float
///     By how much the command was slowed: 1 where nothing was in the way, 0 where the arm stands still.
///
/// Raises
/// ------
/// ShapeMismatch, NotFinite, QuestError
///     For arrays of other shapes, numbers that are not finite, a damping or time that is no positive number.
///
/// Notes
/// -----
/// Nakamura and Hanafusa, *Inverse kinematic solutions with singularity robustness for robot manipulator control*, 1986.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from quest_pose.servo import joint_velocities
/// >>> velocities, factor = joint_velocities([0.2, 0, 0], [0, 0, 0], np.eye(6), max_speeds=np.full(6, 0.1), damping=1e-9)
/// >>> velocities.round(6), round(factor, 6)
/// (array([0.1, 0. , 0. , 0. , 0. , 0. ]), 0.5)
#[pyfunction]
#[pyo3(signature = (linear, angular, jacobian, /, *, max_speeds, damping=0.05, positions=None, ends=None, seconds=0.5))]
#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
pub(crate) fn joint_velocities<'py>(
    py: Python<'py>,
    linear: &Bound<'py, PyAny>,
    angular: &Bound<'py, PyAny>,
    jacobian: &Bound<'py, PyAny>,
    max_speeds: &Bound<'py, PyAny>,
    damping: f64,
    positions: Option<&Bound<'py, PyAny>>,
    ends: Option<&Bound<'py, PyAny>>,
    seconds: f64,
) -> PyResult<(Bound<'py, PyArray1<f64>>, f64)> {
    let twist = Twist { linear: vector3("linear", linear)?, angular: vector3("angular", angular)? };
    let columns = py.import("numpy")?.call_method1("transpose", (jacobian,))?;
    let jacobian: Vec<[f64; 6]> = arrays::rows("the transpose of jacobian", &columns)?;
    let joints = jacobian.len();
    all_finite("jacobian", jacobian.as_flattened())?;
    let speeds = one_a_joint("max_speeds", max_speeds, joints)?;
    let positions = joint_positions(positions, ends, joints)?;
    let limits =
        JointLimits { speeds: &speeds, positions: &positions, seconds: positive("seconds", seconds)? };
    let mut velocities = vec![0.0; joints];
    let damping = not_negative("damping", damping)?;
    let factor = servo::joint_velocities(&twist, &jacobian, damping, &limits, &mut velocities);
    Ok((velocities.to_pyarray(py), factor))
}

fn all_finite(name: &str, numbers: &[f64]) -> PyResult<()> {
    match numbers.iter().find(|x| !x.is_finite()) {
        Some(x) => Err(NotFinite::new_err(format!("{name} has the number {x}, expected finite ones"))),
        None => Ok(()),
    }
}

fn one_a_joint(name: &str, given: &Bound<'_, PyAny>, joints: usize) -> PyResult<Vec<f64>> {
    let numbers = arrays::vector(name, given)?;
    if numbers.len() != joints {
        let found = numbers.len();
        return Err(ShapeMismatch::new_err(format!(
            "{name} has {found} numbers, expected {joints} as the Jacobian has columns"
        )));
    }
    // Speeds and ends may be infinite: no limit.
    match numbers.iter().find(|x| x.is_nan()) {
        Some(_) => Err(NotFinite::new_err(format!("{name} has NaN, expected numbers"))),
        None => Ok(numbers),
    }
}

fn vector3(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vector3<f64>> {
    let numbers = arrays::vector(name, given)?;
    all_finite(name, &numbers)?;
    let [x, y, z] = numbers[..] else {
        let found = numbers.len();
        return Err(ShapeMismatch::new_err(format!("{name} has {found} numbers, expected three")));
    };
    Ok(Vector3::new(x, y, z))
}

/// Where the joints are and may be; empty where nothing is said.
fn joint_positions(
    positions: Option<&Bound<'_, PyAny>>,
    ends: Option<&Bound<'_, PyAny>>,
    joints: usize,
) -> PyResult<Vec<JointPosition>> {
    let (positions, ends) = match (positions, ends) {
        (None, None) => return Ok(Vec::new()),
        (Some(positions), Some(ends)) => (positions, ends),
        _ => {
            return Err(ShapeMismatch::new_err(
                "one of positions and ends is given without the other, expected both or none",
            ));
        }
    };
    let positions = one_a_joint("positions", positions, joints)?;
    let ends: Vec<[f64; 2]> = arrays::rows("ends", ends)?;
    if ends.len() != joints {
        let found = ends.len();
        return Err(ShapeMismatch::new_err(format!("ends has {found} rows, expected {joints}")));
    }
    if ends.as_flattened().iter().any(|x| x.is_nan()) {
        return Err(NotFinite::new_err("ends has NaN, expected numbers"));
    }
    Ok(positions
        .into_iter()
        .zip(ends)
        .map(|(now, [least, most])| JointPosition { now, least, most })
        .collect())
}
