//! `estimate_batch`: many pairs at once, results in columns.

use numpy::ndarray::{Array1, Array2, Array3};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3, ToPyArray};
use pyo3::prelude::*;
use quest_core::robust::{self, Estimate, EstimateError, Options, Problem};
use quest_core::{Camera, Correspondence, InputError, correspondence};

use crate::arrays::{self, Points};
use crate::camera;
use crate::errors::{self, BadCamera, ShapeMismatch};
use crate::estimate::{loss_named, threshold_for};
use crate::solve::solver_named;

/// The poses of many pairs, each as ``estimate`` finds it.
///
/// Parameters
/// ----------
/// x1, x2 : array_like of shape (M, 2) or (M, 3)
///     The points of all pairs, one pair after the other, as for ``estimate``.
/// offsets : array_like of shape (B + 1,) of int
///     Pair ``i`` has the rows from ``offsets[i]`` to ``offsets[i + 1]``, the latter not included.
/// cameras1, cameras2 : Camera, array_like of shape (3, 3), or a sequence of B of them, optional
///     The cameras of all pairs, or of each. ``cameras2`` is ``cameras1`` where absent.
/// threshold, confidence, min_iterations, max_iterations, max_false_alarms, seed, solver, loss
///     As for ``estimate``.
/// first_index : int
///     Pair ``i`` gets the answer that ``estimate`` gives for it with the same seed and ``index=first_index + i``, whatever
///     the number of threads. A batch that is a part of a larger one begins with the index of its first pair there.
/// num_threads : int
///     How many threads to use, all of the machine's for 0.
///
/// Returns
/// -------
/// EstimateBatch
///     Results in columns. A pair without a pose has ``found`` False and its ``reason``; its numbers are zero.
///
/// Raises
/// ------
/// NotFinite, ShapeMismatch, DegenerateInput, BadCamera, QuestError
///     As ``estimate``, for points, offsets, cameras and options.
#[pyfunction]
#[pyo3(signature = (
    x1, x2, offsets, cameras1=None, cameras2=None, *, threshold=None, confidence=0.9999, min_iterations=300,
    max_iterations=100_000, max_false_alarms=0.03, seed=0, first_index=0, solver=None, loss="marginalised",
    num_threads=0
))]
#[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
pub(crate) fn estimate_batch(
    py: Python<'_>,
    x1: &Bound<'_, PyAny>,
    x2: &Bound<'_, PyAny>,
    offsets: &Bound<'_, PyAny>,
    cameras1: Option<&Bound<'_, PyAny>>,
    cameras2: Option<&Bound<'_, PyAny>>,
    threshold: Option<f64>,
    confidence: f64,
    min_iterations: usize,
    max_iterations: usize,
    max_false_alarms: f64,
    seed: u64,
    first_index: u64,
    solver: Option<&str>,
    loss: &str,
    num_threads: usize,
) -> PyResult<EstimateBatch> {
    let (solver, loss) = (solver_named(solver)?, loss_named(loss)?);
    let (x1, x2) = (arrays::points("x1", x1)?, arrays::points("x2", x2)?);
    let offsets = offsets_of(offsets, &x1)?;
    let pairs = offsets.len() - 1;
    let cameras1 = cameras1.map(|c| cameras("cameras1", c, pairs)).transpose()?;
    let cameras2 = cameras2.map(|c| cameras("cameras2", c, pairs)).transpose()?;
    let cameras = match (cameras1, cameras2) {
        (None, Some(_)) => {
            return Err(BadCamera::new_err("cameras2 is given without cameras1, expected both"));
        }
        (first, second) => first.map(|first| (first.clone(), second.unwrap_or(first))),
    };
    let threshold = threshold_for(cameras.is_some(), threshold)?;
    let index = first_index;
    let numbers = Options { confidence, min_iterations, max_iterations, seed, index, ..Options::default() };
    let options = Options { threshold, max_false_alarms, solver, loss, ..numbers };
    py.detach(|| {
        let matches = matches(&x1, &x2, &offsets, cameras.as_ref())?;
        let problems: Vec<_> = (0..pairs)
            .map(|i| Problem {
                matches: &matches[offsets[i]..offsets[i + 1]],
                focal_lengths: cameras.as_ref().map_or([[1.0; 2]; 2], |(first, second)| {
                    [first[i], second[i]].map(|camera| camera.focal_lengths().into())
                }),
            })
            .collect();
        let found = robust::estimate_batch(&problems, &options, num_threads);
        // What is wrong with the options is wrong for every pair.
        if let Some(Err(error @ EstimateError::Option { .. })) = found.first() {
            return Err(errors::estimate(error));
        }
        let rows = problems.iter().map(|p| p.matches.len());
        Ok(EstimateBatch::new(found.into_iter().zip(rows)))
    })
}

