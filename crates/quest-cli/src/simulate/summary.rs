//! The results for people: a few values of each figure, and table 1.

use comfy_table::{Cell, Table};
use quest_core::simulate::{Figure, Reading};

use super::{Record, curves, record::Quantity, run::Run};
use crate::table;

/// The columns of a table, as parts of the range.
const SHOWN: [f64; 5] = [0.0, 0.1, 0.2, 0.5, 1.0];
/// Errors count as equal if they differ by less than this fraction or lie below the rounding.
const NEARLY: f64 = 1.02;
const ROUNDING: f64 = 1e-9;

/// Everything as text.
pub(super) fn text(run: &Run, records: &[Record]) -> String {
    let mut parts: Vec<String> = run.figures.iter().map(|&figure| of_figure(run, figure, records)).collect();
    if run.has_table {
        parts.push(of_table(records));
    }
    parts.join("\n")
}

fn of_figure(run: &Run, figure: Figure, records: &[Record]) -> String {
    let name = format!("figure {}", figure.number());
    let records: Vec<&Record> = records.iter().filter(|r| r.experiment == name).collect();
    let mut text = format!("{}\n{}\n", curves::title(figure), curves::conditions(run, figure));
    for (quantity, word) in [(Quantity::RotationRad, "rotation"), (Quantity::TranslationRad, "translation")] {
        for reading in Reading::ALL {
            let of_both = |r: &&&Record| r.quantity == quantity && r.reading == reading.name();
            let chosen: Vec<&Record> = records.iter().filter(of_both).copied().collect();
            if !chosen.is_empty() {
                let heading = format!("mean {word} error in rad, {}", curves::reading_title(reading));
                text.extend(["\n", &heading, "\n", &errors(run, figure, &chosen), "\n"]);
            }
        }
    }
    text
}

/// One row a solver: the mean at some values, how often it is the lowest, and how often it beats the first solver.
fn errors(run: &Run, figure: Figure, records: &[&Record]) -> String {
    let cells = figure.cells(&run.base);
    let last = cells.last().map_or(0.0, |cell| cell.x);
    let unit = if figure.varies_parallax() { "" } else { " px" };
    // 0.01, not 0.010000000000000002.
    let header = |part: f64| format!("{}{unit}", (1e6 * part * last).round() / 1e6);
    let [a, b, c, d, e] = SHOWN.map(header);
    let solvers = run.solvers_of(figure);
    let ahead = format!("ahead of\n{}", solvers[0].info().name);
    let mut table: Table =
        table::empty(["solver", &a, &b, &c, &d, &e, "lowest\nor within 2 %", &ahead, "no\ncandidate"]);
    for (k, solver) in solvers.into_iter().enumerate() {
        let name = solver.info().name;
        let own: Vec<&&Record> = records.iter().filter(|r| r.solver == name).collect();
        let mut row = vec![Cell::new(name)];
        for part in SHOWN {
            let at = own.iter().find(|r| (r.value - part * last).abs() < 1e-9);
            row.push(table::right(at.map_or_else(String::new, |r| interval(r))));
        }
        let lowest = own.iter().filter(|r| is_lowest(r, records)).count();
        row.push(table::right(format!("{lowest} of {}", own.len())));
        let ahead = own.iter().filter(|r| is_ahead(r)).count();
        row.push(table::right(if k == 0 { String::new() } else { ahead.to_string() }));
        row.push(table::right(own.iter().map(|r| r.unanswered).sum::<usize>()));
        table.add_row(row);
    }
    table.trim_fmt()
}

/// The mean and its confidence interval.
fn interval(record: &Record) -> String {
    match (record.mean, record.ci95) {
        (None, _) => "–".to_owned(),
        (Some(mean), Some(ci95)) if mean > ROUNDING => format!("{mean:.4} ±{ci95:.4}"),
        (Some(mean), _) => table::short(mean),
    }
}

/// Whether no solver has a mean that is lower by more than 2 % at this value.
fn is_lowest(record: &Record, records: &[&Record]) -> bool {
    let Some(mean) = record.mean else { return false };
    let rivals = records.iter().filter(|r| r.value.total_cmp(&record.value).is_eq());
    let lowest = rivals.filter_map(|r| r.mean).fold(f64::INFINITY, f64::min);
    mean <= (NEARLY * lowest).max(ROUNDING)
}

/// Whether the errors are smaller than those of the first solver at the same scenes by more than chance explains.
fn is_ahead(record: &Record) -> bool {
    let bounds = record.difference.zip(record.difference_ci95);
    bounds.is_some_and(|(difference, ci95)| difference + ci95 < -ROUNDING)
}

/// What a row of table 1 compares with the paper's.
fn what_it_is(solver: &str) -> &'static str {
    match solver {
        "quest-literal" | "relinearization-literal" => "the paper's steps as printed",
        "quest" => "this project's, beside QuEst",
        "quest-eigen" | "relinearization" => "this project's form of the paper's",
        _ => "as published",
    }
}

fn of_table(records: &[Record]) -> String {
    let mut table = table::empty([
        "points",
        "solver",
        "kinds",
        "µs",
        "median",
        "paper, µs",
        "times faster",
        "what it is",
    ]);
    for record in records.iter().filter(|r| r.quantity == Quantity::TimeMs) {
        let micro = |ms: Option<f64>| ms.map(|ms| 1e3 * ms);
        let smallest = micro(record.smallest);
        let faster = record.paper.zip(record.smallest).map(|(paper, own)| format!("{:.0}", paper / own));
        let shown = |us: Option<f64>| table::right(us.map(|us| format!("{us:.1}")).unwrap_or_default());
        table.add_row([
            table::right(record.value),
            Cell::new(record.solver),
            Cell::new(record.reading),
            shown(smallest),
            shown(micro(record.median)),
            shown(micro(record.paper)),
            table::right(faster.unwrap_or_default()),
            Cell::new(what_it_is(record.solver)),
        ]);
    }
    format!(
        "Table 1: time of a solve\nThe mean over all scenes, of the fastest round and of the median one, on one \
         thread of this machine; the paper's machine was an Intel i7 of the fourth generation.\n\n{}\n",
        table.trim_fmt()
    )
}
