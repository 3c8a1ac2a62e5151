//! The figures as charts.

use quest_core::{
    simulate::{Figure, Reading},
    solver::Kinds,
};
use quest_plot::{Axis, Page, Panel, PlotError, Series, Style, colour};

use super::{Record, record::Quantity, run::Run};

pub(super) fn title(figure: Figure) -> &'static str {
    match figure {
        Figure::Four => "Figure 4: noise, general points",
        Figure::Five => "Figure 5: noise, coplanar points",
        Figure::Six => "Figure 6: parallax, at 0.75 px of noise",
        Figure::Seven => "Figure 7: noise, rotation alone",
        Figure::Eight => "Figure 8: noise, translation alone",
    }
}

pub(super) fn reading_title(reading: Reading) -> &'static str {
    match reading {
        Reading::Exact => "closest real solution",
        Reading::All => "closest of all kinds",
        Reading::Selected => "chosen by 30 more points",
    }
}

/// One sentence on what was run.
pub(super) fn conditions(run: &Run, figure: Figure) -> String {
    let scenes = if run.scenes == "paper" { "scenes of the paper's kind" } else { "realistic scenes" };
    let rounded = if run.base.rounded { ", rounded to pixels" } else { "" };
    let planar = if run.kinds == Kinds::Planar { "; planar candidates beside the others" } else { "" };
    format!(
        "{} {scenes}{rounded} of {} points at each value, seed {}, the same for every solver{planar}.",
        run.trials_of(figure),
        run.base.points,
        run.seed
    )
}

/// All figures as one SVG file or one page.
pub(super) fn drawn(run: &Run, records: &[Record], is_svg: bool) -> Result<String, PlotError> {
    let figures: Vec<_> = run.figures.iter().map(|&figure| chart(run, figure, records)).collect();
    if is_svg {
        return quest_plot::to_svg(&figures);
    }
    let page = Page::new("Section 9: errors of the solvers").introduction(
        "Closest real solution and closest of all kinds: the candidate nearest to the truth, as the paper has it. \
         Selected: the one that further points of the scene choose, without the truth. Compare within one column.",
    );
    figures.into_iter().fold(page, Page::figure).to_html()
}

fn chart(run: &Run, figure: Figure, records: &[Record]) -> quest_plot::Figure {
    let caption =
        format!("{} Bands are the 95 % confidence intervals of the means.", conditions(run, figure));
    let mut chart = quest_plot::Figure::new(title(figure)).caption(caption);
    for (quantity, word) in [(Quantity::RotationRad, "Rotation"), (Quantity::TranslationRad, "Translation")] {
        let name = format!("figure {}", figure.number());
        let is_wanted = |r: &&Record| r.experiment == name && r.quantity == quantity;
        let wanted: Vec<&Record> = records.iter().filter(is_wanted).collect();
        let highest = wanted.iter().filter_map(|r| r.mean).fold(0.0, f64::max);
        if highest <= 0.0 {
            continue;
        }
        let panel = |reading: Reading| {
            let varied =
                if figure.varies_parallax() { "parallax" } else { "noise, standard deviation in px" };
            let y = Axis::linear("mean error, rad").range(0.0, 1.05 * highest);
            let panel = Panel::new(format!("{word}: {}", reading_title(reading)), Axis::linear(varied), y);
            // The first solver is drawn last, on top.
            let solvers = run.solvers_of(figure).into_iter().rev();
            solvers.fold(panel, |panel, solver| {
                panel.with(curve(&wanted, reading, solver.info().name, solver == run.solvers_of(figure)[0]))
            })
        };
        chart = chart.row(Reading::ALL.map(panel));
    }
    chart
}

fn curve(records: &[&Record], reading: Reading, solver: &str, is_first: bool) -> Series {
    let own = || records.iter().filter(|r| r.solver == solver && r.reading == reading.name());
    let points = own().filter_map(|r| Some([r.value, r.mean?])).collect();
    let band = own().filter_map(|r| Some([r.value, r.mean? - r.ci95?, r.mean? + r.ci95?])).collect();
    Series::line(solver, points).banded(band).coloured(colour::of_solver(solver)).styled(if is_first {
        Style::Thick
    } else {
        Style::Line
    })
}
