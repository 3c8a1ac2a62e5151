//! `quest-cli polynomials`: every solution of a system of polynomial equations, by section 4.2 of the paper.

use std::path::{Path, PathBuf};

use clap::Args;
use comfy_table::Cell;
use quest_core::polynomial_system::{Options, RankDecision, Solution, Solutions, System, solve};
use serde::{Deserialize, Serialize};

use crate::{
    Failure, Outcome,
    options::{Format, OutputOptions},
    rows, table, words,
};

const EXAMPLES: &str = "\
The file is JSON: how many unknowns, or their names, and a list of equations f(x) = 0. An equation is a
list of terms [coefficient, [exponents]], one exponent for each unknown.

  {\"unknowns\": [\"x\", \"y\"],
   \"equations\": [[[1, [2, 0]], [1, [0, 2]], [-4, [0, 0]]],
                 [[1, [1, 1]], [-1, [0, 0]]]]}

is x² + y² = 4, x y = 1. At least as many equations as unknowns are needed. Solutions at infinity are
counted, not listed. Where a list would not be complete, there is an error instead.

Examples:
  quest-cli polynomials examples/three_quadrics.json
  quest-cli polynomials --real --format json system.json
  quest-cli polynomials --solutions 2 measured.json      coefficients with noise: the two nearest";

/// Every solution of a system of polynomial equations, real and complex.
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Arguments {
    /// The system as JSON; - is standard input.
    file: PathBuf,
    /// List the real solutions alone.
    #[arg(long)]
    real: bool,
    /// How many solutions there are, those at infinity counted: for coefficients with noise.
    #[arg(long, value_name = "COUNT")]
    solutions: Option<usize>,
    /// How many rounds of relinearisation there may be.
    #[arg(long, value_name = "COUNT", default_value_t = Options::default().max_rounds)]
    max_rounds: usize,
    /// How many monomials a round may have.
    #[arg(long, value_name = "COUNT", default_value_t = Options::default().max_monomials)]
    max_monomials: usize,
    /// The seed of the random combinations of commuting matrices.
    #[arg(long, default_value_t = Options::default().seed)]
    seed: u64,
    #[command(flatten)]
    output: OutputOptions,
}

/// The file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SystemFile {
    unknowns: Unknowns,
    equations: Vec<Vec<(f64, Vec<u8>)>>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Unknowns {
    Count(usize),
    Names(Vec<String>),
}

#[derive(Serialize)]
struct Record {
    unknowns: Vec<String>,
    solutions: Vec<SolutionRecord>,
    at_infinity: usize,
    rounds: usize,
    degree: usize,
    grading: usize,
    d_bar: [usize; 2],
    linearized: RankRecord,
    relinearized: RankRecord,
    w_0: RankRecord,
}

#[derive(Serialize)]
struct SolutionRecord {
    real: bool,
    re: Vec<f64>,
    im: Vec<f64>,
    residual: f64,
    multiplicity: usize,
}

#[derive(Serialize)]
struct RankRecord {
    rows: usize,
    columns: usize,
    rank: usize,
    kept: f64,
    dropped: f64,
}

/// One unknown of one solution, for CSV.
#[derive(Serialize)]
struct Row<'a> {
    solution: usize,
    unknown: &'a str,
    re: f64,
    im: f64,
    residual: f64,
    multiplicity: usize,
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    // Ahead of the work: a target that cannot be written is known at once.
    let mut output = arguments.output.open()?;
    let (names, system) = read(&arguments.file)?;
    let options = Options {
        solutions: arguments.solutions,
        max_rounds: arguments.max_rounds.max(1),
        max_monomials: arguments.max_monomials,
        seed: arguments.seed,
        ..Options::default()
    };
    let found = match solve(&system, &options) {
        Ok(found) => found,
        Err(error) => {
            words::say("no solutions", &format!("{}: {error}", arguments.file.display()));
            return Ok(Outcome::NoPose);
        }
    };
    let record = record(names, &found, arguments.real);
    output.write(|writer| match arguments.output.format(Format::Table) {
        Format::Table => writeln!(writer, "{}", as_table(&record)),
        Format::Json => quest_io::write_json(writer, &record),
        Format::Jsonl => rows::write_line(writer, &record),
        Format::Csv => rows::write_csv(writer, &as_rows(&record)),
    })?;
    output.finish()?;
    Ok(Outcome::Answer)
}

