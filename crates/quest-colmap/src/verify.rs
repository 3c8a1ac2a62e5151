//! `verify`: the two-view geometries of a database's pairs.
//!
//! # Steps
//! 1. The pairs: those of a list, or all with matches; those that have a row are replaced, left, or an error.
//! 2. Some hundred pairs at a time: their matches are read, and the keypoints of their images turned into rays, once an image.
//! 3. Every pair is estimated (`pair`), on all threads; its own key seeds it.
//! 4. The rows are written in the order of the keys. All of it is one transaction.

use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;
use std::time::Instant;

use quest_core::robust::{EstimateError, Options, STACK_SIZE};
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

mod pair;

use crate::image::Rays;
use crate::report::{PairReport, Report};
use crate::{ColmapError, Database, Matches, PairId, TwoViewGeometry, pairs};
use pair::Work;

/// Pairs that are worked on together. Fewer would leave threads without work at the end of each lot.
const LOT: usize = 256;

/// Keypoints that are kept between lots: about half a gigabyte.
const KEPT: usize = 16_000_000;

/// What to do with pairs that have a row.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Existing {
    /// Refuse to begin.
    #[default]
    Refuse,
    /// Replace the rows.
    Overwrite,
    /// Leave the rows, and verify the other pairs.
    Resume,
}

/// What to do with pairs of cameras whose focal length is a guess (`prior_focal_length` is 0).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Uncalibrated {
    /// Leave them to COLMAP.
    #[default]
    Skip,
    /// Search with the guess, and write a fundamental matrix or a homography that is fitted to the pixels; no pose.
    Guess,
}

/// How pairs are verified.
#[derive(Clone, Debug, PartialEq)]
pub struct VerifyOptions {
    /// The pairs, two names of images each; all pairs with matches for `None`.
    pub pairs: Option<Vec<(String, String)>>,
    /// How each pair is searched; its cameras set the focal lengths, and its key the index. COLMAP's threshold of 4 pixels gives as
    /// many points as COLMAP, and its 10,000 iterations find a pair of which a fifth of the matches are right.
    pub search: Options,
    /// Pairs with fewer inliers have no pose.
    pub min_inliers: usize,
    /// Pairs with a smaller part of inliers among their matches have no pose.
    pub min_inlier_ratio: f64,
    /// What to do with pairs that have a row.
    pub existing: Existing,
    /// What to do where a focal length is a guess.
    pub uncalibrated: Uncalibrated,
    /// The part of the inliers that one shift of the images' border has to explain for the pair to be a watermark; above one
    /// for never.
    pub watermark: f64,
    /// The number of threads, all of the machine's for zero. It changes no answer.
    pub threads: usize,
    /// Whether to write nothing.
    pub dry_run: bool,
}

impl Default for VerifyOptions {
    /// COLMAP's thresholds, numbers and watermark; pairs that have a row are an error, and those with a guessed focal length left
    /// to COLMAP.
    fn default() -> Self {
        Self {
            pairs: None,
            search: Options {
                threshold: 4.0,
                confidence: 0.999,
                max_iterations: 10_000,
                ..Options::default()
            },
            min_inliers: 15,
            min_inlier_ratio: 0.0,
            existing: Existing::default(),
            uncalibrated: Uncalibrated::default(),
            watermark: 0.7,
            threads: 0,
            dry_run: false,
        }
    }
}

impl VerifyOptions {
    fn check(&self) -> Result<(), ColmapError> {
        let refuse = |option, found: f64, expected| {
            Err(ColmapError::Option { option, found: found.to_string(), expected })
        };
        if let Err(EstimateError::Option { option, found, expected }) = self.search.check() {
            return refuse(option, found, expected);
        }
        if !(0.0..=1.0).contains(&self.min_inlier_ratio) {
            return refuse("smallest ratio of inliers", self.min_inlier_ratio, "a number from 0 to 1");
        }
        if self.watermark.is_nan() || self.watermark <= 0.0 {
            return refuse("ratio of a watermark", self.watermark, "a positive number, above 1 for never");
        }
        Ok(())
    }
}

/// Who is told of the progress of a run, and asked whether to end it.
pub trait Watch: Sync {
    /// So many of so many pairs are done.
    fn progress(&self, done: usize, total: usize) {
        let _ = (done, total);
    }

    /// Whether to end the run, which leaves the database as it was. Asked often, by every thread.
    fn is_cancelled(&self) -> bool {
        false
    }
}

/// Nobody.
impl Watch for () {}

/// Verifies pairs and writes their rows: all of them, or none.
///
/// # Errors
/// [`ColmapError::Option`], [`ColmapError::Pairs`] for a name that the database does not have, [`ColmapError::Verified`],
/// [`ColmapError::Sqlite`] where the database cannot be read or written, [`ColmapError::Cancelled`]. The database then is as it
/// was. What is wrong with a single pair is the reason in its report, and no error.
pub fn verify(
    database: &mut Database,
    options: &VerifyOptions,
    watch: &dyn Watch,
) -> Result<Report, ColmapError> {
    options.check()?;
    let start = Instant::now();
    let pool = pool(options.threads)?;
    let mut report = database.in_transaction(!options.dry_run, |database| {
        let mut report = Report::default();
        let keys = wanted(database, options, &mut report)?;
        let mut images = Images::default();
        let mut done = 0;
        for lot in keys.chunks(LOT) {
            let works = read(database, lot, &mut images, pool.as_ref())?;
            for (key, geometry, pair) in solve(&works, options, watch, pool.as_ref())? {
                if let Some(geometry) = geometry.filter(|_| !options.dry_run) {
                    database.write_row(key, &geometry)?;
                }
                report.push(pair);
            }
            done += lot.len();
            watch.progress(done, keys.len());
        }
        Ok(report)
    })?;
    report.summary.dry_run = options.dry_run;
    report.summary.elapsed_s = start.elapsed().as_secs_f64();
    Ok(report)
}

