//! `solve` and `solvers`: every pose of correct matches, and the methods that find them.

use quest_core::solver::{Kinds, SolverName};
use quest_core::{Camera, Candidates, InputError};
use serde::{Deserialize, Serialize};
use wasm_bindgen::prelude::*;

use crate::input;
use crate::output::{self, CandidateObject};

const NAMES: [&str; 4] = ["camera1", "camera2", "solver", "kinds"];

#[derive(Default, Deserialize)]
#[serde(default)]
struct Given {
    camera1: Option<Camera>,
    camera2: Option<Camera>,
    solver: Option<String>,
    kinds: Option<String>,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct SolverObject {
    name: &'static str,
    min_matches: usize,
    max_candidates: usize,
    reference: &'static str,
}

/// Every pose that explains five or more correct matches, best first.
///
/// `matches` are rows `u1, v1, u2, v2` as for `estimate`. The list is empty where the constraints have no real solution and those alone
/// were asked for.
///
/// # Errors
/// Those of the core, with their text.
#[wasm_bindgen(unchecked_return_type = "Candidate[]")]
pub fn solve(
    matches: &[f64],
    #[wasm_bindgen(unchecked_optional_param_type = "SolveOptions")] options: JsValue,
) -> Result<JsValue, JsError> {
    let given: Given = input::options(options, &NAMES)?;
    let solver = input::solver(given.solver.as_deref())?;
    let kinds: Kinds = given.kinds.as_deref().unwrap_or("all").parse()?;
    let cameras = input::cameras(given.camera1, given.camera2)?;
    let matches = input::matches(&input::rows("matches", matches)?, cameras.as_ref())?;
    let (found, needed) = (matches.len(), solver.info().min_matches);
    if found < needed {
        return Err(InputError::TooFewMatches { found, needed }.into());
    }
    let mut candidates = Candidates::new();
    solver.solve(kinds, &matches, &mut candidates);
    if let (true, Some(degeneracy)) = (candidates.is_empty(), candidates.degeneracy()) {
        return Err(InputError::Degenerate(degeneracy).into());
    }
    output::object(&candidates.iter().map(|c| CandidateObject::new(c, &matches)).collect::<Vec<_>>())
}

/// The solvers by name, the default first.
///
/// # Errors
/// None.
#[wasm_bindgen(unchecked_return_type = "SolverInfo[]")]
pub fn solvers() -> Result<JsValue, JsError> {
    let rows = SolverName::ALL.map(|solver| {
        let info = solver.info();
        SolverObject {
            name: info.name,
            min_matches: info.min_matches,
            max_candidates: info.max_candidates,
            reference: info.reference,
        }
    });
    output::object(&rows)
}
