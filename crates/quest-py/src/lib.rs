//! The extension module `quest_pose._core`: checks shapes, converts, releases the interpreter's lock, calls the
//! core and maps its errors.

mod arrays;
mod batch_result;
mod camera;
mod candidate;
mod choose;
mod colmap;
mod coordinates;
mod errors;
mod estimate;
mod estimate_batch;
mod estimate_result;
mod foreign_camera;
mod html;
mod options;
mod paper;
mod polynomials;
mod pose;
mod servo;
mod solve;
mod solve_batch;
mod supervisor;
mod third_view;

use pyo3::pymodule;

/// What `quest_pose` re-exports.
#[pymodule]
mod _core {
    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::batch_result::{_estimate_batch, EstimateBatch};
    #[pymodule_export]
    use crate::camera::Camera;
    #[pymodule_export]
    use crate::candidate::{_candidate, Candidate};
    #[pymodule_export]
    use crate::choose::_choose;
    #[pymodule_export]
    use crate::colmap::{_colmap_export, _colmap_read_pairs, _colmap_verify, _colmap_write};
    #[pymodule_export]
    use crate::errors::{
        BadCamera, DegenerateInput, NoAnswer, NoPose, NotFinite, QuestError, ShapeMismatch, TooFewMatches,
    };
    #[pymodule_export]
    use crate::estimate::estimate;
    #[pymodule_export]
    use crate::estimate_batch::estimate_batch;
    #[pymodule_export]
    use crate::estimate_result::{_estimate, _runner_up, Estimate, RunnerUp};
    #[pymodule_export]
    use crate::paper::{
        _columns, _parallax, _rotation_metric, _scene, _translation_and_depths, _translation_metric,
    };
    #[pymodule_export]
    use crate::polynomials::_solve_polynomials;
    #[pymodule_export]
    use crate::pose::RelativePose;
    #[pymodule_export]
    use crate::servo::{_command, CameraServo, Command, Controller, RobotServo, joint_velocities};
    #[pymodule_export]
    use crate::solve::{_solvers, constraint_matrix, solve};
    #[pymodule_export]
    use crate::solve_batch::_solve_batch;
    #[pymodule_export]
    use crate::third_view::_third_view;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        // Loads what arrays are made with. The first call would load it otherwise, and a signal in the middle of that is a panic.
        let _ = numpy::PyArray1::<f64>::zeros(module.py(), 0, false);
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