fn pool(threads: usize) -> Result<Option<ThreadPool>, ColmapError> {
    if threads == 1 {
        return Ok(None);
    }
    let built = ThreadPoolBuilder::new().num_threads(threads).stack_size(STACK_SIZE).build();
    built.map(Some).map_err(|_| ColmapError::Threads(threads))
}

/// The pairs to work on, in ascending order.
fn wanted(
    database: &Database,
    options: &VerifyOptions,
    report: &mut Report,
) -> Result<Vec<PairId>, ColmapError> {
    let keys = match &options.pairs {
        Some(pairs) => pairs::keys(pairs, &database.numbers())?,
        None => database.matched_pairs()?,
    };
    report.summary.pairs = keys.len();
    let verified: BTreeSet<_> = database.verified_pairs()?.intersection(&keys).copied().collect();
    match options.existing {
        Existing::Refuse if !verified.is_empty() => {
            let (path, pairs) = (database.path.clone(), keys.len());
            return Err(ColmapError::Verified { path, rows: verified.len(), pairs });
        }
        Existing::Resume => report.summary.resumed = verified.len(),
        _ => {}
    }
    let is_open = |key: &PairId| options.existing != Existing::Resume || !verified.contains(key);
    let is_known = |key: &PairId| {
        let (a, b) = key.images();
        [a, b]
            .iter()
            .all(|image| database.camera_of(*image).is_ok_and(|camera| camera.has_prior_focal_length))
    };
    let (known, guessed): (Vec<_>, Vec<_>) = keys.into_iter().filter(is_open).partition(is_known);
    if options.uncalibrated == Uncalibrated::Guess {
        let mut all = [known, guessed].concat();
        all.sort_unstable();
        return Ok(all);
    }
    // What has no camera cannot be read, which is another reason.
    let (unreadable, guessed): (Vec<_>, Vec<_>) = guessed.into_iter().partition(|key| {
        let (a, b) = key.images();
        database.camera_of(a).is_err() || database.camera_of(b).is_err()
    });
    report.summary.uncalibrated = guessed.len();
    let mut all = [known, unreadable].concat();
    all.sort_unstable();
    Ok(all)
}

/// The keypoints of images as rays.
#[derive(Default)]
pub(crate) struct Images(HashMap<i64, Arc<Result<Rays, String>>>);

/// Step 2: what the pairs of a lot need.
pub(crate) fn read(
    database: &Database,
    lot: &[PairId],
    images: &mut Images,
    pool: Option<&ThreadPool>,
) -> Result<Vec<Work>, ColmapError> {
    let needed: BTreeSet<i64> = lot.iter().flat_map(|key| <[i64; 2]>::from(key.images())).collect();
    let kept: usize = images.0.values().map(|rays| rays.as_ref().as_ref().map_or(0, |r| r.rays.len())).sum();
    if kept > KEPT {
        images.0.retain(|image, _| needed.contains(image));
    }
    let mut raw = Vec::new();
    for &image in needed.iter().filter(|image| !images.0.contains_key(image)) {
        raw.push((image, database.keypoints(image)?));
    }
    let to_rays = |(image, raw): (i64, Result<_, String>)| {
        let rays = raw.and_then(|keypoints: crate::database::Keypoints| keypoints.rays());
        (image, Arc::new(rays.map_err(|reason| format!("image {image}: {reason}"))))
    };
    let rays: Vec<_> = match pool {
        Some(pool) => pool.install(|| raw.into_par_iter().map(to_rays).collect()),
        None => raw.into_iter().map(to_rays).collect(),
    };
    images.0.extend(rays);
    let work = |&key: &PairId| Ok(Work::new(database, key, database.matches(key)?, &images.0));
    lot.iter().map(work).collect()
}

type Solved = (PairId, Option<TwoViewGeometry>, PairReport);

/// Step 3: the estimates of a lot, in its order.
fn solve(
    works: &[Work],
    options: &VerifyOptions,
    watch: &dyn Watch,
    pool: Option<&ThreadPool>,
) -> Result<Vec<Solved>, ColmapError> {
    let is_cancelled = || watch.is_cancelled();
    let one = |work: &Work| {
        if is_cancelled() {
            return Err(ColmapError::Cancelled);
        }
        let (geometry, report) = work.verify(options, &is_cancelled)?;
        Ok((work.key, geometry, report))
    };
    match pool {
        Some(pool) => pool.install(|| works.par_iter().with_max_len(1).map(one).collect()),
        None => works.iter().map(one).collect(),
    }
}

/// The matches that a pair has, kept for [`Work`].
pub(crate) type Found = Result<Matches, String>;
