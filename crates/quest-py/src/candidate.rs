//! `Candidate`: one pose that may be the true one.

use numpy::{PyArray1, ToPyArray};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use quest_core::Correspondence;
use quest_core::feasibility::Feasibility;

use crate::pose::{Pose, PoseState, RelativePose, with_base};

/// A pose that may be the true one, as ``solve`` returns it: ``X2 = R @ X1 + t``.
///
/// ``t`` and the depths share one scale: the mean absolute depth over both views is 1.
#[pyclass(frozen, eq, extends = RelativePose, module = "quest_pose")]
#[derive(Debug, PartialEq)]
pub(crate) struct Candidate {
    /// str : Where it comes from.
    ///
    /// ``"exact"`` is a real solution of the constraints, ``"from_complex"`` the real part of a complex one,
    /// ``"rotation_only"`` the rotation that best aligns the bearings, ``"planar"`` a motion of the plane that
    /// best explains the matches.
    #[pyo3(get)]
    kind: String,
    pose: Pose,
    depths1: Vec<f64>,
    depths2: Vec<f64>,
    /// float : How far the matches are from satisfying the epipolar constraint, in radians.
    ///
    /// The root mean square over the matches of the angle by which the bearings would have to turn.
    #[pyo3(get)]
    residual: f64,
    /// int : How many of the matches have positive depth in both views.
    #[pyo3(get)]
    in_front: usize,
    /// bool : Whether the candidate passes the test of feasibility of ``solve``: by default, whether every match
    /// lies in front of both cameras.
    #[pyo3(get)]
    feasible: bool,
}

impl Candidate {
    /// A candidate of the core for these matches.
    pub(crate) fn new(
        candidate: &quest_core::Candidate,
        matches: &[Correspondence],
        feasibility: Feasibility,
    ) -> Self {
        let feasible = feasibility.accepts(candidate, matches);
        let quest_core::Candidate { kind, pose, residual, in_front } = *candidate;
        let (depths1, depths2) = matches.iter().map(|m| depths(&pose, m)).unzip();
        Self {
            kind: kind.name().to_owned(),
            pose: Pose::new(&pose),
            depths1,
            depths2,
            residual,
            in_front,
            feasible,
        }
    }

    pub(crate) fn into_python(self, py: Python<'_>) -> PyResult<Py<Self>> {
        with_base(py, self.pose, self)
    }
}

/// The depths of a match, infinite where undetermined: NaN would make two equal candidates differ.
fn depths(pose: &quest_core::RelativePose, m: &Correspondence) -> (f64, f64) {
    let finite = |z: f64| if z.is_finite() { z } else { f64::INFINITY };
    pose.depths(m).map_or((f64::INFINITY, f64::INFINITY), |(z1, z2)| (finite(z1), finite(z2)))
}

type State = (String, PoseState, Vec<f64>, Vec<f64>, f64, usize, bool);

/// The candidate that ``Candidate.__reduce__`` took apart.
#[pyfunction]
pub(crate) fn _candidate(py: Python<'_>, state: State) -> PyResult<Py<Candidate>> {
    let (kind, pose, depths1, depths2, residual, in_front, feasible) = state;
    let pose = Pose::from_state(pose);
    Candidate { kind, pose, depths1, depths2, residual, in_front, feasible }.into_python(py)
}

#[pymethods]
impl Candidate {
    /// numpy.ndarray of shape (N,) : The depth of each match in view 1, in the unit of ``t``.
    ///
    /// A depth multiplies the point as it was given: it is a z coordinate for normalised points and for pixels of
    /// perspective cameras, a distance for unit bearings and for pixels of fisheye cameras. It is ``numpy.inf``
    /// where none is determined: where the two rays are parallel, or ``t`` is zero. It is never NaN.
    #[getter]
    fn depths1<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.depths1.to_pyarray(py)
    }

    /// numpy.ndarray of shape (N,) : The depth of each match in view 2; see ``depths1``.
    #[getter]
    fn depths2<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.depths2.to_pyarray(py)
    }

    /// The candidate as plain numbers and lists, ready for ``json.dumps``.
    ///
    /// Returns
    /// -------
    /// dict
    ///     ``kind``, ``q_21`` (w, x, y, z), ``R_21``, ``t_21``, ``depths1``, ``depths2``, ``residual``,
    ///     ``in_front`` and ``feasible``, as the command line writes them. An undetermined depth is None.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let finite =
            |depths: &[f64]| -> Vec<_> { depths.iter().map(|&d| d.is_finite().then_some(d)).collect() };
        let dict = PyDict::new(py);
        dict.set_item("kind", &self.kind)?;
        self.pose.write_to(&dict)?;
        dict.set_item("depths1", finite(&self.depths1))?;
        dict.set_item("depths2", finite(&self.depths2))?;
        dict.set_item("residual", self.residual)?;
        dict.set_item("in_front", self.in_front)?;
        dict.set_item("feasible", self.feasible)?;
        Ok(dict)
    }

    fn __repr__(&self) -> String {
        let Self { kind, pose, residual, in_front, depths1, .. } = self;
        let (pose, of) = (pose.text(), depths1.len());
        format!("<Candidate {kind}: {pose}, residual={residual:.1e}, in_front={in_front} of {of}>")
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (State,))> {
        let Self { kind, pose, depths1, depths2, residual, in_front, feasible } = self;
        let depths = (depths1.clone(), depths2.clone());
        let state = (kind.clone(), pose.state(), depths.0, depths.1, *residual, *in_front, *feasible);
        Ok((py.import("quest_pose._core")?.getattr("_candidate")?, (state,)))
    }
}
