//! A scene in three dimensions as plotly sees it.

use plotly::common::{HoverInfo, Line, Marker, Mode};
use plotly::layout::{AspectMode, Axis, Camera, Layout, LayoutScene, Margin};
use plotly::{Plot, Scatter3D};

use crate::colour::GRID;
use crate::{Part, Space};

pub(super) fn plot(space: &Space) -> Plot {
    let mut plot = Plot::new();
    for part in &space.parts {
        add(&mut plot, part);
    }
    let axis = |name: &str| {
        let axis = Axis::new().title(name).grid_color(GRID.hex()).show_spikes(false);
        if space.is_bare { axis.visible(false) } else { axis }
    };
    let [x, y, z] = &space.axes;
    let ([up_x, up_y, up_z], [eye_x, eye_y, eye_z]) = (space.up, space.eye);
    let camera = Camera::new().up((up_x, up_y, up_z).into()).eye((eye_x, eye_y, eye_z).into());
    let scene = LayoutScene::new()
        .camera(camera)
        .aspect_mode(AspectMode::Data)
        .x_axis(axis(x))
        .y_axis(axis(y))
        .z_axis(axis(z));
    let margin = Margin::new().left(0).right(0).top(0).bottom(0);
    plot.set_layout(Layout::new().show_legend(false).margin(margin).scene(scene));
    plot
}

/// More points than this are drawn smaller.
const MANY: usize = 100;

fn add(plot: &mut Plot, part: &Part) {
    let colour = part.colour.hex();
    let trace = |points: &[[f64; 3]]| {
        let axis = |k: usize| points.iter().map(|p| p[k]).collect::<Vec<_>>();
        let trace = Scatter3D::new(axis(0), axis(1), axis(2)).name(part.name.as_str()).opacity(part.opacity);
        if part.is_shown { trace } else { trace.visible(plotly::common::Visible::LegendOnly) }
    };
    if !part.lines.is_empty() {
        // A point that is none, between two lines, keeps them apart.
        let gap = vec![[f64::NAN; 3]];
        let points: Vec<_> = part.lines.join(gap.as_slice());
        let line = Line::new().color(colour.clone()).width(3.0);
        plot.add_trace(trace(&points).mode(Mode::Lines).line(line).hover_info(HoverInfo::Skip));
    }
    if !part.points.is_empty() {
        let (points, words): (Vec<_>, Vec<_>) = part.points.iter().cloned().unzip();
        // Many points hide each other.
        let size = if points.len() > MANY { 2 } else { 5 };
        let marker = Marker::new().color(colour.clone()).size(size);
        let named = trace(&points).mode(Mode::Markers).marker(marker);
        plot.add_trace(named.hover_text_array(words).hover_info(HoverInfo::Text));
    }
    if !part.words.is_empty() {
        let (points, words): (Vec<_>, Vec<_>) = part.words.iter().cloned().unzip();
        let written = trace(&points).mode(Mode::Text);
        plot.add_trace(written.text_array(words).hover_info(HoverInfo::Skip));
    }
}
