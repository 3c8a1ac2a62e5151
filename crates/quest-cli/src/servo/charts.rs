//! Figures 9, 10 and 12 to 19: cameras in space, paths in the image, poses over time, paths on the floor.

mod arrival;
mod space;

use quest_core::Camera;
use quest_plot::{Axis, Colour, Figure, Page, Panel, PlotError, Series, Style, colour};

use super::Run;
use super::frame::{FrameRecord, Pose};

/// One run, and the paths of others, as one SVG file or one page.
pub(super) fn drawn(title: &str, run: &Run, others: &[Run], is_svg: bool) -> Result<String, PlotError> {
    let frames = &run.frames[..arrival::shown(&run.frames)];
    let mut figure = Figure::new(title)
        .caption(
            "Dots: the features of the first image. Crosses: those of the goal. Arrows: where the camera looks. Translations have the \
             length that makes the first one 1; the essential matrix has no other. Time ends shortly after the \
             arrival; of methods that the loop does not use some images are drawn.",
        )
        .key(key(frames));
    if is_svg && run.is_free {
        figure = figure.row(space::instants(run, frames));
    }
    let figure = figure
        .row([image(&run.camera, &run.goal, frames), floor(run, others), commands(frames)])
        .row([rotation(frames), translation(frames), lengths(frames)]);
    if is_svg {
        return quest_plot::to_svg(&[figure]);
    }
    let page = Page::new(title);
    let page = if run.is_free { page.space(space::whole(run, frames)) } else { page };
    page.figure(figure).to_html()
}

/// The methods that are drawn.
fn key(frames: &[FrameRecord]) -> Vec<(Style, &'static str)> {
    let drawn = METHODS.iter().rev().filter(|(_, pose, _)| frames.iter().any(|f| pose(f).is_some()));
    let words = |name| match name {
        "essential" => "essential matrix (Stewénius)",
        LOOP => "the loop: what the commands are based on",
        other => other,
    };
    drawn.map(|(name, _, style)| (*style, words(*name))).collect()
}

fn image(camera: &Camera, goal: &[[f64; 2]], frames: &[FrameRecord]) -> Panel {
    let (width, height) = camera.size().unwrap_or((640, 480));
    let panel = Panel::new(
        "Features in the image",
        Axis::linear("u, px").range(0.0, f64::from(width)),
        // As an image has it: v runs down.
        Axis::linear("v, px").range(f64::from(height), 0.0),
    );
    let paths = (0..goal.len()).map(|k| {
        let path = frames.iter().map(|f| f.pixels[k].unwrap_or([f64::NAN; 2])).collect();
        Series::line("features", path).coloured(colour::nth(k)).labelled("")
    });
    let first = frames.first().map(|f| f.pixels.iter().flatten().copied().collect());
    let panel = paths.fold(panel, Panel::with);
    panel
        .with(Series::points("start", first.unwrap_or_default()).coloured(colour::MUTED))
        .with(crosses("goal", goal.to_vec()))
        .equal_scales()
}

/// How many arrows a path has.
const ARROWS: usize = 8;

fn floor(run: &Run, others: &[Run]) -> Panel {
    let panel = Panel::new("Path, from above", Axis::linear("x, m"), Axis::linear("z, m"));
    let path = |run: &Run| run.frames.iter().map(|f| [f.position[0], f.position[2]]).collect::<Vec<_>>();
    let all = || others.iter().chain([run]).flat_map(path);
    let extent = |k: usize| {
        let (low, high) = all().fold((0.0_f64, 0.0_f64), |(low, high), p| (low.min(p[k]), high.max(p[k])));
        high - low
    };
    let length = 0.07 * extent(0).max(extent(1));
    let mut panel = panel;
    for (k, other) in others.iter().enumerate() {
        let colour = colour::nth(k);
        panel = panel.with(Series::line("other starts", path(other)).coloured(colour).labelled(""));
        panel = arrows(panel, "other starts", other, length, colour, Style::Line);
    }
    let colour = colour::of_solver("quest");
    let own = Series::line("path", path(run)).coloured(colour).styled(Style::Thick).labelled("");
    let panel = arrows(panel.with(own), "path", run, length, colour, Style::Line);
    panel.with(crosses("goal", vec![[0.0, 0.0]])).equal_scales()
}

/// Where the camera looks, at equal distances on its path.
fn arrows(mut panel: Panel, name: &str, run: &Run, length: f64, colour: Colour, style: Style) -> Panel {
    let (mut walked, mut last) = (vec![0.0], None::<[f64; 2]>);
    for frame in &run.frames {
        let at = [frame.position[0], frame.position[2]];
        let step = last.map_or(0.0, |last| (at[0] - last[0]).hypot(at[1] - last[1]));
        walked.push(walked.last().copied().unwrap_or(0.0) + step);
        last = Some(at);
    }
    let whole = walked.last().copied().unwrap_or(0.0);
    for k in 0..ARROWS {
        let place = walked[1..].partition_point(|w| *w < whole * k as f64 / ARROWS as f64);
        let Some(frame) = run.frames.get(place) else { continue };
        let [w, x, y, z] = frame.truth.q_21;
        // The optical axis in the frame of the goal: the last row of R_21.
        let axis = [2.0 * (x * z - w * y), 1.0 - 2.0 * (x * x + y * y)];
        let from = [frame.position[0], frame.position[2]];
        let to = [from[0] + length * axis[0], from[1] + length * axis[1]];
        panel = panel.with(Series::arrow(name, from, to, 0.35 * length).coloured(colour).styled(style));
    }
    panel
}

