//! `estimate_batch`: many pairs at once, results in columns.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use quest_core::Camera;
use quest_core::correspondence::Usable;
use quest_core::robust::{Batch, KnownDirection, Options, Problem};

use crate::arrays::{self, Points};
use crate::batch_result::EstimateBatch;
use crate::camera;
use crate::errors::{self, BadCamera, ShapeMismatch};
use crate::estimate::{Direction, Invalid, direction};
use crate::estimate_result::Estimate;
use crate::options;
use crate::supervisor::Supervisor;

/// Fewer pairs are solved where they are called: a thread costs as much as some of them.
const FEW: usize = 4;

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
/// first_index : int
///     Pair ``i`` gets the answer that ``estimate`` gives for it with the same seed and ``index=first_index + i``, whatever
///     the number of threads. A batch that is a part of a larger one begins with the index of its first pair there.
/// num_threads : int
///     How many threads to use, all of the machine's for 0.
/// scores : array_like of shape (M,), optional
///     One a match, higher is better: the best matches of each pair are tried first.
/// indices : array_like of shape (B,) of int, optional
///     The key of each pair in place of ``first_index + i``: its answer then does not depend on which other pairs there are.
/// invalid : {"outlier", "pair", "raise"}
///     What a match without a bearing is, a NaN or a pixel for which a camera has no viewing ray: an outlier, counted in
///     ``invalid_count``; the reason why its pair has no pose; or an error. It changes nothing of the other pairs.
/// progress : callable, optional
///     Called with the number of pairs that are done and that of all, some twenty times a second and at the end. An exception
///     ends the batch.
/// known_direction : (array_like of shape (3,), array_like of shape (3,), float), optional
///     As for ``estimate``, the same for all pairs.
/// threshold, confidence, max_iterations, seed, ... : optional
///     As for ``estimate``: the keywords of ``EstimateOptions`` but for ``index``, whose place ``first_index`` and ``indices`` take.
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
///
/// Notes
/// -----
/// The lock of the interpreter is released while the searches run; Ctrl-C ends them.
#[pyfunction]
#[pyo3(signature = (
    x1, x2, offsets, cameras1=None, cameras2=None, *, first_index=0, num_threads=0, scores=None, indices=None,
    invalid="outlier", progress=None, known_direction=None, **options
))]
#[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
#[expect(clippy::needless_pass_by_value, reason = "pyo3 hands callables over")]
pub(crate) fn estimate_batch(
    py: Python<'_>,
    x1: &Bound<'_, PyAny>,
    x2: &Bound<'_, PyAny>,
    offsets: &Bound<'_, PyAny>,
    cameras1: Option<&Bound<'_, PyAny>>,
    cameras2: Option<&Bound<'_, PyAny>>,
    first_index: i128,
    num_threads: i128,
    scores: Option<&Bound<'_, PyAny>>,
    indices: Option<&Bound<'_, PyAny>>,
    invalid: &str,
    progress: Option<Py<PyAny>>,
    known_direction: Option<Direction<'_>>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<EstimateBatch> {
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
    let options = options::options("estimate_batch", options, &["index"], cameras.is_some())?;
    let first_index = arrays::whole("first_index", first_index)?;
    let options = Options { index: if indices.is_some() { 0 } else { first_index }, ..options };
    // What is wrong with the options is wrong whether there are pairs or none.
    options.check().map_err(|error| errors::estimate(&error))?;
    let direction = known_direction.as_ref().map(direction).transpose()?;
    let scores = scores.map(|scores| arrays::vector("scores", scores)).transpose()?;
    if let Some(scores) = scores.as_ref().filter(|scores| scores.len() != x1.len()) {
        return Err(length("scores", scores.len(), x1.len(), "match"));
    }
    let indices = indices.map(|indices| arrays::keys("indices", indices)).transpose()?;
    if let Some(indices) = indices.as_ref().filter(|indices| indices.len() != pairs) {
        return Err(length("indices", indices.len(), pairs, "pair"));
    }
    let task = Task {
        x1,
        x2,
        offsets,
        cameras,
        scores,
        indices,
        direction,
        invalid: invalid.parse()?,
        options,
        num_threads: arrays::whole("num_threads", num_threads)?,
    };
    py.detach(|| task.run(progress.as_ref()))
}

fn length(name: &str, found: usize, expected: usize, one: &str) -> PyErr {
    ShapeMismatch::new_err(format!("{name} has {found} numbers, expected {expected}, one a {one}"))
}

/// All that a batch was called with.
struct Task {
    x1: Points,
    x2: Points,
    offsets: Vec<usize>,
    cameras: Option<(Vec<Camera>, Vec<Camera>)>,
    scores: Option<Vec<f64>>,
    indices: Option<Vec<u64>>,
    direction: Option<KnownDirection>,
    invalid: Invalid,
    options: Options,
    num_threads: usize,
}

