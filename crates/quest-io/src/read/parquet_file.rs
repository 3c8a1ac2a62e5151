//! Parquet: one pair a row, with the columns of `quest_pose.arrow`.
//!
//! `x1`, `x2` are lists of points of two numbers; `pair` is the key of the pair, `name` its name, `camera1`, `params1`, `camera2`,
//! `params2` are its cameras, `score` has a number for each match. Other columns are left out. A coordinate that is null, NaN or
//! infinite makes its match one without a bearing.

use std::{
    fs::File,
    io::{self, BufRead, Write},
    panic::{AssertUnwindSafe, catch_unwind},
    path::Path,
};

use parquet::{
    column::reader::{ColumnReader, ColumnReaderImpl},
    data_type::{ByteArray, DataType},
    errors::ParquetError,
    file::reader::{FileReader, SerializedFileReader},
    schema::types::{ColumnDescriptor, Type},
};
use quest_core::Camera;

use super::bounded;
use crate::{
    Gap, Pair,
    camera::camera,
    error::{Fault, Place, ReadError},
};

/// The pairs of a file, one after the other.
pub(super) struct Rows {
    place: Place,
    file: SerializedFileReader<File>,
    /// The group of rows that comes next.
    group: usize,
    /// Rows of the group that is open which were not read yet.
    left: usize,
    columns: Columns,
    /// Rows read so far.
    row: usize,
    most: u64,
}

/// The columns of the group that is open.
#[derive(Default)]
struct Columns {
    pair: Option<Column>,
    name: Option<Column>,
    points: [Option<Column>; 2],
    cameras: [Option<Column>; 2],
    params: [Option<Column>; 2],
    score: Option<Column>,
}

/// One of them.
struct Column {
    reader: ColumnReader,
    name: &'static str,
    /// The level of a value that is there, and the levels of an element of the outer list and of the inner one.
    value: i16,
    elements: Vec<i16>,
}

/// What a row has in a column of numbers.
struct Numbers {
    /// NaN for those that are missing.
    values: Vec<f64>,
    /// How many stand in each of the inner lists, where there are any.
    widths: Vec<usize>,
    is_null: bool,
}

impl Rows {
    /// The pairs of `path`, or of `input`, which begins with what was already read, where that is no file that can be read from its end.
    pub(super) fn open(
        path: &Path,
        place: &Place,
        input: &mut dyn BufRead,
        most: u64,
    ) -> Result<Self, ReadError> {
        let mut open = || -> Result<_, Fault> {
            let file = if path.is_file() { File::open(path)? } else { copied(input, most)? };
            guarded(|| SerializedFileReader::new(file))
        };
        let file = open().map_err(|fault| place.clone().error(fault))?;
        Ok(Self { place: place.clone(), file, group: 0, left: 0, columns: Columns::default(), row: 0, most })
    }

    /// The next pair. The place of an error has a line where only this row is no pair.
    pub(super) fn next(&mut self) -> Option<Result<Pair, ReadError>> {
        while self.left == 0 {
            if self.group == self.file.num_row_groups() {
                return None;
            }
            if let Err(fault) = self.open_group() {
                return Some(Err(self.place.clone().error(fault)));
            }
        }
        self.left -= 1;
        self.row += 1;
        let row = Row { place: self.place.at_line(self.row), most: self.most };
        Some(match self.columns.read(&row) {
            Ok(pair) => pair,
            Err(fault) => Err(self.place.at_key(format!("row {}", self.row)).error(fault)),
        })
    }

