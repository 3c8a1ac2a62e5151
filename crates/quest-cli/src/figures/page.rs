//! The figures as one SVG file or one page.

use quest_plot::{Figure, Page, PlotError};

use super::{Drawn, scene, sphere};
use crate::table;

const WORDS: &str = "Image points of view 2 lie on a sphere that a candidate turns into the frame of view 1 (dots). Moving the camera along t, \
                     from O2 to O1, moves each of them on its great arc towards −t. A candidate is feasible only if every point \
                     comes to its place in view 1 (crosses): the arcs of the others lead away from it. Theorem 2 reads that from \
                     above: (a) no dot lies on the lower half, (b) every cross is turned away from t_xy further than its dot, \
                     (c) on the same side of it.";

pub(super) fn svg(drawn: &Drawn) -> Result<String, PlotError> {
    quest_plot::to_svg(&[figure(drawn)])
}

fn figure(drawn: &Drawn) -> Figure {
    let mut figure = Figure::new(&drawn.title).caption(WORDS);
    let mut first = Vec::new();
    if let Some(best) = drawn.shown.last() {
        let mut space = scene::space(drawn, best);
        space.eye = [-1.0, -0.75, -0.9];
        first.push(space.drawn("B.20: the cameras and the points"));
    }
    first.extend([scene::images(drawn), sphere::of_view_1(drawn)]);
    figure = figure.row(first);
    let letters = ['c', 'd', 'e'];
    let spheres = drawn.shown.iter().zip(letters);
    figure
        .row(spheres.map(|(judged, letter)| sphere::of_candidate(drawn, judged, letter)))
        .row(drawn.shown.iter().map(|judged| sphere::from_above(drawn, judged)))
}

pub(super) fn html(drawn: &Drawn) -> Result<String, PlotError> {
    let mut page = Page::new(&drawn.title).introduction(WORDS);
    page = page.space(sphere::space(drawn));
    if let Some(best) = drawn.shown.last() {
        page = page.space(scene::space(drawn, best));
    }
    page.figure(figure(drawn).caption("")).table("Candidates", candidates(drawn)).to_html()
}

fn candidates(drawn: &Drawn) -> Vec<Vec<String>> {
    let header = ["candidate", "theorem 2", "in front of both cameras", "rotation, °", "t"];
    let mut rows = vec![header.map(str::to_owned).to_vec()];
    rows.extend(drawn.all.iter().map(|judged| {
        let pose = &judged.candidate.pose;
        vec![
            judged.number.to_string(),
            judged.words().to_owned(),
            format!("{} of {}", judged.candidate.in_front, drawn.matches.len()),
            format!("{:.3}", table::angle_axis(pose.wxyz()).0),
            table::vector(pose.t_21.into(), 3).join(" "),
        ]
    }));
    rows
}
