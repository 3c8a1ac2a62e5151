//! What `quest_pose.colmap` stands on: the databases of COLMAP.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::PathBuf;

use pyo3::exceptions::PyOSError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use quest_colmap::{
    ColmapError, Database, Existing, Given, PairId, Uncalibrated, VerifyOptions, Watch, export_matches,
    export_poses, verify, write_g2o, write_two_view_geometries,
};
use quest_core::robust::Model;

use crate::arrays;
use crate::errors::QuestError;
use crate::estimate_result::Estimate;
use crate::options;
use crate::supervisor::Supervisor;

impl Watch for Supervisor<'_> {
    fn progress(&self, done: usize, total: usize) {
        self.set(done, total);
    }

    fn is_cancelled(&self) -> bool {
        Supervisor::is_cancelled(self)
    }
}

fn error(error: &ColmapError) -> PyErr {
    match error {
        ColmapError::Io { .. } => PyOSError::new_err(error.to_string()),
        _ => QuestError::new_err(error.to_string()),
    }
}

type Names = Vec<(String, String)>;

/// The report of ``quest_pose.colmap.verify`` as JSON.
#[pyfunction]
#[pyo3(signature = (
    database, pairs, min_inliers, min_inlier_ratio, existing, uncalibrated, watermark, num_threads, dry_run, progress, options
))]
#[expect(clippy::too_many_arguments, reason = "the keywords of its wrapper")]
#[expect(clippy::needless_pass_by_value, reason = "pyo3 hands values over")]
pub(crate) fn _colmap_verify(
    py: Python<'_>,
    database: PathBuf,
    pairs: Option<Names>,
    min_inliers: i128,
    min_inlier_ratio: f64,
    existing: &str,
    uncalibrated: &str,
    watermark: f64,
    num_threads: i128,
    dry_run: bool,
    progress: Option<Py<PyAny>>,
    options: &Bound<'_, PyDict>,
) -> PyResult<String> {
    let unknown = |name: &str, found: &str, expected: &str| {
        QuestError::new_err(format!("{name} is {found:?}, expected {expected}"))
    };
    let existing = match existing {
        "raise" => Existing::Refuse,
        "overwrite" => Existing::Overwrite,
        "resume" => Existing::Resume,
        found => return Err(unknown("existing", found, "\"raise\", \"overwrite\" or \"resume\"")),
    };
    let uncalibrated = match uncalibrated {
        "skip" => Uncalibrated::Skip,
        "guess" => Uncalibrated::Guess,
        found => return Err(unknown("uncalibrated", found, "\"skip\" or \"guess\"")),
    };
    let options = VerifyOptions {
        pairs,
        search: options::options("verify", Some(options), &["index"], true)?,
        min_inliers: arrays::whole("min_inliers", min_inliers)?,
        min_inlier_ratio,
        existing,
        uncalibrated,
        watermark,
        threads: arrays::whole("num_threads", num_threads)?,
        dry_run,
    };
    let supervisor = Supervisor::new(progress.as_ref(), 0);
    let report = py.detach(|| {
        supervisor.run(|| {
            let mut database = Database::open(&database)?;
            verify(&mut database, &options, &supervisor)
        })
    })?;
    let report = report.map_err(|e| error(&e))?;
    serde_json::to_string(&report).map_err(|e| QuestError::new_err(e.to_string()))
}

/// The pairs of a text file.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "pyo3 hands values over")]
pub(crate) fn _colmap_read_pairs(path: PathBuf) -> PyResult<Names> {
    quest_colmap::read_pairs(&path).map_err(|e| error(&e))
}

/// Writes the rows of estimates.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "pyo3 hands values over")]
pub(crate) fn _colmap_write(
    database: PathBuf,
    pairs: Names,
    estimates: Vec<Option<PyRef<'_, Estimate>>>,
    overwrite: bool,
) -> PyResult<()> {
    let mut database = Database::open(&database).map_err(|e| error(&e))?;
    let mut rows = Vec::with_capacity(pairs.len());
    for (images, estimate) in pairs.into_iter().zip(estimates) {
        let (pose, inliers) = match estimate {
            Some(estimate) => {
                let model = match estimate.model.as_str() {
                    "planar" => Model::Planar,
                    "pure_rotation" => Model::PureRotation,
                    _ => Model::General,
                };
                (Some((model, *estimate.pose().relative())), estimate.inlier_flags().to_vec())
            }
            None => (None, Vec::new()),
        };
        let row = if pose.is_some() {
            database.geometry(&Given { images, pose, inliers })
        } else {
            database.keys_of(&[images]).map(|keys| (keys[0], quest_colmap::TwoViewGeometry::undefined()))
        };
        rows.push(row.map_err(|e| error(&e))?);
    }
    write_two_view_geometries(&mut database, &rows, overwrite).map_err(|e| error(&e))
}

/// Writes matches or poses into a file: how many pairs were written, and why the others were not.
#[pyfunction]
#[pyo3(signature = (database, target, what, pairs, min_inliers, progress, options))]
#[expect(clippy::too_many_arguments, reason = "the keywords of its wrapper")]
#[expect(clippy::needless_pass_by_value, reason = "pyo3 hands values over")]
pub(crate) fn _colmap_export(
    py: Python<'_>,
    database: PathBuf,
    target: PathBuf,
    what: &str,
    pairs: Option<Names>,
    min_inliers: i128,
    progress: Option<Py<PyAny>>,
    options: &Bound<'_, PyDict>,
) -> PyResult<(usize, Vec<(String, String)>)> {
    let are_poses = what == "poses";
    let search = options::options("export_poses", Some(options), &["index"], true)?;
    let min_inliers = arrays::whole("min_inliers", min_inliers)?;
    let options = VerifyOptions { search, min_inliers, ..VerifyOptions::default() };
    let supervisor = Supervisor::new(progress.as_ref(), 0);
    let exported = py.detach(|| {
        supervisor.run(|| {
            let failed = |source: io::Error| ColmapError::Io { file: target.display().to_string(), source };
            let database = Database::open(&database)?;
            let keys: Vec<PairId> = match &pairs {
                Some(pairs) => database.keys_of(pairs)?,
                None => database.matched_pairs()?.into_iter().collect(),
            };
            let mut writer = BufWriter::new(File::create(&target).map_err(failed)?);
            let exported = if are_poses {
                let (edges, mut exported) = export_poses(&database, &keys, &options, &supervisor)?;
                let left = write_g2o(&edges, &mut writer).map_err(failed)?;
                exported.written -= left.len();
                let reason = "the covariance has no inverse".to_owned();
                exported.left.extend(left.into_iter().map(|names| (names.join(" "), reason.clone())));
                exported
            } else {
                export_matches(&database, &keys, &mut writer, &supervisor)?
            };
            writer.flush().map_err(failed)?;
            Ok(exported)
        })
    })?;
    let exported = exported.map_err(|e: ColmapError| error(&e))?;
    Ok((exported.written, exported.left))
}