fn commands(frames: &[FrameRecord]) -> Panel {
    let norm = |v: &[f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let curve = |value: &dyn Fn(&FrameRecord) -> f64| frames.iter().map(|f| [f.time, value(f)]).collect();
    Panel::new("Commands", Axis::linear("time, s"), Axis::linear("m/s, rad/s"))
        .with(Series::line("speed", curve(&|f| norm(&f.linear))).coloured(colour::nth(0)))
        .with(Series::line("turn rate", curve(&|f| norm(&f.angular))).coloured(colour::nth(1)))
}

/// The values of a pose over time; gaps where there is none.
fn over_time(frames: &[FrameRecord], value: impl Fn(&FrameRecord) -> Option<f64>) -> Vec<[f64; 2]> {
    frames.iter().map(|f| [f.time, value(f).unwrap_or(f64::NAN)]).collect()
}

/// What is compared: a method, where its pose is, and how it is drawn.
type Method = (&'static str, fn(&FrameRecord) -> Option<&Pose>, Style);

/// The pose that the commands are based on, whichever solver it is from.
const LOOP: &str = "the loop";

const METHODS: [Method; 3] = [
    ("essential", |f| f.essential.as_ref(), Style::Dashed),
    ("homography", |f| f.homography.as_ref(), Style::Line),
    (LOOP, |f| f.estimate.as_ref(), Style::Thick),
];

/// Each component of each method, in the component's colour. The scale is that of the loop: a method that jumps leaves the panel.
fn components(
    panel: Panel,
    names: &[&str],
    frames: &[FrameRecord],
    value: impl Fn(&Pose, usize) -> f64,
    scaled: bool,
) -> Panel {
    let mut panel = panel;
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for (method, pose, style) in METHODS {
        let first = frames.iter().find_map(pose).map(length).filter(|l| scaled && *l > 0.0);
        for (k, name) in names.iter().enumerate() {
            let points = over_time(frames, |f| pose(f).map(|p| value(p, k) / first.unwrap_or(1.0)));
            if points.iter().all(|p| p[1].is_nan()) {
                continue;
            }
            if method == LOOP {
                (low, high) = points.iter().fold((low, high), |(l, h), p| (l.min(p[1]), h.max(p[1])));
            }
            let label = if method == LOOP { (*name).to_owned() } else { String::new() };
            let series = Series::line(method, if method == LOOP { points } else { some(points) });
            panel = panel.with(series.coloured(colour::nth(k)).styled(style).labelled(label));
        }
    }
    if low < high {
        let room = 0.08 * (high - low);
        panel.y = panel.y.range(low - room, high + room);
    }
    panel
}

/// Points of a line, at most, that jumps from image to image.
const SOME: usize = 120;

/// Every nth point.
fn some(points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    let step = points.len().div_ceil(SOME).max(1);
    points.into_iter().step_by(step).collect()
}

fn rotation(frames: &[FrameRecord]) -> Panel {
    let panel = Panel::new("Rotation", Axis::linear("time, s"), Axis::linear("quaternion"));
    components(panel, &["q1", "q2", "q3", "q4"], frames, |p, k| p.q_21[k], false)
}

fn translation(frames: &[FrameRecord]) -> Panel {
    let panel = Panel::new("Translation", Axis::linear("time, s"), Axis::linear("t, first length 1"));
    components(panel, &["tx", "ty", "tz"], frames, |p, k| p.t_21[k], true)
}

fn lengths(frames: &[FrameRecord]) -> Panel {
    let panel = Panel::new("Length of the translation", Axis::linear("time, s"), Axis::log("|t|, first 1"));
    METHODS.iter().fold(panel, |panel, (name, pose, style)| {
        let Some(first) = frames.iter().find_map(pose).map(length).filter(|l| *l > 0.0) else { return panel };
        let points = over_time(frames, |f| pose(f).map(|p| length(p) / first));
        let solver = match *name {
            "essential" => "stewenius",
            LOOP => "quest",
            solver => solver,
        };
        panel.with(Series::line(*name, points).coloured(colour::of_solver(solver)).styled(*style))
    })
}

fn length(pose: &Pose) -> f64 {
    pose.t_21.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn crosses(name: &str, points: Vec<[f64; 2]>) -> Series {
    const GOAL: Colour = colour::INK;
    Series::points(name, points).coloured(GOAL).styled(Style::Crosses)
}
