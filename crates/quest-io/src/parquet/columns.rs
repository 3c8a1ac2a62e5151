//! Values of one column with the levels of Parquet: how deep each is defined, and at which depth a list goes on.

use std::io::{self, Write};

use parquet::{
    column::writer::ColumnWriter,
    data_type::ByteArray,
    errors::ParquetError,
    file::writer::{SerializedColumnWriter, SerializedFileWriter},
};

/// A column of rows that were not written yet. Every column is optional, and so is every element of a list, as Arrow has them.
#[derive(Debug)]
pub(super) struct Column {
    values: Values,
    definitions: Vec<i16>,
    /// Empty for a column without lists.
    repetitions: Vec<i16>,
}

#[derive(Debug)]
enum Values {
    Longs(Vec<i64>),
    Doubles(Vec<f64>),
    Flags(Vec<bool>),
    Texts(Vec<ByteArray>),
}

/// The form of a column.
#[derive(Clone, Copy, Debug)]
pub(super) enum Kind {
    Long,
    Double,
    Flag,
    Text,
}

impl Column {
    pub(super) fn new(kind: Kind) -> Self {
        let values = match kind {
            Kind::Long => Values::Longs(Vec::new()),
            Kind::Double => Values::Doubles(Vec::new()),
            Kind::Flag => Values::Flags(Vec::new()),
            Kind::Text => Values::Texts(Vec::new()),
        };
        Self { values, definitions: Vec::new(), repetitions: Vec::new() }
    }

    /// A row with a whole number; unsigned ones keep their bits.
    pub(super) fn long(&mut self, value: u64) {
        if let Values::Longs(values) = &mut self.values {
            values.push(value.cast_signed());
            self.definitions.push(1);
        }
    }

    pub(super) fn double(&mut self, value: Option<f64>) {
        if let Values::Doubles(values) = &mut self.values {
            values.extend(value);
            self.definitions.push(i16::from(value.is_some()));
        }
    }

    pub(super) fn text(&mut self, value: Option<&str>) {
        if let Values::Texts(values) = &mut self.values {
            values.extend(value.map(ByteArray::from));
            self.definitions.push(i16::from(value.is_some()));
        }
    }

    /// A row with a list of numbers, or with none.
    pub(super) fn doubles(&mut self, list: Option<&[f64]>) {
        if let Values::Doubles(values) = &mut self.values {
            values.extend(list.unwrap_or_default());
        }
        self.list(list.map(<[f64]>::len));
    }

    pub(super) fn flags(&mut self, list: &[bool]) {
        if let Values::Flags(values) = &mut self.values {
            values.extend(list);
        }
        self.list(Some(list.len()));
    }

    /// A row with a list of points, each of which is a list of two numbers.
    pub(super) fn points(&mut self, list: impl IntoIterator<Item = [f64; 2]>) {
        let before = self.definitions.len();
        let Values::Doubles(values) = &mut self.values else { return };
        for [u, v] in list {
            values.extend([u, v]);
            self.definitions.extend([5, 5]);
            self.repetitions.extend([1, 2]);
        }
        self.begin(before, 1);
    }

    /// The levels of a list of so many values.
    fn list(&mut self, count: Option<usize>) {
        let before = self.definitions.len();
        let count_or_none = count.unwrap_or(0);
        self.definitions.extend(std::iter::repeat_n(3, count_or_none));
        self.repetitions.extend(std::iter::repeat_n(1, count_or_none));
        self.begin(before, i16::from(count.is_some()));
    }

    /// The first of the levels from `before` on begins a row; one without any has the definition of an empty one.
    fn begin(&mut self, before: usize, empty: i16) {
        if let Some(first) = self.repetitions.get_mut(before) {
            *first = 0;
        } else {
            self.definitions.push(empty);
            self.repetitions.push(0);
        }
    }

    /// Writes the rows and forgets them.
    fn write(&mut self, mut writer: SerializedColumnWriter<'_>) -> Result<(), ParquetError> {
        let definitions = Some(self.definitions.as_slice());
        let repetitions = (!self.repetitions.is_empty()).then_some(self.repetitions.as_slice());
        match (writer.untyped(), &self.values) {
            (ColumnWriter::Int64ColumnWriter(column), Values::Longs(values)) => {
                column.write_batch(values, definitions, repetitions)?
            }
            (ColumnWriter::DoubleColumnWriter(column), Values::Doubles(values)) => {
                column.write_batch(values, definitions, repetitions)?
            }
            (ColumnWriter::BoolColumnWriter(column), Values::Flags(values)) => {
                column.write_batch(values, definitions, repetitions)?
            }
            (ColumnWriter::ByteArrayColumnWriter(column), Values::Texts(values)) => {
                column.write_batch(values, definitions, repetitions)?
            }
            _ => return Err(ParquetError::General("a column has another form than the schema".to_owned())),
        };
        self.clear();
        writer.close()
    }

    fn clear(&mut self) {
        match &mut self.values {
            Values::Longs(values) => values.clear(),
            Values::Doubles(values) => values.clear(),
            Values::Flags(values) => values.clear(),
            Values::Texts(values) => values.clear(),
        }
        self.definitions.clear();
        self.repetitions.clear();
    }
}

/// Writes the rows of all columns as one group, and forgets them.
pub(super) fn write_group<W: Write + Send>(
    file: &mut SerializedFileWriter<W>,
    columns: &mut [Column],
) -> io::Result<()> {
    let write = || {
        let mut group = file.next_row_group()?;
        for column in columns {
            if let Some(writer) = group.next_column()? {
                column.write(writer)?;
            }
        }
        group.close().map(|_| ())
    };
    write().map_err(plain)
}

/// The error of the target itself, where it is one.
pub(super) fn plain(error: ParquetError) -> io::Error {
    match error {
        ParquetError::External(error) => match error.downcast::<io::Error>() {
            Ok(error) => *error,
            Err(error) => io::Error::other(error),
        },
        other => io::Error::other(other),
    }
}
