//! `solve_batch`: many samples of five matches at once.

use std::num::NonZero;
use std::thread::{self, ScopedJoinHandle};

use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::prelude::*;
use quest_core::lanes::{BatchSolver, Essentials, Tolerance};
use quest_core::robust::STACK_SIZE;
use quest_core::{Candidates, Correspondence, InputError};

use crate::arrays::{self, Samples};
use crate::errors::{self, QuestError, ShapeMismatch};
use crate::supervisor::Supervisor;

type Columns<'py> = (
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<f64>>,
);

/// The columns of ``solve_batch()``.
#[pyfunction]
pub(crate) fn _solve_batch<'py>(
    py: Python<'py>,
    x1: &Bound<'py, PyAny>,
    x2: &Bound<'py, PyAny>,
) -> PyResult<Columns<'py>> {
    let samples = (arrays::samples("x1", x1)?, arrays::samples("x2", x2)?);
    let columns = py.detach(|| match samples {
        (Samples::Image(x1), Samples::Image(x2)) => solve(&x1, &x2, Correspondence::from_image_points),
        (Samples::Bearings(x1), Samples::Bearings(x2)) => solve(&x1, &x2, Correspondence::from_bearings),
        _ => Err(ShapeMismatch::new_err(
            "one of x1 and x2 has two numbers a point and the other has three, expected as many",
        )),
    })?;
    let Solved { counts, quat_wxyz, t, in_front, residual } = columns;
    let mut offsets = vec![0];
    offsets.extend(counts.iter().scan(0, |sum, count| {
        *sum += count;
        Some(*sum)
    }));
    Ok((
        offsets.into_pyarray(py),
        Array2::from(quat_wxyz).into_pyarray(py),
        Array2::from(t).into_pyarray(py),
        in_front.into_pyarray(py),
        residual.into_pyarray(py),
    ))
}

/// The candidates of consecutive samples.
#[derive(Default)]
struct Solved {
    counts: Vec<i64>,
    quat_wxyz: Vec<[f64; 4]>,
    t: Vec<[f64; 3]>,
    in_front: Vec<i64>,
    residual: Vec<f64>,
}

/// A match of two points or bearings.
trait Match<const D: usize>:
    Fn([f64; D], [f64; D]) -> Result<Correspondence, quest_core::MatchError> + Sync
{
}

impl<const D: usize, T> Match<D> for T where
    T: Fn([f64; D], [f64; D]) -> Result<Correspondence, quest_core::MatchError> + Sync
{
}

/// Solves the samples, on all cores. Which core solves what changes nothing.
fn solve<const D: usize>(
    x1: &[[[f64; D]; 5]],
    x2: &[[[f64; D]; 5]],
    make: impl Match<D>,
) -> PyResult<Solved> {
    if x1.len() != x2.len() {
        let message = format!("x1 has {} samples and x2 has {}, expected as many", x1.len(), x2.len());
        return Err(ShapeMismatch::new_err(message));
    }
    if x1.len() <= MIN_SHARE {
        return solve_part(0, x1, x2, &make, &|| false);
    }
    let supervisor = Supervisor::new(None, 0);
    supervisor.run(|| solve_parts(x1, x2, &make, &|| supervisor.is_cancelled()))?
}

/// The same on all threads of the machine, as far as the system gives them.
fn solve_parts<const D: usize>(
    x1: &[[[f64; D]; 5]],
    x2: &[[[f64; D]; 5]],
    make: &impl Match<D>,
    is_cancelled: &(impl Fn() -> bool + Sync),
) -> PyResult<Solved> {
    let threads = thread::available_parallelism().map_or(1, NonZero::get);
    let share = x1.len().div_ceil(threads).max(MIN_SHARE);
    let parts: Vec<_> = thread::scope(|scope| {
        let chunks = x1.chunks(share).zip(x2.chunks(share)).enumerate();
        let start = |(part, (x1, x2))| {
            let work = move || solve_part(part * share, x1, x2, make, is_cancelled);
            (work, thread::Builder::new().stack_size(STACK_SIZE).spawn_scoped(scope, work))
        };
        let running: Vec<_> = chunks.map(start).collect();
        // A part whose thread was refused is done here.
        running
            .into_iter()
            .map(|(work, thread)| thread.map_or_else(|_| Ok(work()), ScopedJoinHandle::join))
            .collect()
    });
    let mut all = Solved::default();
    for part in parts {
        let part = part.map_err(|_| QuestError::new_err("a thread of the solver ended early"))??;
        all.counts.extend(part.counts);
        all.quat_wxyz.extend(part.quat_wxyz);
        all.t.extend(part.t);
        all.in_front.extend(part.in_front);
        all.residual.extend(part.residual);
    }
    Ok(all)
}

/// Fewer samples are not worth a thread.
const MIN_SHARE: usize = 256;
/// Samples of a batch: their matches fit into the nearest cache.
const BATCH: usize = 64;

fn solve_part<const D: usize>(
    first: usize,
    x1: &[[[f64; D]; 5]],
    x2: &[[[f64; D]; 5]],
    make: &impl Match<D>,
    is_cancelled: &impl Fn() -> bool,
) -> PyResult<Solved> {
    let solver = BatchSolver::new(Tolerance::Tight);
    let (mut found, mut candidates) = (Essentials::new(), Candidates::new());
    let (mut matches, mut samples) = (Vec::new(), Vec::new());
    let mut out = Solved::default();
    for (batch, (x1, x2)) in x1.chunks(BATCH).zip(x2.chunks(BATCH)).enumerate() {
        if is_cancelled() {
            break;
        }
        matches.clear();
        samples.clear();
        for (k, (a, b)) in x1.iter().zip(x2).enumerate() {
            for (index, (&a, &b)) in a.iter().zip(b).enumerate() {
                let error =
                    |source| errors::sample(first + batch * BATCH + k, &InputError::Match { index, source });
                matches.push(make(a, b).map_err(error)?);
            }
            let start = 5 * u32::try_from(k)?;
            samples.push(std::array::from_fn(|i| start + u32::try_from(i).unwrap_or_default()));
        }
        solver
            .solve_all(&matches, &samples, &mut found)
            .map_err(|error| QuestError::new_err(error.to_string()))?;
        for (sample, five) in matches.as_chunks::<5>().0.iter().enumerate() {
            found.candidates(sample, five, &mut candidates);
            out.counts.push(i64::try_from(candidates.len())?);
            for c in candidates.iter() {
                out.quat_wxyz.push(c.pose.wxyz());
                out.t.push(c.pose.t_21.into());
                out.in_front.push(i64::try_from(c.in_front)?);
                out.residual.push(c.residual);
            }
        }
    }
    Ok(out)
}
