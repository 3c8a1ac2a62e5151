//! One panel: axes, series, and a label at the end of each.

use plotters::backend::SVGBackend;
use plotters::chart::{ChartBuilder, ChartContext};
use plotters::element::{Circle, Cross};
use plotters::prelude::Cartesian2d;
use plotters::style::text_anchor::HPos;
use plotters::style::{Color, ShapeStyle, TRANSPARENT};

use super::ink::{self, Weight};
use super::{Canvas, DASHED_WIDTH, FINE, drawing};
use crate::axis::Ruler;
use crate::colour::{GRID, INK, MUTED};
use crate::label::spread;
use crate::{Colour, Panel, PlotError, Series, Style};

type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<Ruler, Ruler>>;

/// Height of what stands above the axes: the title and the label of the y axis.
const HEAD: i32 = 48;
const FOOT: i32 = 44;
const LEFT: i32 = 56;
/// The same of a drawing without axes, and what is left free around it.
const BARE_HEAD: i32 = 40;
const MARGIN: i32 = 12;
/// Width of a letter of a label, height of its line.
const LETTER: f64 = 6.6;
const LINE: f64 = 14.0;

/// Draws on a canvas of this size in units.
pub(super) fn draw(canvas: &Canvas, panel: &Panel, size: [i32; 2]) -> Result<(), PlotError> {
    if panel.is_bare {
        return draw_bare(canvas, panel, size);
    }
    let right = label_width(panel);
    ink::text(canvas, &panel.title, (LEFT, 12), HPos::Left, Weight::Bold, 15, INK)?;
    ink::text(canvas, &panel.y.label, (LEFT, 33), HPos::Left, Weight::Normal, 13, MUTED)?;
    let inside = [size[0] - LEFT - right - 8, size[1] - HEAD - FOOT];
    let [x, y] = extents(panel, inside);
    let mut chart = ChartBuilder::on(canvas)
        .margin_top(FINE * HEAD)
        .margin_right(FINE * (right + 8))
        .x_label_area_size(FINE * FOOT)
        .y_label_area_size(FINE * LEFT)
        .build_cartesian_2d(Ruler::new(panel.x.scale, x), Ruler::new(panel.y.scale, y))
        .map_err(drawing)?;
    chart
        .configure_mesh()
        .x_labels(usize::try_from(inside[0] / 34).unwrap_or(0).clamp(2, 10))
        .y_labels(usize::try_from(inside[1] / 38).unwrap_or(0).clamp(2, 10))
        .set_all_tick_mark_size(4 * FINE)
        .light_line_style(TRANSPARENT)
        .bold_line_style(ink::stroke(GRID, 10, 1.0))
        .axis_style(ink::stroke(MUTED, 10, 1.0))
        .label_style(ink::style(12, Weight::Normal, MUTED))
        .axis_desc_style(ink::style(13, Weight::Normal, MUTED))
        .x_desc(panel.x.label.as_str())
        .draw()
        .map_err(drawing)?;
    for series in &panel.series {
        draw_series(canvas, &mut chart, panel, series, [x, y])?;
    }
    draw_labels(canvas, &chart, panel, [x, y])
}

/// A drawing under its title: no axes, and every label where its series ends.
fn draw_bare(canvas: &Canvas, panel: &Panel, size: [i32; 2]) -> Result<(), PlotError> {
    ink::text(canvas, &panel.title, (MARGIN, 12), HPos::Left, Weight::Bold, 15, INK)?;
    ink::text(canvas, &panel.y.label, (MARGIN, 31), HPos::Left, Weight::Normal, 13, MUTED)?;
    let inside = [size[0] - 2 * MARGIN, size[1] - BARE_HEAD - MARGIN];
    let [x, y] = extents(panel, inside);
    let mut chart = ChartBuilder::on(canvas)
        .margin_top(FINE * BARE_HEAD)
        .margin_bottom(FINE * MARGIN)
        .margin_left(FINE * MARGIN)
        .margin_right(FINE * MARGIN)
        .build_cartesian_2d(Ruler::new(panel.x.scale, x), Ruler::new(panel.y.scale, y))
        .map_err(drawing)?;
    for series in &panel.series {
        draw_series(canvas, &mut chart, panel, series, [x, y])?;
    }
    for series in panel.series.iter().filter(|s| !s.label.is_empty()) {
        let Some(last) = series.points.iter().rev().find(|p| is_inside(panel, [x, y], **p)) else { continue };
        let (px, py) = local(canvas, &chart, *last);
        let (position, anchor) = match series.style {
            Style::Words => ((px / FINE, py / FINE), HPos::Center),
            _ => ((px / FINE + 7, py / FINE - 7), HPos::Left),
        };
        ink::text(canvas, &series.label, position, anchor, Weight::Normal, 12, series.colour)?;
    }
    Ok(())
}

/// Width of the labels beside the axes.
fn label_width(panel: &Panel) -> i32 {
    let longest = panel.series.iter().map(|s| s.label.chars().count()).max().unwrap_or(0);
    let letters = (LETTER * longest as f64).ceil();
    if longest == 0 { 0 } else { 22 + rounded(letters) }
}

#[expect(clippy::cast_possible_truncation, reason = "a length on the canvas")]
fn rounded(length: f64) -> i32 {
    length.round() as i32
}

