//! What can be wrong with a database, a list of pairs or an option.

use rusqlite::ErrorCode;

/// Why a database was not read, or not written. A database that could not be written is as it was.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ColmapError {
    /// There is no such file.
    #[error("{path}: found no file, expected a COLMAP database")]
    Missing {
        /// The file as it was named.
        path: String,
    },
    /// The file is no database of COLMAP, or of one that is too old.
    #[error("{path}: {found}, expected a database of COLMAP 3.6 or later")]
    NotColmap {
        /// The file as it was named.
        path: String,
        /// What was found in place of it.
        found: String,
    },
    /// SQLite refuses.
    #[error("{path}: {}", words(.source))]
    Sqlite {
        /// The file as it was named.
        path: String,
        /// What SQLite says.
        source: rusqlite::Error,
    },
    /// Some of the pairs have been verified before.
    #[error(
        "{path}: {rows} of {pairs} pairs have a row in two_view_geometries, expected none; --overwrite replaces them, \
         --resume verifies the others (in Python existing=\"overwrite\" and \"resume\")"
    )]
    Verified {
        /// The file as it was named.
        path: String,
        /// Pairs with a row.
        rows: usize,
        /// All pairs.
        pairs: usize,
    },
    /// A list of pairs names an image that the database does not have, or is not two names a line.
    #[error("{file}:{line}: {found}, expected the names of two images of the database")]
    Pairs {
        /// The list.
        file: String,
        /// Counted from one.
        line: usize,
        /// What was found.
        found: String,
    },
    /// What was given for a pair does not fit the database.
    #[error("pair {pair}: {found}, expected {expected}")]
    Given {
        /// The names of its images.
        pair: String,
        /// What was found.
        found: String,
        /// What was expected.
        expected: &'static str,
    },
    /// The list of pairs cannot be read.
    #[error("{file}: cannot be read: {source}")]
    Io {
        /// The list.
        file: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// An option is impossible.
    #[error("the {option} is {found}, expected {expected}")]
    Option {
        /// Its name.
        option: &'static str,
        /// What was found.
        found: String,
        /// What was expected.
        expected: &'static str,
    },
    /// The threads could not be started.
    #[error("{0} threads could not be started, expected as many; --threads 1 needs none")]
    Threads(usize),
    /// The caller ended the run; the database is as it was.
    #[error("the run was ended before its end; the database is as it was")]
    Cancelled,
}

/// SQLite's reason in words that say what to do.
fn words(error: &rusqlite::Error) -> String {
    match error.sqlite_error_code() {
        Some(ErrorCode::DatabaseBusy | ErrorCode::DatabaseLocked) => {
            "another program is writing to the database, expected to be the only one; try again when it has ended".into()
        }
        Some(ErrorCode::ReadOnly) => "the database cannot be written, expected a file that is not read-only".into(),
        Some(ErrorCode::DiskFull) => "the disk is full; the database is as it was".into(),
        Some(ErrorCode::NotADatabase) => "found another kind of file, expected an SQLite database".into(),
        Some(ErrorCode::DatabaseCorrupt) => format!("the database is damaged ({error}); restore a copy of it"),
        Some(ErrorCode::CannotOpen) => {
            format!("the database or its journal cannot be opened ({error}), expected a folder that can be written")
        }
        _ => error.to_string(),
    }
}
