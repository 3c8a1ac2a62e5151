//! `quest-cli colmap verify`: the two-view geometries of a database.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use quest_colmap::{
    Config, Database, Existing, PairReport, Report, Summary, Uncalibrated, VerifyOptions, read_pairs, verify,
};
use quest_io::Output;

use super::{OfColmap, Shown};
use crate::{
    Failure, Outcome,
    estimate_options::EstimateOptions,
    options::{Format, OutputOptions},
    rows,
};

const EXAMPLES: &str = "\
Examples:
  quest-cli colmap verify database.db                           every pair that has matches
  quest-cli colmap verify database.db --pairs pairs.txt --resume
  quest-cli colmap verify database.db --dry-run --report pairs.csv
  colmap mapper --database_path database.db --image_path images --output_path sparse

It stands where COLMAP's own verification does: after the matches are in the database, ahead of the mapper.
Databases of COLMAP 3.6 to 4.2 are read as they are; only the table two_view_geometries is written, in one
transaction: a run that is killed, or finds the disk full, leaves the database as it was.

Results:
  A pair of too few inliers gets an empty row, as from COLMAP. Planar pairs and pure rotations are told
  apart; a watermark is one shift of the images' border.
  The threshold of 4 px is COLMAP's and gives as many points; 2 px gives purer inliers.
  With cameras whose focal length is a guess (prior_focal_length = 0) there is no pose to be had: they are
  left to COLMAP, or, with --uncalibrated guess, get a fundamental matrix that is fitted to the pixels.
  A calibrated camera is declared by UPDATE cameras SET prior_focal_length = 1 in the database, or in pycolmap by
  camera.has_prior_focal_length = True.
  The same seed gives the same rows, whatever the number of threads and whichever other pairs there are.

Exit status:
  0 the database was verified, 1 no pair has a pose or another geometry, 2 bad input or arguments, or a database that could
  not be written.";

/// Verify the image pairs of a COLMAP database: inliers, models and poses into its two-view geometries.
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(super) struct Arguments {
    /// The database.
    database: PathBuf,
    /// Only the pairs of this file: the names of two images a line.
    #[arg(long, value_name = "FILE")]
    pairs: Option<PathBuf>,
    /// Pairs with fewer inliers have no pose.
    #[arg(long, value_name = "N", default_value_t = VerifyOptions::default().min_inliers)]
    min_inliers: usize,
    /// Pairs with a smaller part of inliers have no pose.
    #[arg(long, value_name = "R", allow_negative_numbers = true, default_value_t = VerifyOptions::default().min_inlier_ratio)]
    min_inlier_ratio: f64,
    #[command(flatten)]
    search: EstimateOptions<OfColmap>,
    /// Replace the rows of pairs that have been verified before.
    #[arg(long, conflicts_with = "resume")]
    overwrite: bool,
    /// Leave the rows of pairs that have been verified before, and verify the others.
    #[arg(long)]
    resume: bool,
    /// What to do with pairs whose focal lengths are a guess.
    #[arg(long, value_enum, default_value = "skip")]
    uncalibrated: UncalibratedName,
    /// The part of the inliers that one shift of the border has to explain for a watermark; above 1 for never.
    #[arg(long, value_name = "R", allow_negative_numbers = true, default_value_t = VerifyOptions::default().watermark)]
    watermark: f64,
    /// The number of threads, 0 for all of the machine's.
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    /// Write nothing into the database.
    #[arg(long)]
    dry_run: bool,
    /// Write what was found of every pair to this file: .json, .jsonl or .csv.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    #[command(flatten)]
    output: OutputOptions,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum UncalibratedName {
    /// Leave them to COLMAP.
    Skip,
    /// Search with the guess, write a matrix that fits the pixels.
    Guess,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    // Targets that cannot be written are known ahead of the work.
    let mut output = arguments.output.open()?;
    let mut file = arguments.report.as_deref().map(|path| Output::open(Some(path))).transpose()?;
    let options = arguments.options()?;
    let mut database = Database::open(&arguments.database)?;
    let shown = Shown::new(arguments.output.quiet);
    let report = verify(&mut database, &options, &shown);
    shown.progress.finish();
    let report = report.map_err(|error| super::of_list(error, arguments.pairs.as_deref()))?;
    if let (Some(file), Some(path)) = (&mut file, &arguments.report) {
        let format = extension(path);
        file.write(|writer| write(writer, &report, format))?;
    }
    let format = arguments.output.format(Format::Table);
    output.write(|writer| write(writer, &report, format))?;
    file.map_or(Ok(()), Output::finish)?;
    output.finish()?;
    if report.summary.pairs == 0 {
        super::say_empty(&arguments.database);
    }
    let nothing = report.summary.verified == 0 && report.summary.resumed == 0;
    Ok(if nothing { Outcome::NoPose } else { Outcome::Answer })
}

impl Arguments {
    fn options(&self) -> Result<VerifyOptions, Failure> {
        Ok(VerifyOptions {
            pairs: self.pairs.as_deref().map(read_pairs).transpose()?,
            search: self.search.for_colmap(),
            min_inliers: self.min_inliers,
            min_inlier_ratio: self.min_inlier_ratio,
            existing: match (self.overwrite, self.resume) {
                (true, _) => Existing::Overwrite,
                (_, true) => Existing::Resume,
                _ => Existing::Refuse,
            },
            uncalibrated: match self.uncalibrated {
                UncalibratedName::Skip => Uncalibrated::Skip,
                UncalibratedName::Guess => Uncalibrated::Guess,
            },
            watermark: self.watermark,
            threads: self.threads,
            dry_run: self.dry_run,
        })
    }
}

/// The format of a report: JSON Lines where the extension says nothing else.
fn extension(path: &Path) -> Format {
    match quest_io::Format::from_extension(path) {
        Some(quest_io::Format::Json) => Format::Json,
        Some(quest_io::Format::Csv) => Format::Csv,
        _ => Format::Jsonl,
    }
}

fn write(writer: &mut dyn Write, report: &Report, format: Format) -> io::Result<()> {
    match format {
        Format::Table => writeln!(writer, "{}", text(&report.summary)),
        Format::Json => quest_io::write_json(writer, report),
        Format::Jsonl => report.pairs.iter().try_for_each(|pair| rows::write_line(writer, pair)),
        Format::Csv => {
            let header = COLUMNS.map(str::to_owned).to_vec();
            rows::write_rows(writer, std::iter::once(header).chain(report.pairs.iter().map(row)))
        }
    }
}

/// What becomes of cameras that nobody declared calibrated, which is pycolmap's default.
const GUESSED: &str = "have a guessed focal length (prior_focal_length is 0), left to COLMAP
              where the cameras are calibrated, declare it: UPDATE cameras SET prior_focal_length = 1
              (pycolmap: camera.has_prior_focal_length = True); where not: --uncalibrated guess";

/// What the pairs have that are not without: rows that are fitted to pixels hold no pose.
fn what(summary: &Summary) -> &'static str {
    let of_pixels = [Config::Uncalibrated, Config::PlanarOrPanoramic].map(Config::name);
    if of_pixels.iter().any(|name| summary.configs.contains_key(name)) {
        "with geometry"
    } else {
        "with a pose  "
    }
}

