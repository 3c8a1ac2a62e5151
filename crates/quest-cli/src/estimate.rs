//! `quest-cli estimate`: one pose from matches with outliers.

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::{Args, ValueEnum};
use quest_core::correspondence::Usable;
use quest_core::robust::{self, Estimate, EstimateError, KnownDirection, Options, Priors, ThirdView};
use quest_core::{Correspondence, InputError, RelativePose};
use quest_io::{EstimateRecord, Fault, Pair, ReadError, ThirdViewRecord};

use crate::{
    Failure, Outcome,
    estimate_options::{EstimateOptions, OfEstimate, parse_direction, parse_pose},
    estimate_table,
    in_order::in_order,
    input::{InputsOptions, Unread},
    options::OutputOptions,
    progress::ProgressOptions,
    resume::{Task, Tasks},
    rows,
    tally::{Refusal, Tally},
    words,
    writer::{Record, Writer},
};

/// The threshold in pixels where none is given.
const THRESHOLD: f64 = 1.0;

/// A threshold in pixels below which hardly any matches agree: half the noise of the best of them, optical flow of a sharp video.
const NARROW: f64 = 0.05;

const EXAMPLES: &str = "\
Examples:
  quest-cli estimate examples/tumfr3_98072_98172.json
  quest-cli estimate pair.json --threshold 1.5 --seed 7 --format json
  quest-cli estimate points.csv --threshold 0.001
  quest-cli estimate pairs.jsonl -o results.jsonl
  quest-cli estimate 'pairs/*.npz' --camera1 PINHOLE,640,480,500,500,320,240 -o results.jsonl
  quest-cli estimate pairs.jsonl -o results.jsonl --resume     after it was ended
  quest-cli estimate pairs.parquet -o poses.parquet            built with --features parquet
  quest-cli estimate views12.json --third views13.json

Files are those of `quest-cli solve`, whose help describes them; several of them, folders and patterns are
read one after the other. With scores the best matches are tried first. All cores work on the pairs of
JSON Lines and of several files; the results are in their order.
With --third the poses of views 1 and 2 and of views 1 and 3 are chosen so that the depths of their
common points agree; a point is common where its numbers in view 1 are the same.

Results:
  X2 = R X1 + t. The mean absolute depth over both views is 1, so |t| is the parallax.
  The model is general, planar or pure_rotation (no translation that stands clear of the noise);
  the evidence is the median residual of the inliers under each. A plane may have a second pose that the
  noise does not rule out, the runner-up, and so may a camera that hardly moved.
  In the table `about` is the axis of the rotation, `score` how well the pose explains all matches, from 0 to 1, and the
  noise the standard deviation of the inliers' errors.
  Matches that determine no pose, such as points on a line, are bad input. Among several pairs their model is
  degenerate, with a reason and without a pose. No line and no file stops the others: one that cannot be
  read gets a record with its reason, in CSV in the last column. With -o each record of JSON Lines is kept in FILE.part as it comes, and
  FILE.part becomes FILE at the end. --resume needs JSON Lines: it keeps the records with a pose, tries the pairs without one again, each in its
  place, and goes on after them. A record whose pair is not that of the input, or has another answer under these options, is an
  error, and nothing is written; the first four poses are estimated again to see it.
  A pixel without a viewing ray is an outlier, and so is a match with a coordinate that is NaN, infinite or
  missing (null in JSON, an empty field in CSV). invalid_count tells how many there are.
  The covariance is that of the rotation vector, in radians and in the frame of camera 2, and of t.
  The same seed gives the same answer; each of several pairs has random numbers of its own.

Exit status:
  0 an answer, 1 no pose could be found (of several pairs: for one or more of them),
  2 bad input or arguments (of several pairs: none of them could be read).";

