//! Matches and poses as Parquet, with the columns of `quest_pose.arrow`: docs/cluster.md.
//!
//! Arrow knows lists of a fixed size and Parquet does not: the form of the columns in Arrow stands beside the data
//! (`*.arrow.base64`, pyarrow's `schema.serialize()`), as every program that writes Arrow to Parquet puts it there. A test of the
//! Python package holds it together with `quest_pose.arrow`.

mod columns;

use std::{
    io::{self, Write},
    sync::Arc,
};

use parquet::{
    basic::{Compression, Type as Physical},
    file::{metadata::KeyValue, properties::WriterProperties, writer::SerializedFileWriter},
    schema::{parser::parse_message_type, types::SchemaDescriptor},
};
use quest_core::Camera;

use self::columns::{Column, Kind, plain, write_group};
use crate::{EstimateRecord, FoundRecord};

/// Rows that are written together, and read together. A thousand pairs of 500 matches are 16 MB.
const GROUP: usize = 1000;

const MATCHES: [&str; 2] = [include_str!("matches.schema"), include_str!("matches.arrow.base64")];
const POSES: [&str; 2] = [include_str!("poses.schema"), include_str!("poses.arrow.base64")];

/// A table in the making. Its bytes are handed on as groups of rows are whole.
struct Table {
    file: SerializedFileWriter<Vec<u8>>,
    columns: Vec<Column>,
    /// Rows that were not written yet.
    rows: usize,
}

impl Table {
    fn new([schema, arrow]: [&str; 2]) -> io::Result<Self> {
        let schema = Arc::new(parse_message_type(schema).map_err(plain)?);
        let leaves = SchemaDescriptor::new(Arc::clone(&schema));
        let kind = |physical| match physical {
            Physical::INT64 => Kind::Long,
            Physical::BOOLEAN => Kind::Flag,
            Physical::BYTE_ARRAY => Kind::Text,
            _ => Kind::Double,
        };
        let columns = leaves.columns().iter().map(|leaf| Column::new(kind(leaf.physical_type()))).collect();
        let arrow = KeyValue::new("ARROW:schema".to_owned(), arrow.trim_end().to_owned());
        let properties = WriterProperties::builder()
            .set_compression(Compression::SNAPPY)
            // Coordinates hardly repeat.
            .set_dictionary_enabled(false)
            .set_key_value_metadata(Some(vec![arrow]))
            .build();
        let file = SerializedFileWriter::new(Vec::new(), schema, Arc::new(properties)).map_err(plain)?;
        Ok(Self { file, columns, rows: 0 })
    }

    /// Ends a row, each of whose columns has been given its value.
    fn end_row(&mut self, writer: &mut dyn Write) -> io::Result<()> {
        self.rows += 1;
        if self.rows == GROUP { self.flush(writer) } else { Ok(()) }
    }

    fn flush(&mut self, writer: &mut dyn Write) -> io::Result<()> {
        if self.rows > 0 {
            write_group(&mut self.file, &mut self.columns)?;
            self.rows = 0;
        }
        self.hand_on(writer)
    }

    fn finish(mut self, writer: &mut dyn Write) -> io::Result<()> {
        self.flush(writer)?;
        self.file.finish().map_err(plain)?;
        self.hand_on(writer)
    }

    fn hand_on(&mut self, writer: &mut dyn Write) -> io::Result<()> {
        self.file.flush()?;
        writer.write_all(&std::mem::take(self.file.inner_mut()))
    }
}

impl std::fmt::Debug for Table {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Table").field("rows", &self.rows).finish_non_exhaustive()
    }
}

/// The matches of pairs, a row each, as `quest-cli estimate` and `quest_pose.arrow.estimate` read them.
#[derive(Debug)]
pub struct MatchesTable(Table);

impl MatchesTable {
    /// A table without rows.
    ///
    /// # Errors
    /// None that is known: the form of the table is a constant.
    pub fn new() -> io::Result<Self> {
        Table::new(MATCHES).map(Self)
    }

