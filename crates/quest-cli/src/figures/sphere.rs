//! Figure B.22: image points on unit spheres, the arcs that translation moves them on, and the same from above.

use std::f64::consts::{PI, TAU};

use nalgebra::Vector3;
use quest_core::Correspondence;
use quest_plot::{Panel, Part, Projection, Series, Space, Style, colour};

use super::{Drawn, Judged};

/// From where spheres are seen: z up, a little from above.
const EYE: [f64; 3] = [-0.55, -0.95, 1.0];
const UP: [f64; 3] = [0.0, 0.0, 1.0];

/// Points of a whole circle.
const SMOOTH: usize = 120;

/// A place that makes the way longer by less than this, in radians, lies on it: drawn lines are a hundredth wide.
const ON_THE_ARC: f64 = 1e-3;

/// The length of the arrow of a translation, in radii.
const ARROW: f64 = 1.35;

/// A sphere: view 1, or view 2 turned by a candidate.
struct Sphere {
    points: Vec<Vector3<f64>>,
    /// Where the points are in view 1.
    goals: Vec<Vector3<f64>>,
    /// From O2 to O1, of length one.
    t: Option<Vector3<f64>>,
}

impl Sphere {
    fn of_view_1(matches: &[Correspondence]) -> Self {
        Self { points: matches.iter().map(|m| *m.bearing1()).collect(), goals: Vec::new(), t: None }
    }

    fn turned(judged: &Judged, matches: &[Correspondence]) -> Self {
        let to_frame_1 = judged.candidate.pose.q_21.inverse();
        Self {
            points: matches.iter().map(|m| to_frame_1 * m.bearing2()).collect(),
            goals: matches.iter().map(|m| *m.bearing1()).collect(),
            t: (to_frame_1 * judged.candidate.pose.t_21).try_normalize(0.0),
        }
    }

    /// The arc that moving along t takes a point on: from where it is to −t.
    fn arc(&self, k: usize) -> Vec<[f64; 3]> {
        let Some(t) = self.t else { return Vec::new() };
        great_arc(&self.points[k], &-t)
    }

    /// The part of it up to the point's place in view 1, where that lies on it.
    fn moved(&self, k: usize) -> Vec<[f64; 3]> {
        let (Some(t), Some(goal)) = (self.t, self.goals.get(k)) else { return Vec::new() };
        let x = &self.points[k];
        let detour = x.angle(goal) + goal.angle(&-t) - x.angle(&-t);
        if detour < ON_THE_ARC { great_arc(x, goal) } else { Vec::new() }
    }
}

/// The shorter great arc from one point of the sphere to another.
fn great_arc(from: &Vector3<f64>, to: &Vector3<f64>) -> Vec<[f64; 3]> {
    let angle = from.angle(to);
    let Some(across) = (to - from * from.dot(to)).try_normalize(1e-9) else { return vec![(*from).into()] };
    let steps = 60;
    let at =
        |k: i32| from * (angle * f64::from(k) / 60.0).cos() + across * (angle * f64::from(k) / 60.0).sin();
    (0..=steps).map(|k| at(k).into()).collect()
}

/// Circles of latitude and longitude.
fn graticule() -> Vec<Vec<[f64; 3]>> {
    let circle = |f: &dyn Fn(f64) -> [f64; 3]| -> Vec<[f64; 3]> {
        (0..=SMOOTH).map(|k| f(TAU * k as f64 / SMOOTH as f64)).collect()
    };
    let latitudes = [-60.0_f64, -30.0, 30.0, 60.0].map(|degrees| {
        let (s, c) = degrees.to_radians().sin_cos();
        circle(&|a| [c * a.cos(), c * a.sin(), s])
    });
    let longitudes = (0..6).map(|k| {
        let (s, c) = (f64::from(k) * PI / 6.0).sin_cos();
        circle(&|a| [c * a.cos(), s * a.cos(), a.sin()])
    });
    latitudes.into_iter().chain(longitudes).collect()
}

fn equator() -> Vec<[f64; 3]> {
    let at = |k: usize| (TAU * k as f64 / SMOOTH as f64).sin_cos();
    (0..=SMOOTH).map(|k| [at(k).1, at(k).0, 0.0]).collect()
}

/// The sphere of view 1, B.22 (a).
pub(super) fn of_view_1(drawn: &Drawn) -> Panel {
    on_paper("B.22 (a): view 1", "where the points have to come", &Sphere::of_view_1(&drawn.matches))
}

/// The sphere of view 2 as a candidate turns it, B.22 (c) to (e).
pub(super) fn of_candidate(drawn: &Drawn, judged: &Judged, letter: char) -> Panel {
    let title = format!("B.22 ({letter}): candidate {}", judged.number);
    on_paper(&title, judged.words(), &Sphere::turned(judged, &drawn.matches))
}

