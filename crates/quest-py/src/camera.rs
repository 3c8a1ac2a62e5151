//! `Camera`, and what else may stand where a camera is expected.

use nalgebra::Matrix3;
use numpy::PyArray2;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use quest_core::CameraError;

use crate::arrays;
use crate::errors::{self, BadCamera};

/// A calibrated camera, with COLMAP's models and parameters.
///
/// Parameters
/// ----------
/// model : str
///     ``"SIMPLE_PINHOLE"`` (f, cx, cy), ``"PINHOLE"`` (fx, fy, cx, cy), ``"SIMPLE_RADIAL"`` (f, cx, cy, k),
///     ``"RADIAL"`` (f, cx, cy, k1, k2), ``"OPENCV"`` (fx, fy, cx, cy, k1, k2, p1, p2), ``"OPENCV_FISHEYE"``
///     (fx, fy, cx, cy, k1, k2, k3, k4), ``"FULL_OPENCV"`` (fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6),
///     ``"SIMPLE_RADIAL_FISHEYE"`` (f, cx, cy, k) or ``"RADIAL_FISHEYE"`` (f, cx, cy, k1, k2).
/// params : array_like of shape (P,)
///     The model's parameters in that order: focal lengths and principal point in pixels, then the distortion.
/// width, height : int, optional
///     The size of the image in pixels. Poses do not depend on it.
///
/// Raises
/// ------
/// BadCamera
///     For an unknown model, a wrong number of parameters, or impossible ones.
#[pyclass(frozen, eq, module = "quest_pose")]
#[derive(Debug, PartialEq)]
pub(crate) struct Camera(quest_core::Camera);

/// The camera of the argument `name`: a `Camera`, or a 3 x 3 matrix K.
pub(crate) fn from_argument(name: &str, given: &Bound<'_, PyAny>) -> PyResult<quest_core::Camera> {
    match given.cast::<Camera>() {
        Ok(camera) => Ok(camera.get().0),
        Err(_) => from_k(name, given),
    }
}

fn from_k(name: &str, k: &Bound<'_, PyAny>) -> PyResult<quest_core::Camera> {
    let rows = arrays::matrix3(name, k)?;
    // nalgebra keeps columns, NumPy rows.
    let k = Matrix3::from(rows).transpose();
    quest_core::Camera::from_k(&k).map_err(|error| errors::camera(name, &error))
}

/// Each of `items` through `one`, with the index of the first that is refused.
fn each<T, U>(name: &str, items: &[T], one: impl Fn(&T) -> Result<U, CameraError>) -> PyResult<Vec<U>> {
    let indexed = items.iter().enumerate();
    indexed.map(|(i, item)| one(item).map_err(|e| errors::camera(&format!("{name} {i}"), &e))).collect()
}

/// Model and parameters.
type Args<'a> = (&'static str, &'a [f64]);

#[pymethods]
impl Camera {
    #[new]
    #[pyo3(signature = (model, params, *, width=None, height=None))]
    fn new(
        model: &str,
        params: &Bound<'_, PyAny>,
        width: Option<u32>,
        height: Option<u32>,
    ) -> PyResult<Self> {
        let bad = |error| errors::camera("camera", &error);
        let params = arrays::vector("params", params)?;
        let camera = quest_core::Camera::new(model.parse().map_err(bad)?, &params).map_err(bad)?;
        match (width, height) {
            (Some(width), Some(height)) => camera.with_size(width, height).map(Self).map_err(bad),
            (None, None) => Ok(Self(camera)),
            _ => Err(BadCamera::new_err("one of width and height is given, expected both or none")),
        }
    }

    /// The pinhole camera with the matrix K.
    ///
    /// Parameters
    /// ----------
    /// k : array_like of shape (3, 3)
    ///     ``[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]`` in pixels.
    ///
    /// Returns
    /// -------
    /// Camera
    ///     With the model ``"PINHOLE"`` and without a size.
    ///
    /// Raises
    /// ------
    /// ShapeMismatch, BadCamera
    ///     For an array of another shape, and for an impossible matrix.
    #[staticmethod]
    #[pyo3(name = "from_k", signature = (k, /))]
    fn py_from_k(k: &Bound<'_, PyAny>) -> PyResult<Self> {
        from_k("k", k).map(Self)
    }

    /// str : COLMAP's name of the model.
    #[getter]
    fn model(&self) -> &'static str {
        self.0.model().name()
    }

    /// tuple of float : The parameters in COLMAP's order, as given.
    #[getter]
    fn params<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, self.0.params())
    }

    /// int or None : The width of the image in pixels.
    #[getter]
    fn width(&self) -> Option<u32> {
        self.0.size().map(|(width, _)| width)
    }

    /// int or None : The height of the image in pixels.
    #[getter]
    fn height(&self) -> Option<u32> {
        self.0.size().map(|(_, height)| height)
    }

    /// The viewing rays of pixels.
    ///
    /// Parameters
    /// ----------
    /// pixels : array_like of shape (N, 2)
    ///     Pixels (u, v).
    ///
    /// Returns
    /// -------
    /// numpy.ndarray of shape (N, 3)
    ///     The rays in the frame of the camera: points on the plane z = 1, or unit vectors for fisheye models.
    ///
    /// Raises
    /// ------
    /// ShapeMismatch, NotFinite, BadCamera
    ///     For an array of another shape, for NaN and infinity, and for a pixel without a viewing ray.
    #[pyo3(signature = (pixels, /))]
    fn bearing<'py>(
        &self,
        py: Python<'py>,
        pixels: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let pixels = arrays::rows("pixels", pixels)?;
        let rays = py.detach(|| each("pixel", &pixels, |&u| self.0.bearing(u).map(Into::into)))?;
        Ok(arrays::to_numpy::<3>(py, rays))
    }

    /// The pixels of points.
    ///
    /// Parameters
    /// ----------
    /// points : array_like of shape (N, 3)
    ///     Points in the frame of the camera, in any unit of length.
    ///
    /// Returns
    /// -------
    /// numpy.ndarray of shape (N, 2)
    ///     Pixels (u, v), which may lie outside of the image.
    ///
    /// Raises
    /// ------
    /// ShapeMismatch, NotFinite, BadCamera
    ///     For an array of another shape, for NaN and infinity, and for a point that the camera cannot see.
    #[pyo3(signature = (points, /))]
    fn project<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let points = arrays::rows("points", points)?;
        let pixels = py.detach(|| each("point", &points, |&x: &[f64; 3]| self.0.project(&x.into())))?;
        Ok(arrays::to_numpy::<2>(py, pixels))
    }

    fn __repr__(&self) -> String {
        let size = self.0.size().map_or_else(String::new, |(w, h)| format!(", width={w}, height={h}"));
        format!("Camera({:?}, {:?}{size})", self.model(), self.0.params())
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<(Args<'_>, Bound<'py, PyDict>)> {
        let size = PyDict::new(py);
        size.set_item("width", self.width())?;
        size.set_item("height", self.height())?;
        Ok(((self.model(), self.0.params()), size))
    }
}
