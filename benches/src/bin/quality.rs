//! How often every solver misses the truth without noise, what complex solutions bring with noise, and whether the
//! translation's length is the parallax: three tables in Markdown.
#![expect(clippy::print_stdout, reason = "a program for people: tables are its output")]

use std::error::Error;

use clap::{Parser, ValueEnum};
use comfy_table::{CellAlignment, Table, presets};
use quest_benches::cells::Cell;
use quest_benches::kinds::{self, SceneKind};
use quest_benches::statistics::{mean, percentile, sorted};
use quest_benches::{SEED, errors, parallel};
use quest_core::simulate::{Scene, SceneError, View};
use quest_core::solver::SolverName;
use quest_core::{Candidate, CandidateKind, Candidates};

/// Points beside the five of the sample, that choose a candidate without the truth.
const FURTHER_POINTS: usize = 30;
/// Failing scenes that are printed, of each row.
const PRINTED: usize = 5;

/// The answers of every solver against the truth, in three tables.
#[derive(Debug, Parser)]
struct Arguments {
    /// Scenes of a row
    #[arg(long, default_value_t = 100_000)]
    scenes: u64,
    /// Matches of a scene without noise, in the table of failures
    #[arg(long, default_value_t = 5)]
    points: usize,
    /// Seed of the scenes
    #[arg(long, default_value_t = SEED)]
    seed: u64,
    /// Only these solvers, separated by commas
    #[arg(long, value_delimiter = ',')]
    solvers: Vec<SolverName>,
    /// Only these tables, separated by commas
    #[arg(long, value_delimiter = ',', default_value = "failures,noise,length")]
    tables: Vec<Name>,
    /// Only kinds of scenes whose name contains this
    #[arg(long, default_value = "")]
    kind: String,
    /// Threads; the numbers do not depend on it
    #[arg(long, default_value_t = parallel::all_cores())]
    threads: usize,
}

/// A table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Name {
    /// Scenes without noise of which no candidate is the truth
    Failures,
    /// Errors with 0.75 px of noise, real solutions alone and all kinds
    Noise,
    /// The length of the translation divided by the parallax
    Length,
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = Arguments::parse();
    if arguments.solvers.is_empty() {
        arguments.solvers = SolverName::ALL.to_vec();
    }
    println!("{} scenes a row, seed {}", arguments.scenes, arguments.seed);
    for name in &arguments.tables {
        match name {
            Name::Failures => failures(&arguments)?,
            Name::Noise => noise(&arguments)?,
            Name::Length => length(&arguments)?,
        }
    }
    Ok(())
}

impl Arguments {
    /// `f` of every scene of a kind, in order.
    fn scenes<T: Send>(
        &self,
        kind: &SceneKind,
        f: impl Fn(&Scene) -> T + Sync,
    ) -> Result<Vec<T>, SceneError> {
        parallel::map(self.scenes, self.threads, |index| Ok(f(&kind.scene(self.seed, index)?)))
    }

    /// The solvers to which five matches are enough.
    fn five_point_solvers(&self) -> impl Iterator<Item = SolverName> {
        self.solvers.iter().copied().filter(|solver| solver.info().min_matches <= 5)
    }

    fn is_wanted(&self, kind: &SceneKind) -> bool {
        kind.name.contains(&self.kind)
    }
}

/// What one solve without noise is judged by.
#[derive(Clone, Copy, Debug)]
struct Judged {
    rotation: f64,
    pose: f64,
    candidates: usize,
}

fn judge(cell: Cell, scene: &Scene) -> Judged {
    let mut out = Candidates::new();
    cell.solve(&scene.matches, &mut out);
    Judged {
        rotation: errors::rotation_error(&scene.truth, &out),
        pose: errors::nearest(scene, &out).map_or(f64::INFINITY, |(_, error)| error),
        candidates: out.len(),
    }
}

fn failures(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let mut table =
        table(["scenes", "solver", "kinds", "R fails", "pose fails", "median R", "99.9 % R", "candidates"]);
    let cells = Cell::of(&arguments.solvers, arguments.points);
    let mut failing = Vec::new();
    let kinds = kinds::noise_free().into_iter().map(|kind| kind.with_points(arguments.points));
    for kind in kinds.filter(|kind| arguments.is_wanted(kind)) {
        let judge_all = |scene: &Scene| cells.iter().map(|&cell| judge(cell, scene)).collect::<Vec<_>>();
        let judged = arguments.scenes(&kind, judge_all)?;
        for (k, cell) in cells.iter().enumerate() {
            let rotation = sorted(judged.iter().map(|j| j[k].rotation));
            let indices = |error: fn(&Judged) -> f64| {
                let failed = move |(_, j): &(usize, &Vec<Judged>)| error(&j[k]) > errors::TOLERANCE;
                judged.iter().enumerate().filter(failed).map(|(index, _)| index).collect::<Vec<_>>()
            };
            let (by_rotation, by_pose) = (indices(|j| j.rotation), indices(|j| j.pose));
            table.add_row([
                kind.name.clone(),
                cell.solver_name().to_owned(),
                cell.kinds_name().to_owned(),
                by_rotation.len().to_string(),
                by_pose.len().to_string(),
                format!("{:.1e}", percentile(&rotation, 0.5)),
                format!("{:.1e}", percentile(&rotation, 0.999)),
                format!("{:.2}", mean(judged.iter().map(|j| j[k].candidates as f64))),
            ]);
            for (what, indices) in [("R", by_rotation), ("pose", by_pose)] {
                if !indices.is_empty() {
                    let first = &indices[..indices.len().min(PRINTED)];
                    let (solver, kinds) = (cell.solver_name(), cell.kinds_name());
                    failing.push(format!("- {}, {solver} ({kinds}), {what}: {first:?}", kind.name));
                }
            }
        }
    }
    println!("\n### Without noise\n");
    println!("{} matches a scene.", arguments.points);
    println!("R fails: no candidate within {:.0e} rad of the true rotation.", errors::TOLERANCE);
    println!(
        "Pose fails: none with max(error of R, |t| × error of t's direction) below 1e-6 × max(|t|, 1e-6).\n"
    );
    println!("{table}\n\nThe first failing scenes, by index:\n");
    println!("{}", if failing.is_empty() { "none".to_owned() } else { failing.join("\n") });
    Ok(())
}