/// The ranges of both axes, enlarged where the scales have to be equal.
fn extents(panel: &Panel, [width, height]: [i32; 2]) -> [[f64; 2]; 2] {
    let [x, y] = panel.ranges();
    if !panel.equal_scales {
        return [x, y];
    }
    let per_unit = [x, y].map(|[from, to]| (to - from).abs());
    let unit = (per_unit[0] / f64::from(width)).max(per_unit[1] / f64::from(height));
    let enlarged = |[from, to]: [f64; 2], length: i32| {
        let half = 0.5 * unit * f64::from(length) * (to - from).signum();
        let middle = 0.5 * (from + to);
        [middle - half, middle + half]
    };
    [enlarged(x, width), enlarged(y, height)]
}

/// Whether a point has a place in the panel.
fn is_inside(panel: &Panel, [x, y]: [[f64; 2]; 2], point: [f64; 2]) -> bool {
    let within = |range: [f64; 2], v: f64| (range[0].min(range[1])..=range[0].max(range[1])).contains(&v);
    panel.x.shows(point[0]) && panel.y.shows(point[1]) && within(x, point[0]) && within(y, point[1])
}

/// How a line of a style is drawn.
pub(super) fn stroke(style: Style, colour: Colour) -> ShapeStyle {
    let (tenths, opacity) = match style {
        Style::Thick => (26, 1.0),
        Style::Faint => (9, 0.35),
        _ => (15, 1.0),
    };
    let mut stroke = ink::stroke(colour, tenths, opacity);
    if style == Style::Dashed {
        stroke.stroke_width = DASHED_WIDTH.unsigned_abs();
    }
    stroke
}

fn draw_series(
    canvas: &Canvas,
    chart: &mut Chart,
    panel: &Panel,
    series: &Series,
    ranges: [[f64; 2]; 2],
) -> Result<(), PlotError> {
    let here = |p: [f64; 2]| local(canvas, chart, p);
    let is_inside = |p: &[f64; 2]| is_inside(panel, ranges, *p);
    let clamped = |v: f64| v.clamp(ranges[1][0].min(ranges[1][1]), ranges[1][0].max(ranges[1][1]));
    let band = series.band.iter().filter(|b| is_inside(&[b[0], clamped(b[1])]));
    let edges: (Vec<_>, Vec<_>) =
        band.map(|b| (here([b[0], clamped(b[1])]), here([b[0], clamped(b[2])]))).unzip();
    if edges.0.len() > 1 {
        let outline = edges.0.into_iter().chain(edges.1.into_iter().rev()).collect();
        ink::area(canvas, outline, series.colour, 0.10)?;
    }
    let dots = || series.points.iter().filter(|p| is_inside(p)).map(|p| here(*p));
    let stroke = stroke(series.style, series.colour);
    match series.style {
        Style::Points => dots().try_for_each(|p| {
            canvas
                .draw(&Circle::new(p, 5 * FINE / 2, ink::rgb(series.colour).mix(0.8).filled()))
                .map_err(drawing)
        }),
        Style::Crosses => {
            dots().try_for_each(|p| canvas.draw(&Cross::new(p, 5 * FINE, stroke)).map_err(drawing))
        }
        Style::Words => Ok(()),
        Style::Area => ink::area(canvas, dots().collect(), series.colour, 0.12),
        Style::Line | Style::Thick | Style::Dashed | Style::Faint => {
            for run in series.points.split(|p| !is_inside(p)).filter(|run| run.len() > 1) {
                ink::path(canvas, run.iter().map(|p| here(*p)).collect(), stroke)?;
            }
            Ok(())
        }
    }
}

/// The position of a point relative to the canvas.
fn local(canvas: &Canvas, chart: &Chart, [x, y]: [f64; 2]) -> (i32, i32) {
    let (px, py) = chart.plotting_area().map_coordinate(&(x, y));
    let (left, top) = canvas.get_base_pixel();
    (px - left, py - top)
}

/// The labels at the right, in the order of the curves' ends, each with a line to its curve.
fn draw_labels(
    canvas: &Canvas,
    chart: &Chart,
    panel: &Panel,
    ranges: [[f64; 2]; 2],
) -> Result<(), PlotError> {
    let ends = panel.series.iter().filter(|s| !s.label.is_empty()).filter_map(|series| {
        let last = series.points.iter().rev().find(|p| is_inside(panel, ranges, **p))?;
        Some((series, local(canvas, chart, *last)))
    });
    let (across, down) = chart.plotting_area().get_pixel_range();
    let (left, top) = canvas.get_base_pixel();
    // A curve that ends within the panel has its label there.
    let is_at_the_right = |(_, end): &(&Series, (i32, i32))| end.0 + left > across.end - 40 * FINE;
    let (ends, within): (Vec<_>, Vec<_>) = ends.partition(is_at_the_right);
    for (series, (x, y)) in within {
        let position = (x / FINE + 7, y / FINE - 7);
        ink::text(canvas, &series.label, position, HPos::Left, Weight::Normal, 12, series.colour)?;
    }
    let fine = f64::from(FINE);
    let height = f64::from(down.end - down.start) / fine;
    let wanted: Vec<f64> = ends.iter().map(|(_, p)| f64::from(p.1 + top - down.start) / fine).collect();
    for ((series, end), y) in ends.iter().zip(spread(&wanted, LINE, height)) {
        let (x, y) = (across.end - left, down.start - top + rounded(y * fine));
        let leader = vec![*end, (x + 4 * FINE, y), (x + 10 * FINE, y)];
        ink::path(canvas, leader, ink::stroke(series.colour, 8, 0.6))?;
        let weight = if series.style == Style::Thick { Weight::Bold } else { Weight::Normal };
        let position = (x / FINE + 13, y / FINE);
        ink::text(canvas, &series.label, position, HPos::Left, weight, 12, series.colour)?;
    }
    Ok(())
}