/// Half of what a drawing of a sphere with its arrow takes.
const HALF: f64 = 1.5;

fn drawing(title: &str, words: &str) -> Panel {
    let mut panel = Panel::drawing(title).subtitled(words);
    (panel.x, panel.y) = (panel.x.range(-HALF, HALF), panel.y.range(-HALF, HALF));
    panel
}

fn on_paper(title: &str, words: &str, sphere: &Sphere) -> Panel {
    let p = Projection::new(EYE, UP);
    let circle: Vec<[f64; 2]> = {
        let at = |k: usize| (TAU * k as f64 / SMOOTH as f64).sin_cos();
        (0..=SMOOTH).map(|k| [at(k).1, at(k).0]).collect()
    };
    let mut panel = drawing(title, words)
        .with(Series::line("sphere", circle.clone()).coloured(colour::MUTED).styled(Style::Area).labelled(""))
        .with(Series::line("sphere", circle).coloured(colour::MUTED).styled(Style::Faint).labelled(""));
    for line in graticule() {
        panel = in_front(panel, &p, "sphere", &line, colour::MUTED, [Style::Faint, Style::Words]);
    }
    panel = in_front(panel, &p, "sphere", &equator(), colour::MUTED, [Style::Line, Style::Faint]);
    for (axis, name) in [([1.0, 0.0, 0.0], "x"), ([0.0, 1.0, 0.0], "y"), ([0.0, 0.0, 1.0], "z")] {
        let tip: [f64; 3] = axis.map(|x| 1.3 * x);
        let arrow = Series::arrow("sphere", p.at(axis), p.at(tip), 0.07).coloured(colour::MUTED);
        let word = Series::points("sphere", vec![p.at(axis.map(|x| 1.42 * x))]).labelled(name);
        panel = panel.with(arrow).with(word.coloured(colour::MUTED).styled(Style::Words));
    }
    for k in 0..sphere.points.len() {
        let arc = sphere.arc(k);
        panel = in_front(panel, &p, "arcs", &arc, colour::nth(k), [Style::Line, Style::Faint]);
        let moved = sphere.moved(k);
        panel = in_front(panel, &p, "arcs", &moved, colour::nth(k), [Style::Thick, Style::Thick]);
    }
    for (k, goal) in sphere.goals.iter().enumerate() {
        let at = p.at((*goal).into());
        panel =
            panel.with(Series::points("view 1", vec![at]).coloured(colour::nth(k)).styled(Style::Crosses));
    }
    for (k, x) in sphere.points.iter().enumerate() {
        let point = Series::points("points", vec![p.at((*x).into())]).coloured(colour::nth(k));
        panel = panel.with(point.labelled((k + 1).to_string()));
    }
    if let Some(t) = sphere.t {
        panel = panel.with(arrow_of(p.at([0.0; 3]), p.at((t * ARROW).into())));
        let word = Series::points("t", vec![p.at((t * 1.5).into())]).labelled("t");
        panel = panel.with(word.coloured(colour::of_solver("quest")).styled(Style::Words));
    }
    panel
}

/// Adds a line on the sphere in two styles: of what is in front, and of what is behind. Words: not at all.
fn in_front(
    mut panel: Panel,
    p: &Projection,
    name: &str,
    line: &[[f64; 3]],
    colour: quest_plot::Colour,
    styles: [Style; 2],
) -> Panel {
    for (is_front, style) in [(false, styles[1]), (true, styles[0])] {
        if style == Style::Words {
            continue;
        }
        let at = |x: &[f64; 3]| if (p.nearness(*x) >= 0.0) == is_front { p.at(*x) } else { [f64::NAN; 2] };
        let points: Vec<_> = line.iter().map(at).collect();
        if points.iter().any(|x| x[0].is_finite()) {
            panel = panel.with(Series::line(name, points).coloured(colour).styled(style).labelled(""));
        }
    }
    panel
}

fn arrow_of(from: [f64; 2], to: [f64; 2]) -> Series {
    Series::arrow("t", from, to, 0.12).coloured(colour::of_solver("quest")).styled(Style::Thick)
}