/// The names of the unknowns, and the system.
fn read(file: &Path) -> Result<(Vec<String>, System), Failure> {
    let refused = |why: String| Failure::Arguments(format!("{}: {why}", file.display()));
    let text = if file == Path::new("-") {
        std::io::read_to_string(std::io::stdin())
    } else {
        std::fs::read_to_string(file)
    };
    let text = text.map_err(|error| refused(format!("cannot be read: {error}")))?;
    let expected = "expected {\"unknowns\": 2, \"equations\": [[[coefficient, [exponents]], …], …]}";
    let parsed: SystemFile =
        serde_json::from_str(&text).map_err(|error| refused(format!("{error}; {expected}")))?;
    let names = match parsed.unknowns {
        Unknowns::Names(names) => names,
        Unknowns::Count(count) => (1..=count).map(|k| format!("x{k}")).collect(),
    };
    let system = System::new(names.len(), parsed.equations).map_err(|error| refused(error.to_string()))?;
    Ok((names, system))
}

fn record(unknowns: Vec<String>, found: &Solutions, real: bool) -> Record {
    let rank = |d: &RankDecision| RankRecord {
        rows: d.rows,
        columns: d.columns,
        rank: d.rank,
        kept: d.kept,
        dropped: d.dropped,
    };
    let solution = |s: &Solution| SolutionRecord {
        real: s.is_real(),
        re: s.real(),
        im: s.x.iter().map(|x| x.im).collect(),
        residual: s.residual,
        multiplicity: s.multiplicity,
    };
    let report = &found.report;
    Record {
        unknowns,
        solutions: found.all.iter().filter(|s| !real || s.is_real()).map(solution).collect(),
        at_infinity: found.at_infinity,
        rounds: report.rounds,
        degree: report.degree,
        grading: report.grading,
        d_bar: [report.d_bar.0, report.d_bar.1],
        linearized: rank(&report.linearized),
        relinearized: rank(&report.relinearized),
        w_0: rank(&report.w_0),
    }
}

fn as_table(record: &Record) -> String {
    let mut table = table::empty(["", "unknown", "real part", "imaginary part", "residual", "times"]);
    for (k, solution) in record.solutions.iter().enumerate() {
        for (i, name) in record.unknowns.iter().enumerate() {
            let first = |text: String| table::right(if i == 0 { text } else { String::new() });
            let imaginary = if solution.real { String::new() } else { format!("{:.12}", solution.im[i]) };
            table.add_row([
                first((k + 1).to_string()),
                Cell::new(name),
                table::right(format!("{:.12}", solution.re[i])),
                table::right(imaginary),
                first(format!("{:.1e}", solution.residual)),
                first(solution.multiplicity.to_string()),
            ]);
        }
    }
    let [rows, columns] = record.d_bar;
    let counted: usize = record.solutions.iter().map(|s| s.multiplicity).sum();
    format!(
        "{}\n{counted} solutions listed, {} at infinity; {} of relinearisation: D̄ {rows} × {columns}, nullity {}",
        table.trim_fmt(),
        record.at_infinity,
        if record.rounds == 1 { "one round".to_owned() } else { format!("{} rounds", record.rounds) },
        record.relinearized.columns - record.relinearized.rank,
    )
}

fn as_rows(record: &Record) -> Vec<Row<'_>> {
    let of = |(k, s): (usize, &SolutionRecord)| -> Vec<Row<'_>> {
        let row = |(i, unknown)| Row {
            solution: k + 1,
            unknown,
            re: s.re[i],
            im: s.im[i],
            residual: s.residual,
            multiplicity: s.multiplicity,
        };
        record.unknowns.iter().map(String::as_str).enumerate().map(row).collect()
    };
    record.solutions.iter().enumerate().flat_map(of).collect()
}
