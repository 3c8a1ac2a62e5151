//! What several figures draw: a camera in space.

use nalgebra::Vector3;
use quest_core::RelativePose;
use quest_plot::{Colour, Part};

/// Half the width and the height of a drawn image, on the plane `z = 1`.
pub(crate) const HALF_IMAGE: [f64; 2] = [0.5, 0.375];

/// How far above its middle the word of a camera stands, in half heights of its image.
pub(crate) const ABOVE: f64 = 2.1;

/// The pyramid of a camera of this depth in the frame of camera 1, with a word above it; `pose` takes points of that frame to the
/// camera's.
pub(crate) fn camera(name: &str, word: &str, colour: Colour, pose: &RelativePose, depth: f64) -> Part {
    let world = pose.inverse();
    let at = |x: [f64; 3]| -> [f64; 3] { (world.q_21 * Vector3::from(x) + world.t_21).into() };
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let image = corners.map(|[x, y]| at([x * HALF_IMAGE[0] * depth, y * HALF_IMAGE[1] * depth, depth]));
    let centre = at([0.0; 3]);
    let mut lines = vec![vec![image[0], image[1], image[2], image[3], image[0]]];
    lines.extend(image.map(|corner| vec![centre, corner]));
    // A mark on the upper edge: which way is up.
    let tip = at([0.0, -1.5 * HALF_IMAGE[1] * depth, depth]);
    lines.push(vec![image[0], tip, image[1]]);
    let above = at([0.0, -ABOVE * HALF_IMAGE[1] * depth, depth]);
    Part { lines, words: vec![(above, word.to_owned())], ..Part::new(name, colour) }
}