    /// Appends a pair: its key, its name, its cameras, and `u1, v1, u2, v2` of its matches.
    ///
    /// # Errors
    /// Those of `writer`, which gets the rows a thousand at a time.
    pub fn write(
        &mut self,
        key: u64,
        name: &str,
        cameras: [&Camera; 2],
        matches: &[[f32; 4]],
        writer: &mut dyn Write,
    ) -> io::Result<()> {
        if let [pair, x1, x2, camera1, params1, camera2, params2, named] = self.0.columns.as_mut_slice() {
            pair.long(key);
            let [first, second] =
                [0, 2].map(|k| matches.iter().map(move |m| [m[k], m[k + 1]].map(f64::from)));
            x1.points(first);
            x2.points(second);
            for (camera, model, params) in [(cameras[0], camera1, params1), (cameras[1], camera2, params2)] {
                model.text(Some(camera.model().name()));
                params.doubles(Some(camera.params()));
            }
            named.text(Some(name));
        }
        self.0.end_row(writer)
    }

    /// Writes what is left, and the end of the file.
    ///
    /// # Errors
    /// Those of `writer`.
    pub fn finish(self, writer: &mut dyn Write) -> io::Result<()> {
        self.0.finish(writer)
    }
}

/// The poses of pairs, a row each, with the columns of `quest_pose.arrow.schema_out()` and the name of the pair.
#[derive(Debug)]
pub struct PosesTable(Table);

impl PosesTable {
    /// A table without rows.
    ///
    /// # Errors
    /// None that is known: the form of the table is a constant.
    pub fn new() -> io::Result<Self> {
        Table::new(POSES).map(Self)
    }

    /// Appends a result.
    ///
    /// # Errors
    /// Those of `writer`, which gets the rows a thousand at a time.
    pub fn write(&mut self, record: &EstimateRecord, writer: &mut dyn Write) -> io::Result<()> {
        self.row(record);
        self.0.end_row(writer)
    }

    fn row(&mut self, record: &EstimateRecord) {
        let [
            pair,
            model,
            reason,
            q,
            t,
            covariance,
            parallax,
            noise,
            inlier_count,
            invalid_count,
            iterations,
            score,
            inliers,
            other_q,
            other_t,
            normal,
            false_share,
            unmoved,
            name,
        ] = self.0.columns.as_mut_slice()
        else {
            return;
        };
        let found = record.found.as_ref();
        let pose = found.map(|found| &found.pose);
        let other = found.and_then(|found| Some(&found.runner_up.as_ref()?.pose));
        pair.long(record.key);
        model.text(record.model);
        reason.text(record.reason.as_deref());
        q.doubles(pose.map(|pose| pose.q_21.as_slice()));
        t.doubles(pose.map(|pose| pose.t_21.as_slice()));
        covariance.doubles(found.map(|found| found.covariance.as_flattened()));
        parallax.double(pose.map(|pose| pose.parallax));
        noise.double(found.map(|found| found.noise_px));
        let count = |of: fn(&FoundRecord) -> usize| found.map_or(0, of) as u64;
        inlier_count.long(count(|found| found.inlier_count));
        invalid_count.long(record.invalid_count as u64);
        iterations.long(count(|found| found.iterations));
        score.double(found.map(|found| found.score));
        inliers.flags(found.map_or(&vec![false; record.match_count], |found| &found.inliers));
        other_q.doubles(other.map(|pose| pose.q_21.as_slice()));
        other_t.doubles(other.map(|pose| pose.t_21.as_slice()));
        normal.doubles(found.and_then(|found| Some(found.normal.as_ref()?.as_slice())));
        false_share.double(found.map(|found| found.false_share));
        unmoved.long(count(|found| found.unmoved));
        name.text(record.name.as_deref());
    }

    /// Writes what is left, and the end of the file.
    ///
    /// # Errors
    /// Those of `writer`.
    pub fn finish(self, writer: &mut dyn Write) -> io::Result<()> {
        self.0.finish(writer)
    }
}
