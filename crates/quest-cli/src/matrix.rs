//! `quest-cli matrix`: the quartic constraints on the rotation, (39) and (40), with the names of rows and columns.

use std::io::{self, Write};

use clap::Args;
use comfy_table::Cell;
use quest_core::quaternion::{NORM_ROW, constraint_matrix, monomial_names};
use serde::Serialize;

use crate::{
    Failure, Outcome,
    input::InputOptions,
    options::{Format, OutputOptions},
    rows, table,
};

const EXAMPLES: &str = "\
A row is the polynomial (39) of three matches i < j < k, counted from 0: det[n_i n_j n_k] / |q|^2 with
n = x2 x R(q) x1. It vanishes at the true rotation. The columns are the 35 monomials of degree four in
q1, q2, q3, q4, scalar first. The last row, named norm, is (40): the norm of the quaternion to the fourth
power, which is c = 1. Together they are C x = c of section 7.2.

The table has monomials in rows and triples in columns; CSV and JSON have a row for every triple.

Examples:
  quest-cli matrix examples/points.json
  quest-cli matrix examples/points.json -o matrix.csv
  quest-cli matrix pixels.csv --camera1 PINHOLE,1024,768,1060,1060,514,384 --format json";

/// The constraint matrix of section 6: the quartics of all triples of matches, and the norm.
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Arguments {
    #[command(flatten)]
    input: InputOptions,
    /// Leave out the row of the norm, (40).
    #[arg(long)]
    no_norm: bool,
    #[command(flatten)]
    output: OutputOptions,
}

/// The matrix as it stands in files.
#[derive(Debug, Serialize)]
struct MatrixRecord {
    columns: Vec<String>,
    rows: Vec<RowRecord>,
}

#[derive(Debug, Serialize)]
struct RowRecord {
    /// The matches; none for the row of the norm.
    triple: Option<[usize; 3]>,
    coefficients: Vec<f64>,
    /// The right-hand side: 0, of the norm 1.
    c: f64,
}

impl RowRecord {
    fn name(&self) -> String {
        self.triple.map_or_else(|| "norm".to_owned(), |[i, j, k]| format!("{i} {j} {k}"))
    }
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let mut input = arguments.input.open(arguments.output.quiet)?;
    let mut output = arguments.output.open()?;
    let Some(pair) = input.next()? else {
        return Err(Failure::Arguments("found no pair, expected one".to_owned()));
    };
    if input.is_several() && input.next()?.is_some() {
        return Err(Failure::Arguments(format!("{}: found further pairs, expected one", pair.place)));
    }
    let matches = pair.correspondences()?;
    let quartics = constraint_matrix(&matches).map_err(|error| pair.refuse(error))?;
    let record = record(matches.len(), quartics, !arguments.no_norm);
    output.write(|writer| match arguments.output.format(Format::Table) {
        Format::Table => writeln!(writer, "{}", as_table(&record)),
        Format::Json => quest_io::write_json(writer, &record),
        Format::Jsonl => record.rows.iter().try_for_each(|row| rows::write_line(writer, row)),
        Format::Csv => write_csv(writer, &record),
    })?;
    output.finish()?;
    Ok(Outcome::Answer)
}

fn record(matches: usize, quartics: Vec<[f64; 35]>, has_norm: bool) -> MatrixRecord {
    let from = |i: usize| move |j: usize| (j + 1..matches).map(move |k| [i, j, k]);
    let triples = (0..matches).flat_map(|i| (i + 1..matches).flat_map(from(i)));
    let mut rows: Vec<_> = triples
        .zip(quartics)
        .map(|(triple, row)| RowRecord { triple: Some(triple), coefficients: row.to_vec(), c: 0.0 })
        .collect();
    if has_norm {
        rows.push(RowRecord { triple: None, coefficients: NORM_ROW.to_vec(), c: 1.0 });
    }
    MatrixRecord { columns: monomial_names().to_vec(), rows }
}

fn as_table(record: &MatrixRecord) -> String {
    let mut table = table::empty([""]);
    let names = record.rows.iter().map(|row| table::right(row.name()));
    table.set_header([Cell::new("monomial")].into_iter().chain(names));
    for column in table.column_iter_mut() {
        column.set_padding((0, 2));
    }
    for (k, monomial) in record.columns.iter().enumerate() {
        let numbers = record.rows.iter().map(|row| table::right(table::short(row.coefficients[k])));
        table.add_row([Cell::new(monomial)].into_iter().chain(numbers));
    }
    let sides = record.rows.iter().map(|row| table::right(row.c));
    table.add_row([Cell::new("c")].into_iter().chain(sides));
    table.trim_fmt()
}

fn write_csv(writer: &mut dyn Write, record: &MatrixRecord) -> io::Result<()> {
    let header = ["triple".to_owned()].into_iter().chain(record.columns.clone()).chain(["c".to_owned()]);
    let row = |row: &RowRecord| -> Vec<String> {
        let numbers = row.coefficients.iter().chain([&row.c]).map(|x| rows::text(*x));
        [row.name()].into_iter().chain(numbers).collect()
    };
    rows::write_rows(writer, [header.collect()].into_iter().chain(record.rows.iter().map(row)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use quest_core::simulate::{Scene, SceneOptions};

    #[test]
    fn rows_and_columns_have_their_names() {
        let scene = Scene::generate(&SceneOptions::default(), 39, 0).unwrap();
        let quartics = constraint_matrix(&scene.matches).unwrap();
        let record = record(5, quartics.clone(), true);
        let names: Vec<_> = record.rows.iter().map(RowRecord::name).collect();
        assert_eq!((names.len(), names[0].as_str(), names[9].as_str()), (11, "0 1 2", "2 3 4"));
        assert_eq!((names[10].as_str(), record.rows[10].c.to_bits()), ("norm", 1.0_f64.to_bits()));
        assert_eq!(record.columns[1], "q1^3 q2");
        let mut csv = Vec::new();
        write_csv(&mut csv, &record).unwrap();
        let text = String::from_utf8(csv).unwrap();
        let third: Vec<&str> = text.lines().nth(3).unwrap().split(',').collect();
        assert_eq!((text.lines().count(), third.len(), third[0]), (12, 37, "0 1 4"));
        assert_eq!(third[2].parse(), Ok(quartics[2][1]));
        assert_eq!(as_table(&record).lines().count(), 2 + 35 + 1);
    }
}
