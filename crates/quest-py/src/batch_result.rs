//! What `estimate_batch` returns: `EstimateBatch`.

use numpy::ndarray::{Array1, Array2, Array3};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyIterator, PyList};

use crate::estimate_result::{Estimate, RunnerUp, State};
use crate::html;

/// The estimates of many pairs, in columns; the row of a pair without a pose is zero.
///
/// ``batch[i]`` is the ``Estimate`` of pair ``i``, None where it has no pose; so are the items of an iteration. A batch never
/// changes: its arrays are fresh copies at each access.
#[pyclass(frozen, eq, sequence, module = "quest_pose")]
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct EstimateBatch {
    estimates: Vec<Option<Estimate>>,
    /// list of str or None : Why a pair has no pose.
    #[pyo3(get)]
    reason: Vec<Option<String>>,
    offsets: Vec<usize>,
    invalid_count: Vec<usize>,
}

type Batch = (Vec<Option<State>>, Vec<Option<String>>, Vec<usize>, Vec<usize>);

/// The batch that ``EstimateBatch.__reduce__`` took apart.
#[pyfunction]
pub(crate) fn _estimate_batch(state: Batch) -> EstimateBatch {
    let (estimates, reason, offsets, invalid_count) = state;
    let estimates = estimates.into_iter().map(|state| state.map(Estimate::from_state)).collect();
    EstimateBatch { estimates, reason, offsets, invalid_count }
}

impl EstimateBatch {
    /// From the estimate of each pair, or why there is none, the offsets of its matches, and how many of them have no bearing.
    pub(crate) fn new(
        results: Vec<Result<Estimate, String>>,
        offsets: Vec<usize>,
        invalid_count: Vec<usize>,
    ) -> Self {
        let reason = results.iter().map(|result| result.as_ref().err().cloned()).collect();
        let estimates = results.into_iter().map(Result::ok).collect();
        Self { estimates, reason, offsets, invalid_count }
    }

    /// A number of each estimate; zero where there is none.
    fn column<'py, T: numpy::Element + Default>(
        &self,
        py: Python<'py>,
        one: impl Fn(&Estimate) -> T,
    ) -> Bound<'py, PyArray1<T>> {
        let values = self.estimates.iter().map(|estimate| estimate.as_ref().map_or_else(T::default, &one));
        values.collect::<Vec<_>>().into_pyarray(py)
    }

    /// A row of numbers of each estimate; `absent` where there is none.
    fn rows<'py, const D: usize>(
        &self,
        py: Python<'py>,
        absent: f64,
        one: impl Fn(&Estimate) -> Option<[f64; D]>,
    ) -> Bound<'py, PyArray2<f64>> {
        let rows = self.estimates.iter().map(|e| e.as_ref().and_then(&one).unwrap_or([absent; D]));
        Array2::from(rows.collect::<Vec<_>>()).into_pyarray(py)
    }

    /// A matrix of each estimate; `absent` where there is none.
    fn matrices<'py, const D: usize>(
        &self,
        py: Python<'py>,
        absent: f64,
        one: impl Fn(&Estimate) -> Option<[[f64; D]; D]>,
    ) -> Bound<'py, PyArray3<f64>> {
        let all = self.estimates.iter().map(|e| e.as_ref().and_then(&one).unwrap_or([[absent; D]; D]));
        Array3::from(all.collect::<Vec<_>>()).into_pyarray(py)
    }

    /// A row of numbers of each runner-up; NaN where there is none.
    fn others<'py, const D: usize>(
        &self,
        py: Python<'py>,
        one: impl Fn(&RunnerUp) -> [f64; D],
    ) -> Bound<'py, PyArray2<f64>> {
        self.rows(py, f64::NAN, |e| e.other().map(&one))
    }

    fn items(&self, py: Python<'_>) -> PyResult<Vec<Option<Py<Estimate>>>> {
        let one = |estimate: &Option<Estimate>| estimate.clone().map(|e| e.into_python(py)).transpose();
        self.estimates.iter().map(one).collect()
    }
}

