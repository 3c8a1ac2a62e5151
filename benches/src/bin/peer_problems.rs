//! Minimal problems as JSON for the libraries of `benches/peers`, with what our solvers make of them.
#![expect(clippy::print_stdout, reason = "a program for a pipe: JSON is its output")]

use std::error::Error;
use std::hint::black_box;
use std::time::Instant;

use clap::Parser;
use quest_benches::SEED;
use quest_benches::cells::Cell;
use quest_core::Candidates;
use quest_core::simulate::{Figure, PoseErrors, Problem, SceneOptions};
use quest_core::solver::SolverName;
use serde_json::{Value, json};

/// Rounds of which the fastest counts, of each problem by itself: a busy machine matters little.
const ROUNDS: usize = 20;

/// The figures of section 9 at one value each: its number, the step of its grid, what that is.
const CELLS: [(Figure, usize, &str); 6] = [
    (Figure::Four, 0, "general, no noise"),
    (Figure::Four, 10, "general, 1 px"),
    (Figure::Four, 50, "general, 5 px"),
    (Figure::Five, 10, "coplanar, 1 px"),
    (Figure::Six, 10, "parallax 0.01, 0.75 px"),
    (Figure::Seven, 10, "rotation, 1 px"),
];

/// Realistic scenes of five points as JSON, with the errors and the times of our solvers.
#[derive(Debug, Parser)]
struct Arguments {
    /// Scenes of a kind
    #[arg(long, default_value_t = 1_000)]
    scenes: u32,
    /// Seed of the scenes
    #[arg(long, default_value_t = SEED)]
    seed: u64,
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments = Arguments::parse();
    let mut kinds = Vec::new();
    for (figure, step, name) in CELLS {
        let cell = &figure.cells(&SceneOptions::realistic())[step];
        let problems: Result<Vec<_>, _> =
            (0..arguments.scenes).map(|trial| cell.problem(arguments.seed, trial)).collect();
        let problems = problems?;
        #[cfg_attr(not(feature = "peers"), expect(unused_mut, reason = "a peer adds its row"))]
        let mut rows: Vec<Value> =
            Cell::of(&SolverName::ALL, 5).into_iter().map(|cell| row(cell, &problems)).collect();
        #[cfg(feature = "peers")]
        rows.push(kornia_row(&problems));
        let shown: Vec<Value> = problems.iter().map(as_json).collect();
        kinds.push(json!({ "name": name, "problems": shown, "rows": rows }));
    }
    println!("{}", json!({ "seed": arguments.seed, "kinds": kinds }));
    Ok(())
}

/// Points on the planes `z = 1`, and the truth.
fn as_json(problem: &Problem) -> Value {
    let view = |k: usize| -> Vec<[f64; 2]> {
        let bearings = problem.scene.matches.iter().map(|m| if k == 0 { m.bearing1() } else { m.bearing2() });
        bearings.map(|b| [b.x / b.z, b.y / b.z]).collect()
    };
    let truth = &problem.scene.truth;
    json!({ "x1": view(0), "x2": view(1), "q_21": truth.wxyz(), "t_21": <[f64; 3]>::from(truth.t_21) })
}

fn row(cell: Cell, problems: &[Problem]) -> Value {
    let mut out = Candidates::new();
    let mut errors = Vec::new();
    let mut count = 0;
    for problem in problems {
        cell.solve(&problem.scene.matches, &mut out);
        count += out.len();
        errors.push(PoseErrors::smallest(&problem.scene.truth, out.iter()));
    }
    let seconds = fastest(problems, |problem| {
        cell.solve(black_box(&problem.scene.matches), &mut out);
        black_box(out.len());
    });
    let name = format!("{}, {}", cell.solver_name(), cell.kinds_name());
    as_row(&name, &errors, count, 1e6 * seconds)
}

/// Seconds a problem: the mean over the problems, each in its fastest round.
fn fastest<T>(problems: &[T], mut solve: impl FnMut(&T)) -> f64 {
    let mut best = vec![f64::INFINITY; problems.len()];
    for _ in 0..ROUNDS {
        for (problem, best) in problems.iter().zip(&mut best) {
            let start = Instant::now();
            solve(problem);
            *best = best.min(start.elapsed().as_secs_f64());
        }
    }
    best.iter().sum::<f64>() / problems.len() as f64
}

fn as_row(name: &str, errors: &[Option<PoseErrors>], candidates: usize, time_us: f64) -> Value {
    let answered: Vec<_> = errors.iter().flatten().collect();
    let mean = |f: fn(&PoseErrors) -> f64| answered.iter().map(|e| f(e)).sum::<f64>() / answered.len() as f64;
    json!({
        "name": name,
        "rotation": mean(|e| e.rotation),
        "translation": mean(|e| e.translation),
        "unanswered": errors.len() - answered.len(),
        "candidates": candidates as f64 / errors.len() as f64,
        "time_us": time_us,
    })
}

/// kornia-3d finds essential matrices; the poses of each are made here, outside of its time.
#[cfg(feature = "peers")]
fn kornia_row(problems: &[Problem]) -> Value {
    use quest_benches::peers::{kornia, kornia_problem, poses};
    let mut count = 0;
    let errors: Vec<_> = problems
        .iter()
        .map(|problem| {
            let found = kornia_problem(&problem.scene.matches).map(|p| kornia(&p)).unwrap_or_default();
            count += 4 * found.len();
            let all = found.iter().flat_map(poses).map(|pose| PoseErrors::of(&problem.scene.truth, &pose));
            all.reduce(|a, b| PoseErrors {
                rotation: a.rotation.min(b.rotation),
                translation: a.translation.min(b.translation),
            })
        })
        .collect();
    let inputs: Vec<_> = problems.iter().filter_map(|p| kornia_problem(&p.scene.matches)).collect();
    let seconds = fastest(&inputs, |input| {
        black_box(kornia(black_box(input)));
    });
    as_row("kornia-3d essential_5pt (Rust)", &errors, count, 1e6 * seconds)
}