/// The sphere of a candidate from above, B.22 (f) to (j): what theorem 2 looks at.
pub(super) fn from_above(drawn: &Drawn, judged: &Judged) -> Panel {
    let sphere = Sphere::turned(judged, &drawn.matches);
    let at = |k: usize| (TAU * k as f64 / SMOOTH as f64).sin_cos();
    let circle: Vec<_> = (0..=SMOOTH).map(|k| [at(k).1, at(k).0]).collect();
    let above = |x: &Vector3<f64>| [x.x, x.y];
    let mut panel = drawing("The same from above", judged.words())
        .with(Series::line("sphere", circle.clone()).coloured(colour::MUTED).styled(Style::Area).labelled(""))
        .with(Series::line("sphere", circle).coloured(colour::MUTED).styled(Style::Line).labelled(""));
    for radius in [1.0 / 3.0, 2.0 / 3.0] {
        let ring = (0..=SMOOTH).map(|k| [radius * at(k).1, radius * at(k).0]).collect();
        panel = panel
            .with(Series::line("sphere", ring).coloured(colour::MUTED).styled(Style::Faint).labelled(""));
    }
    if let Some(t) = sphere.t.and_then(|t| t.xy().try_normalize(0.0)) {
        // The primary great arc is a diameter from above.
        let ends = vec![[-t.x, -t.y], [t.x, t.y]];
        let series = Series::line("primary great arc", ends).labelled("").styled(Style::Dashed);
        panel = panel.with(series.coloured(colour::of_solver("quest")));
        let (xy, word) = (t * ARROW, t * 1.5);
        panel = panel.with(arrow_of([0.0; 2], [xy.x, xy.y]));
        let word = Series::points("t", vec![[word.x, word.y]]).labelled("t_xy").styled(Style::Words);
        panel = panel.with(word.coloured(colour::of_solver("quest")));
    }
    for (k, (x, goal)) in sphere.points.iter().zip(&sphere.goals).enumerate() {
        let arc: Vec<_> = sphere.arc(k).into_iter().map(|[x, y, _]| [x, y]).collect();
        let moved: Vec<_> = sphere.moved(k).into_iter().map(|[x, y, _]| [x, y]).collect();
        panel = panel
            .with(Series::line("arcs", arc).coloured(colour::nth(k)).labelled(""))
            .with(Series::line("arcs", moved).coloured(colour::nth(k)).styled(Style::Thick).labelled(""))
            .with(Series::points("view 1", vec![above(goal)]).coloured(colour::nth(k)).styled(Style::Crosses))
            .with(
                Series::points("points", vec![above(x)])
                    .coloured(colour::nth(k))
                    .labelled((k + 1).to_string()),
            );
    }
    panel
}

/// All spheres in space: view 1, then the candidates.
pub(super) fn space(drawn: &Drawn) -> Space {
    let mut space = Space::new("Spheres");
    (space.up, space.eye, space.is_bare) = (UP, [-0.3, -1.9, 0.55], true);
    let mut spheres = vec![("view 1".to_owned(), Sphere::of_view_1(&drawn.matches))];
    spheres.extend(drawn.shown.iter().map(|judged| {
        (format!("candidate {}, {}", judged.number, judged.words()), Sphere::turned(judged, &drawn.matches))
    }));
    for (place, (word, sphere)) in spheres.iter().enumerate() {
        // Two beside each other, two above two.
        let (right, up) = (3.2 * (place % 2) as f64, if place < 2 { 3.4 } else { 0.0 });
        let moved = |[x, y, z]: [f64; 3]| [x + right, y, z + up];
        let line = |line: Vec<[f64; 3]>| -> Vec<[f64; 3]> { line.into_iter().map(moved).collect() };
        let grid = graticule().into_iter().map(&line).collect();
        space = space
            .with(Part { lines: grid, opacity: 0.25, ..Part::new("spheres", colour::MUTED) })
            .with(Part { lines: vec![line(equator())], ..Part::new("spheres", colour::MUTED) })
            .with(Part {
                words: vec![(moved([0.0, 0.0, -1.3]), word.clone())],
                ..Part::new("spheres", colour::INK)
            });
        for k in 0..sphere.points.len() {
            let at = moved(sphere.points[k].into());
            let name = format!("point {}", k + 1);
            space = space
                .with(Part { lines: vec![line(sphere.arc(k))], ..Part::new("arcs", colour::nth(k)) })
                .with(Part { points: vec![(at, name)], ..Part::new("points", colour::nth(k)) });
            if let Some(goal) = sphere.goals.get(k) {
                let (x, r) = (moved((*goal).into()), 0.05);
                let cross = [0, 1, 2].map(|axis| {
                    let end = |s: f64| std::array::from_fn(|i| x[i] + if i == axis { s * r } else { 0.0 });
                    vec![end(-1.0), end(1.0)]
                });
                space = space
                    .with(Part { lines: cross.to_vec(), ..Part::new("places in view 1", colour::nth(k)) });
            }
        }
        if let Some(t) = sphere.t {
            let shaft = vec![moved([0.0; 3]), moved((t * ARROW).into())];
            let words = vec![(moved((t * 1.5).into()), "t".to_owned())];
            space =
                space.with(Part { lines: vec![shaft], words, ..Part::new("t", colour::of_solver("quest")) });
        }
    }
    space
}
