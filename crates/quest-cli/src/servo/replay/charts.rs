//! A recorded run as charts: paths in the image, pose, commands, states, what was left out.

use quest_plot::{Axis, Colour, Figure, Page, Panel, Part, PlotError, Series, Space, Style, colour};

use super::archive::{Image, Recorded};
use super::summary::{Summary, angle, norm};

/// More paths than these hide each other; they are chosen evenly from the goal's list.
const PATHS: usize = 60;

/// Left out of the pose.
const LEFT_OUT: Colour = Colour(0xd6, 0x1f, 0x3a);

/// The page, or its figure alone as SVG.
pub(super) fn drawn(summary: &Summary, run: &Recorded, is_svg: bool) -> Result<String, PlotError> {
    let images = &run.images;
    let figure = Figure::new(&summary.name)
        .caption(
            "Crosses: the features of the goal image. Dots: those of the first image. Red: features that the pose does \
             not rest on. Lengths are in the unit of the run.",
        )
        .row([paths(run), distance(images), commands(images)])
        .row([states(images), counts(images), components(images)]);
    if is_svg {
        return quest_plot::to_svg(&[figure]);
    }
    let introduction = format!(
        "{} images in {:.1} s, {} features in the goal image. X2 = R X1 + t, frame 1 is the goal's camera, frame 2 that \
         of the image.",
        summary.images, summary.seconds, summary.features
    );
    Page::new(&summary.name)
        .introduction(introduction)
        .figure(figure)
        .space(room(images))
        .table("States, one after the other", table(summary))
        .to_html()
}

fn paths(run: &Recorded) -> Panel {
    let axes = run.size.map_or_else(
        || (Axis::linear("x"), Axis::linear("y").backwards()),
        |[w, h]| (Axis::linear("u, px").range(0.0, w), Axis::linear("v, px").range(h, 0.0)),
    );
    let every = run.goal.len().div_ceil(PATHS).max(1);
    let shown = || (0..run.goal.len()).step_by(every);
    let mut lines = Vec::new();
    // A wrong match is a dot of its own: a line to it would cross the whole image.
    let is_out =
        |image: &Image, k: usize| image.pose.is_some() && image.used.as_ref().is_some_and(|used| !used[k]);
    for k in shown() {
        let on_path = |image: &Image| if is_out(image, k) { [f64::NAN; 2] } else { image.points[k] };
        lines.extend(run.images.iter().map(on_path));
        // The next path begins elsewhere.
        lines.push([f64::NAN; 2]);
    }
    let left_out = run.images.iter().flat_map(|image| {
        let out = shown().filter(move |&k| is_out(image, k));
        out.map(|k| image.points[k]).filter(|p| p[0].is_finite())
    });
    let first = run.images.iter().take(1).flat_map(|image| shown().map(|k| image.points[k]));
    let goal = shown().map(|k| run.goal[k]).collect();
    Panel::new("Features in the image", axes.0, axes.1)
        .with(Series::line("paths", lines).coloured(colour::nth(4)).labelled(""))
        .with(Series::points("left out", left_out.collect()).coloured(LEFT_OUT))
        .with(Series::points("first image", first.collect()).coloured(colour::MUTED))
        .with(Series::points("goal", goal).coloured(colour::INK).styled(Style::Crosses))
        .equal_scales()
}

/// A value over time; gaps where there is none.
fn over_time(images: &[Image], value: impl Fn(&Image) -> Option<f64>) -> Vec<[f64; 2]> {
    images.iter().map(|i| [i.time, value(i).unwrap_or(f64::NAN)]).collect()
}

fn time() -> Axis {
    Axis::linear("time, s")
}

fn distance(images: &[Image]) -> Panel {
    let length = over_time(images, |i| i.pose.map(|(_, t)| norm(&t)));
    let turn = over_time(images, |i| i.pose.map(|(r, _)| angle(&r)));
    Panel::new("Distance from the goal", time(), Axis::log("|t|, angle in rad"))
        .with(Series::line("|t|", length).coloured(colour::nth(0)))
        .with(Series::line("angle", turn).coloured(colour::nth(1)))
}

fn commands(images: &[Image]) -> Panel {
    Panel::new("Commands", time(), Axis::linear("m/s, rad/s"))
        .with(Series::line("speed", over_time(images, |i| Some(norm(&i.linear)))).coloured(colour::nth(0)))
        .with(
            Series::line("turn rate", over_time(images, |i| Some(norm(&i.angular)))).coloured(colour::nth(1)),
        )
}

