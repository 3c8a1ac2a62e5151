//! The pair in three dimensions, in the frame of camera 1. The unit is the mean depth.

use nalgebra::Vector3;
use quest_core::{Candidate, Correspondence, RelativePose};
use quest_io::Pair;
use quest_plot::{Colour, Part, Space, colour};

use super::{Solved, page};

/// The largest distance of a drawn point. Farther points would make everything else small, so only their rays are drawn.
pub(super) const FARTHEST: f64 = 8.0;
pub(super) const CAMERA_1: &str = "camera 1";
const TRUTH: &str = "true camera 2";
/// The depth of the image in a drawn camera.
const FRUSTUM: f64 = 0.12;
/// Half the width and the height of a drawn image without a camera, on the plane `z = 1`.
const HALF_IMAGE: [f64; 2] = [0.5, 0.375];

/// Both cameras, and every candidate with its rays and points. The first candidate is switched on.
pub(super) fn space(solved: &Solved) -> Space {
    let camera1 = camera(CAMERA_1, colour::INK, &RelativePose::identity(), corners(solved.pair, 0), true);
    let mut space = Space::of_camera("Cameras and points").with(camera1);
    space.axes = ["x1, mean depths", "y1", "z1"].map(str::to_owned);
    space.caption.push_str(
        "In the frame of camera 1, x to the right, y down, z forward; the unit is the mean depth. Drag to turn, \
         scroll to zoom, point at a point for its depths. A point stands where its ray of camera 1 comes closest to \
         that of camera 2.",
    );
    for (index, candidate) in solved.candidates.iter().enumerate() {
        let (name, colour) = (page::button(index, candidate), colour::nth(index));
        let pose = &candidate.pose;
        space = space
            .with(rays(&name, colour, pose, &solved.matches, index == 0))
            .with(points(&name, colour, solved, candidate, index == 0))
            .with(camera(&name, colour, pose, corners(solved.pair, 1), index == 0));
    }
    match (solved.pair.truth.q_21, solved.pair.truth.t_21.and_then(|t| t.try_normalize(0.0))) {
        (Some(q_21), Some(direction)) => {
            // The truth has a scale of its own.
            let length = solved.candidates.first().map_or(1.0, |c| c.pose.t_21.norm());
            let pose = RelativePose::new(q_21, length * direction);
            space.with(camera(TRUTH, colour::MUTED, &pose, corners(solved.pair, 1), true))
        }
        _ => space,
    }
}

/// The corners of an image on the plane `z = 1`.
pub(super) fn corners(pair: &Pair, view: usize) -> [[f64; 2]; 4] {
    let unknown = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
        .map(|[x, y]| [x * HALF_IMAGE[0], y * HALF_IMAGE[1]]);
    let Some(camera) = pair.cameras.map(|cameras| cameras[view]) else { return unknown };
    let Some((width, height)) = camera.size() else { return unknown };
    let (width, height) = (f64::from(width), f64::from(height));
    let pixels = [[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]];
    let rays = pixels.map(|pixel| camera.bearing(pixel).ok().filter(|b| b[2] > 0.1));
    // A fisheye's corners may lie behind it, or nowhere.
    if rays.iter().any(Option::is_none) {
        return unknown;
    }
    rays.map(|ray| ray.map_or([0.0; 2], |b| [b[0] / b[2], b[1] / b[2]]))
}

/// The pyramid of a camera, with its name at the top.
pub(super) fn camera(
    name: &str,
    colour: Colour,
    pose: &RelativePose,
    corners: [[f64; 2]; 4],
    is_shown: bool,
) -> Part {
    let world = pose.inverse();
    let at = |x: [f64; 3]| -> [f64; 3] { (world.q_21 * Vector3::from(x) + world.t_21).into() };
    let centre = at([0.0; 3]);
    let image = corners.map(|[x, y]| at([x * FRUSTUM, y * FRUSTUM, FRUSTUM]));
    let mut lines = vec![vec![image[0], image[1], image[2], image[3], image[0]]];
    lines.extend(image.map(|corner| vec![centre, corner]));
    // The true camera 2 may stand where a candidate's does: its name goes below.
    let (label, height) = match name {
        CAMERA_1 => (name, -1.0),
        TRUTH => (name, 1.0),
        _ => ("camera 2", -1.0),
    };
    let beside = at([0.0, height * FRUSTUM, FRUSTUM]);
    Part { lines, words: vec![(beside, label.to_owned())], is_shown, ..Part::new(name, colour) }
}

/// Where the two rays of a match come closest: the point on the ray of camera 1, and the point on the ray of camera 2, both in
/// the frame of camera 1. `None` if no depth is determined.
pub(super) fn ends(pose: &RelativePose, m: &Correspondence) -> Option<[Vector3<f64>; 2]> {
    let (z1, z2) = pose.depths(m)?;
    let x2 = m.bearing2() * (z2 * m.length2());
    Some([m.bearing1() * (z1 * m.length1()), pose.q_21.inverse() * (x2 - pose.t_21)])
}

/// The rays from both centres to the points. A match without a point, or with a far one, gets a piece of the ray.
fn rays(name: &str, colour: Colour, pose: &RelativePose, matches: &[Correspondence], is_shown: bool) -> Part {
    let centre2 = pose.inverse().t_21;
    let lines = matches.iter().flat_map(|m| {
        let directions = [*m.bearing1(), pose.q_21.inverse() * m.bearing2()];
        let far = [directions[0] * FARTHEST, centre2 + directions[1] * FARTHEST];
        let is_near = |x: &[Vector3<f64>; 2]| x.iter().all(|x| x.norm() <= FARTHEST);
        let [end1, end2] = ends(pose, m).filter(is_near).unwrap_or(far);
        [vec![[0.0; 3], end1.into()], vec![centre2.into(), end2.into()]]
    });
    Part { lines: lines.collect(), opacity: 0.3, is_shown, ..Part::new(name, colour) }
}

fn points(name: &str, colour: Colour, solved: &Solved, candidate: &Candidate, is_shown: bool) -> Part {
    let pose = &candidate.pose;
    let points = solved.matches.iter().enumerate().filter_map(|(index, m)| {
        let (z1, z2) = pose.depths(m)?;
        let [x, _] = ends(pose, m)?;
        let residual = page::residual(solved, pose.sampson_error(m));
        let words = format!("match {index}<br>depths {z1:.3}, {z2:.3}<br>residual {residual}");
        (x.norm() <= FARTHEST).then(|| (x.into(), words))
    });
    Part { points: points.collect(), is_shown, ..Part::new(name, colour) }
}
