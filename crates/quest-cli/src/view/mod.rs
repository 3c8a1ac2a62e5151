//! `quest-cli view`: a page that shows one pair in three dimensions.

mod estimated;
mod page;
mod scene;

use std::path::PathBuf;

use clap::Args;
use quest_core::{
    Candidate, Candidates,
    robust::Options,
    solver::{Kinds, SolverName},
};
use quest_io::{Output, Pair, SolveRecord};

use crate::{Failure, Outcome, input::InputOptions, options::solver_parser, solve, words};

const EXAMPLES: &str = "\
Examples:
  quest-cli view examples/points.json -o view.html
  quest-cli view examples/tiny_berlin_7in.json --all -o view.html
  quest-cli view examples/tumfr3_98072_98172.json --estimate -o view.html    matches with outliers

The page shows both cameras, the rays, the points at their depths in the frame of camera 1, and the
residuals. Each candidate can be switched on and off. With --estimate it shows one pose as `quest-cli
estimate` finds it: inliers and outliers over both images, cameras and points, the second pose. The page is one file of 5 MB that works without
a network. It reads the files that `quest-cli solve` and `estimate` read, but not their results,
which have no matches. JSON Lines show their first pair.

Exit status: 0 a page, 1 no pose could be found, 2 bad input or arguments.";

/// A page that shows one pair in 3D: cameras, points and candidates.
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Arguments {
    #[command(flatten)]
    input: InputOptions,
    /// Write the page to this file, whole or not at all.
    #[arg(short, long, value_name = "FILE.html")]
    output: PathBuf,
    /// The solver; `quest-cli solvers` describes them.
    #[arg(long, value_name = "NAME", default_value = SolverName::default().info().name, value_parser = solver_parser())]
    solver: SolverName,
    /// Also show the candidates that have points behind a camera.
    #[arg(long, conflicts_with = "estimate")]
    all: bool,
    /// Show one pose from matches with outliers, as `quest-cli estimate` finds it.
    #[arg(long)]
    estimate: bool,
    /// Matches with a Sampson error below this are inliers: in pixels, 1 by default; without cameras in units of the plane z = 1,
    /// where it has to be given.
    #[arg(long, value_name = "PX", allow_negative_numbers = true, requires = "estimate")]
    threshold: Option<f64>,
    /// Write only errors, and why there is no pose, to standard error.
    #[arg(long)]
    quiet: bool,
}

/// A pair and its candidates.
struct Solved<'a> {
    pair: &'a Pair,
    matches: Vec<quest_core::Correspondence>,
    /// Those that are shown, best first.
    candidates: Vec<Candidate>,
    record: SolveRecord,
    /// The mean focal length in pixels. Without cameras residuals are angles.
    focal_length: Option<f64>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let mut input = arguments.input.open(arguments.quiet)?;
    let mut output = Output::open(Some(&arguments.output))?;
    let Some(pair) = input.next()? else {
        return Err(Failure::Arguments("found no pair, expected one".to_owned()));
    };
    if input.is_lines() && !arguments.quiet && input.next()?.is_some() {
        words::say("note", &format!("{}: only this pair is shown", pair.place));
    }
    if arguments.estimate {
        let Some(html) = estimated::html(&pair, &arguments.options(&pair)?)? else {
            return Ok(Outcome::NoPose);
        };
        output.write(|w| w.write_all(html.as_bytes()))?;
        output.finish()?;
        return Ok(Outcome::Answer);
    }
    let matches = solve::enough_matches(&pair, arguments.solver)?;
    let info = arguments.solver.info();
    let mut found = Candidates::new();
    arguments.solver.solve(Kinds::All, &matches, &mut found);
    let is_shown = |c: &&Candidate| arguments.all || c.in_front == matches.len();
    let candidates: Vec<Candidate> = found.iter().filter(is_shown).copied().collect();
    if candidates.is_empty() {
        return Ok(solve::no_pose(&pair, &found, matches.len()));
    }
    let mut record = SolveRecord::new(pair.name.clone(), info.name, &matches, &found, &pair.truth);
    if !arguments.all {
        record.drop_unfeasible();
    }
    let focal_length = pair.focal_length();
    let solved = Solved { pair: &pair, matches, candidates, record, focal_length };
    let html = page::html(&solved)?;
    output.write(|w| w.write_all(html.as_bytes()))?;
    output.finish()?;
    Ok(Outcome::Answer)
}

impl Arguments {
    /// The options of an estimate.
    fn options(&self, pair: &Pair) -> Result<Options, Failure> {
        let options = Options { solver: self.solver, ..Options::default() };
        match (&pair.cameras, self.threshold) {
            (Some([camera1, camera2]), threshold) => {
                Ok(Options { threshold: threshold.unwrap_or(1.0), ..options.with_cameras(camera1, camera2) })
            }
            (None, Some(threshold)) => Ok(Options { threshold, ..options }),
            (None, None) => Err(Failure::Arguments(format!(
                "{}: found no camera and no --threshold, expected a camera, or a threshold in units of the plane z = 1",
                pair.place
            ))),
        }
    }
}
