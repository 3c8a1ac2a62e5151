//! From a path to pairs.

mod bounded;
mod csv_file;
mod gaps;
mod json_file;
mod json_words;
mod npy_file;
#[cfg(feature = "parquet")]
mod parquet_file;
mod strangers;
mod table;

use std::{
    fs::File,
    io::{self, BufRead, BufReader, Cursor, Read},
    ops::Range,
    path::Path,
};

use self::table::{Columns, MATCHES, POINTS, Rows};
use crate::{
    Pair,
    error::{Fault, Place, ReadError},
};

pub use bounded::MOST_BYTES;

/// What standard input is called in messages.
pub const STANDARD_INPUT: &str = "standard input";

/// How a file of Parquet begins.
const PARQUET: &[u8] = b"PAR1";

/// The form of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// One JSON object: one pair.
    Json,
    /// One JSON object a line: one pair each.
    JsonLines,
    /// `u1,v1,u2,v2[,score]`, one match a row: one pair.
    Csv,
    /// An array of NumPy's, or an archive of them: one pair.
    Npy,
    /// A table of Parquet, one pair a row.
    Parquet,
}

/// What is told of a form.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FormatInfo {
    /// The name on the command line.
    pub name: &'static str,
    /// The extensions of its files, without the dot.
    pub extensions: &'static [&'static str],
    /// One line for the help.
    pub help: &'static str,
}

impl Format {
    /// Every form.
    pub const ALL: [Self; 5] = [Self::Json, Self::JsonLines, Self::Csv, Self::Npy, Self::Parquet];

    /// What is told of it.
    #[must_use]
    pub fn info(self) -> FormatInfo {
        match self {
            Self::Json => FormatInfo { name: "json", extensions: &["json"], help: "One JSON object" },
            Self::JsonLines => {
                FormatInfo { name: "jsonl", extensions: &["jsonl", "ndjson"], help: "One JSON object a line" }
            }
            Self::Csv => FormatInfo {
                name: "csv",
                extensions: &["csv"],
                help: "`u1,v1,u2,v2[,score]`, one match a row",
            },
            Self::Npy => FormatInfo {
                name: "npy",
                extensions: &["npy", "npz"],
                help: "An array of NumPy's, one match a row, or an archive of arrays",
            },
            Self::Parquet => FormatInfo {
                name: "parquet",
                extensions: &["parquet"],
                help: "A table, one pair a row (where the tool was built with the feature `parquet`)",
            },
        }
    }

    /// Whether this build reads files of this form.
    #[must_use]
    pub fn is_built(self) -> bool {
        self != Self::Parquet || cfg!(feature = "parquet")
    }

    /// Whether a file may hold several pairs.
    #[must_use]
    pub fn holds_several(self) -> bool {
        matches!(self, Self::JsonLines | Self::Parquet)
    }

    /// The form that the extension of `path` stands for.
    #[must_use]
    pub fn from_extension(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        Self::ALL.into_iter().find(|format| format.info().extensions.contains(&extension.as_str()))
    }

    /// The form of this name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|format| format.info().name == name)
    }
}

/// The pairs of a file, one after the other. A line of JSON Lines or a row of Parquet that is no pair is an error with its line,
/// after which the next one follows; after any other error there are no more.
pub struct Pairs {
    place: Place,
    format: Format,
    input: Box<dyn BufRead>,
    #[cfg(feature = "parquet")]
    rows: Option<Box<parquet_file::Rows>>,
    /// The most bytes of a pair.
    most: u64,
    /// Lines read so far.
    line: usize,
    found_any: bool,
    done: bool,
}

/// Opens `path`, or standard input for `-`. Without a `format` the extension decides, and where there is none
/// that is known, the beginning of the text. A pair may have [`MOST_BYTES`].
///
/// # Errors
/// A file that is missing, unreadable, a directory, or empty where its beginning is needed.
pub fn read(path: &Path, format: Option<Format>) -> Result<Pairs, ReadError> {
    read_within(path, format, MOST_BYTES)
}