    fn open_group(&mut self) -> Result<(), Fault> {
        let metadata = self.file.metadata().row_group(self.group);
        let group = guarded(|| self.file.get_row_group(self.group))?;
        let schema = self.file.metadata().file_metadata().schema_descr();
        let column = |name: &'static str| {
            let index = schema.columns().iter().position(|leaf| leaf.path().parts()[0] == name);
            let Some(index) = index else { return Ok(None) };
            let leaf = schema.column(index);
            let (value, elements) = levels(schema.root_schema(), &leaf);
            let place = metadata.column(index);
            let starts = [Some(place.data_page_offset()), place.dictionary_page_offset()];
            if place.compressed_size() < 0 || starts.into_iter().flatten().any(|start| start < 0) {
                return Err(Fault::Parquet(format!(
                    "found a damaged file of Parquet: {name} has no place in it"
                )));
            }
            let reader = guarded(|| group.get_column_reader(index))?;
            Ok::<_, Fault>(Some(Column { reader, name, value, elements }))
        };
        self.columns = Columns {
            pair: column("pair")?,
            name: column("name")?,
            points: [column("x1")?, column("x2")?],
            cameras: [column("camera1")?, column("camera2")?],
            params: [column("params1")?, column("params2")?],
            score: column("score")?,
        };
        if self.columns.points.iter().any(Option::is_none) {
            let names: Vec<_> = schema.root_schema().get_fields().iter().map(|field| field.name()).collect();
            let found = names.join(", ");
            return Err(Fault::Parquet(format!("found the columns {found}, expected also x1 and x2")));
        }
        self.left = usize::try_from(metadata.num_rows()).unwrap_or(0);
        self.group += 1;
        Ok(())
    }
}

/// A file of its own that holds all of `input`: the end of a file of Parquet is read first.
fn copied(input: &mut dyn BufRead, most: u64) -> Result<File, Fault> {
    let mut bytes = Vec::new();
    bounded::all(input, most, &mut bytes)?;
    if bytes.is_empty() {
        return Err(Fault::Empty);
    }
    let mut file = tempfile::tempfile()?;
    file.write_all(&bytes)?;
    Ok(file)
}

/// The level at which the value of a leaf is there, and that at which an element of each list on the way to it is.
fn levels(root: &Type, leaf: &ColumnDescriptor) -> (i16, Vec<i16>) {
    let (mut elements, mut level, mut node) = (Vec::new(), 0, root);
    for part in leaf.path().parts() {
        let Some(field) = node.get_fields().iter().find(|field| field.name() == part) else { break };
        let info = field.get_basic_info();
        level +=
            i16::from(!info.has_repetition() || info.repetition() != parquet::basic::Repetition::REQUIRED);
        if info.has_repetition() && info.repetition() == parquet::basic::Repetition::REPEATED {
            elements.push(level);
        }
        if field.is_primitive() {
            break;
        }
        node = field;
    }
    (level, elements)
}

/// The error of the system itself, where it is one.
fn damaged(error: ParquetError) -> Fault {
    match error {
        ParquetError::External(error) => match error.downcast::<io::Error>() {
            Ok(error) => Fault::Io(*error),
            Err(error) => Fault::Parquet(format!("found a damaged file of Parquet: {error}")),
        },
        other => Fault::Parquet(format!("found a damaged file of Parquet: {other}")),
    }
}

/// Calls the library, which panics at some of the numbers that a damaged file may hold.
fn guarded<T>(call: impl FnOnce() -> Result<T, ParquetError>) -> Result<T, Fault> {
    let called = catch_unwind(AssertUnwindSafe(call));
    called
        .unwrap_or_else(|_| Err(ParquetError::General("a number is out of its range".to_owned())))
        .map_err(damaged)
}

/// Where the row is that is read, and how large it may be.
struct Row {
    place: Place,
    most: u64,
}

impl Row {
    fn refuse(&self, key: &str, message: String) -> ReadError {
        self.place.at_key(key).error(Fault::Parquet(message))
    }
}

