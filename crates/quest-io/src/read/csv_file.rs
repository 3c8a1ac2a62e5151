//! CSV: one match or one point a row, under a header or without one, separated by commas, semicolons, tabs or blanks.
//!
//! The names of a header are `u1,v1,u2,v2` or `x1,y1,x2,y2`, of points `u,v` or `x,y`, in any case.
//!
//! A coordinate that is NaN, infinite or an empty field makes its match one without a bearing. Lines that begin with `#` are
//! comments; the first one may be the header, as NumPy's `savetxt` writes it.

use std::borrow::Cow;

use csv::{ReaderBuilder, StringRecord, Trim};

use super::table::{Columns, Rows};
use crate::error::{Fault, Place, ReadError};

const COMMENT: char = '#';

/// The rows in `text`. Under a header columns are found by name, in any order.
pub(super) fn parse<const N: usize>(
    place: &Place,
    text: &str,
    columns: &Columns<N>,
) -> Result<Rows<N>, ReadError> {
    let separator = separator(text);
    let text = &*plain(text, separator, columns);
    let mut reader = ReaderBuilder::new();
    reader.flexible(true).trim(Trim::All).has_headers(false).delimiter(separator);
    let mut reader = reader.from_reader(text.as_bytes());
    let mut records = reader.records().filter(|row| !row.as_ref().is_ok_and(is_blank)).peekable();
    // The text is UTF-8 and rows may have any length: there is nothing left that the parser could refuse.
    let csv_error = |e: &csv::Error| place.clone().error(Fault::Csv(e.to_string()));

    let first = match records.peek() {
        Some(Ok(row)) => row.clone(),
        Some(Err(error)) => return Err(csv_error(error)),
        None => return Err(place.clone().error(Fault::Empty)),
    };
    let here = || place.at_line(line(text, &first));
    let is_headless = first.iter().any(is_number) && first.iter().all(|f| f.is_empty() || is_number(f));
    let found = if is_headless {
        Found::in_order(first.len(), columns).map_err(|fault| here().error(fault))?
    } else {
        records.next();
        Found::by_name(&first, columns).map_err(|fault| here().error(fault))?
    };

    let mut rows = Rows::new(found.score.is_some(), found.unknown);
    for row in records {
        let row = row.map_err(|e| csv_error(&e))?;
        let refuse = |(key, fault): Refusal| {
            let here = place.at_line(line(text, &row));
            Place { key: key.map(str::to_owned), ..here }.error(fault)
        };
        if row.len() != first.len() {
            return Err(refuse((None, Fault::FieldCount { found: row.len(), expected: first.len() })));
        }
        let mut values = [0.0; N];
        for ((value, column), name) in values.iter_mut().zip(found.columns).zip(columns.names) {
            *value = coordinate(name, &row[column]).map_err(refuse)?;
        }
        rows.push(values, |k| {
            refuse((Some(columns.names[k]), Fault::NotANumber(row[found.columns[k]].to_owned())))
        });
        if let (Some(scores), Some((name, column))) = (&mut rows.scores, found.score) {
            scores.push(number(name, &row[column]).map_err(refuse)?);
        }
    }
    Ok(rows)
}

/// What separates the fields of the first line that is neither blank nor a comment.
fn separator(text: &str) -> u8 {
    let mut lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
    let first = lines.clone().next().unwrap_or_default();
    let line = lines.find(|line| !line.starts_with(COMMENT)).unwrap_or(first);
    // A comma beside one of the others is a decimal comma, which is refused with the field it stands in.
    b";\t,".iter().copied().find(|&s| line.as_bytes().contains(&s)).unwrap_or(b' ')
}

