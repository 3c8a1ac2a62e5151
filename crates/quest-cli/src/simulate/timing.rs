//! Table 1: the time of a solve.

use std::{
    hint::black_box,
    time::{Duration, Instant},
};

use quest_core::{
    Candidates,
    simulate::{Scene, SceneError, SceneOptions},
    solver::{Kinds, SolverName},
};

use super::{Record, record::Quantity, run::Run, statistics::Statistics};

/// Milliseconds of table 1, by solver and number of points, on an Intel i7 of the fourth generation.
const PAPER: [(&str, usize, f64); 14] = [
    // The method of the default solver is not in the paper; its QuEst is what it stands for.
    ("quest", 5, 0.8857),
    // The paper's own steps.
    ("quest-literal", 5, 0.8857),
    ("relinearization-literal", 5, 41.5110),
    ("relinearization-literal", 6, 11.2461),
    ("relinearization-literal", 7, 0.9355),
    // This project's ways to the same solutions.
    ("quest-eigen", 5, 0.8857),
    ("relinearization", 5, 41.5110),
    ("relinearization", 6, 11.2461),
    ("relinearization", 7, 0.9355),
    ("kneip", 5, 0.9582),
    ("nister", 5, 0.2649),
    ("stewenius", 5, 0.1099),
    ("li-hartley", 5, 0.0354),
    ("kukelova", 5, 0.3832),
];

/// Scenes where no number is given: those of the paper.
const SCENES: u32 = 1000;
/// So many of them where a solve takes milliseconds.
const FEW_SCENES: usize = 50;
/// The shortest time for which a row is measured, and the least number of its rounds.
const BUDGET: Duration = Duration::from_millis(250);
const ROUNDS: usize = 3;

/// One solver with one number of points.
struct Row {
    solver: SolverName,
    kinds: Kinds,
    points: usize,
    rounds_ms: Vec<f64>,
    spent: Duration,
}

/// The table: every solver with five points and those of the paper with six and seven.
pub(super) fn table(run: &Run) -> Result<Vec<Record>, SceneError> {
    let mut rows = Vec::new();
    for points in [5, 6, 7] {
        for solver in run.timed_solvers() {
            let info = solver.info();
            let is_in_paper = PAPER.iter().any(|(name, n, _)| (*name, *n) == (info.name, points));
            if info.min_matches <= points && (points == 5 || is_in_paper) {
                let row = |kinds| Row { solver, kinds, points, rounds_ms: Vec::new(), spent: Duration::ZERO };
                let kinds: &[_] =
                    if is_literal(solver) { &[Kinds::Exact] } else { &[Kinds::Exact, Kinds::All] };
                rows.extend(kinds.iter().copied().map(row));
            }
        }
    }
    let mut scenes = Vec::new();
    for points in [5, 6, 7] {
        scenes.push(problems(run, points)?);
    }
    // The rows take turns, so that a disturbance of the machine falls on all of them.
    loop {
        let mut is_done = true;
        for row in &mut rows {
            if row.rounds_ms.len() < ROUNDS || row.spent < BUDGET {
                is_done = false;
                round(row, &scenes[row.points - 5]);
            }
        }
        if is_done {
            break;
        }
    }
    Ok(rows.iter().map(|row| record(run, row)).collect())
}

/// The scenes of section 9.4: no noise but the rounding to pixels.
fn problems(run: &Run, points: usize) -> Result<Vec<Scene>, SceneError> {
    let options = SceneOptions { points, rounded: true, ..run.base };
    let index = |trial: u32| 1_u64 << 48 | (points as u64) << 32 | u64::from(trial);
    (0..run.trials.unwrap_or(SCENES)).map(|trial| Scene::generate(&options, run.seed, index(trial))).collect()
}

fn is_literal(solver: SolverName) -> bool {
    SolverName::LITERAL.contains(&solver)
}

fn round(row: &mut Row, scenes: &[Scene]) {
    // The paper's own steps take a thousand times as long.
    let scenes = if is_literal(row.solver) { &scenes[..scenes.len().min(FEW_SCENES)] } else { scenes };
    let mut out = Candidates::new();
    let start = Instant::now();
    for scene in scenes {
        row.solver.solve(row.kinds, black_box(&scene.matches), &mut out);
        black_box(out.len());
    }
    let spent = start.elapsed();
    row.spent += spent;
    row.rounds_ms.push(1e3 * spent.as_secs_f64() / scenes.len() as f64);
}

fn record(run: &Run, row: &Row) -> Record {
    let name = row.solver.info().name;
    let paper = PAPER.iter().find(|(solver, points, _)| (*solver, *points) == (name, row.points));
    let record = Record {
        experiment: "table 1".to_owned(),
        scenes: run.scenes,
        varied: "points",
        value: row.points as f64,
        solver: name,
        reading: row.kinds.name(),
        quantity: Quantity::TimeMs,
        trials: row.rounds_ms.len(),
        paper: paper.map(|(.., ms)| *ms),
        ..Record::default()
    };
    record.with(Statistics::of(&row.rounds_ms))
}
