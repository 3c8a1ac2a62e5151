//! The candidates as a table.

use std::io::{self, IsTerminal};

use comfy_table::{Cell, ColumnConstraint, Table};
use quest_io::{CandidateRecord, SolveRecord};

use crate::table::{self, angle_axis, decimals, right, short, vector};

/// The candidates, best first, one line each, or three lines each on a narrow terminal. With a focal length, residuals are
/// also given in pixels.
pub(crate) fn text(record: &SolveRecord, focal_length: Option<f64>) -> String {
    let table = wide(record, focal_length);
    let width = table.lines().map(|line| line.trim_end().chars().count()).max().unwrap_or(0);
    let terminal = terminal_size::terminal_size().filter(|_| io::stdout().is_terminal());
    let is_wide = terminal.is_none_or(|(columns, _)| usize::from(columns.0) >= width);
    if is_wide { table.trim_fmt() } else { narrow(record, focal_length).trim_fmt() }
}

/// The cells of a candidate that both tables show.
struct Shown {
    angle: String,
    axis: [String; 3],
    t: [String; 3],
    length: String,
    residual: String,
    pixels: Option<String>,
    in_front: String,
    feasible: &'static str,
    rotation_error: Option<String>,
    translation_error: Option<String>,
}

impl Shown {
    fn new(c: &CandidateRecord, matches: usize, focal_length: Option<f64>) -> Self {
        let (angle, axis) = angle_axis(c.q_21);
        let length = c.t_21.iter().map(|x| x * x).sum::<f64>().sqrt();
        Self {
            angle: format!("{angle:.3}"),
            axis: axis.map_or_else(|| ["-".to_owned(), String::new(), String::new()], |axis| vector(axis, 3)),
            t: vector(c.t_21, decimals(length)),
            length: short(length),
            residual: short(c.residual),
            pixels: focal_length.map(|f| short(f * c.residual)),
            in_front: format!("{}/{matches}", c.in_front),
            feasible: if c.feasible { "yes" } else { "no" },
            rotation_error: c.rotation_error_deg.map(short),
            translation_error: c.translation_error_deg.map(short),
        }
    }
}

fn wide(record: &SolveRecord, focal_length: Option<f64>) -> Table {
    let mut table = table::empty([
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
        let shown = Shown::new(c, record.matches, focal_length);
        table.add_row([
            right(index + 1),
            Cell::new(c.kind),
            right(shown.angle),
            right(shown.axis.join(" ").trim_end()),
            right(shown.t.join(" ")),
            right(shown.length),
            right(shown.residual),
            right(shown.pixels.unwrap_or_default()),
            right(shown.in_front),
            right(shown.feasible),
            right(shown.rotation_error.unwrap_or_default()),
            right(shown.translation_error.unwrap_or_default()),
        ]);
    }
    // Columns that nothing is known for: pixels without cameras, errors without the truth.
    let is_empty = |known: fn(&CandidateRecord) -> bool| !record.candidates.iter().any(known);
    hide(&mut table, 7, focal_length.is_none());
    hide(&mut table, 10, is_empty(|c| c.rotation_error_deg.is_some()));
    hide(&mut table, 11, is_empty(|c| c.translation_error_deg.is_some()));
    table
}

/// Vectors are written as columns, and related numbers share a cell.
fn narrow(record: &SolveRecord, focal_length: Option<f64>) -> Table {
    let mut table = table::empty([
        "#",
        "kind",
        "rotation\ndeg",
        "about",
        "t",
        "|t|",
        "residual",
        "in front\nfeasible",
        "R error\nt error",
    ]);
    for (index, c) in record.candidates.iter().enumerate() {
        let shown = Shown::new(c, record.matches, focal_length);
        let pixels = shown.pixels.map(|px| format!("\n{px} px ")).unwrap_or_default();
        let degrees = |error: Option<String>| error.map(|e| format!("{e}°")).unwrap_or_default();
        table.add_row([
            right(index + 1),
            Cell::new(c.kind.replace('_', "\n")),
            right(shown.angle),
            right(shown.axis.join("\n").trim_end()),
            right(shown.t.join("\n")),
            right(shown.length),
            right(format!("{} rad{pixels}", shown.residual)),
            right(format!("{}\n{}", shown.in_front, shown.feasible)),
            right(format!("{}\n{}", degrees(shown.rotation_error), degrees(shown.translation_error))),
        ]);
    }
    let no_truth = |c: &CandidateRecord| c.rotation_error_deg.is_none() && c.translation_error_deg.is_none();
    hide(&mut table, 8, record.candidates.iter().all(no_truth));
    table
}

fn hide(table: &mut Table, index: usize, hidden: bool) {
    if let Some(column) = table.column_mut(index).filter(|_| hidden) {
        column.set_constraint(ColumnConstraint::Hidden);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_narrow_table_fits_eighty_columns() {
        let candidate = CandidateRecord {
            kind: "rotation_only",
            q_21: [0.5, 0.5, 0.5, -0.5],
            r_21: [[0.0; 3]; 3],
            t_21: [0.1, -0.2, 0.05],
            depths1: Vec::new(),
            depths2: Vec::new(),
            residual: 1.5e-16,
            in_front: 120,
            feasible: true,
            rotation_error_deg: Some(120.0),
            translation_error_deg: Some(1.5e-14),
            rotation_metric_rad: None,
            translation_metric_rad: None,
        };
        let candidates = vec![candidate; 20];
        let record = SolveRecord {
            name: None,
            solver: "quest",
            matches: 120,
            reason: None,
            degeneracy: None,
            feasibility: None,
            third_view: None,
            candidates,
        };
        let text = narrow(&record, Some(500.0)).trim_fmt();
        assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
        assert!(text.contains("120.000") && text.contains("120.0°") && text.contains("7.5e-14 px"), "{text}");
    }
}
