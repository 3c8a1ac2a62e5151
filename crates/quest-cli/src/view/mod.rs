//! `quest-cli view`: a page that shows one pair in three dimensions, or its cameras and points as PLY.

mod estimated;
mod page;
mod scene;

use std::path::{Path, PathBuf};

use clap::Args;
use quest_core::{
    Candidate, Candidates,
    robust::Options,
    solver::{Kinds, SolverName},
};
use quest_io::{Fault, Output, Pair, ReadError, SolveRecord};

use crate::{Failure, Outcome, input::InputOptions, options::solver_parser, solve, tally::Tally, words};

const EXAMPLES: &str = "\
Examples:
  quest-cli view examples/points.json -o view.html
  quest-cli view examples/tiny_berlin_7in.json --all -o view.html
  quest-cli view examples/tumfr3_98072_98172.json --estimate -o view.html    matches with outliers
  quest-cli view examples/tumfr3_98072_98172.json --estimate -o scene.ply    for MeshLab, CloudCompare, Blender

The page shows both cameras, the rays, the points at their depths in the frame of camera 1, and the
residuals. Each candidate can be switched on and off. With --estimate it shows one pose as `quest-cli
estimate` finds it: inliers and outliers over both images, cameras and points, the second pose. The
page is one file of 5 MB that works without a network. A name that ends with .ply gets the cameras as
edges and the points as vertices in the frame of camera 1, of the best candidate or of the estimate.
It reads the files that `quest-cli solve` and `estimate` read, but not their results, which have no
matches. JSON Lines show their first pair.

Exit status: 0 a page, 1 no pose could be found, 2 bad input or arguments.";

/// A page that shows one pair in 3D: cameras, points and candidates.
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Arguments {
    #[command(flatten)]
    input: InputOptions,
    /// Write to this file, whole or not at all: .html a page, .ply the cameras and points.
    #[arg(short, long, value_name = "FILE.html|ply", value_parser = parse_output)]
    output: View,
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

/// What is written, and where.
#[derive(Clone, Debug)]
struct View {
    path: PathBuf,
    is_ply: bool,
}

fn parse_output(text: &str) -> Result<View, String> {
    let path = PathBuf::from(text);
    let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
    let is_ply = match extension.as_deref() {
        Some("ply") => true,
        Some("html" | "htm") => false,
        // A page to standard output or a device.
        None if text == "-" || path.starts_with("/dev") => false,
        _ => return Err("expected a name that ends with .html or .ply".to_owned()),
    };
    Ok(View { path, is_ply })
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
    let mut output = Output::open(Some(Path::new(&arguments.output.path)))?;
    let Some(pair) = input.next()? else {
        return Err(Failure::Arguments("found no pair, expected one".to_owned()));
    };
    if input.is_several() && !arguments.quiet && input.next()?.is_some() {
        words::say("note", &format!("{}: only this pair is shown", pair.place));
    }
    if arguments.estimate {
        let options = arguments.options(&pair)?;
        let Some(text) = estimated::text(&pair, &options, arguments.output.is_ply)? else {
            return Ok(Outcome::NoPose);
        };
        output.write(|w| w.write_all(text.as_bytes()))?;
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
        let mut tally = Tally::default();
        tally.count(Some(solve::refusal(&pair, &found, matches.len())));
        return tally.outcome();
    }
    let mut record = SolveRecord::new(pair.name.clone(), info.name, &matches, &found, &pair.truth);
    if !arguments.all {
        record.drop_unfeasible();
    }
    let focal_length = pair.focal_length();
    let solved = Solved { pair: &pair, matches, candidates, record, focal_length };
    let text = if arguments.output.is_ply { scene::space(&solved).to_ply() } else { page::html(&solved)? };
    output.write(|w| w.write_all(text.as_bytes()))?;
    output.finish()?;
    Ok(Outcome::Answer)
}

impl Arguments {
    /// The options of an estimate.
    fn options(&self, pair: &Pair) -> Result<Options, ReadError> {
        let options = Options { solver: self.solver, ..Options::default() };
        match (&pair.cameras, self.threshold) {
            (Some([camera1, camera2]), threshold) => {
                Ok(Options { threshold: threshold.unwrap_or(1.0), ..options.with_cameras(camera1, camera2) })
            }
            (None, Some(threshold)) => Ok(Options { threshold, ..options }),
            (None, None) => Err(pair.place.clone().error(Fault::NoThreshold)),
        }
    }
}
