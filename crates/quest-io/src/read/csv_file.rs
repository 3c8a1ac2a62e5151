//! CSV: the header `u1,v1,u2,v2[,score]`, one match a row.
//!
//! A coordinate that is NaN, infinite or an empty field makes its match one without a bearing.

use csv::{ReaderBuilder, StringRecord, Trim};

use crate::{
    Gap, Pair,
    error::{Fault, Place, ReadError},
};

const COLUMNS: [&str; 4] = ["u1", "v1", "u2", "v2"];
const SCORE: &str = "score";

/// The pair in `text`. Columns are found by name, in any order.
pub(crate) fn parse(place: &Place, text: &str) -> Result<Pair, ReadError> {
    let mut reader = ReaderBuilder::new().flexible(true).trim(Trim::All).from_reader(text.as_bytes());
    // The text is UTF-8 and rows may have any length: there is nothing left that the parser could refuse.
    let csv_error = |e: &csv::Error| place.clone().error(Fault::Csv(e.to_string()));
    let header = reader.headers().map_err(|e| csv_error(&e))?.clone();
    let (columns, score) = columns(&header)
        .ok_or_else(|| place.at_line(1).error(Fault::Header(header.iter().collect::<Vec<_>>().join(","))))?;

    let mut pair = Pair {
        place: place.clone(),
        scores: score.map(|_| Vec::new()),
        unknown_keys: header.iter().filter(|c| !known(c)).map(str::to_owned).collect(),
        ..Pair::default()
    };
    for row in reader.records() {
        let row = row.map_err(|e| csv_error(&e))?;
        if row.len() == 1 && row[0].is_empty() {
            continue;
        }
        let refuse = |(key, fault): Refusal| {
            let here = place.at_line(line(text, &row));
            Place { key: key.map(str::to_owned), ..here }.error(fault)
        };
        if row.len() != header.len() {
            return Err(refuse((None, Fault::FieldCount { found: row.len(), expected: header.len() })));
        }
        let mut values = [0.0; 4];
        for ((value, column), name) in values.iter_mut().zip(columns).zip(COLUMNS) {
            *value = coordinate(name, &row[column]).map_err(refuse)?;
            if value.is_nan() && pair.first_gap.is_none() {
                let error = refuse((Some(name), Fault::NotANumber(row[column].to_owned())));
                pair.first_gap = Some(Gap { message: error.fault.to_string(), place: error.place });
            }
        }
        pair.matches.push(values);
        if let (Some(scores), Some(column)) = (&mut pair.scores, score) {
            scores.push(number(SCORE, &row[column]).map_err(refuse)?);
        }
    }
    Ok(pair)
}

/// The error of a row, with its column if it concerns one.
type Refusal = (Option<&'static str>, Fault);

/// The line that a row stands on. The csv crate gives the end of the row before, which may be followed by blank lines
/// and one half of `\r\n`.
fn line(text: &str, row: &StringRecord) -> usize {
    let end = row.position().map_or(0, |p| usize::try_from(p.byte()).unwrap_or(usize::MAX));
    let text = text.as_bytes();
    let blank = text[end.min(text.len())..].iter().take_while(|b| b"\r\n".contains(b)).count();
    text[..(end + blank).min(text.len())].split(|&b| b == b'\n').count()
}

fn known(column: &str) -> bool {
    COLUMNS.contains(&column) || column == SCORE
}

/// The columns of the coordinates and of the score; `None` if a coordinate is missing or a column appears twice.
fn columns(header: &StringRecord) -> Option<([usize; 4], Option<usize>)> {
    let find = |name: &str| {
        let mut places = header.iter().enumerate().filter(|(_, column)| *column == name).map(|(k, _)| k);
        (places.next(), places.next())
    };
    let mut columns = [0; 4];
    for (column, name) in columns.iter_mut().zip(COLUMNS) {
        *column = match find(name) {
            (Some(k), None) => k,
            _ => return None,
        };
    }
    match find(SCORE) {
        (score, None) => Some((columns, score)),
        _ => None,
    }
}

/// A coordinate; NaN where it is infinite, NaN or missing. Tables write a missing number as an empty field.
fn coordinate(column: &'static str, field: &str) -> Result<f64, Refusal> {
    match field.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        Ok(_) => Ok(f64::NAN),
        Err(_) if field.is_empty() => Ok(f64::NAN),
        Err(_) => Err((Some(column), Fault::NotANumber(field.to_owned()))),
    }
}

fn number(column: &'static str, field: &str) -> Result<f64, Refusal> {
    let value = field.parse::<f64>().ok().filter(|v| v.is_finite());
    value.ok_or_else(|| (Some(column), Fault::NotANumber(field.to_owned())))
}
