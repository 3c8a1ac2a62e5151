//! `quest-cli solve`: candidate poses from five or more correct matches.

use std::io::{self, Write};

use clap::Args;
use quest_core::{
    Candidates, Correspondence, Degeneracy, InputError,
    solver::{Kinds, SolverName},
};
use quest_io::{Pair, ReadError, SolveRecord};

use crate::{
    Failure, Outcome, candidate_table,
    input::InputOptions,
    options::{OutputOptions, kinds_parser, solver_parser},
    rows, words,
    writer::{Record, Writer},
};

const EXAMPLES: &str = "\
Examples:
  quest-cli solve examples/points.json
  quest-cli solve examples/points.json --all --kinds exact
  quest-cli solve examples/points.csv --format json
  quest-cli solve pixels.csv --camera1 PINHOLE,1024,768,1060,1060,514,384
  quest-cli solve - < pair.json
  quest-cli solve pairs.jsonl -o results.jsonl

Files:
  JSON: one object, a pair. Only \"matches\" is needed; q_21 (w, x, y, z) and t_21 are the truth.
    {\"name\": \"a\", \"matches\": [[u1, v1, u2, v2], …], \"scores\": […], \"camera1\": {\"model\": \"PINHOLE\",
     \"width\": 1024, \"height\": 768, \"params\": [1060, 1060, 514, 384]}, \"camera2\": {…},
     \"q_21\": […], \"t_21\": […]}
  JSON Lines: one such object a line.
  CSV: the header u1,v1,u2,v2[,score], one match a row.
  Without cameras the points are on the plane z = 1.

Results:
  X2 = R X1 + t. The mean absolute depth over both views is 1, so |t| is the parallax.
  --format chooses the format. Without it the extension of -o does; without both, the
  results of JSON Lines are JSON Lines, and others are a table.
  Results of JSON Lines are written one by one up to the first bad line. With -o or with
  --format json nothing is written if a line is bad.

Exit status:
  0 an answer, 1 no pose could be found (of JSON Lines: for one or more of the pairs),
  2 bad input or arguments.";

/// Candidate poses from five or more correct matches.
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Arguments {
    #[command(flatten)]
    input: InputOptions,
    /// The solver; `quest-cli solvers` describes them.
    #[arg(long, value_name = "NAME", default_value = SolverName::default().info().name, value_parser = solver_parser())]
    solver: SolverName,
    /// Which candidates to compute. `exact`: real solutions only. `all`: also the real parts of complex solutions, and the
    /// rotation alone. `planar`: as `all`, with the motions of a plane if a plane explains the matches.
    #[arg(long, value_name = "KINDS", default_value = Kinds::default().name(), value_parser = kinds_parser())]
    kinds: Kinds,
    /// Also list the candidates that have points behind a camera.
    #[arg(long)]
    all: bool,
    #[command(flatten)]
    output: OutputOptions,
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let mut pairs = arguments.input.open(arguments.output.quiet)?;
    let is_lines = pairs.is_lines();
    let mut writer = Writer::open(&arguments.output, is_lines)?;
    let mut outcome = Outcome::Answer;
    while let Some(pair) = pairs.next()? {
        if let Outcome::NoPose = one_pair(arguments, &pair, is_lines, &mut writer)? {
            outcome = Outcome::NoPose;
        }
    }
    writer.finish(is_lines)?;
    Ok(outcome)
}

fn one_pair(
    arguments: &Arguments,
    pair: &Pair,
    is_lines: bool,
    writer: &mut Writer<SolveRecord>,
) -> Result<Outcome, Failure> {
    let info = arguments.solver.info();
    let matches = enough_matches(pair, arguments.solver)?;
    let mut found = Candidates::new();
    arguments.solver.solve(arguments.kinds, &matches, &mut found);
    // One degenerate pair among the lines of a file is no reason to stop; a file that holds nothing else is bad input.
    if let (false, true, Some(degeneracy)) = (is_lines, found.is_empty(), found.degeneracy()) {
        return Err(pair.refuse(InputError::Degenerate(degeneracy)).into());
    }

    let mut record = SolveRecord::new(pair.name.clone(), info.name, &matches, &found, &pair.truth);
    let hidden = if arguments.all { 0 } else { record.drop_unfeasible() };
    let heading = heading(pair, &record, found.degeneracy());
    let is_empty = record.candidates.is_empty();
    writer.write(&heading, record, pair.focal_length())?;

    if is_empty {
        return Ok(no_pose(pair, &found, matches.len()));
    }
    if hidden > 0 && !arguments.output.quiet {
        let what = if hidden == 1 { "candidate with points" } else { "candidates with points" };
        words::say(
            "note",
            &format!("{}: {hidden} {what} behind a camera not listed, --all lists them", pair.place),
        );
    }
    Ok(Outcome::Answer)
}

/// The matches of a pair, at least as many as the solver needs.
pub(crate) fn enough_matches(pair: &Pair, solver: SolverName) -> Result<Vec<Correspondence>, ReadError> {
    let matches = pair.correspondences()?;
    let (found, needed) = (matches.len(), solver.info().min_matches);
    if found < needed {
        return Err(pair.refuse(InputError::TooFewMatches { found, needed }));
    }
    Ok(matches)
}

/// Says why no candidate of a solver is shown.
pub(crate) fn no_pose(pair: &Pair, found: &Candidates, matches: usize) -> Outcome {
    let why = match (found.iter().map(|c| c.in_front).max(), found.degeneracy()) {
        (Some(most), _) => format!(
            "none of the {} candidates has all {matches} points in front of both cameras, the best has {most}; --all \
             lists them",
            found.len()
        ),
        (None, Some(degeneracy)) => degeneracy.to_string(),
        (None, None) => "the solver found no candidate".to_owned(),
    };
    words::say("no pose", &format!("{}: {why}", pair.place));
    Outcome::NoPose
}

/// The line above the table.
fn heading(pair: &Pair, record: &SolveRecord, degeneracy: Option<Degeneracy>) -> String {
    let name = record.name.clone().unwrap_or_else(|| pair.place.to_string());
    let degeneracy = degeneracy.map(|d| format!(", {d}")).unwrap_or_default();
    words::one_line(&format!("{name}: {} matches, solver {}{degeneracy}", record.matches, record.solver))
}

impl Record for SolveRecord {
    fn table(&self, focal_length: Option<f64>) -> Option<String> {
        (!self.candidates.is_empty()).then(|| candidate_table::text(self, focal_length))
    }

    fn write_csv(&self, writer: &mut dyn Write, pair: usize) -> io::Result<()> {
        rows::write_candidates(writer, pair, self)
    }
}