fn text(summary: &Summary) -> String {
    let configs: Vec<_> = summary.configs.iter().map(|(name, count)| format!("{count} {name}")).collect();
    let mut lines = vec![
        format!("pairs         {}", summary.pairs),
        format!(
            "{} {}, {} inliers of {} matches",
            what(summary),
            summary.verified,
            summary.inliers,
            summary.matches
        ),
        format!("without       {}", summary.rejected),
        format!("rows          {}", if configs.is_empty() { "none".to_owned() } else { configs.join(", ") }),
    ];
    for (count, what) in [
        (summary.resumed, "have a row, left as they are"),
        (summary.uncalibrated, GUESSED),
        (summary.unreadable, "cannot be read (--report says why)"),
    ] {
        if count > 0 {
            lines.push(format!("pairs         {count} {what}"));
        }
    }
    if summary.invalid > 0 {
        lines.push(format!("matches       {} without a viewing ray, taken for outliers", summary.invalid));
    }
    let rate = (summary.verified + summary.rejected) as f64 / summary.elapsed_s.max(f64::MIN_POSITIVE);
    let dry = if summary.dry_run { ", nothing written" } else { "" };
    lines.push(format!("time          {:.2} s, {rate:.0} pairs a second{dry}", summary.elapsed_s));
    lines.join("\n")
}

const COLUMNS: [&str; 9] =
    ["pair_id", "image1", "image2", "matches", "invalid", "inliers", "config", "model", "reason"];

fn row(pair: &PairReport) -> Vec<String> {
    vec![
        pair.pair_id.to_string(),
        pair.image1.clone(),
        pair.image2.clone(),
        pair.matches.to_string(),
        pair.invalid.to_string(),
        pair.inliers.to_string(),
        pair.config.map(|config| config.name().to_owned()).unwrap_or_default(),
        pair.model.unwrap_or_default().to_owned(),
        pair.reason.clone().unwrap_or_default(),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_pixels_are_no_poses() {
        let of = |config: Config| {
            let configs = [(config.name(), 5)].into();
            text(&Summary { pairs: 6, verified: 5, configs, ..Summary::default() })
        };
        assert!(of(Config::Calibrated).contains("\nwith a pose   5, "));
        assert!(of(Config::Uncalibrated).contains("\nwith geometry 5, "));
        assert!(of(Config::PlanarOrPanoramic).contains("\nwith geometry 5, "));
    }
}
