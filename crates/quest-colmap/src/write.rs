//! Rows of `two_view_geometries`, and the transaction around them.

use nalgebra::Matrix3;
use quest_core::RelativePose;
use rusqlite::types::Value;

use crate::{ColmapError, Database, PairId, TwoViewGeometry};

/// Writes rows in one transaction: all of them, or none.
///
/// # Errors
/// [`ColmapError::Verified`] for a pair that has a row, unless `overwrite`; [`ColmapError::Sqlite`] where the database cannot be
/// written, which then is as it was.
pub fn write_two_view_geometries(
    database: &mut Database,
    rows: &[(PairId, TwoViewGeometry)],
    overwrite: bool,
) -> Result<(), ColmapError> {
    database.in_transaction(true, |database| {
        let verified = database.verified_pairs()?;
        let known = rows.iter().filter(|(pair, _)| verified.contains(pair)).count();
        if known > 0 && !overwrite {
            let path = database.path.clone();
            return Err(ColmapError::Verified { path, rows: known, pairs: rows.len() });
        }
        rows.iter().try_for_each(|(pair, geometry)| database.write_row(*pair, geometry))
    })
}

impl Database {
    /// Runs `work` in a transaction, which ends with it: for good where it went well, else as if nothing had been done.
    pub(crate) fn in_transaction<T>(
        &mut self,
        writes: bool,
        work: impl FnOnce(&mut Self) -> Result<T, ColmapError>,
    ) -> Result<T, ColmapError> {
        let begin = if writes { "BEGIN IMMEDIATE" } else { "BEGIN DEFERRED" };
        self.connection.execute_batch(begin).map_err(|source| self.sqlite(source))?;
        let done = work(self).and_then(|value| {
            self.connection.execute_batch("COMMIT").map_err(|source| self.sqlite(source))?;
            Ok(value)
        });
        if done.is_err() && !self.connection.is_autocommit() {
            // What went wrong before is what the caller has to know; SQLite rolls back itself at the latest when it is closed.
            let _ = self.connection.execute_batch("ROLLBACK");
        }
        done
    }

    /// Writes a row, in place of that of the same pair.
    pub(crate) fn write_row(&self, pair: PairId, geometry: &TwoViewGeometry) -> Result<(), ColmapError> {
        let columns = self.schema.columns();
        let places: Vec<_> = (1..=columns.len()).map(|k| format!("?{k}")).collect();
        let sql = format!(
            "INSERT OR REPLACE INTO two_view_geometries({}) VALUES({})",
            columns.join(", "),
            places.join(", ")
        );
        let values = columns.iter().map(|column| self.value(column, pair, geometry));
        let write = || {
            let mut statement = self.connection.prepare_cached(&sql)?;
            statement.execute(rusqlite::params_from_iter(values))
        };
        write().map(|_| ()).map_err(|source| self.sqlite(source))
    }

    fn value(&self, column: &str, pair: PairId, geometry: &TwoViewGeometry) -> Value {
        let is_null = self.schema.absent_is_null();
        match column {
            "pair_id" => Value::Integer(pair.0),
            "rows" => Value::Integer(i64::try_from(geometry.inliers.0.len()).unwrap_or(i64::MAX)),
            "cols" => Value::Integer(2),
            "data" => Value::Blob(geometry.inliers.to_bytes()),
            "config" => Value::Integer(geometry.config.code()),
            "F" => matrix(geometry.fundamental.as_ref(), is_null),
            "E" => matrix(geometry.essential.as_ref(), is_null),
            "H" => matrix(geometry.homography.as_ref(), is_null),
            "qvec" => pose(geometry.pose.as_ref(), is_null, |pose| pose.wxyz().to_vec()),
            "tvec" => pose(geometry.pose.as_ref(), is_null, |pose| pose.t_21.as_slice().to_vec()),
            // `camera1` and `camera2` hold intrinsics that were estimated with the pose: there are none.
            _ => Value::Null,
        }
    }
}

/// A matrix row after row.
fn matrix(m: Option<&Matrix3<f64>>, absent_is_null: bool) -> Value {
    match m {
        Some(m) => blob(m.transpose().as_slice()),
        None if absent_is_null => Value::Null,
        None => blob(&[0.0; 9]),
    }
}

fn pose(pose: Option<&RelativePose>, absent_is_null: bool, part: fn(&RelativePose) -> Vec<f64>) -> Value {
    match pose {
        Some(pose) => blob(&part(pose)),
        None if absent_is_null => Value::Null,
        None => blob(&part(&RelativePose::identity())),
    }
}

fn blob(numbers: &[f64]) -> Value {
    // Without the sign of zeros, which no reader needs.
    Value::Blob(numbers.iter().flat_map(|x| (x + 0.0).to_le_bytes()).collect())
}
