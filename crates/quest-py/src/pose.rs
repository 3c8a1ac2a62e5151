//! What every result that is a pose has: the rotation, the translation, the quaternion in both orders.

use nalgebra::{Quaternion, UnitQuaternion};
use numpy::{PyArray1, PyArray2, ToPyArray};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use quest_core::RelativePose;

use crate::arrays;

/// A pose as `__reduce__` takes it apart: the quaternion, scalar first, and the translation.
pub(crate) type PoseState = ([f64; 4], [f64; 3]);

/// A pose whose quaternion has the sign that is shown, so that a pickled copy is equal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pose(RelativePose);

impl Pose {
    pub(crate) fn new(pose: &RelativePose) -> Self {
        Self::from_state((pose.wxyz(), pose.t_21.into()))
    }

    pub(crate) fn from_state(([w, i, j, k], t): PoseState) -> Self {
        Self(RelativePose::new(UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k)), t.into()))
    }

    pub(crate) fn state(&self) -> PoseState {
        (self.wxyz(), self.0.t_21.into())
    }

    pub(crate) fn relative(&self) -> &RelativePose {
        &self.0
    }

    pub(crate) fn wxyz(&self) -> [f64; 4] {
        self.0.wxyz()
    }

    pub(crate) fn parallax(&self) -> f64 {
        self.0.t_21.norm()
    }

    pub(crate) fn r<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        arrays::to_numpy(py, self.rows().to_vec())
    }

    pub(crate) fn t<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.0.t_21.as_slice().to_pyarray(py)
    }

    pub(crate) fn quat_wxyz<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.wxyz().to_pyarray(py)
    }

    pub(crate) fn quat_xyzw<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let [w, x, y, z] = self.wxyz();
        [x, y, z, w].to_pyarray(py)
    }

    /// The keys of the command line's JSON.
    pub(crate) fn write_to(&self, dict: &Bound<'_, PyDict>) -> PyResult<()> {
        dict.set_item("q_21", self.wxyz().to_vec())?;
        dict.set_item("R_21", self.rows().map(Vec::from).to_vec())?;
        dict.set_item("t_21", self.0.t_21.as_slice())
    }

    /// The beginning of a `repr`.
    pub(crate) fn text(&self) -> String {
        format!("quat_wxyz={:.6?}, t={:.6?}", self.wxyz(), self.0.t_21.as_slice())
    }

    pub(crate) fn rows(&self) -> [[f64; 3]; 3] {
        // nalgebra keeps columns, NumPy rows.
        self.0.r_21().transpose().into()
    }
}