/// The text without comments, blanks in a row as one where they separate fields. Lines stay where they are.
fn plain<'a, const N: usize>(text: &'a str, separator: u8, columns: &Columns<N>) -> Cow<'a, str> {
    if separator != b' ' && !text.contains(COMMENT) {
        return Cow::Borrowed(text);
    }
    let mut is_first = true;
    let mut lines = String::with_capacity(text.len());
    for line in text.lines() {
        let comment = line.trim_start().strip_prefix(COMMENT);
        let names = |header: &str| {
            let fields: Vec<_> = header.split(char::from(separator)).map(Columns::<N>::plain).collect();
            columns.spelled(&fields).is_some()
        };
        let line = match comment {
            Some(header) if is_first && names(header) => header,
            Some(_) => "",
            None => line,
        };
        is_first &= comment.is_none() && line.trim().is_empty();
        if separator == b' ' {
            lines.extend(line.split_whitespace().flat_map(|field| [field, " "]));
            lines.truncate(lines.trim_end_matches(' ').len());
        } else {
            lines.push_str(line);
        }
        lines.push('\n');
    }
    Cow::Owned(lines)
}

/// Where the coordinates and the score stand.
struct Found<const N: usize> {
    columns: [usize; N],
    score: Option<(&'static str, usize)>,
    unknown: Vec<String>,
}

impl<const N: usize> Found<N> {
    /// Without a header: in the order of the names.
    fn in_order(count: usize, columns: &Columns<N>) -> Result<Self, Fault> {
        columns.check(count, || Fault::ColumnCount { found: count, expected: columns.expected })?;
        let score = columns.score.filter(|_| count > N).map(|name| (name, N));
        Ok(Self { columns: std::array::from_fn(|k| k), score, unknown: Vec::new() })
    }

    /// By the names in a header: each of them once, the score at most once.
    fn by_name(header: &StringRecord, columns: &Columns<N>) -> Result<Self, Fault> {
        let refuse = || Fault::Header {
            found: header.iter().collect::<Vec<_>>().join(","),
            expected: columns.expected,
        };
        let plain: Vec<_> = header.iter().map(Columns::<N>::plain).collect();
        let names = columns.spelled(&plain).ok_or_else(refuse)?;
        let find = |name: &str| {
            let mut places = plain.iter().enumerate().filter(|(_, column)| *column == name).map(|(k, _)| k);
            (places.next(), places.next())
        };
        let mut places = [0; N];
        for (place, name) in places.iter_mut().zip(names) {
            let (Some(k), None) = find(name) else { return Err(refuse()) };
            *place = k;
        }
        let score = match columns.score.map(|name| (name, find(name))) {
            Some((_, (_, Some(_)))) => return Err(refuse()),
            Some((name, (Some(k), None))) => Some((name, k)),
            _ => None,
        };
        let is_known = |k: usize| places.contains(&k) || score.is_some_and(|(_, score)| score == k);
        let unknown =
            header.iter().enumerate().filter(|(k, _)| !is_known(*k)).map(|(_, name)| name.to_owned());
        let unknown = unknown.collect();
        Ok(Self { columns: places, score, unknown })
    }
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

fn is_blank(row: &StringRecord) -> bool {
    row.len() == 1 && row[0].is_empty()
}

/// Whether a field is one of a row, not of a header: also with a decimal comma.
fn is_number(field: &str) -> bool {
    field.replace(',', ".").parse::<f64>().is_ok()
}

/// A coordinate; NaN where it is infinite, NaN or missing. Tables write a missing number as an empty field.
fn coordinate(column: &'static str, field: &str) -> Result<f64, Refusal> {
    match field.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        Ok(_) => Ok(f64::NAN),
        Err(_) if field.is_empty() => Ok(f64::NAN),
        Err(_) => Err((Some(column), unreadable(field))),
    }
}

fn number(column: &'static str, field: &str) -> Result<f64, Refusal> {
    let value = field.parse::<f64>().ok().filter(|v| v.is_finite());
    value.ok_or_else(|| (Some(column), unreadable(field)))
}

/// Why a field is no number. `1,234` may be 1.234 or 1234: a decimal comma is not guessed.
fn unreadable(field: &str) -> Fault {
    let found = field.to_owned();
    if field.contains(',') && is_number(field) {
        Fault::DecimalComma(found)
    } else {
        Fault::NotANumber(found)
    }
}
