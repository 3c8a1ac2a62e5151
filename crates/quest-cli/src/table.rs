//! Tables for people.

use std::io::{self, IsTerminal};

use comfy_table::{Cell, CellAlignment, ColumnConstraint, ContentArrangement, LineStyle, Table, presets};
use quest_io::{CandidateRecord, SolveRecord};

/// A table with this header and a line under it.
pub(crate) fn empty<const N: usize>(header: [&str; N]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING.header_separator(LineStyle::none().fill('─')));
    table.set_header(header);
    table.column_iter_mut().for_each(|column| _ = column.set_padding((0, 2)));
    // Only a terminal has a width to wrap to.
    if let Some((width, _)) = terminal_size::terminal_size().filter(|_| io::stdout().is_terminal()) {
        table.set_content_arrangement(ContentArrangement::Dynamic).set_width(width.0);
    }
    table
}

/// The candidates, best first. With a focal length residuals are given in pixels too.
pub(crate) fn candidates(record: &SolveRecord, focal_length: Option<f64>) -> String {
    let mut table = empty([
        "#",
        "kind",
        "rotation\ndeg",
        "about",
        "t",
        "|t|",
        "residual\nrad",
        "residual\npx",
        "in front",
        "feasible",
        "R error\ndeg",
        "t error\ndeg",
    ]);
    for (index, c) in record.candidates.iter().enumerate() {
        let (angle, axis) = angle_axis(c.q_21);
        let length = c.t_21.iter().map(|x| x * x).sum::<f64>().sqrt();
        let right = |text: String| Cell::new(text).set_alignment(CellAlignment::Right);
        table.add_row([
            right((index + 1).to_string()),
            Cell::new(c.kind),
            right(format!("{angle:.3}")),
            right(axis.map_or_else(|| "-".to_owned(), |axis| vector(axis, 3))),
            right(vector(c.t_21, decimals(length))),
            right(short(length)),
            right(short(c.residual)),
            right(focal_length.map(|f| short(f * c.residual)).unwrap_or_default()),
            right(format!("{}/{}", c.in_front, record.matches)),
            right(if c.feasible { "yes" } else { "no" }.to_owned()),
            right(c.rotation_error_deg.map(short).unwrap_or_default()),
            right(c.translation_error_deg.map(short).unwrap_or_default()),
        ]);
    }
    hide_empty(&mut table, record, focal_length);
    table.trim_fmt()
}

/// Hides the columns that nothing is known for: pixels without cameras, errors without the truth.
fn hide_empty(table: &mut Table, record: &SolveRecord, focal_length: Option<f64>) {
    let all = |known: fn(&CandidateRecord) -> bool| !record.candidates.iter().any(known);
    let hidden = [
        (7, focal_length.is_none()),
        (10, all(|c| c.rotation_error_deg.is_some())),
        (11, all(|c| c.translation_error_deg.is_some())),
    ];
    for (index, _) in hidden.iter().filter(|(_, is_empty)| *is_empty) {
        if let Some(column) = table.column_mut(*index) {
            column.set_constraint(ColumnConstraint::Hidden);
        }
    }
}

/// The angle in degrees and the unit axis of a rotation; the identity has no axis.
fn angle_axis([w, x, y, z]: [f64; 4]) -> (f64, Option<[f64; 3]>) {
    let length = (x * x + y * y + z * z).sqrt();
    let angle = (2.0 * length.atan2(w)).to_degrees();
    (angle, (length > 0.0).then(|| [x, y, z].map(|v| v / length)))
}

/// Decimals that show four digits of a number.
fn decimals(x: f64) -> usize {
    (3..=9).find(|&n| x * 10_f64.powi(n) >= 1000.0).map_or(9, |n| usize::try_from(n).unwrap_or(3))
}

fn vector(v: [f64; 3], decimals: usize) -> String {
    let width = decimals + 3;
    // Adding zero after rounding to text is too late: `-0.000` is caught by its value.
    let tiny = 0.5 * 10_f64.powi(-i32::try_from(decimals).unwrap_or(9));
    let [x, y, z] = v.map(|x| format!("{:width$.decimals$}", if x.abs() < tiny { 0.0 } else { x }));
    format!("{x} {y} {z}")
}

/// Three digits, with an exponent where the number is very small or large.
fn short(x: f64) -> String {
    match x.abs() {
        0.0 => "0".to_owned(),
        size if !(1e-3..1e5).contains(&size) => format!("{x:.1e}"),
        size if size < 0.1 => format!("{x:.4}"),
        size if size < 10.0 => format!("{x:.3}"),
        size if size < 100.0 => format!("{x:.2}"),
        _ => format!("{x:.1}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_three_digits() {
        let shown = [0.0, 1.234e-16, 0.012_34, 0.123_45, 1.234_5, 12.345, 123.45, 1e7].map(short);
        assert_eq!(shown, ["0", "1.2e-16", "0.0123", "0.123", "1.234", "12.35", "123.5", "1.0e7"]);
    }

    #[test]
    fn small_translations_are_shown_with_more_decimals() {
        assert_eq!([1.0, 0.1, 0.012, 1e-5, 0.0].map(decimals), [3, 4, 5, 8, 9]);
        assert_eq!(vector([1.0, -0.0001, 0.5], 3), " 1.000  0.000  0.500");
    }

    #[test]
    fn a_rotation_is_an_angle_about_an_axis() {
        let (angle, axis) = angle_axis([0.5_f64.sqrt(), 0.0, 0.5_f64.sqrt(), 0.0]);
        assert!((angle - 90.0).abs() < 1e-12);
        assert_eq!(axis, Some([0.0, 1.0, 0.0]));
        assert_eq!(angle_axis([1.0, 0.0, 0.0, 0.0]), (0.0, None));
    }
}