/// The pair of two files of points, one of each image, whose rows correspond: CSV or arrays of NumPy's. The place is that of the first.
///
/// # Errors
/// As [`read`], for files without points, and for different numbers of them.
pub fn read_points(files: [&Path; 2], format: Option<Format>, most: u64) -> Result<Pair, ReadError> {
    let mut opened = [read_within(files[0], format, most)?, read_within(files[1], format, most)?];
    let [first, second] = [opened[0].rows(&POINTS)?, opened[1].rows(&POINTS)?];
    Ok(first.beside(second, &opened[1].place)?.pair(&opened[0].place))
}

/// As [`read`], for pairs of at most so many bytes. One of more is an error after which there are no more pairs: what follows may
/// never end.
///
/// # Errors
/// As [`read`].
pub fn read_within(path: &Path, format: Option<Format>, most: u64) -> Result<Pairs, ReadError> {
    let place = if path == Path::new("-") {
        Place::file(STANDARD_INPUT)
    } else {
        Place::file(path.display().to_string())
    };
    let mut input = open(path).map_err(|fault| place.clone().error(fault))?;
    let format = if let Some(format) = format.or_else(|| Format::from_extension(path)) {
        format
    } else {
        let (format, start) = sniff(&mut input, most).map_err(|e| place.clone().error(e))?;
        input = Box::new(Cursor::new(start).chain(input));
        format
    };
    // An error of the system is said where the file is read.
    let start = input.fill_buf().unwrap_or_default();
    strangers::refuse(start, format).map_err(|fault| place.clone().error(fault))?;
    #[cfg(not(feature = "parquet"))]
    if format == Format::Parquet {
        return Err(place.error(Fault::NoParquet));
    }
    #[cfg(feature = "parquet")]
    let rows = match format {
        Format::Parquet => Some(Box::new(parquet_file::Rows::open(path, &place, &mut *input, most)?)),
        _ => None,
    };
    Ok(Pairs {
        place,
        format,
        input,
        #[cfg(feature = "parquet")]
        rows,
        most,
        line: 0,
        found_any: false,
        done: false,
    })
}

/// All bytes of a file.
pub(crate) fn whole_file(path: &Path) -> Result<Vec<u8>, ReadError> {
    let read = || {
        let mut bytes = Vec::new();
        bounded::all(&mut *open(path)?, MOST_BYTES, &mut bytes)?;
        Ok(bytes)
    };
    read().map_err(|fault: Fault| Place::file(path.display().to_string()).error(fault))
}

fn open(path: &Path) -> Result<Box<dyn BufRead>, Fault> {
    if path == Path::new("-") {
        return Ok(Box::new(io::stdin().lock()));
    }
    if path.is_dir() {
        return Err(Fault::Directory);
    }
    Ok(Box::new(BufReader::new(File::open(path)?)))
}

/// The form that the beginning of the text has, and the beginning, which was taken from `input`.
fn sniff(input: &mut dyn BufRead, most: u64) -> Result<(Format, Vec<u8>), Fault> {
    let mut text = Vec::new();
    let first = next_line(input, most, &mut text)?;
    let is_json = matches!(text.get(first.start), Some(b'{' | b'['));
    let is_whole = serde_json::from_slice::<serde::de::IgnoredAny>(&text[first]).is_ok();
    let format = match (is_json, is_whole) {
        (false, _) if npy_file::is_one(&text) => Format::Npy,
        (false, _) if text.starts_with(PARQUET) => Format::Parquet,
        (false, _) => Format::Csv,
        (true, true) if !next_line(input, most, &mut text)?.is_empty() => Format::JsonLines,
        (true, _) => Format::Json,
    };
    Ok((format, text))
}

/// Where in `text`, to which all that is read is appended, the next line is that is not blank, trimmed; empty at the end.
fn next_line(input: &mut dyn BufRead, most: u64, text: &mut Vec<u8>) -> Result<Range<usize>, Fault> {
    loop {
        let before = text.len();
        let is_end = bounded::line(input, most, text)? == 0;
        let line = without_mark(&text[before..]);
        let start = text.len() - line.trim_ascii_start().len();
        let length = line.trim_ascii().len();
        if is_end || length > 0 {
            return Ok(start..start + length);
        }
    }
}

