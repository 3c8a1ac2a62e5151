//! `RelativePose`: what every result that is a pose has.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion};
use numpy::{PyArray1, PyArray2, ToPyArray};
use pyo3::PyClass;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use quest_core::RelativePose as CorePose;

use crate::errors::BadCamera;
use crate::{arrays, camera};

/// A pose as `__reduce__` takes it apart: the quaternion, scalar first, and the translation.
pub(crate) type PoseState = ([f64; 4], [f64; 3]);

/// A pose whose quaternion has the sign that is shown, so that a pickled copy is equal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pose(CorePose);

impl Pose {
    pub(crate) fn new(pose: &CorePose) -> Self {
        Self::from_state((pose.wxyz(), pose.t_21.into()))
    }

    pub(crate) fn from_state(([w, i, j, k], t): PoseState) -> Self {
        Self(CorePose::new(UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k)), t.into()))
    }

    pub(crate) fn state(&self) -> PoseState {
        (self.wxyz(), self.0.t_21.into())
    }

    pub(crate) fn relative(&self) -> &CorePose {
        &self.0
    }

    pub(crate) fn wxyz(&self) -> [f64; 4] {
        self.0.wxyz()
    }

    pub(crate) fn parallax(&self) -> f64 {
        self.0.t_21.norm()
    }

    /// `[t]× R` with `|t| = 1`, zero without a translation.
    fn unit_essential(&self) -> Matrix3<f64> {
        let CorePose { q_21, t_21 } = self.0;
        CorePose::new(q_21, t_21.try_normalize(0.0).unwrap_or_default()).essential()
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

/// The rows of a matrix.
fn rows(m: &Matrix3<f64>) -> Vec<[f64; 3]> {
    // nalgebra keeps columns, NumPy rows.
    let rows: [[f64; 3]; 3] = m.transpose().into();
    rows.map(|row| row.map(|x| x + 0.0)).to_vec()
}

/// A pose: ``X2 = R @ X1 + t``. The base of ``Candidate``, ``Estimate`` and ``RunnerUp``.
///
/// ``X1`` and ``X2`` are the coordinates of a point in the frames of camera 1 and camera 2: x to the right, y down, z forward. The
/// mean absolute depth over both views is 1, so that the length of ``t`` is the parallax. A pose never changes: its arrays are
/// fresh copies at each access.
#[pyclass(frozen, subclass, module = "quest_pose")]
#[derive(Clone, Copy, Debug)]
pub(crate) struct RelativePose(Pose);

/// A result whose base is its pose, as Python has it.
pub(crate) fn with_base<T>(py: Python<'_>, pose: Pose, value: T) -> PyResult<Py<T>>
where
    T: PyClass<BaseType = RelativePose>,
{
    Py::new(py, PyClassInitializer::from(RelativePose(pose)).add_subclass(value))
}

#[pymethods]
impl RelativePose {
    /// numpy.ndarray of shape (3, 3) : The rotation from the frame of camera 1 to that of camera 2.
    #[getter]
    #[pyo3(name = "R")]
    fn r<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        arrays::to_numpy(py, self.0.rows().to_vec())
    }

    /// numpy.ndarray of shape (3,) : The origin of camera 1 in the frame of camera 2; its length is the parallax.
    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.0.relative().t_21.as_slice().to_pyarray(py)
    }

    /// numpy.ndarray of shape (4,) : The rotation as a unit quaternion, scalar first and not negative.
    #[getter]
    fn quat_wxyz<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.0.wxyz().to_pyarray(py)
    }

    /// numpy.ndarray of shape (4,) : The same quaternion scalar last, as SciPy and ROS have it.
    #[getter]
    fn quat_xyzw<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let [w, x, y, z] = self.0.wxyz();
        [x, y, z, w].to_pyarray(py)
    }

    /// float : The length of ``t``.
    #[getter]
    fn parallax(&self) -> f64 {
        self.0.parallax()
    }

    /// numpy.ndarray of shape (3, 3) : The essential matrix ``[t]x R`` with ``|t| = 1``, zero where ``t`` is: ``x2 @ E @ x1 = 0`` of rays.
    #[getter]
    #[pyo3(name = "E")]
    fn essential<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        arrays::to_numpy(py, rows(&self.0.unit_essential()))
    }

    /// The pose as a matrix: ``X2 = T @ X1`` of homogeneous points.
    ///
    /// Returns
    /// -------
    /// numpy.ndarray of shape (4, 4)
    fn matrix<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let (r, t) = (self.0.rows(), self.0.relative().t_21);
        let mut all: Vec<[f64; 4]> = (0..3).map(|k| [r[k][0], r[k][1], r[k][2], t[k]]).collect();
        all.push([0.0, 0.0, 0.0, 1.0]);
        arrays::to_numpy(py, all)
    }

    /// The fundamental matrix: ``u2 @ F @ u1 = 0`` of homogeneous pixels without distortion.
    ///
    /// Parameters
    /// ----------
    /// camera1, camera2 : Camera or what may stand for one
    ///     The cameras of the two views. ``camera2`` is ``camera1`` where absent.
    ///
    /// Returns
    /// -------
    /// numpy.ndarray of shape (3, 3)
    ///     With the Frobenius norm 1; zero where ``t`` is.
    ///
    /// Raises
    /// ------
    /// BadCamera
    ///     For a fisheye camera, whose pixels no matrix describes.
    #[pyo3(signature = (camera1, camera2=None))]
    fn fundamental<'py>(
        &self,
        py: Python<'py>,
        camera1: &Bound<'py, PyAny>,
        camera2: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let first = camera::from_argument("camera1", camera1)?;
        let second = camera2.map_or(Ok(first), |c| camera::from_argument("camera2", c))?;
        let inverse = |name: &str, camera: &quest_core::Camera| {
            let ((fx, fy), (cx, cy)) = (camera.focal_lengths(), camera.principal_point());
            if camera.model().is_fisheye() {
                return Err(BadCamera::new_err(format!(
                    "{name} is a fisheye camera, expected one whose pixels a matrix K describes"
                )));
            }
            Ok(Matrix3::new(1.0 / fx, 0.0, -cx / fx, 0.0, 1.0 / fy, -cy / fy, 0.0, 0.0, 1.0))
        };
        let (k1, k2) = (inverse("camera1", &first)?, inverse("camera2", &second)?);
        let f = k2.transpose() * self.0.unit_essential() * k1;
        Ok(arrays::to_numpy(py, rows(&f.try_normalize(0.0).unwrap_or_default())))
    }
}
