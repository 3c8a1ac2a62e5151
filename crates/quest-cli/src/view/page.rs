//! The page: the scene, the residuals, the candidates as a table.

use quest_core::Candidate;
use quest_plot::{Axis, Figure, Page, Panel, PlotError, Series, colour};

use super::{Solved, scene};
use crate::{table, words};

pub(super) fn html(solved: &Solved) -> Result<String, PlotError> {
    let title = solved.pair.name.clone().unwrap_or_else(|| solved.pair.place.to_string());
    let introduction = format!(
        "{} matches, solver {}; X2 = R X1 + t. Candidates come best first: points in front of both cameras, then \
         residual. The mean absolute depth over both views is 1, so |t| is the parallax.",
        solved.matches.len(),
        solved.record.solver
    );
    Page::new(words::one_line(&title))
        .introduction(introduction)
        .space(scene::space(solved))
        .figure(residuals(solved))
        .table("Candidates", candidates(solved))
        .to_html()
}

/// Candidates with a button of their own; the others share one.
const OWN: usize = 9;

/// The name of a candidate in the table.
fn name(index: usize, candidate: &Candidate) -> String {
    format!("{} {}", index + 1, candidate.kind.name().replace('_', " "))
}

/// The name of a candidate in the legend.
pub(super) fn button(index: usize, candidate: &Candidate) -> String {
    if index < OWN { name(index, candidate) } else { format!("{} and more", OWN + 1) }
}

/// An angle in pixels where there are cameras, else in milliradians.
fn in_unit(solved: &Solved, radians: f64) -> f64 {
    radians * solved.focal_length.unwrap_or(1e3)
}

fn unit(solved: &Solved) -> &'static str {
    if solved.focal_length.is_some() { "px" } else { "mrad" }
}

/// A residual with its unit.
pub(super) fn residual(solved: &Solved, radians: f64) -> String {
    format!("{} {}", table::short(in_unit(solved, radians)), unit(solved))
}

/// What counts as zero on the logarithmic axis of residuals, in radians.
const ROUNDING: f64 = 1e-17;

fn residuals(solved: &Solved) -> Figure {
    let y = Axis::log(format!("Sampson error, {}", unit(solved)));
    let mut panel = Panel::new("", Axis::linear("match, counted from 0"), y);
    for (index, candidate) in solved.candidates.iter().enumerate() {
        let errors = solved.matches.iter().map(|m| candidate.pose.sampson_error(m).max(ROUNDING));
        let points = errors.enumerate().map(|(k, error)| [k as f64, in_unit(solved, error)]);
        let series = Series::points(button(index, candidate), points.collect()).coloured(colour::nth(index));
        panel = panel.with(series);
    }
    Figure::new("Residuals")
        .caption(
            "The angle by which the two bearings of a match have to turn to satisfy the candidate. Five matches are \
             satisfied by every exact candidate; more of them tell candidates apart.",
        )
        .row([panel])
}

fn candidates(solved: &Solved) -> Vec<Vec<String>> {
    let is_known = |f: fn(&quest_io::CandidateRecord) -> Option<f64>| {
        solved.record.candidates.iter().any(|c| f(c).is_some())
    };
    let has_rotation = is_known(|c| c.rotation_error_deg);
    let has_translation = is_known(|c| c.translation_error_deg);
    let mut header = vec!["candidate", "in front", "residual", "rotation, °", "t", "|t|"];
    header.extend(has_rotation.then_some("R error, °"));
    header.extend(has_translation.then_some("t error, °"));
    let mut rows = vec![header.into_iter().map(str::to_owned).collect::<Vec<_>>()];
    let shown = solved.candidates.iter().zip(&solved.record.candidates).enumerate();
    for (index, (candidate, record)) in shown {
        let length = candidate.pose.t_21.norm();
        let degrees = |error: Option<f64>| error.map(table::short).unwrap_or_default();
        let mut row = vec![
            name(index, candidate),
            format!("{} of {}", record.in_front, solved.matches.len()),
            residual(solved, record.residual),
            format!("{:.3}", table::angle_axis(record.q_21).0),
            table::vector(record.t_21, table::decimals(length)).join(" "),
            table::short(length),
        ];
        row.extend(has_rotation.then(|| degrees(record.rotation_error_deg)));
        row.extend(has_translation.then(|| degrees(record.translation_error_deg)));
        rows.push(row);
    }
    rows
}
