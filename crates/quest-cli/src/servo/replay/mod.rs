//! `quest-cli servo --replay`: a live run that `quest_pose.servo.Recorder` wrote, in a few lines and as a page.

mod archive;
mod charts;
mod summary;

use std::path::Path;

use crate::options::{Format, OutputOptions};
use crate::plot::Plot;
use crate::{Failure, Outcome, rows};
use summary::Row;

/// Reads the run at `path`, says what happened, and draws it.
pub(super) fn run(path: &Path, plot: Option<&Plot>, options: &OutputOptions) -> Result<Outcome, Failure> {
    let mut output = options.open()?;
    let page = plot.map(|plot| plot.open().map(|file| (plot, file))).transpose()?;
    let recorded = archive::read(path)?;
    if recorded.images.is_empty() {
        return Err(Failure::Arguments(format!("{}: found no image, expected at least one", path.display())));
    }
    let title =
        path.file_name().map_or_else(|| path.display().to_string(), |n| n.to_string_lossy().into_owned());
    let summary = summary::Summary::new(title, &recorded);
    output.write(|writer| match options.format(Format::Table) {
        Format::Table => summary.write(writer),
        Format::Json => quest_io::write_json(writer, &summary),
        Format::Jsonl => recorded.images.iter().try_for_each(|i| rows::write_line(writer, &Row::new(i))),
        Format::Csv => rows::write_csv(writer, &recorded.images.iter().map(Row::new).collect::<Vec<_>>()),
    })?;
    if let Some((plot, file)) = page {
        plot.write(file, charts::drawn(&summary, &recorded, plot.is_svg())?)?;
    }
    output.finish()?;
    Ok(Outcome::Answer)
}
