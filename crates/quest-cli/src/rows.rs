//! Results as lines of JSON and rows of CSV.

use std::io::{self, Write};

use quest_io::{CandidateRecord, EstimateRecord, SolveRecord};
use serde::Serialize;

use crate::words;

/// One line of JSON.
pub(crate) fn write_line<T: Serialize>(writer: &mut dyn Write, record: &T) -> io::Result<()> {
    // In one piece, so that a reader of the pipe never sees half a line.
    let mut line = serde_json::to_vec(record)?;
    line.push(b'\n');
    writer.write_all(&line)
}

/// A header and one row of CSV for each record.
pub(crate) fn write_csv<T: Serialize>(writer: &mut dyn Write, records: &[T]) -> io::Result<()> {
    let mut csv = csv::Writer::from_writer(writer);
    records.iter().try_for_each(|record| csv.serialize(record)).map_err(plain)?;
    csv.flush()
}

/// The error of the target itself. Its kind distinguishes a closed pipe from a full disk.
fn plain(error: csv::Error) -> io::Error {
    match error.into_kind() {
        csv::ErrorKind::Io(error) => error,
        other => io::Error::other(format!("{other:?}")),
    }
}

/// The columns of [`write_candidates`]. Only JSON has the depths, because their number varies.
const COLUMNS: [&str; 18] = [
    "pair",
    "name",
    "solver",
    "candidate",
    "kind",
    "qw",
    "qx",
    "qy",
    "qz",
    "tx",
    "ty",
    "tz",
    "residual",
    "in_front",
    "matches",
    "feasible",
    "rotation_error_deg",
    "translation_error_deg",
];

/// One row of CSV for each candidate of the pair with number `pair`, counted from one. The header comes before the rows of the
/// first pair.
pub(crate) fn write_candidates(writer: &mut dyn Write, pair: usize, record: &SolveRecord) -> io::Result<()> {
    let rows = record.candidates.iter().enumerate().map(|(i, candidate)| row(pair, i + 1, record, candidate));
    write_rows(writer, header(pair, COLUMNS).into_iter().chain(rows.map(Vec::from)))
}

/// The columns of the first pair.
fn header<const N: usize>(pair: usize, columns: [&str; N]) -> Option<Vec<String>> {
    (pair == 1).then(|| columns.map(str::to_owned).to_vec())
}

/// Rows of CSV.
pub(crate) fn write_rows(
    writer: &mut dyn Write,
    rows: impl IntoIterator<Item = Vec<String>>,
) -> io::Result<()> {
    let mut csv = csv::Writer::from_writer(writer);
    rows.into_iter().try_for_each(|row| csv.write_record(row)).map_err(plain)?;
    csv.flush()
}

fn row(pair: usize, number: usize, record: &SolveRecord, c: &CandidateRecord) -> [String; COLUMNS.len()] {
    let ([qw, qx, qy, qz], [tx, ty, tz]) = (c.q_21.map(text), c.t_21.map(text));
    let error = |e: Option<f64>| e.map(text).unwrap_or_default();
    [
        pair.to_string(),
        record.name.clone().unwrap_or_default(),
        record.solver.to_owned(),
        number.to_string(),
        c.kind.to_owned(),
        qw,
        qx,
        qy,
        qz,
        tx,
        ty,
        tz,
        text(c.residual),
        c.in_front.to_string(),
        record.matches.to_string(),
        c.feasible.to_string(),
        error(c.rotation_error_deg),
        error(c.translation_error_deg),
    ]
}

/// The columns of [`write_estimate`]. Only JSON has the inliers and the covariance.
const ESTIMATE_COLUMNS: [&str; 19] = [
    "pair",
    "name",
    "model",
    "qw",
    "qx",
    "qy",
    "qz",
    "tx",
    "ty",
    "tz",
    "parallax",
    "inlier_count",
    "matches",
    "score",
    "iterations",
    "elapsed_ms",
    "rotation_error_deg",
    "translation_error_deg",
    "reason",
];

/// One row of CSV for the estimate of the pair with number `pair`, counted from one. Without a pose its fields are empty but for the
/// reason. The header comes before the row of the first pair.
pub(crate) fn write_estimate(writer: &mut dyn Write, pair: usize, record: &EstimateRecord) -> io::Result<()> {
    let mut row = vec![
        pair.to_string(),
        record.name.clone().unwrap_or_default(),
        record.model.unwrap_or_default().to_owned(),
    ];
    match &record.found {
        Some(found) => {
            let pose = &found.pose;
            row.extend(pose.q_21.into_iter().chain(pose.t_21).chain([pose.parallax]).map(text));
            row.extend([found.inlier_count.to_string(), found.inliers.len().to_string(), text(found.score)]);
            row.push(found.iterations.to_string());
        }
        None => row.extend(std::iter::repeat_n(String::new(), 12)),
    }
    row.push(text(record.elapsed_ms));
    for error in [record.rotation_error_deg, record.translation_error_deg] {
        row.push(error.map(text).unwrap_or_default());
    }
    row.push(record.reason.as_deref().map(words::one_line).unwrap_or_default());
    write_rows(writer, header(pair, ESTIMATE_COLUMNS).into_iter().chain([row]))
}

/// All digits, with an exponent if that is shorter. The text is empty for NaN and infinity.
pub(crate) fn text(x: f64) -> String {
    if x.is_finite() { format!("{x:?}") } else { String::new() }
}