/// The text without the byte order mark that some editors begin a file with.
fn without_mark(text: &[u8]) -> &[u8] {
    text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text)
}

impl Pairs {
    /// The form of the file.
    #[must_use]
    pub fn format(&self) -> Format {
        self.format
    }

    fn bytes(&mut self) -> Result<Vec<u8>, ReadError> {
        let mut bytes = Vec::new();
        bounded::all(&mut *self.input, self.most, &mut bytes).map_err(|e| self.place.clone().error(e))?;
        Ok(bytes)
    }

    fn whole(&mut self) -> Result<Pair, ReadError> {
        match self.format {
            Format::Json | Format::JsonLines => {
                let bytes = self.bytes()?;
                json_file::parse(&self.place, text(&self.place, &bytes)?)
            }
            Format::Parquet => Err(self.place.clone().error(Fault::NoParquet)),
            _ => Ok(self.rows(&MATCHES)?.pair(&self.place)),
        }
    }

    /// The rows of a file that holds one table.
    fn rows<const N: usize>(&mut self, columns: &Columns<N>) -> Result<Rows<N>, ReadError> {
        let bytes = self.bytes()?;
        match self.format {
            Format::Json | Format::JsonLines => Err(self.place.clone().error(Fault::NoPoints("JSON"))),
            Format::Parquet => Err(self.place.clone().error(Fault::NoPoints("Parquet"))),
            Format::Csv => csv_file::parse(&self.place, text(&self.place, &bytes)?, columns),
            Format::Npy => npy_file::parse(&self.place, &bytes, columns, self.most),
        }
    }

    /// The pair on the next line that is not blank.
    fn one_line(&mut self) -> Option<Result<Pair, ReadError>> {
        loop {
            let mut bytes = Vec::new();
            match bounded::line(&mut *self.input, self.most, &mut bytes) {
                Err(fault) => {
                    // Not as a line of the place: after that the next line would follow.
                    let place = self.place.at_key(format!("line {}", self.line + 1));
                    return Some(Err(place.error(fault)));
                }
                Ok(0) if !self.found_any => return Some(Err(self.place.clone().error(Fault::Empty))),
                Ok(0) => return None,
                Ok(_) => self.line += 1,
            }
            let place = self.place.at_line(self.line);
            match utf8(&place, &bytes) {
                Err(error) => return Some(Err(error)),
                Ok(text) if text.trim().is_empty() => {}
                Ok(text) => return Some(json_file::parse(&place, text.trim_end())),
            }
        }
    }
}

/// A text that says something.
fn text<'a>(place: &Place, bytes: &'a [u8]) -> Result<&'a str, ReadError> {
    let text = utf8(place, bytes)?;
    if text.trim().is_empty() { Err(place.clone().error(Fault::Empty)) } else { Ok(text) }
}

pub(crate) fn utf8<'a>(place: &Place, bytes: &'a [u8]) -> Result<&'a str, ReadError> {
    let bytes = without_mark(bytes);
    std::str::from_utf8(bytes).map_err(|e| {
        let (before, rest) = bytes.split_at(e.valid_up_to());
        let line = place.line.unwrap_or_else(|| before.split(|&b| b == b'\n').count());
        place.at_line(line).error(Fault::NotUtf8(rest.first().copied().unwrap_or_default()))
    })
}

impl Iterator for Pairs {
    type Item = Result<Pair, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.done {
            return None;
        }
        let pair = match self.format {
            Format::JsonLines => self.one_line(),
            #[cfg(feature = "parquet")]
            Format::Parquet => self.rows.as_mut()?.next(),
            _ => Some(self.whole()),
        };
        self.found_any = true;
        let is_line = |error: &ReadError| error.place.line.is_some();
        self.done = !self.format.holds_several()
            || match &pair {
                Some(Ok(_)) => false,
                Some(Err(error)) => !is_line(error),
                None => true,
            };
        pair
    }
}

impl std::fmt::Debug for Pairs {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { place, format, line, .. } = self;
        f.debug_struct("Pairs")
            .field("place", place)
            .field("format", format)
            .field("line", line)
            .finish_non_exhaustive()
    }
}
