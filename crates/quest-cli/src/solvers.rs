//! `quest-cli solvers`: the table of solvers, each timed on the spot.

use std::hint::black_box;
use std::time::{Duration, Instant};

use clap::Args;
use comfy_table::Cell;
use quest_core::Candidates;
use quest_core::simulate::{Layout, Scene, SceneError, SceneOptions};
use quest_core::solver::{Kinds, SolverName};
use serde::Serialize;

use crate::{
    Failure, Outcome,
    options::{Format, OutputOptions},
    progress::PATIENCE,
    rows, table, words,
};

const EXAMPLES: &str = "\
The time is that of one solve on this machine, the shortest of many measurements. A solve computes the
real solutions as poses, with their scale and rank. The 100 scenes are realistic (coplanar for
homography), with 0.75 px of noise and as few matches as the solver needs. Other load on the machine
makes the time longer. All of it takes some seconds.

quest-literal and relinearization-literal are the paper's two algorithms as it prints them, on dense
matrices: for comparing with the paper. The others find the same solutions faster, and those that
these lose: the lines below the table, and the field lost of JSON and CSV, count them.

Examples:
  quest-cli solvers
  quest-cli solvers --format json
  quest-cli solvers --no-times";

/// The table of solvers: name, smallest number of matches, largest number of candidates, time of a solve, reference.
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Arguments {
    /// Do not measure, and leave out the times.
    #[arg(long)]
    no_times: bool,
    #[command(flatten)]
    output: OutputOptions,
}

#[derive(Serialize)]
struct SolverRecord {
    name: &'static str,
    min_matches: usize,
    max_candidates: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    time_us: Option<f64>,
    reference: &'static str,
    lost: &'static str,
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    // Ahead of the measurements: a target that cannot be written is known at once.
    let mut output = arguments.output.open()?;
    let is_silent = arguments.no_times || arguments.output.quiet;
    let (start, mut is_said) = (Instant::now(), is_silent);
    let record = |solver: SolverName| -> Result<_, SceneError> {
        let info = solver.info();
        if !is_said && start.elapsed() > PATIENCE {
            is_said = true;
            words::say("note", "measuring how long each solver takes; --no-times leaves that out");
        }
        Ok(SolverRecord {
            name: info.name,
            min_matches: info.min_matches,
            max_candidates: info.max_candidates,
            time_us: if arguments.no_times { None } else { Some(time_us(solver)?) },
            reference: info.reference,
            lost: info.lost,
        })
    };
    let records = SolverName::named().map(record).collect::<Result<Vec<_>, _>>()?;
    output.write(|writer| match arguments.output.format(Format::Table) {
        Format::Table => writeln!(writer, "{}", as_table(&records)),
        Format::Json => quest_io::write_json(writer, &records),
        Format::Jsonl => records.iter().try_for_each(|record| rows::write_line(writer, record)),
        Format::Csv => rows::write_csv(writer, &records),
    })?;
    output.finish()?;
    Ok(Outcome::Answer)
}

/// Scenes of a measurement.
const SCENES: u64 = 100;

/// How many scenes are timed together. A group takes long compared with reading the clock, and is short compared with the time
/// slices of other programs.
const GROUP: usize = 5;

const SEED: u64 = 2018;

/// How long one solver is measured.
const MEASURED: Duration = Duration::from_millis(40);

/// Microseconds of one solve, to the nanosecond, for the real solutions alone, which every solver has.
///
/// A disturbance can only make a measurement longer, so the shortest of many counts for each group of scenes. The first round
/// does not count, because it fills the caches.
fn time_us(solver: SolverName) -> Result<f64, SceneError> {
    let layout = if solver == SolverName::Homography { Layout::Coplanar } else { Layout::General };
    let points = solver.info().min_matches;
    let options = SceneOptions { layout, points, noise_px: 0.75, ..SceneOptions::realistic() };
    let scenes: Vec<_> =
        (0..SCENES).map(|index| Scene::generate(&options, SEED, index)).collect::<Result<_, _>>()?;
    let mut out = Candidates::new();
    let mut time = |group: &[Scene]| {
        let start = Instant::now();
        for scene in group {
            solver.solve(Kinds::Exact, black_box(&scene.matches), &mut out);
            black_box(&out);
        }
        start.elapsed()
    };
    time(&scenes);
    let start = Instant::now();
    let mut shortest: Vec<_> = scenes.chunks(GROUP).map(&mut time).collect();
    while start.elapsed() < MEASURED {
        for (shortest, group) in shortest.iter_mut().zip(scenes.chunks(GROUP)) {
            *shortest = time(group).min(*shortest);
        }
    }
    let nanoseconds = shortest.iter().sum::<Duration>().as_secs_f64() * 1e9 / scenes.len() as f64;
    Ok(nanoseconds.round() / 1e3)
}

fn as_table(records: &[SolverRecord]) -> String {
    let header = ["solver", "matches\nat least", "candidates\nat most", "time\nµs", "reference"];
    let mut table = table::empty(header);
    for record in records {
        table.add_row([
            Cell::new(record.name),
            table::right(record.min_matches),
            table::right(record.max_candidates),
            table::right(record.time_us.map_or_else(String::new, |time| format!("{time:.1}"))),
            Cell::new(record.reference),
        ]);
    }
    let lost = records.iter().filter(|r| !r.lost.is_empty());
    let lost: Vec<String> = lost.map(|r| format!("{} loses {}", r.name, r.lost)).collect();
    format!("{}\n\n{}", table.trim_fmt(), lost.join("\n"))
}
