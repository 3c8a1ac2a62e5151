//! Which version of COLMAP a database is of.

use std::collections::HashSet;

use rusqlite::Connection;

/// The version from which what is absent is `NULL`, not zeros: COLMAP's own migration takes zeros for absent up to 3.14.0, the
/// name that 4.0 had while it was written.
const NULL_SINCE: i64 = 3_140_001;

/// The columns that tell versions apart.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Schema {
    /// `PRAGMA user_version`: `major * 1000000 + minor * 10000 + patch * 100 + revision`, 0 where none was set.
    pub user_version: i64,
    /// `two_view_geometries` has `qvec` and `tvec` (3.8).
    pub has_pose: bool,
    /// `two_view_geometries` has `camera1` and `camera2` (4.2).
    pub has_cameras: bool,
}

/// What every supported version has.
const NEEDED: [(&str, &[&str]); 5] = [
    ("cameras", &["camera_id", "model", "width", "height", "params", "prior_focal_length"]),
    ("images", &["image_id", "name", "camera_id"]),
    ("keypoints", &["image_id", "rows", "cols", "data"]),
    ("matches", &["pair_id", "rows", "cols", "data"]),
    ("two_view_geometries", &["pair_id", "rows", "cols", "data", "config", "F", "E", "H"]),
];

impl Schema {
    /// The schema of an open database, or what it lacks.
    pub(crate) fn read(connection: &Connection) -> rusqlite::Result<Result<Self, String>> {
        for (table, columns) in NEEDED {
            let found = columns_of(connection, table)?;
            if found.is_empty() {
                return Ok(Err(format!("found no table {table}")));
            }
            if let Some(missing) = columns.iter().find(|column| !found.contains(**column)) {
                return Ok(Err(format!("found no column {missing} in the table {table}")));
            }
        }
        let geometries = columns_of(connection, "two_view_geometries")?;
        let has = |columns: [&str; 2]| columns.iter().all(|column| geometries.contains(*column));
        Ok(Ok(Self {
            user_version: connection.query_row("PRAGMA user_version", [], |row| row.get(0))?,
            has_pose: has(["qvec", "tvec"]),
            has_cameras: has(["camera1", "camera2"]),
        }))
    }

    /// Whether what is absent is `NULL`; else it is zeros, and the identity in place of the pose.
    #[must_use]
    pub fn absent_is_null(&self) -> bool {
        self.user_version >= NULL_SINCE
    }

    /// The columns of a row that is written, in order.
    pub(crate) fn columns(&self) -> Vec<&'static str> {
        let mut columns = vec!["pair_id", "rows", "cols", "data", "config", "F", "E", "H"];
        if self.has_pose {
            columns.extend(["qvec", "tvec"]);
        }
        if self.has_cameras {
            columns.extend(["camera1", "camera2"]);
        }
        columns
    }
}

fn columns_of(connection: &Connection, table: &str) -> rusqlite::Result<HashSet<String>> {
    let mut statement = connection.prepare("SELECT name FROM pragma_table_info(?1)")?;
    statement.query_map([table], |row| row.get(0))?.collect()
}