impl Columns {
    /// The pair of the next row. All columns go on to the next row also where it is none; the outer error is that of the file.
    fn read(&mut self, row: &Row) -> Result<Result<Pair, ReadError>, Fault> {
        let numbers = |column: &mut Option<Column>| column.as_mut().map(|c| c.numbers(row)).transpose();
        let points = [numbers(&mut self.points[0])?, numbers(&mut self.points[1])?];
        let params = [numbers(&mut self.params[0])?, numbers(&mut self.params[1])?];
        let score = numbers(&mut self.score)?;
        let text = |column: &mut Option<Column>| column.as_mut().map_or(Ok(None), Column::text);
        let [camera1, camera2] = &mut self.cameras;
        let models = [text(camera1)?, text(camera2)?];
        let name = text(&mut self.name)?;
        let key = self.pair.as_mut().map_or(Ok(None), Column::key)?;
        let pair = || {
            let [Some(x1), Some(x2)] = &points else { return Err(row.refuse("x1", "found none".to_owned())) };
            let (x1, x2) = (x1.points(row, "x1")?, x2.points(row, "x2")?);
            if x1.len() != x2.len() {
                let message = format!("found {} points, expected {} as in x1", x2.len(), x1.len());
                return Err(row.refuse("x2", message));
            }
            let matches: Vec<_> = x1.iter().zip(&x2).map(|(a, b)| [a[0], a[1], b[0], b[1]]).collect();
            let scores = score.filter(|score| !score.is_null).map(|score| score.values);
            if let Some(found) = scores.as_ref().map(Vec::len).filter(|&found| found != matches.len()) {
                let fault = Fault::ScoreCount { found, expected: matches.len() };
                return Err(row.place.at_key("score").error(fault));
            }
            if let Some(score) = scores.iter().flatten().find(|score| !score.is_finite()) {
                return Err(row.place.at_key("score").error(Fault::NotANumber(score.to_string())));
            }
            let cameras = cameras(row, &models, &params)?;
            let first_gap = gap(row, &matches);
            let place = row.place.clone();
            Ok(Pair { name, key, cameras, matches, first_gap, scores, place, ..Pair::default() })
        };
        Ok(pair().map_err(|error: ReadError| ReadError { key, ..error }))
    }
}

/// The first coordinate that is missing.
fn gap(row: &Row, matches: &[[f64; 4]]) -> Option<Gap> {
    let has_gap = |m: &[f64; 4]| m.iter().any(|x| x.is_nan());
    let index = matches.iter().position(has_gap)?;
    let column = if matches[index][..2].iter().any(|x| x.is_nan()) { "x1" } else { "x2" };
    let message = Fault::NotANumber("NaN".to_owned()).to_string();
    Some(Gap { place: row.place.at_key(format!("{column}[{index}]")), message })
}

fn cameras(
    row: &Row,
    models: &[Option<String>; 2],
    params: &[Option<Numbers>; 2],
) -> Result<Option<[Camera; 2]>, ReadError> {
    const NAMES: [[&str; 2]; 2] = [["camera1", "params1"], ["camera2", "params2"]];
    let one = |k: usize| {
        let Some(model) = &models[k] else { return Ok(None) };
        let [model_name, params_name] = NAMES[k];
        let Some(params) = params[k].as_ref().filter(|params| !params.is_null) else {
            return Err(
                row.refuse(params_name, format!("found no parameters of {model_name}, expected a list"))
            );
        };
        let made = camera(model, None, &params.values);
        made.map(Some).map_err(|error| row.place.at_key(model_name).error(error))
    };
    match (one(0)?, one(1)?) {
        (None, None) => Ok(None),
        (Some(camera1), camera2) => Ok(Some([camera1, camera2.unwrap_or(camera1)])),
        (None, Some(_)) => Err(row.place.at_key("camera2").error(Fault::FirstCameraMissing)),
    }
}

impl Numbers {
    /// The numbers as points, infinite ones as NaN.
    fn points(&self, row: &Row, name: &str) -> Result<Vec<[f64; 2]>, ReadError> {
        if self.is_null {
            return Err(row.refuse(name, "found null, expected a list of points".to_owned()));
        }
        if let Some(width) = self.widths.iter().find(|&&width| width != 2) {
            return Err(row.refuse(name, format!("found a point of {width} numbers, expected 2")));
        }
        let usable = |x: f64| if x.is_finite() { x } else { f64::NAN };
        Ok(self.values.as_chunks::<2>().0.iter().map(|point| point.map(usable)).collect())
    }
}