/// One pose from matches with outliers.
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Arguments {
    #[command(flatten)]
    input: InputsOptions,
    #[command(flatten)]
    search: EstimateOptions<OfEstimate>,
    /// A pose to begin with: a quaternion, scalar first, and a translation, whose length plays no part.
    #[arg(long, value_name = "W,X,Y,Z,TX,TY,TZ", allow_hyphen_values = true, value_parser = parse_pose)]
    initial_pose: Option<RelativePose>,
    /// A direction that both cameras know, such as gravity, or the axis about which a robot turns, which is the same in both. Poses
    /// that turn one further than DEG degrees from the other are neither the answer nor the second pose.
    #[arg(long, value_name = "X1,Y1,Z1[,X2,Y2,Z2],DEG", allow_hyphen_values = true, value_parser = parse_direction)]
    known_direction: Option<KnownDirection>,
    /// The matches of view 1 with a third view. Where two poses are possible, the one that agrees with them is taken.
    #[arg(long, value_name = "FILE")]
    third: Option<PathBuf>,
    /// What to do with a match that has no bearing: a pixel without a viewing ray, or NaN.
    #[arg(long, value_enum, default_value = "outlier")]
    invalid: Invalid,
    /// The number of threads, 0 for all of the machine's; pairs are divided among them.
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    /// The number of the first pair. A part of a larger input that begins with this pair has the same answers as there.
    #[arg(long, value_name = "K", default_value_t = 0)]
    first_index: u64,
    /// Go on with a run that was ended: keep the poses that it wrote to -o, which is JSON Lines, and estimate the other pairs. Records of
    /// another input, or of other options, are an error.
    #[arg(long, requires = "output")]
    resume: bool,
    #[command(flatten)]
    progress: ProgressOptions,
    #[command(flatten)]
    output: OutputOptions,
}

/// What becomes of a match without a bearing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Invalid {
    /// It is an outlier.
    Outlier,
    /// Its pair has no pose.
    Pair,
    /// It is bad input, which ends the run.
    Raise,
}

/// The result of one pair.
struct Estimated {
    heading: String,
    record: EstimateRecord,
    focal_length: Option<f64>,
    /// Why there is no pose.
    refusal: Option<Refusal>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let mut pairs = arguments.input.open(&arguments.output)?;
    let is_several = pairs.is_several();
    arguments.check(is_several)?;
    let (mut writer, earlier) = Writer::open_long(&arguments.output, is_several, arguments.resume)?;
    let progress = arguments.progress.start("pairs", None, arguments.output.quiet);
    let mut tally = Tally::default();
    let numbered = (arguments.first_index..).map_while(|index| {
        let pair = pairs.next().transpose()?;
        // The key of the file seeds the search, where it has one.
        let key = match &pair {
            Ok(pair) => pair.key,
            Err(error) => error.key,
        };
        Some((key.unwrap_or(index), pair.map_err(|error| pairs.alone(error))))
    });
    let done = in_order(
        arguments.threads,
        Tasks::new(numbered, earlier),
        |task| carry_out(arguments, task, is_several),
        |done: Result<Done, Failure>| {
            match done? {
                Done::Estimated(estimated) => {
                    let Estimated { heading, record, focal_length, refusal } = *estimated;
                    writer.write(&heading, record, focal_length)?;
                    tally.count(refusal);
                    progress.add(1);
                }
                Done::Kept(line) => {
                    writer.keep(&line)?;
                    tally.count(None);
                }
                Done::Settled => writer.settle()?,
            }
            Ok::<_, Failure>(())
        },
    );
    progress.finish();
    // What was answered is kept, whatever ended the run; of one pair there is nothing. Where it could not be written it ends within a
    // line, and stays in the part.
    let is_whole = !matches!(done, Err(Failure::Write(_)));
    if is_whole && (is_several || done.is_ok()) {
        writer.finish(is_several)?;
    }
    done?;
    tally.outcome()
}

/// What became of a task.
enum Done {
    Estimated(Box<Estimated>),
    /// The line of a record of an earlier run.
    Kept(Vec<u8>),
    /// All of its records are this run's own.
    Settled,
}

