//! What can be wrong with a file: where, what was found, what was expected.

use std::{fmt, io};

use quest_core::{CameraError, InputError, MatchError};

/// A place in a file, `file:line:column: key`. Parts that are not known are left out.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Place {
    /// The file as it was named.
    pub file: String,
    /// Counted from one.
    pub line: Option<usize>,
    /// Counted from one, in bytes.
    pub column: Option<usize>,
    /// The path to the value, such as `matches[3]`, or the column of a CSV file.
    pub key: Option<String>,
}

impl Place {
    /// The file as a whole.
    #[must_use]
    pub fn file(name: impl Into<String>) -> Self {
        Self { file: name.into(), ..Self::default() }
    }

    /// The same with a line.
    #[must_use]
    pub fn at_line(&self, line: usize) -> Self {
        Self { line: Some(line), ..self.clone() }
    }

    /// The same with a key.
    #[must_use]
    pub fn at_key(&self, key: impl Into<String>) -> Self {
        Self { key: Some(key.into()), ..self.clone() }
    }

    /// The error that `fault` is in this place.
    #[must_use]
    pub fn error(self, fault: impl Into<Fault>) -> ReadError {
        ReadError { place: self, key: None, fault: Box::new(fault.into()) }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.file)?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        if let Some(column) = self.column {
            write!(f, ":{column}")?;
        }
        self.key.as_ref().map_or(Ok(()), |key| write!(f, ": {key}"))
    }
}

/// Why a file was refused.
#[derive(Debug, thiserror::Error)]
#[error("{place}: {fault}")]
pub struct ReadError {
    /// The place of the error.
    pub place: Place,
    /// The key of the pair that could not be read, where its file gives it one.
    pub key: Option<u64>,
    /// What was found, and what was expected.
    pub fault: Box<Fault>,
}

/// What is wrong with a file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Fault {
    /// The system refuses to read it.
    #[error("cannot be read: {}", plain(.0))]
    Io(#[from] io::Error),
    /// It is a directory.
    #[error("found a directory, expected a file")]
    Directory,
    /// A pair is larger than was allowed, or never ends.
    #[error("found a pair of more than {most} bytes, expected at most as many; --max-input allows more")]
    TooLarge {
        /// The most bytes that were allowed.
        most: u64,
    },
    /// There is nothing in it.
    #[error("found an empty file, expected matches as JSON, JSON Lines, CSV or an array of NumPy's")]
    Empty,
    /// It is not text.
    #[error("found the byte 0x{0:02x}, expected UTF-8 text")]
    NotUtf8(u8),
    /// It is another kind of file.
    #[error("found {found}, expected matches; {instead}")]
    NoMatches {
        /// What it is by its first bytes.
        found: &'static str,
        /// What to do with it.
        instead: &'static str,
    },
    /// It is not JSON, or not of the form expected.
    #[error("{0}")]
    Json(String),
    /// It is not CSV.
    #[error("{0}")]
    Csv(String),
    /// Two of the columns of a CSV file have the same name, or one is missing.
    #[error("found the header {found:?}, expected {expected}, or rows of these without a header")]
    Header {
        /// The names of the columns.
        found: String,
        /// Those that were expected.
        expected: &'static str,
    },
    /// A CSV file without a header has too many columns, or too few.
    #[error("found {found} columns and no header, expected {expected}, or a header with these names")]
    ColumnCount {
        /// Columns in the first row.
        found: usize,
        /// Those that were expected.
        expected: &'static str,
    },
    /// A row of a CSV file is shorter or longer than the first one.
    #[error("found {found} values, expected {expected} as in the first row")]
    FieldCount {
        /// Values in the row.
        found: usize,
        /// Columns in the first row.
        expected: usize,
    },
    /// A field of a CSV file is not a finite number.
    #[error("found {0:?}, expected a finite number")]
    NotANumber(String),
    /// A field of a CSV file is a number with a comma.
    #[error("found {0:?}, expected a number with a decimal point")]
    DecimalComma(String),
    /// An array of NumPy's has another form.
    #[error("{message}, expected rows of {expected}")]
    Array {
        /// What was found.
        message: String,
        /// What a row was expected to be.
        expected: &'static str,
    },
    /// A file of Parquet, for which the reader was not built.
    #[error("this build has no Parquet: cargo install quest-cli --features parquet")]
    NoParquet,
    /// A file of Parquet is damaged, or has other columns.
    #[error("{0}")]
    Parquet(String),
    /// A file of points where matches were expected.
    #[error(
        "found two columns, the points of one image, expected matches, or --points2 with those of the other image"
    )]
    OneImage,
    /// Two files of points, one of each image, have different numbers of rows.
    #[error("found {found} points, expected {expected} as in the file of the first image")]
    PointCount {
        /// Points of the second image.
        found: usize,
        /// Points of the first one.
        expected: usize,
    },
    /// A file of this form has no rows of points.
    #[error("found {0}, expected the points of one image as CSV or an array of NumPy's")]
    NoPoints(&'static str),
    /// A coordinate of a match is NaN, infinite or missing, where all of them are needed.
    #[error("{0}")]
    Coordinate(String),
    /// A camera is not understood.
    #[error("{0}")]
    Camera(#[from] CameraError),
    /// Points that are on no plane `z = 1`, and no camera.
    #[error(
        "these look like pixels: give --camera1 (points of the plane z = 1 that are so far out: --camera1 SIMPLE_PINHOLE,1,1,1,0,0)"
    )]
    Pixels,
    /// Points of the plane `z = 1`, and a camera.
    #[error(
        "all matches lie within 2 pixels of the corner of the image, expected pixels: points that are on the plane z = 1 already are \
         given without a camera"
    )]
    PointsOfThePlane,
    /// An estimate without a camera does not know what noise is.
    #[error(
        "found no camera and no --threshold, expected a camera, or a threshold in units of the plane z = 1"
    )]
    NoThreshold,
    /// A file of cameras is of another form.
    #[error("{0}")]
    Calibration(String),
    /// The second camera is given, the first is not.
    #[error("found a second camera without the first, expected camera1 as well")]
    FirstCameraMissing,
    /// The width of an image is given without its height, or the reverse.
    #[error("found one of width and height, expected both or none")]
    HalfASize,
    /// The number of scores differs from the number of matches.
    #[error("found {found} scores, expected {expected}, one a match")]
    ScoreCount {
        /// Scores in the file.
        found: usize,
        /// Matches in the file.
        expected: usize,
    },
    /// A quaternion is not a rotation.
    #[error("found a quaternion of length {0:?}, expected length 1 (w, x, y, z)")]
    NotUnit(f64),
    /// One match is unusable.
    #[error("{0}")]
    Match(#[from] MatchError),
    /// The matches as a whole are unusable.
    #[error("{0}")]
    Matches(#[from] InputError),
}

/// The message of the operating system, without the number that Rust appends.
pub(crate) fn plain(error: &io::Error) -> String {
    let text = error.to_string();
    match text.rfind(" (os error ") {
        Some(end) => text[..end].to_owned(),
        None => text,
    }
}
