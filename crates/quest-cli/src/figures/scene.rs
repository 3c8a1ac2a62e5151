//! Figure B.20: cameras and points, and the example of appendix B.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use quest_core::{Correspondence, RelativePose};
use quest_plot::{Axis, Panel, Part, Series, Space, Style, colour};

use super::{Drawn, Judged};
use crate::drawing;

/// The points of the example in the frame of camera 1, in millimetres. They are ours: wide apart, so that the spheres show them.
const POINTS: [[f64; 3]; 5] = [
    [-1_350.0, -750.0, 1_700.0],
    [850.0, -1_250.0, 1_900.0],
    [1_250.0, 700.0, 1_800.0],
    [-500.0, 1_300.0, 2_000.0],
    [150.0, -150.0, 1_500.0],
];

/// The matches of the example: `O2` at (−800, 600, −500), and `q` = (0.95, 0.20, 0.10, 0.20) turns frame 2 into frame 1.
pub(super) fn of_the_paper() -> Vec<Correspondence> {
    let q_12 = UnitQuaternion::new_normalize(Quaternion::new(0.95, 0.20, 0.10, 0.20));
    let pose_21 = RelativePose::new(q_12, Vector3::new(-800.0, 600.0, -500.0)).inverse();
    let seen = |x1: [f64; 3]| {
        let x2 = pose_21.q_21 * Vector3::from(x1) + pose_21.t_21;
        Correspondence::from_image_points([x1[0] / x1[2], x1[1] / x1[2]], [x2.x / x2.z, x2.y / x2.z]).ok()
    };
    POINTS.into_iter().filter_map(seen).collect()
}

/// The cameras of a candidate and its points.
pub(super) fn space(drawn: &Drawn, judged: &Judged) -> Space {
    let pose = &judged.candidate.pose;
    let mut space = Space::of_camera("Cameras and points")
        .with(drawing::camera("camera 1", "F1", colour::INK, &RelativePose::identity(), 0.25))
        .with(drawing::camera("camera 2", "F2", colour::of_solver("quest"), pose, 0.25));
    space.axes = ["x1, mean depths", "y1", "z1"].map(str::to_owned);
    let centre2: [f64; 3] = pose.inverse().t_21.into();
    space = space.with(Part {
        lines: vec![vec![centre2, [0.0; 3]]],
        words: vec![(centre2.map(|x| 0.5 * x), "t".to_owned())],
        ..Part::new("t", colour::of_solver("quest"))
    });
    for (k, m) in drawn.matches.iter().enumerate() {
        let Some((z1, _)) = pose.depths(m).filter(|(z1, _)| z1.is_finite()) else { continue };
        let x: [f64; 3] = (m.bearing1() * (z1 * m.length1())).into();
        space = space
            .with(Part {
                lines: vec![vec![[0.0; 3], x], vec![centre2, x]],
                opacity: 0.3,
                ..Part::new("rays", colour::nth(k))
            })
            .with(Part {
                points: vec![(x, format!("point {}", k + 1))],
                words: vec![([x[0], x[1] - 0.09, x[2]], (k + 1).to_string())],
                ..Part::new("points", colour::nth(k))
            });
    }
    space
}

/// Figure B.21: both images, one over the other, on the plane z = 1.
pub(super) fn images(drawn: &Drawn) -> Panel {
    // Upwards, the y axis of an image runs down.
    let on_plane = |b: &Vector3<f64>| [b.x / b.z, b.y / b.z];
    let pairs: Vec<_> =
        drawn.matches.iter().map(|m| [on_plane(m.bearing1()), on_plane(m.bearing2())]).collect();
    let extent = |k: usize| {
        let all = || pairs.iter().flatten().map(|p| p[k]).filter(|x| x.is_finite());
        let (low, high) = (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
        let room = 0.15 * (high - low).max(0.1);
        [low - room, high + room]
    };
    let ([x0, x1], [y0, y1]) = (extent(0), extent(1));
    let (x, y) = (Axis::linear("x / z").range(x0, x1), Axis::linear("y / z").range(y1, y0));
    let mut panel = Panel::new("B.21: images 1 (×) and 2 (•)", x, y).equal_scales();
    for (k, [p1, p2]) in pairs.into_iter().enumerate() {
        panel = panel
            .with(
                Series::line("moved", vec![p1, p2])
                    .coloured(colour::nth(k))
                    .labelled("")
                    .styled(Style::Faint),
            )
            .with(Series::points("view 1", vec![p1]).coloured(colour::nth(k)).styled(Style::Crosses))
            .with(Series::points("view 2", vec![p2]).coloured(colour::nth(k)).labelled((k + 1).to_string()));
    }
    panel
}