fn carry_out(arguments: &Arguments, task: Task, is_several: bool) -> Result<Done, Failure> {
    let estimated = match task {
        Task::Estimate(numbered) => match *numbered {
            (index, Ok(pair)) => one_pair(arguments, index, pair, is_several)?,
            (index, Err(Ok(unread))) => Estimated::unreadable(index, unread),
            (_, Err(Err(error))) => return Err(error.into()),
        },
        Task::Keep(line) => return Ok(Done::Kept(line)),
        Task::Compare(comparison) => {
            let again = |index, pair| Ok(one_pair(arguments, index, pair, is_several)?.record);
            return comparison.kept(again).map(Done::Kept);
        }
        Task::Settle => return Ok(Done::Settled),
        Task::Refuse(failure) => return Err(failure),
    };
    Ok(Done::Estimated(Box::new(estimated)))
}

impl Estimated {
    /// A line or a file that is no pair.
    fn unreadable(key: u64, unread: Unread) -> Self {
        let heading = unread.heading();
        let Unread { name, error } = unread;
        let record = EstimateRecord { key, ..EstimateRecord::unanswered(name, error.to_string()) };
        Self { heading, record, focal_length: None, refusal: Some(Refusal::Unreadable(error)) }
    }
}

impl Arguments {
    fn options(&self, pair: &Pair, index: u64) -> Result<Options, ReadError> {
        match (&pair.cameras, self.search.threshold) {
            (Some([camera1, camera2]), threshold) => {
                let options = self.search.options(threshold.unwrap_or(THRESHOLD), index);
                Ok(options.with_cameras(camera1, camera2))
            }
            (None, Some(threshold)) => Ok(self.search.options(threshold, index)),
            (None, None) => Err(pair.place.clone().error(Fault::NoThreshold)),
        }
    }

    /// What to say where no pose was found and the threshold is likely in another unit than the pixels that it is taken for.
    fn narrow(&self, pair: &Pair, error: &EstimateError) -> String {
        match (error, self.search.threshold, &pair.cameras) {
            (EstimateError::NoPose { .. }, Some(threshold), Some(_)) if threshold < NARROW => format!(
                "; the threshold of {threshold} is less than the noise of nearly all matches: with cameras it is in pixels, \
                 without them in units of the plane z = 1"
            ),
            _ => String::new(),
        }
    }

    /// What cannot be asked of such an input.
    fn check(&self, is_several: bool) -> Result<(), Failure> {
        self.search.check()?;
        let refuse = |what: &str| Err(Failure::Arguments(what.to_owned()));
        match (is_several, &self.third, &self.initial_pose, &self.known_direction) {
            (true, Some(_), ..) => refuse("found several pairs and --third, expected one pair"),
            (true, _, Some(_), _) => refuse("found several pairs and --initial-pose, expected one pair"),
            (_, Some(_), Some(_), _) => refuse("found --third and --initial-pose, expected one of them"),
            (_, Some(_), _, Some(_)) => refuse("found --third and --known-direction, expected one of them"),
            _ => Ok(()),
        }
    }
}

fn one_pair(
    arguments: &Arguments,
    index: u64,
    mut pair: Pair,
    is_several: bool,
) -> Result<Estimated, Failure> {
    let usable = pair.usable();
    // Ten million matches need not be there twice.
    let match_count = std::mem::take(&mut pair.matches).len();
    let options = match arguments.options(&pair, index) {
        Err(error) if is_several => {
            return Ok(Estimated::unreadable(index, Unread { name: pair.name.clone(), error }));
        }
        options => options?,
    };
    let third = arguments.third.as_deref().map(|file| third(arguments, file)).transpose()?;
    let start = Instant::now();
    let result = match (usable.error(), arguments.invalid) {
        (Some(error), Invalid::Raise) => {
            let gap = pair.first_gap.clone().map(ReadError::from);
            return Err(gap.unwrap_or_else(|| pair.refuse(error)).into());
        }
        (Some(error), Invalid::Pair) => Err(error.into()),
        _ => search(arguments, &pair, &usable, &options, third.as_ref()),
    };
    let elapsed_ms = start.elapsed().as_secs_f64() * 1e3;
    let (record, reason) = match result {
        Ok((estimate, third)) => (found(&pair, &estimate, third.as_ref(), elapsed_ms), None),
        Err(error @ EstimateError::Option { .. }) => return Err(Failure::Arguments(error.to_string())),
        // One pair of a file that has no pose is no reason to stop; a file that holds nothing else is bad input.
        Err(EstimateError::Input(error)) if !(is_several || matches!(error, InputError::Match { .. })) => {
            let left_out = left_out(match_count, &usable);
            return Err(Failure::Arguments(format!("{}{left_out}", pair.refuse(error))));
        }
        Err(error) => {
            let record = EstimateRecord::no_pose(pair.name.clone(), &error, elapsed_ms);
            let left_out = left_out(match_count, &usable);
            let reason = format!("{error}{}{left_out}", arguments.narrow(&pair, &error));
            (EstimateRecord { reason: Some(reason.clone()), ..record }, Some(reason))
        }
    };
    let record = EstimateRecord { key: index, match_count, invalid_count: usable.invalid.len(), ..record };
    let name = pair.name.clone().unwrap_or_else(|| pair.place.to_string());
    let heading = words::one_line(&format!("{name}: {match_count} matches{}", summary(&record)));
    let why = reason.as_deref().map(words::after_no_pose);
    let refusal = why.map(|why| Refusal::NoPose(format!("{}: {why}", pair.place)));
    Ok(Estimated { heading, record, focal_length: pair.focal_length(), refusal })
}

