//! Figures 9, 10 and 12 to 19: paths in the image, poses over time, paths on the floor.

use quest_core::Camera;
use quest_plot::{Axis, Colour, Figure, Page, Panel, PlotError, Series, Style, colour};

use super::Run;
use super::frame::{FrameRecord, Pose};

/// One run, and the paths of others, as one SVG file or one page.
pub(super) fn drawn(title: &str, run: &Run, others: &[Run], is_svg: bool) -> Result<String, PlotError> {
    let frames = &run.frames;
    let figure = Figure::new(title)
        .caption(
            "Dots: the features of the first image. Crosses: those of the goal. Translations have the length that makes \
             the first one 1; the essential matrix has no other.",
        )
        .row([image(&run.camera, &run.goal, frames), floor(run, others), commands(frames)])
        .row([rotation(frames), translation(frames), lengths(frames)]);
    if is_svg { quest_plot::to_svg(&[figure]) } else { Page::new(title).figure(figure).to_html() }
}

fn image(camera: &Camera, goal: &[[f64; 2]], frames: &[FrameRecord]) -> Panel {
    let (width, height) = camera.size().unwrap_or((640, 480));
    let panel = Panel::new(
        "Features in the image",
        Axis::linear("u, px").range(0.0, f64::from(width)),
        // Upwards, the image's v runs down.
        Axis::linear("−v, px").range(-f64::from(height), 0.0),
    );
    let upright = |p: [f64; 2]| [p[0], -p[1]];
    let paths = (0..goal.len()).map(|k| {
        let path = frames.iter().map(|f| f.pixels[k].map_or([f64::NAN; 2], upright)).collect();
        Series::line(format!("feature {}", k + 1), path).coloured(colour::nth(k)).labelled("")
    });
    let first = frames.first().map(|f| f.pixels.iter().flatten().map(|&p| upright(p)).collect());
    let panel = paths.fold(panel, Panel::with);
    panel
        .with(Series::points("start", first.unwrap_or_default()).coloured(colour::MUTED))
        .with(crosses("goal", goal.iter().map(|&p| upright(p)).collect()))
        .equal_scales()
}

fn floor(run: &Run, others: &[Run]) -> Panel {
    let panel = Panel::new("Path, from above", Axis::linear("x, m"), Axis::linear("z, m"));
    let path = |run: &Run| run.frames.iter().map(|f| [f.position[0], f.position[2]]).collect::<Vec<_>>();
    let others = others.iter().enumerate().map(|(k, other)| {
        Series::line(format!("start {}", k + 2), path(other)).coloured(colour::nth(k)).labelled("")
    });
    let own = Series::line("path", path(run))
        .coloured(colour::of_solver("quest"))
        .styled(Style::Thick)
        .labelled("");
    others.fold(panel, Panel::with).with(own).with(crosses("goal", vec![[0.0, 0.0]])).equal_scales()
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

/// Each component of each method, in the component's colour.
fn components(
    panel: Panel,
    names: &[&str],
    frames: &[FrameRecord],
    value: impl Fn(&Pose, usize) -> f64,
    scaled: bool,
) -> Panel {
    let mut panel = panel;
    for (method, pose, style) in METHODS {
        let first = frames.iter().find_map(pose).map(length).filter(|l| scaled && *l > 0.0);
        for (k, name) in names.iter().enumerate() {
            let points = over_time(frames, |f| pose(f).map(|p| value(p, k) / first.unwrap_or(1.0)));
            if points.iter().all(|p| p[1].is_nan()) {
                continue;
            }
            let label = if method == LOOP { (*name).to_owned() } else { String::new() };
            let series = Series::line(format!("{name}, {method}"), points);
            panel = panel.with(series.coloured(colour::nth(k)).styled(style).labelled(label));
        }
    }
    panel
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
