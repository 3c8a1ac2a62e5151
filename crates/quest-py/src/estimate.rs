//! `estimate`: one pose from matches with outliers.

use std::str::FromStr;

use nalgebra::{UnitQuaternion, Vector3};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use quest_core::robust::{self, KnownDirection, Priors};
use quest_core::{InputError, RelativePose};

use crate::errors::{self, NoAnswer, QuestError, ShapeMismatch};
use crate::estimate_result::Estimate;
use crate::solve::Views;
use crate::supervisor::Supervisor;
use crate::{arrays, options};

/// One pose from matches with outliers.
///
/// Parameters
/// ----------
/// x1, x2 : array_like of shape (N, 2) or (N, 3)
///     The same N points in view 1 and in view 2: pixels where cameras are given, otherwise points on the plane
///     z = 1 of each camera. Three numbers a row are bearings of any length, and take no camera.
/// camera1, camera2 : Camera or array_like of shape (3, 3), optional
///     The cameras, or their matrices K. ``camera2`` is ``camera1`` where absent.
/// scores : array_like of shape (N,), optional
///     One a match, higher is better: the best matches are tried first.
/// initial_pose : (array_like of shape (3, 3), array_like of shape (3,)), optional
///     A rotation and a translation to begin with.
/// known_direction : (array_like of shape (3,), array_like of shape (3,), float), optional
///     A direction in space in the frame of camera 1 and in that of camera 2, such as gravity or (twice the same) the
///     axis of the rotation, and how far a pose may turn one from the other, in radians from 0 to π. Neither the answer nor the
///     second pose turns it further.
/// invalid : {"outlier", "pair", "raise"}
///     What a match without a bearing is: a NaN, or a pixel for which a camera has no viewing ray. An outlier, which the
///     result counts; or no match of a pair that has a pose (``NoAnswer``); or the error that it is for ``solve``.
/// threshold, confidence, max_iterations, seed, ... : optional
///     How the search is made: the keywords of ``EstimateOptions``, which names them all with their defaults. The threshold is the
///     one to think of: two to three standard deviations of the points' noise, in pixels, 1 by default. Without cameras it is in
///     units of the plane z = 1, in radians for bearings, and must be given.
///
/// Returns
/// -------
/// Estimate
///
/// Raises
/// ------
/// NoPose
///     Where the best pose agrees with no more matches than chance explains. With fewer than ten matches, of which
///     that cannot be said, the best pose is returned where five agree with it, with its runner-up. Also where no pose turns the
///     known direction as told.
/// TooFewMatches
///     For fewer than five matches, or than the solver takes.
/// ShapeMismatch, DegenerateInput, BadCamera
///     As ``solve``.
/// NoAnswer
///     The base of the errors that mean that these matches have no pose; itself for ``invalid="pair"``.
/// NotFinite
///     For a NaN with ``invalid="raise"``, and for masked values.
/// QuestError
///     The base of these, itself for an option of an impossible value.
/// TypeError
///     For an option of another type, and for a keyword that is none.
///
/// Notes
/// -----
/// The lock of the interpreter is released while the search runs; Ctrl-C ends it.
#[pyfunction]
#[pyo3(signature = (
    x1, x2, camera1=None, camera2=None, *, scores=None, initial_pose=None, known_direction=None, invalid="outlier", **options
))]
#[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
#[expect(clippy::needless_pass_by_value, reason = "pyo3 hands tuples over")]
pub(crate) fn estimate(
    py: Python<'_>,
    x1: &Bound<'_, PyAny>,
    x2: &Bound<'_, PyAny>,
    camera1: Option<&Bound<'_, PyAny>>,
    camera2: Option<&Bound<'_, PyAny>>,
    scores: Option<&Bound<'_, PyAny>>,
    initial_pose: Option<(Bound<'_, PyAny>, Bound<'_, PyAny>)>,
    known_direction: Option<Direction<'_>>,
    invalid: &str,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<Py<Estimate>> {
    let invalid: Invalid = invalid.parse()?;
    let views = Views::new(x1, x2, camera1, camera2)?;
    views.refuse_other_units()?;
    let scores = scores.map(|scores| arrays::vector("scores", scores)).transpose()?;
    let pose = initial_pose.as_ref().map(|given| pose("initial_pose", given)).transpose()?;
    let direction = known_direction.as_ref().map(direction).transpose()?;
    let options = options::options("estimate", options, &[], views.cameras().is_some())?;
    let options = match views.cameras() {
        Some([camera1, camera2]) => options.with_cameras(camera1, camera2),
        None => options,
    };
    let supervisor = Supervisor::new(None, 1);
    let found = py.detach(|| {
        let usable = views.usable().map_err(|error| errors::input(&error))?;
        if let Some(error) = usable.error().filter(|_| invalid != Invalid::Outlier) {
            return Err(invalid.error(&error));
        }
        if let Some(scores) = scores.as_ref().filter(|scores| scores.len() != usable.given()) {
            let (found, expected) = (scores.len(), usable.given());
            return Err(ShapeMismatch::new_err(format!(
                "scores has {found} numbers, expected {expected}, one a match"
            )));
        }
        let scores = scores.as_ref().map(|scores| usable.keep(scores));
        let priors = Priors { scores: scores.as_deref(), pose, direction };
        let search = || robust::estimate_until(&usable.matches, &options, &priors, &|| supervisor.poll());
        let found = supervisor.run_here(search)?;
        let found = found.map_err(|error| errors::estimate_of_usable(&error, &usable))?;
        Ok(Estimate::of_usable(&found, &usable))
    })?;
    found.into_python(py)
}

/// What a match without a bearing is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Invalid {
    /// An outlier.
    Outlier,
    /// A reason for its pair to have no pose.
    Pair,
    /// An error.
    Raise,
}