/// Errors of one solve with noise: of the real solutions, then of all candidates.
#[derive(Clone, Copy, Debug)]
struct Noisy {
    /// The errors of the candidate nearest to the truth.
    best: [f64; 2],
    /// The errors of the candidate that fits the further points best.
    chosen: [f64; 2],
    candidates: [usize; 2],
}

fn judge_noisy(solver: SolverName, scene: &Scene) -> Noisy {
    let (five, further) = scene.matches.split_at(5);
    let judged = Cell::of(&[solver], 5).into_iter().map(|cell| {
        let mut out = Candidates::new();
        cell.solve(five, &mut out);
        let best = errors::rotation_error(&scene.truth, &out);
        let chosen = errors::chosen(&out, further);
        let chosen = chosen.map_or(f64::INFINITY, |c| scene.truth.rotation_error(&c.pose));
        (best, chosen, out.len())
    });
    let judged: Vec<_> = judged.collect();
    Noisy {
        best: [0, 1].map(|k| judged[k].0),
        chosen: [0, 1].map(|k| judged[k].1),
        candidates: [0, 1].map(|k| judged[k].2),
    }
}

/// Two errors and their ratio.
fn compared([exact, all]: [f64; 2]) -> [String; 3] {
    [format!("{exact:.5}"), format!("{all:.5}"), format!("{:.3}", all / exact)]
}

fn noise(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let mut table = table([
        "scenes",
        "solver",
        "best: exact",
        "all",
        "ratio",
        "chosen: exact",
        "all",
        "ratio",
        "candidates: exact",
        "all",
        "no exact",
    ]);
    for kind in kinds::noisy(5 + FURTHER_POINTS).iter().filter(|kind| arguments.is_wanted(kind)) {
        for solver in arguments.five_point_solvers() {
            let judged = arguments.scenes(kind, |scene| judge_noisy(solver, scene))?;
            let answered: Vec<_> = judged.iter().filter(|n| n.candidates[0] > 0).collect();
            let best = [0, 1].map(|k| mean(answered.iter().map(|n| n.best[k])));
            let chosen = [0, 1].map(|k| mean(answered.iter().map(|n| n.chosen[k])));
            let candidates = [0, 1].map(|k| mean(judged.iter().map(|n| n.candidates[k] as f64)));
            let mut row = vec![kind.name.clone(), solver.info().name.to_owned()];
            row.extend(compared(best));
            // Further points behind camera 2 cannot tell a pose from its twisted partner.
            let can_choose = kind.options.view == View::InBothImages;
            row.extend(if can_choose { compared(chosen) } else { ["–"; 3].map(str::to_owned) });
            row.extend(candidates.map(|n| format!("{n:.2}")));
            row.push((judged.len() - answered.len()).to_string());
            table.add_row(row);
        }
    }
    println!("\n### With 0.75 px of noise\n");
    println!(
        "Mean rotation error in rad of the candidate nearest to the truth (best) and of the one that explains"
    );
    println!("{FURTHER_POINTS} further points best (chosen): real solutions alone (exact), and all kinds.");
    println!("Scenes without a real solution (no exact) are left out of the errors.\n");
    println!("{table}");
    Ok(())
}

fn length(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let mut table = table(["parallax", "solver", "median |ratio − 1|", "99.9 %", "largest", "no pose"]);
    for (parallax, kind) in kinds::parallaxes().iter().filter(|(_, kind)| arguments.is_wanted(kind)) {
        for solver in arguments.five_point_solvers() {
            let off = arguments.scenes(kind, |scene| {
                let mut out = Candidates::new();
                solver.solve(quest_core::solver::Kinds::All, &scene.matches, &mut out);
                let with_length = |c: &&Candidate| c.kind != CandidateKind::RotationOnly;
                let poses: Vec<_> = out.iter().filter(with_length).copied().collect();
                let nearest = errors::nearest(scene, &poses);
                nearest.map(|(c, _)| (c.pose.t_21.norm() / parallax - 1.0).abs())
            })?;
            let errors = sorted(off.iter().flatten().copied());
            let mut row = vec![format!("{parallax:.0e}"), solver.info().name.to_owned()];
            row.extend([0.5, 0.999, 1.0].map(|p| format!("{:.1e}", percentile(&errors, p))));
            row.push((off.len() - errors.len()).to_string());
            table.add_row(row);
        }
    }
    println!("\n### The length of the translation\n");
    println!(
        "Realistic scenes without noise: |t| of the pose nearest to the truth, divided by the parallax.\n"
    );
    println!("{table}");
    Ok(())
}

fn table<const N: usize>(header: [&str; N]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN);
    table.set_header(header);
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}
