//! `Camera`, and what else may stand where a camera is expected.

use std::hash::{Hash, Hasher};

use nalgebra::Matrix3;
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use quest_core::CameraError;

use crate::arrays;
use crate::errors::{self, BadCamera, QuestError};
use crate::foreign_camera;
use crate::supervisor::Supervisor;

/// A calibrated camera, with COLMAP's models and parameters.
///
/// Parameters
/// ----------
/// model : str
///     ``"SIMPLE_PINHOLE"`` (f, cx, cy), ``"PINHOLE"`` (fx, fy, cx, cy), ``"SIMPLE_RADIAL"`` (f, cx, cy, k),
///     ``"RADIAL"`` (f, cx, cy, k1, k2), ``"OPENCV"`` (fx, fy, cx, cy, k1, k2, p1, p2), ``"OPENCV_FISHEYE"``
///     (fx, fy, cx, cy, k1, k2, k3, k4), ``"FULL_OPENCV"`` (fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6),
///     ``"SIMPLE_RADIAL_FISHEYE"`` (f, cx, cy, k), ``"RADIAL_FISHEYE"`` (f, cx, cy, k1, k2), ``"SIMPLE_FISHEYE"``
///     (f, cx, cy), ``"FISHEYE"`` (fx, fy, cx, cy), ``"FOV"`` (fx, fy, cx, cy, omega), ``"THIN_PRISM_FISHEYE"``
///     (fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, sx1, sy1), ``"RAD_TAN_THIN_PRISM_FISHEYE"`` (fx, fy, cx, cy, k0, k1, k2,
///     k3, k4, k5, p0, p1, s0, s1, s2, s3), ``"SIMPLE_DIVISION"`` (f, cx, cy, k), ``"DIVISION"`` (fx, fy, cx, cy, k),
///     ``"EUCM"`` (fx, fy, cx, cy, alpha, beta) or ``"EQUIRECTANGULAR"`` (w, h).
/// params : array_like of shape (P,)
///     The model's parameters in that order: focal lengths and principal point in pixels, then the distortion. A panorama
///     has its width and height in pixels.
/// width, height : int, optional
///     The size of the image in pixels. Poses do not depend on it.
///
/// Raises
/// ------
/// BadCamera
///     For an unknown model, a wrong number of parameters, or impossible ones.
#[pyclass(frozen, eq, hash, module = "quest_pose")]
#[derive(Debug, PartialEq)]
pub(crate) struct Camera(quest_core::Camera);

impl Hash for Camera {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.0.model().hash(state);
        self.0.size().hash(state);
        // Zeros of either sign are equal.
        self.0.params().iter().for_each(|x| (x + 0.0).to_bits().hash(state));
    }
}

/// The camera of the argument `name`: a `Camera`, a 3 x 3 matrix K, or what other libraries call a camera.
pub(crate) fn from_argument(name: &str, given: &Bound<'_, PyAny>) -> PyResult<quest_core::Camera> {
    if let Ok(camera) = given.cast::<Camera>() {
        return Ok(camera.get().0);
    }
    match foreign_camera::read(name, given)? {
        Some(camera) => Ok(camera),
        None if given.is_instance_of::<PyTuple>() && given.len()? == 2 => Err(BadCamera::new_err(format!(
            "{name} is a tuple of two, expected a Camera or a matrix K of shape (3, 3); \
             Camera.from_opencv(K, dist) takes the distortion of OpenCV too"
        ))),
        None => from_k(name, given),
    }
}

pub(crate) fn from_k(name: &str, k: &Bound<'_, PyAny>) -> PyResult<quest_core::Camera> {
    let rows = arrays::matrix3(name, k, "a Camera or a matrix K of shape (3, 3)")?;
    // nalgebra keeps columns, NumPy rows.
    let k = Matrix3::from(rows).transpose();
    quest_core::Camera::from_k(&k).map_err(|error| errors::camera(name, &error))
}

/// Each of `items` through `one`, with the index of the first that is refused.
fn each<T, U>(name: &str, items: &[T], one: impl Fn(&T) -> Result<U, CameraError>) -> PyResult<Vec<U>> {
    let indexed = items.iter().enumerate();
    watched(indexed.map(|(i, item)| one(item).map_err(|e| errors::camera(&format!("{name} {i}"), &e))))
}

