//! Options that subcommands share.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use quest_core::lanes::SearchScore;
use quest_core::{
    Camera,
    feasibility::Feasibility,
    solver::{Kinds, SolverName},
};
use quest_io::{Earlier, Output, WriteError};

use crate::Failure;

/// How a result is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// For people.
    Table,
    /// One JSON value, indented.
    Json,
    /// One JSON object a line.
    Jsonl,
    /// A header and one row each.
    Csv,
}

/// The form of a file by its name, with what each is in the help.
pub(crate) fn input_format_parser() -> impl clap::builder::TypedValueParser<Value = quest_io::Format> {
    use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
    let forms = quest_io::Format::ALL.map(quest_io::Format::info);
    PossibleValuesParser::new(forms.map(|form| PossibleValue::new(form.name).help(form.help)))
        .try_map(|name| quest_io::Format::named(&name).ok_or("no form has this name"))
}

/// Where a result goes, and how.
#[derive(Args, Debug)]
pub(crate) struct OutputOptions {
    /// How the result is written [default: by the extension of -o where it is .json, .jsonl, .ndjson or .csv, else a table; of several
    /// pairs JSON Lines].
    #[arg(long, value_enum, hide_default_value = true)]
    format: Option<Format>,
    /// Write the result to this file, whole or not at all.
    #[arg(short, long, value_name = "FILE", value_parser = parse_output)]
    output: Option<PathBuf>,
    /// Say nothing on standard error but errors and why there is no pose.
    #[arg(long)]
    pub(crate) quiet: bool,
}

/// A name whose extension is no promise that is not kept.
fn parse_output(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    match quest_io::Format::from_extension(&path) {
        Some(quest_io::Format::Npy) => {
            Err("results are not written as NumPy's arrays, expected .json, .jsonl, .csv, .parquet or another name"
                .to_owned())
        }
        _ => Ok(path),
    }
}

impl OutputOptions {
    /// The format asked for, else that of the output's extension, else `default`. Whether standard output is a
    /// terminal plays no part: what is seen there is what a pipe gets.
    pub(crate) fn format(&self, default: Format) -> Format {
        let extension = || quest_io::Format::from_extension(self.output.as_ref()?);
        self.format.unwrap_or_else(|| match extension() {
            Some(quest_io::Format::Json) => Format::Json,
            Some(quest_io::Format::JsonLines) => Format::Jsonl,
            Some(quest_io::Format::Csv) => Format::Csv,
            _ => default,
        })
    }

    /// The file of the result, where it is one.
    pub(crate) fn file(&self) -> Option<&Path> {
        self.output.as_deref()
    }

    /// Whether the result is a table of Parquet, by the name of the file.
    pub(crate) fn is_parquet(&self) -> bool {
        let form = self.file().and_then(quest_io::Format::from_extension);
        self.format.is_none() && form == Some(quest_io::Format::Parquet)
    }

    /// The target, found writable, of a result that is text.
    ///
    /// # Errors
    /// A target that cannot be written to, and one that promises Parquet.
    pub(crate) fn open(&self) -> Result<Output, Failure> {
        if self.is_parquet() {
            let message = "only the results of `quest-cli estimate` and the matches of `quest-cli colmap export` are written as \
                           Parquet, expected .json, .jsonl, .csv or another name";
            return Err(Failure::Arguments(message.to_owned()));
        }
        Ok(self.open_any()?)
    }

    /// The target, found writable, of a result of any form.
    pub(crate) fn open_any(&self) -> Result<Output, WriteError> {
        Output::open(self.output.as_deref().map(Path::new))
    }

    /// The target of a long run, found writable, and the lines of an earlier run that it holds.
    pub(crate) fn open_growing(&self, resume: bool) -> Result<(Output, Option<Earlier>), WriteError> {
        Output::growing(self.output.as_deref().map(Path::new), resume)
    }
}

/// `MODEL,width,height,params…` as a camera, or the camera in `FILE` or `FILE:ID`.
pub(crate) fn parse_camera(text: &str) -> Result<Camera, String> {
    const FORM: &str = "MODEL,width,height,params such as PINHOLE,1024,768,1060,1060,514,384";
    const EXPECTED: &str = "expected MODEL,width,height,params such as PINHOLE,1024,768,1060,1060,514,384";
    let of_file =
        |path: &str, id| quest_io::read_camera(Path::new(path), id).map_err(|error| error.to_string());
    if Path::new(text).exists() {
        return of_file(text, None);
    }
    if let Some((path, id)) = text.rsplit_once(':').filter(|(path, _)| Path::new(path).exists()) {
        return of_file(path, Some(id));
    }
    if !text.contains(',') {
        return Err(format!("found no file of this name, expected the file of a camera, or {FORM}"));
    }
    let mut parts = text.split(',').map(str::trim);
    let (Some(model), Some(width), Some(height)) = (parts.next(), parts.next(), parts.next()) else {
        return Err(format!("found {} values, {EXPECTED}", text.split(',').count()));
    };
    let size = |field: &str| {
        field.parse::<u32>().map_err(|_| format!("found {field:?} for the width or height, {EXPECTED}"))
    };
    let size = (size(width)?, size(height)?);
    let number = |field: &str| {
        let value = field.parse::<f64>().ok().filter(|v| v.is_finite());
        value.ok_or_else(|| format!("found the parameter {field:?}, expected a finite number"))
    };
    let params = parts.map(number).collect::<Result<Vec<_>, _>>()?;
    quest_io::camera(model, Some(size), &params).map_err(|error| format!("{error}; {EXPECTED}"))
}

/// Kinds of candidates by their name, with the names listed in the help.
pub(crate) fn kinds_parser() -> impl clap::builder::TypedValueParser<Value = Kinds> {
    use clap::builder::{PossibleValuesParser, TypedValueParser};
    PossibleValuesParser::new(Kinds::CHOICES.map(Kinds::name)).try_map(|name| name.parse::<Kinds>())
}

/// A test of feasibility by its name, with the names listed in the help.
pub(crate) fn feasibility_parser() -> impl clap::builder::TypedValueParser<Value = Feasibility> {
    use clap::builder::{PossibleValuesParser, TypedValueParser};
    PossibleValuesParser::new(Feasibility::CHOICES.map(Feasibility::name))
        .try_map(|name| name.parse::<Feasibility>())
}

/// A loss by its name, with the names listed in the help.
pub(crate) fn loss_parser() -> impl clap::builder::TypedValueParser<Value = SearchScore> {
    use clap::builder::{PossibleValuesParser, TypedValueParser};
    PossibleValuesParser::new(SearchScore::CHOICES.map(SearchScore::name))
        .try_map(|name| name.parse::<SearchScore>())
}

/// A solver by its name, with the names listed in the help.
pub(crate) fn solver_parser() -> impl clap::builder::TypedValueParser<Value = SolverName> {
    use clap::builder::{PossibleValuesParser, TypedValueParser};
    PossibleValuesParser::new(SolverName::named().map(|s| s.info().name))
        .try_map(|name| name.parse::<SolverName>())
}