/// A line of dots for each state, in the order of their first appearance.
fn states(images: &[Image]) -> Panel {
    let mut names: Vec<&str> = Vec::new();
    for image in images {
        if !names.contains(&image.state.as_str()) {
            names.push(&image.state);
        }
    }
    let top = names.len() as f64;
    let panel =
        Panel::new("State", time(), Axis::linear("state, in the order of appearance").range(0.0, top + 1.0));
    names.iter().enumerate().fold(panel, |panel, (k, name)| {
        let dots = images.iter().filter(|i| i.state == *name).map(|i| [i.time, k as f64 + 1.0]).collect();
        panel.with(Series::points(*name, dots).coloured(colour::nth(k)).labelled(*name))
    })
}

fn counts(images: &[Image]) -> Panel {
    let left_out = |i: &Image| i.pose.and(i.inliers).map(|n| (i.seen() as f64 - n).max(0.0));
    Panel::new("Features", time(), Axis::linear("features"))
        .with(Series::line("seen", over_time(images, |i| Some(i.seen() as f64))).coloured(colour::nth(0)))
        .with(Series::line("used", over_time(images, |i| i.inliers)).coloured(colour::nth(2)))
        .with(Series::line("seen, not used", over_time(images, left_out)).coloured(LEFT_OUT))
}

fn components(images: &[Image]) -> Panel {
    let panel = Panel::new("Translation", time(), Axis::linear("t"));
    ["tx", "ty", "tz"].into_iter().enumerate().fold(panel, |panel, (k, name)| {
        let points = over_time(images, |i| i.pose.map(|(_, t)| t[k]));
        panel.with(Series::line(name, points).coloured(colour::nth(k)))
    })
}

/// The camera's path in the goal's frame, with its axes at the first and the last pose.
fn room(images: &[Image]) -> Space {
    let poses: Vec<_> = images.iter().filter_map(|i| i.pose.map(|p| (i, p))).collect();
    // C = −Rᵀ t
    let centre =
        |(r, t): &([f64; 9], [f64; 3])| [0, 1, 2].map(|k| -(r[k] * t[0] + r[3 + k] * t[1] + r[6 + k] * t[2]));
    let mut path = Part::new("path", colour::nth(0));
    path.lines.push(poses.iter().map(|(_, pose)| centre(pose)).collect());
    path.points =
        poses.iter().map(|(i, pose)| (centre(pose), format!("{:.2} s, {}", i.time, i.state))).collect();
    let longest = poses.iter().map(|(_, (_, t))| norm(t)).fold(0.0, f64::max);
    let identity = ([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], [0.0; 3]);
    let mut axes = Part::new("optical axes", colour::INK);
    let ends = [("first", poses.first()), ("last", poses.last())];
    let marked = ends.into_iter().filter_map(|(name, p)| p.map(|(_, pose)| (name, *pose)));
    for (name, pose) in marked.chain([("goal", identity)]) {
        let from = centre(&pose);
        let forward = [0, 1, 2].map(|k| from[k] + 0.25 * longest.max(1e-3) * pose.0[6 + k]);
        axes.lines.push(vec![from, forward]);
        axes.words.push((from, name.to_owned()));
    }
    let away = distance_of_eye(&path.lines.concat());
    let mut space = Space::of_camera("Path of the camera").with(path).with(axes);
    space.eye = space.eye.map(|x| away * x);
    space.caption.push_str("In the frame of the goal's camera: x to the right, y down, z forward.");
    space
}

/// How many times as far away as usual a path is to be seen from: the viewer's unit is the geometric mean of its sides, so that a path
/// in a plane would reach beyond the picture.
fn distance_of_eye(path: &[[f64; 3]]) -> f64 {
    let sides = [0, 1, 2].map(|k| {
        let (least, most) = path
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), p| (p[k].min(least), p[k].max(most)));
        (most - least).max(f64::MIN_POSITIVE)
    });
    let longest = sides.iter().copied().fold(0.0, f64::max);
    let mean = sides.iter().map(|side| side.cbrt()).product::<f64>();
    // Beyond that a path on a line would be a dot.
    (longest / mean).clamp(1.0, 6.0)
}

fn table(summary: &Summary) -> Vec<Vec<String>> {
    let header =
        ["state", "from, s", "to, s", "images", "seen", "used", "advice"].map(str::to_owned).to_vec();
    let row = |s: &super::summary::Stretch| {
        vec![
            s.state.clone(),
            format!("{:.2}", s.from),
            format!("{:.2}", s.to),
            s.images.to_string(),
            format!("{:.0}", s.seen),
            format!("{:.0}", s.used),
            s.advice.clone(),
        ]
    };
    [header].into_iter().chain(summary.states.iter().map(row)).collect()
}
