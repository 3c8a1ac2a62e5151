//! The errors Python sees: one class a cause, all of them a `ValueError`.

use pyo3::create_exception;
use pyo3::exceptions::{PyMemoryError, PyValueError};
use pyo3::prelude::*;
use quest_core::correspondence::Usable;
use quest_core::robust::EstimateError;
use quest_core::{CameraError, Degeneracy, InputError, MatchError};

create_exception!(
    quest_pose,
    QuestError,
    PyValueError,
    "Why no answer can be given. The base of the other errors."
);
create_exception!(
    quest_pose,
    NoAnswer,
    QuestError,
    "The matches have no answer: the base of NoPose, TooFewMatches and DegenerateInput."
);
create_exception!(quest_pose, TooFewMatches, NoAnswer, "There are fewer matches than the solver needs.");
create_exception!(quest_pose, NotFinite, QuestError, "A number is NaN or infinite.");
create_exception!(
    quest_pose,
    ShapeMismatch,
    QuestError,
    "An array does not have the shape that is expected."
);
create_exception!(
    quest_pose,
    DegenerateInput,
    NoAnswer,
    "The points determine no pose, or have no direction."
);
create_exception!(
    quest_pose,
    NoPose,
    NoAnswer,
    "No pose agrees with more of the matches than chance explains."
);
create_exception!(
    quest_pose,
    BadCamera,
    QuestError,
    "A camera is impossible, or has no viewing ray for a pixel."
);

/// The exception for a set of matches that the core refuses.
pub(crate) fn input(error: &InputError) -> PyErr {
    of_input(error, error.to_string())
}

/// The exception for a set of matches that the core refuses, one of many sets.
pub(crate) fn sample(index: usize, error: &InputError) -> PyErr {
    of_input(error, format!("sample {index}, {error}"))
}

fn of_input(error: &InputError, message: String) -> PyErr {
    match error {
        InputError::Match { source, .. } => match source {
            MatchError::NotFinite { .. } => NotFinite::new_err(message),
            MatchError::TooFar { .. } | MatchError::NoDirection { .. } => DegenerateInput::new_err(message),
            MatchError::Camera { source, .. } => of_camera(source, message),
            _ => QuestError::new_err(message),
        },
        InputError::LengthMismatch { .. } => ShapeMismatch::new_err(message),
        InputError::TooFewMatches { .. } => TooFewMatches::new_err(message),
        InputError::Degenerate { .. } => DegenerateInput::new_err(message),
        InputError::TooManyMatches { .. } => PyMemoryError::new_err(message),
        _ => QuestError::new_err(message),
    }
}

/// The exception for an estimate that failed.
pub(crate) fn estimate(error: &EstimateError) -> PyErr {
    match error {
        EstimateError::Input(error) => input(error),
        EstimateError::NoPose { .. } | EstimateError::Direction { .. } => NoPose::new_err(error.to_string()),
        _ => QuestError::new_err(error.to_string()),
    }
}

/// The exception for an estimate of the usable ones of the matches.
pub(crate) fn estimate_of_usable(error: &EstimateError, usable: &Usable) -> PyErr {
    match error {
        EstimateError::Input(InputError::TooFewMatches { .. }) => {
            TooFewMatches::new_err(reason(error, usable))
        }
        _ => estimate(error),
    }
}

/// Why there is no estimate: where there are too few matches, also what is wrong with the others.
pub(crate) fn reason(error: &EstimateError, usable: &Usable) -> String {
    match (error, usable.error()) {
        (EstimateError::Input(InputError::TooFewMatches { .. }), Some(first)) => {
            format!("{error}; {} more have no bearing, the first of them: {first}", usable.invalid.len())
        }
        _ => error.to_string(),
    }
}

/// The exception for a camera that the core refuses, called `name` by the caller.
pub(crate) fn camera(name: &str, error: &CameraError) -> PyErr {
    of_camera(error, format!("{name}: {error}"))
}

fn of_camera(error: &CameraError, message: String) -> PyErr {
    match error {
        CameraError::NotFinite { .. } => NotFinite::new_err(message),
        _ => BadCamera::new_err(message),
    }
}

/// The exception where a degeneracy left no candidate.
pub(crate) fn degenerate(degeneracy: Degeneracy) -> PyErr {
    DegenerateInput::new_err(format!("the matches do not determine a pose: {degeneracy}"))
}
