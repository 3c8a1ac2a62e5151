//! Figures as SVG, drawn by plotters.

mod compact;
mod ink;
mod panel;

use plotters::backend::SVGBackend;
use plotters::coord::Shift;
use plotters::drawing::{DrawingArea, IntoDrawingArea};
use plotters::style::WHITE;
use plotters::style::text_anchor::HPos;

use crate::colour::{INK, MUTED};
use crate::{Figure, PlotError, Style};

type Canvas<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Width of a figure in the units of the file, and what its parts take of the height.
const WIDTH: i32 = 1200;
const TITLE: i32 = 44;
const CAPTION_LINE: i32 = 20;
const KEY: i32 = 22;
const GAP: i32 = 16;
/// Characters on a line of the caption.
const CAPTION_WIDTH: usize = 165;

/// plotters places everything at whole numbers: so many of them make one unit of the file.
const FINE: i32 = 8;

/// The width of dashed lines, in fine units, and of no others: plotters has no dashes, [`compact`] finds these lines by it.
const DASHED_WIDTH: i32 = 13;

/// The figures, one below the other, as one SVG file of 1200 units' width.
///
/// # Errors
/// [`PlotError::Drawing`].
pub fn to_svg(figures: &[Figure]) -> Result<String, PlotError> {
    let height: i32 = figures.iter().map(figure_height).sum::<i32>().max(1);
    let mut text = String::new();
    {
        let size = [WIDTH, height].map(|length| (FINE * length).unsigned_abs());
        let canvas = SVGBackend::with_string(&mut text, (size[0], size[1])).into_drawing_area();
        canvas.fill(&WHITE).map_err(drawing)?;
        let mut top = 0;
        for figure in figures {
            draw_figure(&canvas, figure, top)?;
            top += figure_height(figure);
        }
        canvas.present().map_err(drawing)?;
    }
    // The view box keeps the fine units; the size that is shown is that of the file's.
    let fine = format!("width=\"{}\" height=\"{}\"", FINE * WIDTH, FINE * height);
    let shown = format!("width=\"{WIDTH}\" height=\"{height}\"");
    Ok(compact::compact(&text.replacen(&fine, &shown, 1)))
}

fn drawing(error: impl std::fmt::Display) -> PlotError {
    PlotError::Drawing(error.to_string())
}

fn figure_height(figure: &Figure) -> i32 {
    let rows: i32 = figure.rows.iter().map(|row| row_height(row.len()) + GAP).sum();
    let lines = i32::try_from(wrapped(&figure.caption).len()).unwrap_or(i32::MAX / FINE);
    let key = if figure.key.is_empty() { 0 } else { KEY };
    TITLE + lines * CAPTION_LINE + key + rows + GAP
}

/// The fewer panels beside each other, the higher they are.
fn row_height(panels: usize) -> i32 {
    match panels {
        0 => 0,
        1 => 460,
        2 => 400,
        _ => 330,
    }
}

fn draw_figure(canvas: &Canvas, figure: &Figure, top: i32) -> Result<(), PlotError> {
    ink::text(canvas, &figure.title, (20, top + TITLE / 2 + 2), HPos::Left, ink::Weight::Bold, 22, INK)?;
    let mut y = top + TITLE;
    for line in wrapped(&figure.caption) {
        ink::text(canvas, &line, (20, y + 6), HPos::Left, ink::Weight::Normal, 14, MUTED)?;
        y += CAPTION_LINE;
    }
    if !figure.key.is_empty() {
        draw_key(canvas, &figure.key, y + KEY / 2)?;
        y += KEY;
    }
    for row in &figure.rows {
        let height = row_height(row.len());
        let count = i32::try_from(row.len()).unwrap_or(i32::MAX);
        for (left, panel) in (0..).map(|index| 8 + index * (WIDTH - 16) / count).zip(row) {
            let width = (WIDTH - 16) / count;
            let fine = [left, y + GAP, width, height].map(|v| FINE * v);
            let size = (fine[2].unsigned_abs(), fine[3].unsigned_abs());
            panel::draw(&canvas.clone().shrink((fine[0], fine[1]), size), panel, [width, height])?;
        }
        y += height + GAP;
    }
    Ok(())
}

/// A piece of line of each style, with what it means.
fn draw_key(canvas: &Canvas, key: &[(Style, String)], y: i32) -> Result<(), PlotError> {
    const SAMPLE: i32 = 34;
    const LETTER: i32 = 7;
    let mut x = 20;
    for (style, words) in key {
        ink::path(
            canvas,
            vec![(FINE * x, FINE * y), (FINE * (x + SAMPLE), FINE * y)],
            panel::stroke(*style, INK),
        )?;
        ink::text(canvas, words, (x + SAMPLE + 8, y), HPos::Left, ink::Weight::Normal, 13, INK)?;
        x += SAMPLE + 34 + LETTER * i32::try_from(words.chars().count()).unwrap_or(0);
    }
    Ok(())
}

/// The lines of a text.
fn wrapped(text: &str) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + word.chars().count() < CAPTION_WIDTH => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use crate::{Axis, Figure, Panel, Series, to_svg};

    #[test]
    fn a_figure_has_a_curve_labels_and_escaped_words() {
        let line = Series::line("a < b & c", (0..50).map(|k| [f64::from(k), f64::from(k * k)]).collect());
        let hidden = Series::line("empty", vec![[f64::NAN, 1.0]]);
        let panel = Panel::new("p", Axis::linear("x, m"), Axis::log("y")).with(line).with(hidden);
        let svg = to_svg(&[Figure::new("Title").row([panel.clone(), panel])]).unwrap();
        assert!(svg.starts_with("<svg width=\"1200\" height=\""));
        assert!(svg.contains("a &lt; b &amp; c") && svg.contains("x, m") && svg.contains("Title"));
        assert!(svg.matches("<path").count() >= 2 && !svg.contains("NaN"));
        assert!(!svg.contains("empty"));
    }
}
