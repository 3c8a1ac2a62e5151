//! Text, lines and areas on the canvas, in the units of the file.

use plotters::element::{PathElement, Polygon};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, FontStyle, IntoFont, RGBColor, ShapeStyle, TextStyle};

use super::{Canvas, FINE, drawing};
use crate::{Colour, PlotError};

#[derive(Clone, Copy)]
pub(super) enum Weight {
    Normal,
    Bold,
}

pub(super) fn rgb(colour: Colour) -> RGBColor {
    RGBColor(colour.0, colour.1, colour.2)
}

/// A style of text whose letters are `size` units high.
pub(super) fn style(size: i32, weight: Weight, colour: Colour) -> TextStyle<'static> {
    let weight = match weight {
        Weight::Normal => FontStyle::Normal,
        Weight::Bold => FontStyle::Bold,
    };
    // plotters divides the size by 1.24 when it writes it.
    ("Helvetica, Arial, sans-serif", 1.24 * f64::from(size * FINE))
        .into_font()
        .style(weight)
        .color(&rgb(colour))
}

pub(super) fn text(
    canvas: &Canvas,
    text: &str,
    (x, y): (i32, i32),
    anchor: HPos,
    weight: Weight,
    size: i32,
    colour: Colour,
) -> Result<(), PlotError> {
    let style = style(size, weight, colour).pos(Pos::new(anchor, VPos::Center));
    canvas.draw_text(text, &style, (FINE * x, FINE * y)).map_err(drawing)
}

/// A line of this width, in tenths of a unit.
pub(super) fn stroke(colour: Colour, tenths: i32, opacity: f64) -> ShapeStyle {
    let width = (FINE * tenths / 10).unsigned_abs().max(1);
    ShapeStyle { color: rgb(colour).mix(opacity), filled: false, stroke_width: width }
}

/// A line through positions of the canvas.
pub(super) fn path(canvas: &Canvas, points: Vec<(i32, i32)>, style: ShapeStyle) -> Result<(), PlotError> {
    canvas.draw(&PathElement::new(points, style)).map_err(drawing)
}

/// A filled polygon of positions of the canvas.
pub(super) fn area(
    canvas: &Canvas,
    points: Vec<(i32, i32)>,
    colour: Colour,
    opacity: f64,
) -> Result<(), PlotError> {
    canvas.draw(&Polygon::new(points, rgb(colour).mix(opacity).filled())).map_err(drawing)
}
