//! `quest-cli colmap export`: matches and poses of a database for other programs.

use std::{io::Write, path::PathBuf};

use clap::{Args, ValueEnum};
use quest_colmap::{
    ColmapError, Database, Exported, PairId, VerifyOptions, export_each, export_matches, export_poses,
    read_pairs, write_g2o,
};
use quest_io::{Output, WriteError};

use super::{OfColmap, Shown};
use crate::{
    Failure, Outcome,
    estimate_options::EstimateOptions,
    parquet::{self, MatchesTable},
    words,
};

const EXAMPLES: &str = "\
Examples:
  quest-cli colmap export database.db -o pairs.jsonl
  quest-cli colmap export database.db --what poses -o poses.g2o
  quest-cli colmap export database.db | quest-cli estimate - -o poses.jsonl
  quest-cli colmap export database.db -o pairs.parquet         built with --features parquet

Matches are JSON Lines as `quest-cli estimate` reads them, one pair a line, named by its two images; in a file whose name
ends with .parquet a table, one pair a row, with COLMAP's key of the pair.
Poses are edges of a graph in g2o's form: every pair is estimated with the threshold, and the edge holds
the pose of the second camera in the frame of the first and its information, the inverse of the
covariance, of (x, y, z, qx, qy, qz). Each translation has the scale of its own pair, in which the mean
depth is one.";

/// Write the matches of a COLMAP database as JSON Lines or Parquet, or its poses with covariances as a graph.
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(super) struct Arguments {
    /// The database.
    database: PathBuf,
    /// What is written.
    #[arg(long, value_enum, default_value = "matches")]
    what: What,
    /// Only the pairs of this file: the names of two images a line.
    #[arg(long, value_name = "FILE")]
    pairs: Option<PathBuf>,
    #[command(flatten)]
    search: EstimateOptions<OfColmap>,
    /// Pairs with fewer inliers have no pose.
    #[arg(long, value_name = "N", default_value_t = VerifyOptions::default().min_inliers)]
    min_inliers: usize,
    /// Write to this file, whole or not at all.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Say nothing on standard error but errors.
    #[arg(long)]
    quiet: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum What {
    /// JSON Lines, or Parquet.
    Matches,
    /// A graph in g2o's form.
    Poses,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let mut output = Output::open(arguments.output.as_deref())?;
    let database = Database::open(&arguments.database)?;
    let pairs = arguments.pairs(&database)?;
    if pairs.is_empty() && !arguments.quiet {
        super::say_empty(&arguments.database);
    }
    let shown = Shown::new(arguments.quiet);
    let exported = match arguments.what {
        What::Matches => {
            let table = arguments.table()?;
            let mut done = Ok(Exported::default());
            output.write(|writer| {
                done = match table {
                    None => export_matches(&database, &pairs, writer, &shown),
                    Some(table) => export_table(&database, &pairs, table, writer, &shown),
                };
                match std::mem::replace(&mut done, Ok(Exported::default())) {
                    Err(ColmapError::Io { source, .. }) => Err(source),
                    other => {
                        done = other;
                        Ok(())
                    }
                }
            })?;
            done?
        }
        What::Poses => {
            let options = VerifyOptions {
                search: arguments.search.for_colmap(),
                min_inliers: arguments.min_inliers,
                ..VerifyOptions::default()
            };
            let (edges, mut exported) = export_poses(&database, &pairs, &options, &shown)?;
            let mut left = Vec::new();
            output.write(|writer| {
                left = write_g2o(&edges, writer)?;
                Ok(())
            })?;
            exported.written -= left.len();
            let reason = "the covariance has no inverse".to_owned();
            exported.left.extend(left.into_iter().map(|names| (names.join(" "), reason.clone())));
            exported
        }
    };
    shown.progress.finish();
    output.finish()?;
    for (name, reason) in exported.left.iter().filter(|_| !arguments.quiet) {
        words::say("left out", &format!("{name}: {reason}"));
    }
    Ok(if exported.written == 0 { Outcome::NoPose } else { Outcome::Answer })
}

/// As [`export_matches`], into a table of Parquet.
fn export_table(
    database: &Database,
    pairs: &[PairId],
    mut table: MatchesTable,
    writer: &mut dyn Write,
    shown: &Shown,
) -> Result<Exported, ColmapError> {
    let exported = export_each(database, pairs, shown, |pair| {
        let [camera1, camera2] = &pair.cameras;
        table.write(pair.key.0.cast_unsigned(), &pair.name, [camera1, camera2], &pair.matches, writer)
    })?;
    let failed = |source| ColmapError::Io { file: "output".to_owned(), source };
    table.finish(writer).map_err(failed)?;
    Ok(exported)
}

impl Arguments {
    /// The table of Parquet, where the name of the output asks for one.
    fn table(&self) -> Result<Option<MatchesTable>, WriteError> {
        let form = |path: &PathBuf| quest_io::Format::from_extension(path);
        let file = self.output.as_ref().filter(|path| form(path) == Some(quest_io::Format::Parquet));
        file.map(|file| parquet::made(MatchesTable::new(), file)).transpose()
    }

    fn pairs(&self, database: &Database) -> Result<Vec<PairId>, Failure> {
        Ok(match &self.pairs {
            Some(file) => {
                let keys = database.keys_of(&read_pairs(file)?);
                keys.map_err(|error| super::of_list(error, Some(file)))?
            }
            None => database.matched_pairs()?.into_iter().collect(),
        })
    }
}