#[pymethods]
impl EstimateBatch {
    fn __len__(&self) -> usize {
        self.estimates.len()
    }

    fn __getitem__(&self, py: Python<'_>, index: isize) -> PyResult<Option<Py<Estimate>>> {
        let count = self.estimates.len();
        let place = if index < 0 { index.checked_add_unsigned(count) } else { Some(index) };
        let place = place.and_then(|place| usize::try_from(place).ok());
        let found = place.and_then(|place| self.estimates.get(place)).ok_or_else(|| {
            PyIndexError::new_err(format!("pair {index} is not one of the {count} of the batch"))
        })?;
        found.clone().map(|estimate| estimate.into_python(py)).transpose()
    }

    fn __iter__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyIterator>> {
        PyList::new(py, self.items(py)?)?.try_iter()
    }

    /// list of str or None : The model of each pair, as in ``Estimate``; None where no pose was found.
    #[getter]
    fn model(&self) -> Vec<Option<&str>> {
        self.estimates.iter().map(|e| e.as_ref().map(|e| e.model.as_str())).collect()
    }

    /// numpy.ndarray of shape (B,) of bool : Whether a pose was found.
    #[getter]
    fn found<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        self.column(py, |_| true)
    }

    /// numpy.ndarray of shape (B, 3, 3) : The rotations.
    #[getter]
    #[pyo3(name = "R")]
    fn r<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray3<f64>> {
        self.matrices(py, 0.0, |e| Some(e.pose().rows()))
    }

    /// numpy.ndarray of shape (B, 3) : The translations; their lengths are the parallaxes.
    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        self.rows::<3>(py, 0.0, |e| Some(e.pose().relative().t_21.into()))
    }

    /// numpy.ndarray of shape (B, 4) : The rotations as unit quaternions, scalar first and not negative.
    #[getter]
    fn quat_wxyz<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        self.rows::<4>(py, 0.0, |e| Some(e.pose().wxyz()))
    }

    /// numpy.ndarray of shape (B, 6, 6) : The covariances, as in ``Estimate``.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray3<f64>> {
        self.matrices::<6>(py, 0.0, |e| Some((*e.covariance_matrix()).into()))
    }

    /// numpy.ndarray of shape (B + 1,) of int : The offsets of the pairs among the matches, as given.
    #[getter]
    fn offsets<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<usize>> {
        self.offsets.clone().into_pyarray(py)
    }

    /// numpy.ndarray of shape (M,) of bool : The inliers of all pairs, in the order of the points.
    #[getter]
    fn inliers<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        let mut all = Vec::with_capacity(self.offsets.last().copied().unwrap_or(0));
        for (estimate, w) in self.estimates.iter().zip(self.offsets.windows(2)) {
            match estimate {
                Some(estimate) => all.extend_from_slice(estimate.inlier_flags()),
                None => all.resize(all.len() + w[1] - w[0], false),
            }
        }
        all.into_pyarray(py)
    }

    /// numpy.ndarray of shape (B,) of int : How many matches are inliers.
    #[getter]
    fn inlier_count<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<usize>> {
        self.column(py, Estimate::inlier_count)
    }

    /// numpy.ndarray of shape (B,) of int : How many matches have no bearing and were taken for outliers, of pairs without a pose too.
    #[getter]
    fn invalid_count<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<usize>> {
        self.invalid_count.clone().into_pyarray(py)
    }

    /// numpy.ndarray of shape (B,) : How well each pose explains its matches, from 0 to 1.
    #[getter]
    fn score<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |e| e.score)
    }

    /// numpy.ndarray of shape (B,) of int : Samples drawn.
    #[getter]
    fn iterations<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<usize>> {
        self.column(py, |e| e.iterations)
    }

    /// numpy.ndarray of shape (B,) : The lengths of the translations.
    #[getter]
    fn parallax<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |e| e.pose().parallax())
    }

    /// numpy.ndarray of shape (B,) : The standard deviations of the inliers' Sampson errors.
    #[getter]
    fn noise_px<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |e| e.noise_px)
    }

    /// numpy.ndarray of shape (B, 3) : The normals of the planes, as in ``Estimate``; NaN where the model is not ``"planar"``.
    #[getter]
    fn normal<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        self.rows::<3>(py, f64::NAN, Estimate::plane)
    }

    /// numpy.ndarray of shape (B,) : The shares of false matches that the threshold accepts.
    #[getter]
    fn false_share<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |e| e.false_share)
    }

    /// numpy.ndarray of shape (B,) of int : How many matches were set aside because they did not move at all.
    #[getter]
    fn unmoved<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<usize>> {
        self.column(py, |e| e.unmoved)
    }

    /// numpy.ndarray of shape (B, 3) : The median residuals under a rotation, a plane and the general model; NaN without a pose.
    #[getter]
    fn evidence<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        self.rows::<3>(py, f64::NAN, |e| Some(e.evidence_px()))
    }

    /// numpy.ndarray of shape (B, 3, 3) : The rotations of the runners-up; NaN where there is none.
    #[getter]
    #[pyo3(name = "runner_up_R")]
    fn runner_up_r<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray3<f64>> {
        self.matrices(py, f64::NAN, |e| e.other().map(|other| other.pose.rows()))
    }

    /// numpy.ndarray of shape (B, 4) : The rotations of the runners-up as unit quaternions; NaN where there is none.
    #[getter]
    fn runner_up_quat_wxyz<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        self.others::<4>(py, |other| other.pose.wxyz())
    }

    /// numpy.ndarray of shape (B, 3) : The translations of the runners-up; NaN where there is none.
    #[getter]
    fn runner_up_t<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        self.others::<3>(py, |other| other.pose.relative().t_21.into())
    }

    /// numpy.ndarray of shape (B,) : The scores of the runners-up; NaN where there is none.
    #[getter]
    fn runner_up_score<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let score =
            |e: &Option<Estimate>| e.as_ref().and_then(Estimate::other).map_or(f64::NAN, |other| other.score);
        Array1::from_iter(self.estimates.iter().map(score)).into_pyarray(py)
    }

    /// The batch as plain numbers and lists, ready for ``json.dumps``.
    ///
    /// Returns
    /// -------
    /// dict
    ///     ``pairs``: for each pair the keys of ``Estimate.to_dict``, or its ``reason``.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let pairs = PyList::empty(py);
        for ((estimate, reason), invalid) in self.estimates.iter().zip(&self.reason).zip(&self.invalid_count)
        {
            let pair = if let Some(estimate) = estimate {
                estimate.to_dict(py)?
            } else {
                let pair = PyDict::new(py);
                pair.set_item("model", py.None())?;
                pair.set_item("reason", reason)?;
                if *invalid > 0 {
                    pair.set_item("invalid_count", invalid)?;
                }
                pair
            };
            pairs.append(pair)?;
        }
        let dict = PyDict::new(py);
        dict.set_item("pairs", pairs)?;
        Ok(dict)
    }

    fn __repr__(&self) -> String {
        let found = self.estimates.iter().flatten().count();
        format!("<EstimateBatch: {found} of {} pairs have a pose>", self.estimates.len())
    }

    fn _repr_html_(&self) -> String {
        html::batch(&self.model(), &self.reason)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (Batch,))> {
        let estimates = self.estimates.iter().map(|e| e.as_ref().map(Estimate::state)).collect();
        let state = (estimates, self.reason.clone(), self.offsets.clone(), self.invalid_count.clone());
        Ok((py.import("quest_pose._core")?.getattr("_estimate_batch")?, (state,)))
    }
}
