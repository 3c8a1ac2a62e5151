//! `_solve_polynomials`: every solution of a system of polynomial equations.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use quest_core::polynomial_system::{Options, RankDecision, Report, System, solve};

use crate::arrays::whole;
use crate::errors::{NoAnswer, QuestError};
use crate::supervisor::apart;

/// Of each solution the real and the imaginary parts of the unknowns; residuals; multiplicities; which are real; how many are at
/// infinity; the report.
type Found<'py> = (Vec<Vec<f64>>, Vec<Vec<f64>>, Vec<f64>, Vec<usize>, Vec<bool>, usize, Bound<'py, PyDict>);

/// What `quest_pose.solve_polynomials` names.
#[pyfunction]
#[pyo3(signature = (unknowns, equations, solutions, max_rounds, max_monomials, seed))]
pub(crate) fn _solve_polynomials(
    py: Python<'_>,
    unknowns: usize,
    equations: Vec<Vec<(f64, Vec<u8>)>>,
    solutions: Option<i128>,
    max_rounds: i128,
    max_monomials: i128,
    seed: i128,
) -> PyResult<Found<'_>> {
    let options = Options {
        solutions: solutions.map(|count| whole("solutions", count)).transpose()?,
        max_rounds: whole("max_rounds", max_rounds)?,
        max_monomials: whole("max_monomials", max_monomials)?,
        seed: whole("seed", seed)?,
        ..Options::default()
    };
    let system = System::new(unknowns, equations).map_err(|error| QuestError::new_err(error.to_string()))?;
    let found = py.detach(|| apart(move || solve(&system, &options)))?;
    let found = found.map_err(|error| NoAnswer::new_err(error.to_string()))?;
    let all = &found.all;
    Ok((
        all.iter().map(|s| s.x.iter().map(|x| x.re).collect()).collect(),
        all.iter().map(|s| s.x.iter().map(|x| x.im).collect()).collect(),
        all.iter().map(|s| s.residual).collect(),
        all.iter().map(|s| s.multiplicity).collect(),
        all.iter().map(quest_core::polynomial_system::Solution::is_real).collect(),
        found.at_infinity,
        report(py, &found.report)?,
    ))
}

fn report<'py>(py: Python<'py>, report: &Report) -> PyResult<Bound<'py, PyDict>> {
    let rank = |d: &RankDecision| -> PyResult<_> {
        let dict = PyDict::new(py);
        dict.set_item("rows", d.rows)?;
        dict.set_item("columns", d.columns)?;
        dict.set_item("rank", d.rank)?;
        dict.set_item("nullity", d.nullity())?;
        dict.set_item("kept", d.kept)?;
        dict.set_item("dropped", d.dropped)?;
        Ok(dict)
    };
    let dict = PyDict::new(py);
    dict.set_item("unknowns", report.unknowns)?;
    dict.set_item("degree", report.degree)?;
    dict.set_item("grading", report.grading)?;
    dict.set_item("rounds", report.rounds)?;
    dict.set_item("d_bar", report.d_bar)?;
    dict.set_item("linearized", rank(&report.linearized)?)?;
    dict.set_item("relinearized", rank(&report.relinearized)?)?;
    dict.set_item("w_0", rank(&report.w_0)?)?;
    Ok(dict)
}
