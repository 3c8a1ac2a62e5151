//! `quest-cli estimate`: one pose from matches with outliers.

use std::io::{self, Write};
use std::time::Instant;

use clap::Args;
use quest_core::InputError;
use quest_core::robust::{self, EstimateError, Options, Priors};
use quest_core::solver::SolverName;
use quest_io::{EstimateRecord, Pair};

use crate::{
    Failure, Outcome, estimate_table,
    input::InputOptions,
    options::{OutputOptions, solver_parser},
    progress::Progress,
    rows, words,
    writer::{Record, Writer},
};

/// The threshold in pixels where none is given.
const THRESHOLD: f64 = 1.0;

const EXAMPLES: &str = "\
Examples:
  quest-cli estimate examples/tumfr3_98072_98172.json
  quest-cli estimate pair.json --threshold 1.5 --seed 7 --format json
  quest-cli estimate points.csv --threshold 0.001
  quest-cli estimate pairs.jsonl -o results.jsonl

Files are those of `quest-cli solve`. With scores the best matches are tried first.

Results:
  X2 = R X1 + t. The mean absolute depth over both views is 1, so |t| is the parallax.
  The model is general, planar (there may be a second pose, the runner-up), pure_rotation (no
  translation that stands clear of the noise) or degenerate; the evidence is the median
  residual of the inliers under each.
  The covariance is that of the rotation vector, in radians and in the frame of camera 2, and of t.
  The same seed gives the same answer.

Exit status:
  0 an answer, 1 no pose could be found (of JSON Lines: for one or more of the pairs),
  2 bad input or arguments.";

/// One pose from matches with outliers.
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Arguments {
    #[command(flatten)]
    input: InputOptions,
    /// Matches with a Sampson error below this are inliers: in pixels, 1 by default; without cameras in units of the
    /// plane z = 1, where it has to be given.
    #[arg(long, value_name = "PX", allow_negative_numbers = true)]
    threshold: Option<f64>,
    /// How sure to be that a sample without outliers was seen.
    #[arg(long, value_name = "P", allow_negative_numbers = true, default_value_t = Options::default().confidence)]
    confidence: f64,
    /// Draw at most so many samples.
    #[arg(long, value_name = "N", default_value_t = Options::default().max_iterations)]
    max_iterations: usize,
    /// The seed of the samples.
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u64,
    /// The solver of the samples; `quest-cli solvers` describes them.
    #[arg(long, value_name = "NAME", default_value = SolverName::default().info().name, value_parser = solver_parser())]
    solver: SolverName,
    #[command(flatten)]
    output: OutputOptions,
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let mut pairs = arguments.input.open(arguments.output.quiet)?;
    let is_lines = pairs.is_lines();
    let mut writer = Writer::open(&arguments.output, is_lines)?;
    let mut progress = Progress::new("pairs", arguments.output.quiet);
    let mut outcome = Outcome::Answer;
    while let Some(pair) = pairs.next()? {
        if let Outcome::NoPose = one_pair(arguments, &pair, is_lines, &mut writer)? {
            outcome = Outcome::NoPose;
        }
        progress.add(1);
    }
    progress.finish();
    writer.finish(is_lines)?;
    Ok(outcome)
}

impl Arguments {
    fn options(&self, pair: &Pair) -> Result<Options, Failure> {
        let options = Options {
            confidence: self.confidence,
            max_iterations: self.max_iterations,
            seed: self.seed,
            solver: self.solver,
            ..Options::default()
        };
        match (&pair.cameras, self.threshold) {
            (Some([camera1, camera2]), threshold) => {
                let threshold = threshold.unwrap_or(THRESHOLD);
                Ok(Options { threshold, ..options.with_cameras(camera1, camera2) })
            }
            (None, Some(threshold)) => Ok(Options { threshold, ..options }),
            (None, None) => Err(Failure::Arguments(format!(
                "{}: found no camera and no --threshold, expected a camera, or a threshold in units of the plane z = 1",
                pair.place
            ))),
        }
    }
}

fn one_pair(
    arguments: &Arguments,
    pair: &Pair,
    is_lines: bool,
    writer: &mut Writer<EstimateRecord>,
) -> Result<Outcome, Failure> {
    let matches = pair.correspondences()?;
    let options = arguments.options(pair)?;
    let start = Instant::now();
    let priors = Priors { scores: pair.scores.as_deref(), ..Priors::default() };
    let result = robust::estimate_with(&matches, &options, &priors);
    let elapsed_ms = start.elapsed().as_secs_f64() * 1e3;
    let (record, reason) = match result {
        Ok(estimate) => (EstimateRecord::new(pair.name.clone(), &estimate, &pair.truth, elapsed_ms), None),
        Err(EstimateError::Option { .. }) => return Err(Failure::Arguments(result_text(&result))),
        // One degenerate pair among the lines of a file is no reason to stop; a file that holds nothing else is bad input.
        Err(EstimateError::Input(error)) if !(is_lines && matches!(error, InputError::Degenerate(_))) => {
            return Err(pair.refuse(error).into());
        }
        Err(error) => {
            let reason = error.to_string();
            (EstimateRecord::no_pose(pair.name.clone(), reason.clone(), elapsed_ms), Some(reason))
        }
    };
    let name = pair.name.clone().unwrap_or_else(|| pair.place.to_string());
    let heading = words::one_line(&format!("{name}: {} matches{}", matches.len(), summary(&record)));
    writer.write(&heading, record, pair.focal_length())?;
    let Some(reason) = reason else { return Ok(Outcome::Answer) };
    words::say("no pose", &format!("{}: {reason}", pair.place));
    Ok(Outcome::NoPose)
}

fn result_text<T>(result: &Result<T, EstimateError>) -> String {
    result.as_ref().err().map(ToString::to_string).unwrap_or_default()
}

/// What the heading says beside the number of matches.
fn summary(record: &EstimateRecord) -> String {
    record.found.as_ref().map_or_else(
        || ", no pose".to_owned(),
        |found| format!(", {} inliers, {} iterations", found.inlier_count, found.iterations),
    )
}

impl Record for EstimateRecord {
    fn table(&self, focal_length: Option<f64>) -> Option<String> {
        estimate_table::text(self, if focal_length.is_some() { "px" } else { "z = 1" })
    }

    fn write_csv(&self, writer: &mut dyn Write, pair: usize) -> io::Result<()> {
        rows::write_estimate(writer, pair, self)
    }
}