impl Task {
    /// The estimates of all pairs.
    fn run(self, progress: Option<&Py<PyAny>>) -> PyResult<EstimateBatch> {
        let usable = self.usable()?;
        let scores: Option<Vec<Vec<f64>>> = self.scores.as_ref().map(|scores| {
            let parts = self.offsets.windows(2).map(|w| &scores[w[0]..w[1]]);
            parts.zip(&usable).map(|(part, usable)| usable.keep(part)).collect()
        });
        let scores: Option<Vec<Option<&[f64]>>> =
            scores.as_ref().map(|all| all.iter().map(|part| Some(part.as_slice())).collect());
        let is_refused = |usable: &Usable| self.invalid == Invalid::Pair && !usable.invalid.is_empty();
        let problems: Vec<_> = usable
            .iter()
            .enumerate()
            .map(|(i, usable)| Problem {
                // A pair that is refused has no matches, which takes no time.
                matches: if is_refused(usable) { &[] } else { &usable.matches },
                focal_lengths: self.cameras.as_ref().map_or([[1.0; 2]; 2], |(first, second)| {
                    [first[i], second[i]].map(|camera| camera.focal_lengths().into())
                }),
            })
            .collect();
        let supervisor = Supervisor::new(progress, problems.len());
        let done = || supervisor.add_one();
        let batch = Batch {
            threads: self.num_threads,
            indices: self.indices.as_deref(),
            direction: self.direction,
            scores: scores.as_deref().filter(|_| self.invalid != Invalid::Pair),
            done: &done,
            ..Batch::default()
        };
        let found = if self.num_threads == 1 || problems.len() < FEW {
            let poll = || supervisor.poll();
            let batch = Batch { threads: 1, is_cancelled: &poll, ..batch };
            supervisor.run_here(|| batch.estimate(&problems, &self.options))?
        } else {
            let is_cancelled = || supervisor.is_cancelled();
            let batch = Batch { is_cancelled: &is_cancelled, ..batch };
            supervisor.run(|| batch.estimate(&problems, &self.options))?
        };
        let results = found.into_iter().zip(&usable).map(|(found, usable)| {
            if let Some(error) = usable.error().filter(|_| is_refused(usable)) {
                return Err(error.to_string());
            }
            match found {
                Ok(found) => Ok(Estimate::of_usable(&found, usable)),
                Err(error) => Err(errors::reason(&error, usable)),
            }
        });
        let results: Vec<_> = results.collect();
        let invalid = usable.iter().map(|usable| usable.invalid.len()).collect();
        Ok(EstimateBatch::new(results, self.offsets, invalid))
    }

    /// The matches of each pair that have bearings.
    fn usable(&self) -> PyResult<Vec<Usable>> {
        let (found, expected) = (self.x2.len(), self.x1.len());
        if self.x1.columns() != self.x2.columns() {
            let (first, second) = (self.x1.columns(), self.x2.columns());
            return Err(ShapeMismatch::new_err(format!(
                "x1 has {first} columns and x2 has {second}, expected as many"
            )));
        }
        if found != expected {
            return Err(ShapeMismatch::new_err(format!(
                "view 1 has {expected} points and view 2 has {found}, expected as many"
            )));
        }
        let mut all = Vec::with_capacity(self.offsets.len());
        for (i, w) in self.offsets.windows(2).enumerate() {
            let (from, to) = (w[0], w[1]);
            let one = match (&self.x1, &self.x2, &self.cameras) {
                (Points::Image(x1), Points::Image(x2), None) => {
                    Usable::from_image_points(&x1[from..to], &x2[from..to])
                }
                (Points::Image(x1), Points::Image(x2), Some((first, second))) => {
                    Usable::from_pixels(&first[i], &x1[from..to], &second[i], &x2[from..to])
                }
                (Points::Bearings(x1), Points::Bearings(x2), None) => {
                    Usable::from_bearings(&x1[from..to], &x2[from..to])
                }
                _ => {
                    return Err(ShapeMismatch::new_err(
                        "x1 and x2 have the shape (M, 3), expected pixels of shape (M, 2) where cameras are given",
                    ));
                }
            };
            let one = one.map_err(|error| errors::input(&error))?;
            if let Some((index, source)) = one.invalid.first().filter(|_| self.invalid == Invalid::Raise) {
                let (index, source) = (index + from, source.clone());
                return Err(errors::input(&quest_core::InputError::Match { index, source }));
            }
            all.push(one);
        }
        Ok(all)
    }
}

/// The offsets, ascending from zero to the number of rows.
fn offsets_of(given: &Bound<'_, PyAny>, x1: &Points) -> PyResult<Vec<usize>> {
    let rows = x1.len();
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