impl FromStr for Invalid {
    type Err = PyErr;

    fn from_str(name: &str) -> PyResult<Self> {
        match name {
            "outlier" => Ok(Self::Outlier),
            "pair" => Ok(Self::Pair),
            "raise" => Ok(Self::Raise),
            _ => Err(QuestError::new_err(format!(
                "invalid is {name:?}, expected \"outlier\", \"pair\" or \"raise\""
            ))),
        }
    }
}

impl Invalid {
    /// The exception that an invalid match of a single pair is.
    fn error(self, error: &InputError) -> PyErr {
        match self {
            Self::Pair => NoAnswer::new_err(error.to_string()),
            _ => errors::input(error),
        }
    }
}

/// A rotation matrix and a translation of the argument `name`.
pub(crate) fn pose(name: &str, (r, t): &(Bound<'_, PyAny>, Bound<'_, PyAny>)) -> PyResult<RelativePose> {
    let t = vector3(&format!("{name}[1]"), t)?;
    Ok(RelativePose::new(rotation(&format!("{name}[0]"), r)?, t))
}

/// The rotation of the matrix `name`.
pub(crate) fn rotation(name: &str, r: &Bound<'_, PyAny>) -> PyResult<UnitQuaternion<f64>> {
    let rows = arrays::matrix3(name, r, "a rotation matrix of shape (3, 3)")?;
    // nalgebra keeps columns, NumPy rows.
    let matrix = nalgebra::Matrix3::from(rows).transpose();
    let is_rotation = (matrix * matrix.transpose() - nalgebra::Matrix3::identity()).norm() < 1e-6
        && matrix.determinant() > 0.0;
    if !is_rotation {
        return Err(QuestError::new_err(format!(
            "{name} is not a rotation matrix, expected R with R Rᵀ = I and det R = 1"
        )));
    }
    Ok(UnitQuaternion::from_rotation_matrix(&nalgebra::Rotation3::from_matrix_unchecked(matrix)))
}

/// The direction in the frames of both cameras, and the tolerance.
pub(crate) type Direction<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>, f64);

pub(crate) fn direction((first, second, tolerance): &Direction<'_>) -> PyResult<KnownDirection> {
    Ok(KnownDirection {
        in_view1: vector3("known_direction[0]", first)?,
        in_view2: vector3("known_direction[1]", second)?,
        tolerance: *tolerance,
    })
}

/// Three finite numbers of the argument `name`.
pub(crate) fn vector3(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vector3<f64>> {
    let numbers: [f64; 3] = arrays::vector(name, given)?.try_into().map_err(|v: Vec<f64>| {
        ShapeMismatch::new_err(format!("{name} has the shape ({},), expected (3,)", v.len()))
    })?;
    Ok(numbers.into())
}