/// What to say of the matches without a bearing where there is no pose.
fn left_out(match_count: usize, usable: &Usable) -> String {
    match usable.invalid.len() {
        0 => String::new(),
        invalid => format!("; {invalid} of {match_count} matches had no bearing and were left out"),
    }
}

/// The estimate of the usable matches of a pair, its inliers among all of them.
fn search(
    arguments: &Arguments,
    pair: &Pair,
    usable: &Usable,
    options: &Options,
    third: Option<&(Vec<Correspondence>, Options)>,
) -> Result<(Estimate, Option<ThirdView>), EstimateError> {
    let Some((others, others_options)) = third else {
        let scores = pair.scores.as_ref().map(|scores| usable.keep(scores));
        let (pose, direction) = (arguments.initial_pose, arguments.known_direction);
        let priors = Priors { scores: scores.as_deref(), pose, direction };
        let mut estimate = robust::estimate_with(&usable.matches, options, &priors)?;
        estimate.inliers = usable.spread(&estimate.inliers);
        return Ok((estimate, None));
    };
    let mut found = robust::estimate_with_third_view(&usable.matches, options, others, others_options)?;
    found.estimate_21.inliers = usable.spread(&found.estimate_21.inliers);
    Ok((found.estimate_21.clone(), Some(found)))
}

/// The matches of view 1 with a third view.
fn third(arguments: &Arguments, file: &Path) -> Result<(Vec<Correspondence>, Options), Failure> {
    let Some(pair) = arguments.input.open_other(file, arguments.output.quiet)?.next()? else {
        return Err(Failure::Arguments(format!("{}: found no pair, expected one", file.display())));
    };
    // Random numbers of its own.
    Ok((pair.usable().matches, arguments.options(&pair, 1)?))
}

fn found(pair: &Pair, estimate: &Estimate, third: Option<&ThirdView>, elapsed_ms: f64) -> EstimateRecord {
    let record = EstimateRecord::new(pair.name.clone(), estimate, &pair.truth, elapsed_ms);
    EstimateRecord { third_view: third.map(ThirdViewRecord::new), ..record }
}

/// What the heading says beside the number of matches.
fn summary(record: &EstimateRecord) -> String {
    record.found.as_ref().map_or_else(
        || ", no pose".to_owned(),
        |found| {
            let invalid = match record.invalid_count {
                0 => String::new(),
                count => format!(", {count} without a bearing"),
            };
            format!(", {} inliers, {} iterations{invalid}", found.inlier_count, found.iterations)
        },
    )
}

impl Record for EstimateRecord {
    fn table(&self, focal_length: Option<f64>) -> Option<String> {
        estimate_table::text(self, if focal_length.is_some() { "px" } else { "z = 1" })
    }

    fn write_csv(&self, writer: &mut dyn Write, pair: usize) -> io::Result<()> {
        rows::write_estimate(writer, pair, self)
    }

    fn as_estimate(&self) -> Option<&EstimateRecord> {
        Some(self)
    }
}