impl Column {
    /// The next row of a column of numbers, of lists of numbers, or of lists of lists.
    fn numbers(&mut self, row: &Row) -> Result<Numbers, Fault> {
        let (values, definitions, repetitions) = match &mut self.reader {
            ColumnReader::DoubleColumnReader(reader) => one(reader)?,
            ColumnReader::FloatColumnReader(reader) => {
                let (values, definitions, repetitions) = one(reader)?;
                (values.into_iter().map(f64::from).collect(), definitions, repetitions)
            }
            _ => return Err(self.other("lists of numbers with a point")),
        };
        if values.len() as u64 * 8 > row.most {
            return Err(Fault::TooLarge { most: row.most });
        }
        let depth = if self.name.starts_with('x') { 2 } else { 1 };
        if self.elements.len() != depth {
            return Err(self.other(if depth == 2 { "lists of points" } else { "lists of numbers" }));
        }
        let is_element = |&&definition: &&i16| definition >= self.elements[depth - 1];
        let mut values = values.into_iter();
        let mut number = |&definition: &i16| {
            if definition == self.value { values.next().unwrap_or(f64::NAN) } else { f64::NAN }
        };
        let mut widths = Vec::new();
        for (&definition, &repetition) in definitions.iter().zip(&repetitions).filter(|_| depth == 2) {
            if repetition < 2 && definition >= self.elements[0] {
                widths.push(0);
            }
            if let Some(width) = widths.last_mut().filter(|_| definition >= self.elements[1]) {
                *width += 1;
            }
        }
        // An empty list is one level below its elements, a list that is missing two.
        let is_null = definitions.first().is_none_or(|&definition| definition + 1 < self.elements[0]);
        Ok(Numbers {
            values: definitions.iter().filter(is_element).map(&mut number).collect(),
            widths,
            is_null,
        })
    }

    fn text(&mut self) -> Result<Option<String>, Fault> {
        let ColumnReader::ByteArrayColumnReader(reader) = &mut self.reader else {
            return Err(self.other("text"));
        };
        let values: Vec<ByteArray> = one(reader)?.0;
        let Some(value) = values.first() else { return Ok(None) };
        match std::str::from_utf8(value.data()) {
            Ok(text) => Ok(Some(text.to_owned())),
            Err(_) => Err(self.other("text")),
        }
    }

    fn key(&mut self) -> Result<Option<u64>, Fault> {
        Ok(match &mut self.reader {
            // Numbers without a sign keep their bits.
            ColumnReader::Int64ColumnReader(reader) => one(reader)?.0.first().map(|key| key.cast_unsigned()),
            ColumnReader::Int32ColumnReader(reader) => {
                one(reader)?.0.first().map(|key| u64::from(key.cast_unsigned()))
            }
            _ => return Err(self.other("whole numbers")),
        })
    }

    fn other(&self, expected: &str) -> Fault {
        Fault::Parquet(format!("the column {} is of another form, expected {expected}", self.name))
    }
}

/// The values of one row with their levels.
#[expect(clippy::type_complexity, reason = "the three lists of Parquet")]
fn one<T: DataType>(reader: &mut ColumnReaderImpl<T>) -> Result<(Vec<T::T>, Vec<i16>, Vec<i16>), Fault> {
    let (mut values, mut definitions, mut repetitions) = (Vec::new(), Vec::new(), Vec::new());
    let read =
        guarded(|| reader.read_records(1, Some(&mut definitions), Some(&mut repetitions), &mut values))?;
    if read.0 == 1 {
        return Ok((values, definitions, repetitions));
    }
    Err(Fault::Parquet("found a damaged file of Parquet: a column ends before the others".to_owned()))
}
