//! `quest-cli solvers`: the table of solvers.

use clap::Args;
use comfy_table::Cell;
use quest_core::solver::SolverName;
use serde::Serialize;

use crate::{
    Failure, Outcome,
    options::{Format, OutputOptions},
    rows, table,
};

const EXAMPLES: &str = "\
Examples:
  quest-cli solvers
  quest-cli solvers --format json";

/// The table of solvers: name, smallest number of matches, largest number of candidates, reference.
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Arguments {
    #[command(flatten)]
    output: OutputOptions,
}

#[derive(Serialize)]
struct SolverRecord {
    name: &'static str,
    min_matches: usize,
    max_candidates: usize,
    reference: &'static str,
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let records = SolverName::ALL.map(|solver| {
        let info = solver.info();
        SolverRecord {
            name: info.name,
            min_matches: info.min_matches,
            max_candidates: info.max_candidates,
            reference: info.reference,
        }
    });
    let mut output = arguments.output.open()?;
    output.write(|writer| match arguments.output.format(Format::Table) {
        Format::Table => writeln!(writer, "{}", as_table(&records)),
        Format::Json => quest_io::write_json(writer, &records),
        Format::Jsonl => records.iter().try_for_each(|record| rows::write_line(writer, record)),
        Format::Csv => rows::write_csv(writer, &records),
    })?;
    output.finish()?;
    Ok(Outcome::Answer)
}

fn as_table(records: &[SolverRecord]) -> String {
    let mut table = table::empty(["solver", "matches\nat least", "candidates\nat most", "reference"]);
    for record in records {
        table.add_row([
            Cell::new(record.name),
            table::right(record.min_matches),
            table::right(record.max_candidates),
            Cell::new(record.reference),
        ]);
    }
    table.trim_fmt()
}
