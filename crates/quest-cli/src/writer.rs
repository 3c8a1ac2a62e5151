//! Results of pairs, in the format asked for.

use std::io::{self, Write};

use quest_io::{Earlier, EstimateRecord, Output, WriteError};
use serde::Serialize;

use crate::{
    Failure,
    options::{Format, OutputOptions},
    parquet::{self, PosesTable},
    rows,
};

/// The result of one pair.
pub(crate) trait Record: Serialize {
    /// The text under the heading; empty if there is no answer.
    fn table(&self, focal_length: Option<f64>) -> Option<String>;

    /// The rows of the pair with this number, counted from one. The first pair also has the header.
    fn write_csv(&self, writer: &mut dyn Write, pair: usize) -> io::Result<()>;

    /// The result where it can be a row of a table of poses.
    fn as_estimate(&self) -> Option<&EstimateRecord> {
        None
    }
}

/// Writes the results of pairs as they come.
pub(crate) struct Writer<R> {
    output: Output,
    format: Format,
    /// How many results there were.
    pairs: usize,
    /// The results of `--format json`, which are one value.
    kept: Vec<R>,
    /// The table of Parquet, where the result is one.
    poses: Option<PosesTable>,
}

impl<R: Record> Writer<R> {
    pub(crate) fn open(options: &OutputOptions, is_lines: bool) -> Result<Self, Failure> {
        let format = options.format(if is_lines { Format::Jsonl } else { Format::Table });
        Ok(Self { output: options.open()?, format, pairs: 0, kept: Vec::new(), poses: None })
    }

    /// As [`open`](Self::open), for a long run of poses, also into a table of Parquet: lines of JSON go to a file as they come. With
    /// `resume` also the lines of an earlier run, if there was one; until [`settle`](Self::settle) what it left stays as it is.
    pub(crate) fn open_long(
        options: &OutputOptions,
        is_lines: bool,
        resume: bool,
    ) -> Result<(Self, Option<Earlier>), Failure> {
        let format = options.format(if is_lines { Format::Jsonl } else { Format::Table });
        if format != Format::Jsonl || !is_lines || options.is_parquet() {
            if resume {
                let message =
                    "found --resume, expected several pairs as input and JSON Lines as output with it"
                        .to_owned();
                return Err(Failure::Arguments(message));
            }
            let Some(file) = options.file().filter(|_| options.is_parquet()) else {
                return Ok((Self::open(options, is_lines)?, None));
            };
            let poses = Some(parquet::made(PosesTable::new(), file)?);
            return Ok((
                Self { output: options.open_any()?, format, pairs: 0, kept: Vec::new(), poses },
                None,
            ));
        }
        let (output, earlier) = options.open_growing(resume)?;
        if resume && !output.is_file() {
            let message =
                "found --resume and an output that is no file, expected -o with the file of the earlier run";
            return Err(Failure::Arguments(message.to_owned()));
        }
        Ok((Self { output, format, pairs: 0, kept: Vec::new(), poses: None }, earlier))
    }

    /// Keeps a line of an earlier run as it is.
    pub(crate) fn keep(&mut self, line: &[u8]) -> Result<(), WriteError> {
        self.pairs += 1;
        self.output.write(|w| w.write_all(line))
    }

    /// The lines of the earlier run are this run's own: from here on what is written stays where the run is ended.
    pub(crate) fn settle(&mut self) -> Result<(), WriteError> {
        self.output.settle()
    }

    pub(crate) fn write(
        &mut self,
        heading: &str,
        record: R,
        focal_length: Option<f64>,
    ) -> Result<(), WriteError> {
        self.pairs += 1;
        let is_first = self.pairs == 1;
        if let (Some(poses), Some(record)) = (&mut self.poses, record.as_estimate()) {
            return self.output.write(|w| poses.write(record, w));
        }
        match self.format {
            Format::Json => {
                self.kept.push(record);
                Ok(())
            }
            Format::Jsonl => self.output.write(|w| rows::write_line(w, &record)),
            Format::Csv => self.output.write(|w| record.write_csv(w, self.pairs)),
            Format::Table => self.output.write(|w| {
                writeln!(w, "{}{heading}", if is_first { "" } else { "\n" })?;
                record.table(focal_length).map_or(Ok(()), |table| writeln!(w, "\n{table}"))
            }),
        }
    }

    /// One pair is one JSON object, JSON Lines are a list of them.
    pub(crate) fn finish(mut self, is_list: bool) -> Result<(), WriteError> {
        if let Some(poses) = self.poses.take() {
            self.output.write(|w| poses.finish(w))?;
        } else if self.format == Format::Json {
            let kept = &self.kept;
            self.output.write(|w| match kept.as_slice() {
                [one] if !is_list => quest_io::write_json(w, one),
                all => quest_io::write_json(w, all),
            })?;
        }
        self.output.finish()
    }
}
