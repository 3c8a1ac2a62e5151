//! A panel as plotly sees it.

use plotly::common::{DashType, ExponentFormat, Fill, HoverInfo, Line, Marker, MarkerSymbol, Mode, Position};
use plotly::layout::{Axis as PlotlyAxis, AxisRange, AxisType, HoverMode, Layout, Margin};
use plotly::{Plot, Scatter};

use crate::colour::{GRID, MUTED};
use crate::{Axis, Colour, Panel, Scale, Series, Style};

pub(super) fn plot(panel: &Panel) -> Plot {
    let mut plot = Plot::new();
    for series in &panel.series {
        if !series.band.is_empty() {
            plot.add_trace(band(series));
        }
        plot.add_trace(curve(panel, series));
    }
    let [x, y] = panel.ranges();
    let shown = |given: &Axis, range: [f64; 2]| {
        let drawn = axis(given, range);
        if panel.is_bare { drawn.visible(false).title("") } else { drawn }
    };
    let (x, y) = (shown(&panel.x, x), shown(&panel.y, y));
    let y = if panel.equal_scales { y.scale_anchor("x") } else { y };
    let margin = if panel.is_bare {
        Margin::new().left(8).right(8).top(8).bottom(8)
    } else {
        Margin::new().left(64).right(12).top(8).bottom(48)
    };
    let layout =
        Layout::new().show_legend(false).hover_mode(HoverMode::Closest).margin(margin).x_axis(x).y_axis(y);
    plot.set_layout(layout);
    plot
}

fn axis(axis: &Axis, range: [f64; 2]) -> PlotlyAxis {
    let drawn = PlotlyAxis::new()
        .title(axis.label.as_str())
        .type_(if axis.scale == Scale::Log { AxisType::Log } else { AxisType::Linear })
        .grid_color(GRID.hex())
        .zero_line_color(GRID.hex())
        .line_color(MUTED.hex())
        .exponent_format(ExponentFormat::Power)
        .auto_margin(true);
    // plotly's own range of the data runs forwards.
    match axis.range.or(axis.backwards.then_some(range)) {
        // plotly wants the exponents of a logarithmic axis.
        Some([from, to]) if axis.scale == Scale::Log => drawn.range(AxisRange::new(from.log10(), to.log10())),
        Some([from, to]) => drawn.range(AxisRange::new(from, to)),
        None => drawn,
    }
}

/// The band as one closed outline; it belongs to the curve's entry in the legend.
fn band(series: &Series) -> Box<Scatter<f64, f64>> {
    let forth = series.band.iter().map(|b| (b[0], b[1]));
    let back = series.band.iter().rev().map(|b| (b[0], b[2]));
    let (x, y) = forth.chain(back).unzip();
    Scatter::new(x, y)
        .name(series.name.as_str())
        .mode(Mode::Lines)
        .line(Line::new().width(0.0))
        .fill(Fill::ToSelf)
        .fill_color(translucent(series.colour))
        .hover_info(HoverInfo::Skip)
}

fn curve(panel: &Panel, series: &Series) -> Box<Scatter<f64, f64>> {
    let (x, y) = series.points.iter().map(|p| (p[0], p[1])).unzip();
    let colour = series.colour.hex();
    let drawn = Scatter::new(x, y)
        .name(series.name.as_str())
        .hover_template(format!("{}: %{{x:.4~g}}<br>{}: %{{y:.4~g}}", panel.x.label, panel.y.label));
    let drawn = if series.beside.is_empty() { drawn } else { drawn.custom_data(paths(series)) };
    let line = Line::new().color(colour.clone());
    let marker = Marker::new().color(colour);
    // Only a drawing has its words within: at axes the legend names the curves.
    let label = if panel.is_bare { series.label.as_str() } else { "" };
    match series.style {
        Style::Words => drawn.mode(Mode::Text).text_array(labels(series)).hover_info(HoverInfo::Skip),
        Style::Points if !label.is_empty() => drawn
            .mode(Mode::MarkersText)
            .marker(marker.size(7))
            .text_array(labels(series))
            .text_position(Position::TopRight),
        Style::Faint => {
            drawn.mode(Mode::Lines).line(line.width(1.0)).opacity(0.35).hover_info(HoverInfo::Skip)
        }
        Style::Area => drawn
            .mode(Mode::Lines)
            .line(line.width(0.0))
            .fill(Fill::ToSelf)
            .fill_color(translucent(series.colour))
            .hover_info(HoverInfo::Skip),
        Style::Line => drawn.mode(Mode::Lines).line(line.width(1.6)),
        Style::Thick => drawn.mode(Mode::Lines).line(line.width(3.0)),
        Style::Dashed => drawn.mode(Mode::Lines).line(line.width(1.6).dash(DashType::Dash)),
        Style::Points => drawn.mode(Mode::Markers).marker(marker.size(6)),
        Style::Crosses => drawn.mode(Mode::Markers).marker(marker.size(9).symbol(MarkerSymbol::X)),
    }
}

/// The curves beside the points, as paths of SVG in the units of the axes.
fn paths(series: &Series) -> Vec<String> {
    let path = |curve: &Vec<[f64; 2]>| {
        let points: Vec<_> = curve.iter().map(|[x, y]| format!("{x:.4},{y:.4}")).collect();
        if points.is_empty() { String::new() } else { format!("M{}", points.join("L")) }
    };
    series.beside.iter().map(path).collect()
}

/// The label at the last point, and none at the others.
fn labels(series: &Series) -> Vec<&str> {
    let mut all = vec![""; series.points.len()];
    if let Some(last) = all.last_mut() {
        *last = series.label.as_str();
    }
    all
}

fn translucent(Colour(red, green, blue): Colour) -> String {
    format!("rgba({red},{green},{blue},0.12)")
}