/// The offsets, ascending from zero to the number of rows.
fn offsets_of(given: &Bound<'_, PyAny>, x1: &Points) -> PyResult<Vec<usize>> {
    let rows = match x1 {
        Points::Image(rows) => rows.len(),
        Points::Bearings(rows) => rows.len(),
    };
    let numbers = arrays::vector("offsets", given)?;
    let expected =
        || ShapeMismatch::new_err(format!("offsets are not whole numbers ascending from 0 to {rows}"));
    let mut offsets = Vec::with_capacity(numbers.len());
    for x in numbers {
        if !(x >= 0.0 && x <= rows as f64 && x.fract() == 0.0) {
            return Err(expected());
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "whole, and within the rows"
        )]
        offsets.push(x as usize);
    }
    let ascending = offsets.windows(2).all(|w| w[0] <= w[1]);
    if offsets.first() != Some(&0) || offsets.last() != Some(&rows) || !ascending {
        return Err(expected());
    }
    Ok(offsets)
}

/// One camera for each pair, from one for all or a sequence.
fn cameras(name: &str, given: &Bound<'_, PyAny>, pairs: usize) -> PyResult<Vec<Camera>> {
    if let Ok(one) = camera::from_argument(name, given) {
        return Ok(vec![one; pairs]);
    }
    let all = given
        .try_iter()?
        .enumerate()
        .map(|(i, one)| camera::from_argument(&format!("{name}[{i}]"), &one?))
        .collect::<PyResult<Vec<_>>>()?;
    if all.len() != pairs {
        return Err(ShapeMismatch::new_err(format!(
            "{name} has {} cameras, expected one or {pairs}, one a pair",
            all.len()
        )));
    }
    Ok(all)
}

fn matches(
    x1: &Points,
    x2: &Points,
    offsets: &[usize],
    cameras: Option<&(Vec<Camera>, Vec<Camera>)>,
) -> PyResult<Vec<Correspondence>> {
    let refuse = |error: InputError| errors::input(&error);
    match (x1, x2, cameras) {
        (Points::Image(x1), Points::Image(x2), None) => {
            correspondence::from_image_points(x1, x2).map_err(refuse)
        }
        (Points::Bearings(x1), Points::Bearings(x2), None) => {
            correspondence::from_bearings(x1, x2).map_err(refuse)
        }
        (Points::Image(x1), Points::Image(x2), Some((first, second))) => {
            if x1.len() != x2.len() {
                return Err(refuse(InputError::LengthMismatch { first: x1.len(), second: x2.len() }));
            }
            let mut all = Vec::with_capacity(x1.len());
            for (i, w) in offsets.windows(2).enumerate() {
                let pixels = (&x1[w[0]..w[1]], &x2[w[0]..w[1]]);
                let pair = correspondence::from_pixels(&first[i], pixels.0, &second[i], pixels.1);
                all.extend(pair.map_err(|error| match error {
                    InputError::Match { index, source } => {
                        refuse(InputError::Match { index: index + w[0], source })
                    }
                    other => refuse(other),
                })?);
            }
            Ok(all)
        }
        (x1, x2, _) if x1.columns() != x2.columns() => Err(ShapeMismatch::new_err(format!(
            "x1 has {} columns and x2 has {}, expected as many",
            x1.columns(),
            x2.columns()
        ))),
        _ => Err(ShapeMismatch::new_err(
            "x1 and x2 have the shape (M, 3), expected pixels of shape (M, 2) where cameras are given",
        )),
    }
}

/// The estimates of many pairs, in columns; the row of a pair without a pose is zero.
#[pyclass(frozen, eq, module = "quest_pose")]
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct EstimateBatch {
    /// list of str or None : The model of each pair, as in ``Estimate``; None where no pose was found.
    #[pyo3(get)]
    model: Vec<Option<String>>,
    /// list of str or None : Why a pair has no pose.
    #[pyo3(get)]
    reason: Vec<Option<String>>,
    r: Array3<f64>,
    t: Array2<f64>,
    quat_wxyz: Array2<f64>,
    covariance: Array3<f64>,
    inliers: Array1<bool>,
    inlier_count: Array1<usize>,
    score: Array1<f64>,
    iterations: Array1<usize>,
}

type State = (
    (Vec<Option<String>>, Vec<Option<String>>),
    (Vec<f64>, Vec<f64>, Vec<f64>, Vec<f64>),
    (Vec<bool>, Vec<usize>, Vec<f64>, Vec<usize>),
);

/// The batch that ``EstimateBatch.__reduce__`` took apart.
#[pyfunction]
pub(crate) fn _estimate_batch(state: State) -> PyResult<EstimateBatch> {
    let ((model, reason), (r, t, quat_wxyz, covariance), (inliers, inlier_count, score, iterations)) = state;
    let n = model.len();
    let bad = |error: numpy::ndarray::ShapeError| ShapeMismatch::new_err(error.to_string());
    Ok(EstimateBatch {
        model,
        reason,
        r: Array3::from_shape_vec((n, 3, 3), r).map_err(bad)?,
        t: Array2::from_shape_vec((n, 3), t).map_err(bad)?,
        quat_wxyz: Array2::from_shape_vec((n, 4), quat_wxyz).map_err(bad)?,
        covariance: Array3::from_shape_vec((n, 6, 6), covariance).map_err(bad)?,
        inliers: inliers.into(),
        inlier_count: inlier_count.into(),
        score: score.into(),
        iterations: iterations.into(),
    })
}

