//! Microseconds a solve for every solver, with the share of noise-free scenes whose true rotation it finds beside it.
#![expect(clippy::print_stdout, reason = "a program for people: tables are its output")]

use std::error::Error;
use std::hint::black_box;
use std::time::Instant;

use clap::Parser;
use comfy_table::{CellAlignment, Table, presets};
use quest_benches::cells::Cell;
use quest_benches::statistics::{mean, percentile, sorted};
use quest_benches::{SEED, errors};
use quest_core::quaternion::constraint_matrix_5;
use quest_core::simulate::{Layout, Scene, SceneError, SceneOptions};
use quest_core::solver::SolverName;
use quest_core::{Candidates, Correspondence};

/// Time of every solver on realistic general scenes with 0.75 px of noise: a table in Markdown.
#[derive(Debug, Parser)]
struct Arguments {
    /// Scenes of a round, each solved once
    #[arg(long, default_value_t = 1_000, value_parser = clap::value_parser!(u64).range(1..))]
    scenes: u64,
    /// Rounds; a round's time is its mean over the scenes
    #[arg(long, default_value_t = 100)]
    rounds: usize,
    /// Matches of a scene
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u64).range(4..))]
    points: u64,
    /// Seed of the scenes
    #[arg(long, default_value_t = SEED)]
    seed: u64,
    /// Only these solvers, separated by commas
    #[arg(long, value_delimiter = ',')]
    solvers: Vec<SolverName>,
    /// Time nothing: only solve this many times, with the first solver and all kinds, for an instruction counter
    #[arg(long, value_name = "N")]
    callgrind: Option<usize>,
    /// With --callgrind, exact candidates only
    #[arg(long, requires = "callgrind")]
    exact: bool,
}

/// One line of the table.
struct Row<'a> {
    name: String,
    /// Runs one round.
    round: Box<dyn FnMut() + 'a>,
    times_us: Vec<f64>,
    /// Candidates a solve and the share of truths found, where that makes sense.
    quality: Option<(f64, f64)>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments = Arguments::parse();
    let noisy = Scenes::new(&arguments, 0.75)?;
    let solvers: &[SolverName] =
        if arguments.solvers.is_empty() { &SolverName::ALL } else { &arguments.solvers };
    let cells = Cell::of(solvers, usize::try_from(arguments.points)?);
    if let Some(solves) = arguments.callgrind {
        let cell = cells.get(usize::from(!arguments.exact)).ok_or("too few matches for this solver")?;
        only_solve(*cell, noisy.of(cell.solver), solves);
        return Ok(());
    }
    let clean = Scenes::new(&arguments, 0.0)?;
    let mut rows: Vec<_> = cells.iter().map(|&cell| solver_row(cell, &noisy, &clean)).collect();
    if arguments.points == 5 {
        #[cfg(feature = "peers")]
        rows.push(peer_row(&noisy.general, &clean.general));
        rows.push(stage_row(&noisy.general));
    }
    // The rounds of the rows take turns, so that a disturbance of the machine falls on all of them.
    for _ in 0..arguments.rounds {
        for row in &mut rows {
            let start = Instant::now();
            (row.round)();
            row.times_us.push(start.elapsed().as_secs_f64() * 1e6 / arguments.scenes as f64);
        }
    }
    println!(
        "{} matches, realistic general scenes, 0.75 px; {} scenes of seed {}, {} rounds\n",
        arguments.points, arguments.scenes, arguments.seed, arguments.rounds
    );
    println!("{}", table(&rows));
    Ok(())
}

/// The same scenes for every solver; those of a plane for `homography`, which knows no other.
struct Scenes {
    general: Vec<Scene>,
    planar: Vec<Scene>,
}

impl Scenes {
    fn new(arguments: &Arguments, noise_px: f64) -> Result<Self, Box<dyn Error>> {
        let points = usize::try_from(arguments.points)?;
        let of = |layout| -> Result<_, SceneError> {
            let options = SceneOptions { layout, noise_px, points, ..SceneOptions::realistic() };
            (0..arguments.scenes).map(|index| Scene::generate(&options, arguments.seed, index)).collect()
        };
        Ok(Self { general: of(Layout::General)?, planar: of(Layout::Coplanar)? })
    }

    fn of(&self, solver: SolverName) -> &[Scene] {
        if solver == SolverName::Homography { &self.planar } else { &self.general }
    }
}

fn only_solve(cell: Cell, scenes: &[Scene], solves: usize) {
    let mut out = Candidates::new();
    for scene in scenes.iter().cycle().take(solves) {
        cell.solve(black_box(&scene.matches), &mut out);
        black_box(out.len());
    }
}

fn solver_row<'a>(cell: Cell, noisy: &'a Scenes, clean: &Scenes) -> Row<'a> {
    let (noisy, clean) = (noisy.of(cell.solver), clean.of(cell.solver));
    let solve = |scene: &Scene| {
        let mut out = Candidates::new();
        cell.solve(&scene.matches, &mut out);
        out
    };
    let candidates = mean(noisy.iter().map(|s| solve(s).len() as f64));
    let is_found = |s: &&Scene| errors::rotation_error(&s.truth, &solve(s)) < errors::TOLERANCE;
    let found = clean.iter().filter(is_found).count() as f64 / clean.len() as f64;
    Row {
        name: format!("{}, {}", cell.solver_name(), cell.kinds_name()),
        round: Box::new(move || only_solve(cell, noisy, noisy.len())),
        times_us: Vec::new(),
        quality: Some((candidates, found)),
    }
}

/// The 10 × 35 matrix of section 6.
fn stage_row(noisy: &[Scene]) -> Row<'_> {
    let five: Vec<[Correspondence; 5]> =
        noisy.iter().filter_map(|s| s.matches.as_slice().try_into().ok()).collect();
    let round = move || {
        for matches in &five {
            black_box(constraint_matrix_5(black_box(matches)));
        }
    };
    Row {
        name: "constraint_matrix_5".to_owned(),
        round: Box::new(round),
        times_us: Vec::new(),
        quality: None,
    }
}

#[cfg(feature = "peers")]
fn peer_row<'a>(noisy: &'a [Scene], clean: &[Scene]) -> Row<'a> {
    use quest_benches::peers::{essential_error, kornia, kornia_problem};
    let problems: Vec<_> = noisy.iter().filter_map(|s| kornia_problem(&s.matches)).collect();
    let candidates = mean(problems.iter().map(|p| kornia(p).len() as f64));
    let is_found = |s: &&Scene| {
        let found = kornia_problem(&s.matches).map(|p| kornia(&p)).unwrap_or_default();
        essential_error(&s.truth, &found) < errors::TOLERANCE
    };
    let found = clean.iter().filter(is_found).count() as f64 / clean.len() as f64;
    let round = move || {
        for problem in &problems {
            black_box(kornia(black_box(problem)));
        }
    };
    Row {
        name: "kornia-3d essential_5pt (matrices, no poses)".to_owned(),
        round: Box::new(round),
        times_us: Vec::new(),
        quality: Some((candidates, found)),
    }
}

fn table(rows: &[Row]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN);
    table.set_header(["solver", "min µs", "median µs", "candidates", "truth found, no noise"]);
    for row in rows {
        let times = sorted(row.times_us.iter().copied());
        let (candidates, found) = row.quality.map_or_else(Default::default, |(candidates, found)| {
            (format!("{candidates:.2}"), format!("{:.2} %", 100.0 * found))
        });
        table.add_row([
            row.name.clone(),
            format!("{:.2}", percentile(&times, 0.0)),
            format!("{:.2}", percentile(&times, 0.5)),
            candidates,
            found,
        ]);
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}
