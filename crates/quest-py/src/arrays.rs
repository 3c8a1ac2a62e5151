//! From whatever NumPy can view as an array of numbers to rows of `f64`, and back.

use numpy::{
    IntoPyArray, PyArray2, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn,
    PyUntypedArray, PyUntypedArrayMethods, ndarray::Array2,
};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

use crate::errors::{NotFinite, QuestError, ShapeMismatch};

/// Points as they came: two numbers a row, or three.
pub(crate) enum Points {
    /// Pixels, or points on the plane `z = 1`.
    Image(Vec<[f64; 2]>),
    /// Bearings of any length.
    Bearings(Vec<[f64; 3]>),
}

impl Points {
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Image(rows) => rows.len(),
            Self::Bearings(rows) => rows.len(),
        }
    }

    pub(crate) fn columns(&self) -> usize {
        match self {
            Self::Image(_) => 2,
            Self::Bearings(_) => 3,
        }
    }
}

/// Points of the argument `name`, of shape `(N, 2)` or `(N, 3)`.
pub(crate) fn points(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Points> {
    let array = Real::new(name, given, "real numbers of shape (N, 2) or (N, 3)")?;
    match *array.array.shape() {
        [_, 3] => array.rows().map(Points::Bearings),
        _ => array.rows().map(Points::Image),
    }
}

/// Samples of five points as they came: two numbers a point, or three.
pub(crate) enum Samples {
    /// Points on the plane `z = 1`.
    Image(Vec<[[f64; 2]; 5]>),
    /// Bearings of any length.
    Bearings(Vec<[[f64; 3]; 5]>),
}

/// Samples of the argument `name`, of shape `(B, 5, 2)` or `(B, 5, 3)`.
pub(crate) fn samples(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Samples> {
    let array = Real::new(name, given, "real numbers of shape (B, 5, 2) or (B, 5, 3)")?;
    match *array.array.shape() {
        [_, 5, 2] => Ok(Samples::Image(array.numbers()?.as_slice()?.as_chunks().0.as_chunks().0.to_vec())),
        [_, 5, 3] => Ok(Samples::Bearings(array.numbers()?.as_slice()?.as_chunks().0.as_chunks().0.to_vec())),
        _ => Err(array.mismatch()),
    }
}

/// Rows of `D` numbers from the argument `name`.
pub(crate) fn rows<const D: usize>(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<[f64; D]>> {
    Real::new(name, given, &format!("real numbers of shape (N, {D})"))?.rows()
}

/// The 3 x 3 matrix of the argument `name`, where `expected` says what is.
pub(crate) fn matrix3(name: &str, given: &Bound<'_, PyAny>, expected: &str) -> PyResult<[[f64; 3]; 3]> {
    let array = Real::new(name, given, expected)?;
    array.rows()?.try_into().map_err(|_| array.mismatch())
}

/// The numbers of the argument `name`, of shape `(N,)`.
pub(crate) fn vector(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let array = Real::new(name, given, "real numbers of shape (N,)")?;
    match *array.array.shape() {
        [_] => Ok(array.numbers()?.as_slice()?.to_vec()),
        _ => Err(array.mismatch()),
    }
}

/// The numbers of the argument `name`, of any shape.
pub(crate) fn flat(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    Ok(Real::new(name, given, "real numbers")?.numbers()?.as_slice()?.to_vec())
}

/// The whole numbers of the argument `name`, of shape `(N,)`, none of them negative.
pub(crate) fn keys(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<u64>> {
    let expected = "whole numbers of shape (N,), none of them negative";
    let array = Real::new(name, given, expected)?;
    let [_] = *array.array.shape() else { return Err(array.mismatch()) };
    let numpy = given.py().import("numpy")?;
    let is_whole = b"iu".contains(&array.array.dtype().kind()) || array.array.len() == 0;
    let is_negative = || {
        let below = numpy.call_method1("less", (&array.array, 0))?;
        numpy.call_method1("any", (below,))?.is_truthy()
    };
    if !is_whole || is_negative()? {
        return Err(QuestError::new_err(format!("{name} holds other numbers, expected {expected}")));
    }
    let keys = numpy.call_method1("require", (&array.array, "u8", ["C", "A"]))?;
    Ok(keys.cast_into::<PyArrayDyn<u64>>()?.try_readonly()?.as_slice()?.to_vec())
}

/// A new array of shape `(N, D)`.
pub(crate) fn to_numpy<const D: usize>(py: Python<'_>, rows: Vec<[f64; D]>) -> Bound<'_, PyArray2<f64>> {
    Array2::from(rows).into_pyarray(py)
}

/// The count or the seed of the argument `name`. As an argument it is an `i128`, so that what is refused is refused here.
pub(crate) fn whole<T: TryFrom<i128>>(name: &str, given: i128) -> PyResult<T> {
    T::try_from(given).map_err(|_| {
        let digits = 8 * size_of::<T>();
        let expected = format!("a whole number that is not negative and below 2**{digits}");
        QuestError::new_err(format!("{name} is {given}, expected {expected}"))
    })
}

/// The argument that may be a mask: what is known to be good comes first.
const SCORES: &str = "scores";

/// An array of real numbers whose shape is still to be checked.
struct Real<'a, 'py> {
    name: &'a str,
    expected: &'a str,
    array: Bound<'py, PyUntypedArray>,
}

impl<'a, 'py> Real<'a, 'py> {
    fn new(name: &'a str, given: &Bound<'py, PyAny>, expected: &'a str) -> PyResult<Self> {
        let array = if given.is_exact_instance_of::<PyUntypedArray>() {
            given.cast::<PyUntypedArray>()?.clone()
        } else {
            Self::viewed(name, given, expected)?
        };
        // Complex numbers would lose their imaginary part, NumPy would parse strings, and a mask holds no coordinates; it may hold
        // scores.
        let kind = array.dtype().kind();
        if !(b"iuf".contains(&kind) || kind == b'b' && name == SCORES) {
            let dtype = array.dtype();
            return Err(PyTypeError::new_err(format!("{name} has the dtype {dtype}, expected {expected}")));
        }
        Ok(Self { name, expected, array })
    }

    /// As NumPy views it.
    fn viewed(name: &str, given: &Bound<'py, PyAny>, expected: &str) -> PyResult<Bound<'py, PyUntypedArray>> {
        let py = given.py();
        let numpy = py.import("numpy")?;
        // The array would come without its mask.
        if numpy.getattr("ma")?.call_method1("is_masked", (given,))?.is_truthy()? {
            return Err(NotFinite::new_err(format!("{name} has masked values, expected {expected}")));
        }
        let array = numpy.call_method1("asarray", (given,)).map_err(|error| {
            // Ragged lists are the one thing that NumPy calls a ValueError here.
            if !error.is_instance_of::<PyValueError>(py) {
                return error;
            }
            ShapeMismatch::new_err(format!("{name}: {}, expected {expected}", error.value(py)))
        })?;
        let array: Bound<'py, PyUntypedArray> = array.cast_into()?;
        if array.dtype().kind() != b'O' {
            return Ok(array);
        }
        // Columns of lists, of Arrow and of data frames, which NumPy sees as objects.
        let dense = py.import("quest_pose._columns")?.call_method1("dense", (given,))?;
        if dense.is_none() { Ok(array) } else { Ok(dense.cast_into()?) }
    }

    fn rows<const D: usize>(&self) -> PyResult<Vec<[f64; D]>> {
        match *self.array.shape() {
            [_, columns] if columns == D => Ok(self.numbers()?.as_slice()?.as_chunks().0.to_vec()),
            _ => Err(self.mismatch()),
        }
    }

    /// All numbers, row after row.
    fn numbers(&self) -> PyResult<PyReadonlyArrayDyn<'py, f64>> {
        if let Ok(array) = self.array.cast::<PyArrayDyn<f64>>()
            && array.is_c_contiguous()
            && array.data().is_aligned()
        {
            return Ok(array.try_readonly()?);
        }
        let numpy = self.array.py().import("numpy")?;
        // C: in C order. A: aligned. NumPy copies only where one of them, or the dtype, differs.
        let array = numpy.call_method1("require", (&self.array, "f8", ["C", "A"]))?;
        Ok(array.cast_into::<PyArrayDyn<f64>>()?.try_readonly()?)
    }

    fn mismatch(&self) -> PyErr {
        let Self { name, expected, array } = self;
        array.getattr("shape").map_or_else(
            |error| error,
            |shape| ShapeMismatch::new_err(format!("{name} has the shape {shape}, expected {expected}")),
        )
    }
}