impl EstimateBatch {
    /// From the result of each pair, and its number of matches.
    fn new(found: impl ExactSizeIterator<Item = (Result<Estimate, EstimateError>, usize)>) -> Self {
        let n = found.len();
        let mut all = Self {
            model: vec![None; n],
            reason: vec![None; n],
            r: Array3::zeros((n, 3, 3)),
            t: Array2::zeros((n, 3)),
            quat_wxyz: Array2::zeros((n, 4)),
            covariance: Array3::zeros((n, 6, 6)),
            inliers: Array1::default(0),
            inlier_count: Array1::zeros(n),
            score: Array1::zeros(n),
            iterations: Array1::zeros(n),
        };
        let mut inliers = Vec::new();
        for (i, (result, matches)) in found.enumerate() {
            match result {
                Ok(estimate) => {
                    all.set(i, &estimate);
                    inliers.extend(estimate.inliers);
                }
                Err(error) => {
                    all.reason[i] = Some(error.to_string());
                    inliers.resize(inliers.len() + matches, false);
                }
            }
        }
        all.inliers = inliers.into();
        all
    }

    fn set(&mut self, i: usize, estimate: &Estimate) {
        self.model[i] = Some(estimate.model.name().to_owned());
        let r_21 = estimate.pose.r_21();
        for row in 0..3 {
            for column in 0..3 {
                self.r[(i, row, column)] = r_21[(row, column)];
            }
            self.t[(i, row)] = estimate.pose.t_21[row];
        }
        for (k, component) in estimate.pose.wxyz().into_iter().enumerate() {
            self.quat_wxyz[(i, k)] = component;
        }
        for row in 0..6 {
            for column in 0..6 {
                self.covariance[(i, row, column)] = estimate.covariance[(row, column)];
            }
        }
        self.inlier_count[i] = estimate.inlier_count;
        self.score[i] = estimate.score;
        self.iterations[i] = estimate.iterations;
    }
}

#[pymethods]
impl EstimateBatch {
    fn __len__(&self) -> usize {
        self.model.len()
    }

    /// numpy.ndarray of shape (B,) of bool : Whether a pose was found.
    #[getter]
    fn found<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        self.model.iter().map(Option::is_some).collect::<Vec<_>>().into_pyarray(py)
    }

    /// numpy.ndarray of shape (B, 3, 3) : The rotations.
    #[getter]
    #[pyo3(name = "R")]
    fn r<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray3<f64>> {
        self.r.to_pyarray(py)
    }

    /// numpy.ndarray of shape (B, 3) : The translations; their lengths are the parallaxes.
    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        self.t.to_pyarray(py)
    }

    /// numpy.ndarray of shape (B, 4) : The rotations as unit quaternions, scalar first and not negative.
    #[getter]
    fn quat_wxyz<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        self.quat_wxyz.to_pyarray(py)
    }

    /// numpy.ndarray of shape (B, 6, 6) : The covariances, as in ``Estimate``.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray3<f64>> {
        self.covariance.to_pyarray(py)
    }

    /// numpy.ndarray of shape (M,) of bool : The inliers of all pairs, in the order of the points.
    #[getter]
    fn inliers<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        self.inliers.to_pyarray(py)
    }

    /// numpy.ndarray of shape (B,) of int : How many matches are inliers.
    #[getter]
    fn inlier_count<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<usize>> {
        self.inlier_count.to_pyarray(py)
    }

    /// numpy.ndarray of shape (B,) : How well each pose explains its matches, from 0 to 1.
    #[getter]
    fn score<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.score.to_pyarray(py)
    }

    /// numpy.ndarray of shape (B,) of int : Samples drawn.
    #[getter]
    fn iterations<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<usize>> {
        self.iterations.to_pyarray(py)
    }

    fn __repr__(&self) -> String {
        let found = self.model.iter().flatten().count();
        format!("<EstimateBatch: {found} of {} pairs have a pose>", self.model.len())
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (State,))> {
        let numbers = |a: numpy::ndarray::ArrayViewD<'_, f64>| a.iter().copied().collect::<Vec<_>>();
        let state = (
            (self.model.clone(), self.reason.clone()),
            (
                numbers(self.r.view().into_dyn()),
                numbers(self.t.view().into_dyn()),
                numbers(self.quat_wxyz.view().into_dyn()),
                numbers(self.covariance.view().into_dyn()),
            ),
            (
                self.inliers.to_vec(),
                self.inlier_count.to_vec(),
                self.score.to_vec(),
                self.iterations.to_vec(),
            ),
        );
        Ok((py.import("quest_pose._core")?.getattr("_estimate_batch")?, (state,)))
    }
}