/// All of the results; a signal ends it. Python's lock must not be held.
fn watched<T>(mut results: impl Iterator<Item = PyResult<T>>) -> PyResult<Vec<T>> {
    let supervisor = Supervisor::new(None, 0);
    let mut all = Vec::with_capacity(results.size_hint().0);
    let done = || {
        while !supervisor.poll() {
            // A few milliseconds of work.
            for result in results.by_ref().take(10_000) {
                all.push(result?);
            }
            if results.size_hint().1 == Some(0) {
                break;
            }
        }
        Ok(all)
    };
    supervisor.run_here(done)?
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
        width: Option<i128>,
        height: Option<i128>,
    ) -> PyResult<Self> {
        let side = |name, side: Option<i128>| side.map(|side| arrays::whole(name, side)).transpose();
        let (width, height) = (side("width", width)?, side("height", height)?);
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

    /// The camera that OpenCV's calibration describes.
    ///
    /// Parameters
    /// ----------
    /// k : array_like of shape (3, 3)
    ///     The camera matrix.
    /// dist : array_like of shape (0,), (4,), (5,), (8,), (12,) or (14,)
    ///     The distortion coefficients in OpenCV's order; from the ninth on, thin prism and tilt, they have to be zero. Four,
    ///     for a fisheye camera.
    /// fisheye : bool
    ///     Whether ``dist`` is that of ``cv2.fisheye``.
    /// size : (int, int), optional
    ///     Width and height of the image.
    ///
    /// Returns
    /// -------
    /// Camera
    ///     ``"PINHOLE"``, ``"OPENCV"``, ``"FULL_OPENCV"`` or ``"OPENCV_FISHEYE"``.
    ///
    /// Raises
    /// ------
    /// ShapeMismatch, BadCamera
    ///     For an array of another shape, and for an impossible matrix or number of coefficients.
    #[staticmethod]
    #[pyo3(signature = (k, dist=None, *, fisheye=false, size=None))]
    fn from_opencv(
        k: &Bound<'_, PyAny>,
        dist: Option<&Bound<'_, PyAny>>,
        fisheye: bool,
        size: Option<(i128, i128)>,
    ) -> PyResult<Self> {
        let k = from_k("k", k)?;
        let dist = dist.map_or_else(|| Ok(Vec::new()), |dist| foreign_camera::flat("dist", dist))?;
        let side = |side| arrays::whole("size", side);
        let size = size.map(|(width, height)| Ok::<_, PyErr>((side(width)?, side(height)?))).transpose()?;
        foreign_camera::opencv("camera", &k, &dist, fisheye, size).map(Self)
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
    /// invalid : {"raise", "nan"}
    ///     Whether a pixel without a viewing ray is an error or a row of NaN.
    ///
    /// Returns
    /// -------
    /// numpy.ndarray of shape (N, 3)
    ///     The rays in the frame of the camera: points on the plane z = 1, or unit vectors for fisheye models.
    ///
    /// Raises
    /// ------
    /// ShapeMismatch, NotFinite, BadCamera
    ///     For an array of another shape; with ``invalid="raise"`` for NaN and infinity, and for a pixel without a viewing ray.
    #[pyo3(signature = (pixels, /, *, invalid="raise"))]
    fn bearing<'py>(
        &self,
        py: Python<'py>,
        pixels: &Bound<'py, PyAny>,
        invalid: &str,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let pixels: Vec<[f64; 2]> = arrays::rows("pixels", pixels)?;
        let rays = match invalid {
            "raise" => py.detach(|| each("pixel", &pixels, |&u| self.0.bearing(u).map(Into::into)))?,
            "nan" => py.detach(|| {
                let ray = |&u| Ok(self.0.bearing(u).map_or([f64::NAN; 3], Into::into));
                watched(pixels.iter().map(ray))
            })?,
            _ => {
                return Err(QuestError::new_err(format!(
                    "invalid is {invalid:?}, expected \"raise\" or \"nan\""
                )));
            }
        };
        Ok(arrays::to_numpy::<3>(py, rays))
    }

    /// Which pixels have a viewing ray.
    ///
    /// Parameters
    /// ----------
    /// pixels : array_like of shape (N, 2)
    ///     Pixels (u, v).
    ///
    /// Returns
    /// -------
    /// numpy.ndarray of shape (N,) of bool
    ///     False for NaN, infinity, and where the distortion has no inverse.
    ///
    /// Raises
    /// ------
    /// ShapeMismatch
    ///     For an array of another shape.
    #[pyo3(signature = (pixels, /))]
    fn has_ray<'py>(
        &self,
        py: Python<'py>,
        pixels: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let pixels: Vec<[f64; 2]> = arrays::rows("pixels", pixels)?;
        let found = py.detach(|| watched(pixels.iter().map(|&u| Ok(self.0.bearing(u).is_ok()))))?;
        Ok(found.into_pyarray(py))
    }

    /// The camera as plain numbers and lists, as PoseLib, COLMAP and the files of the command line have it.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        dict.set_item("model", self.model())?;
        if let Some((width, height)) = self.0.size() {
            dict.set_item("width", width)?;
            dict.set_item("height", height)?;
        }
        dict.set_item("params", self.0.params().to_vec())?;
        Ok(dict)
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
