//! Figure 9 (a) to (d): the cameras of the goal and of the run among the points.

use nalgebra::{Quaternion, UnitQuaternion};
use quest_core::RelativePose;
use quest_plot::{Panel, Part, Space, colour};

use crate::drawing;
use crate::servo::Run;
use crate::servo::frame::FrameRecord;

/// How deep a camera is drawn, in metres.
const DEPTH: f64 = 0.28;

/// Four instants of a run, at equal distances on its way: the first and the last are its start and its end.
fn chosen(frames: &[FrameRecord]) -> Vec<usize> {
    let distance = |frame: &FrameRecord| frame.position.iter().map(|x| x * x).sum::<f64>().sqrt();
    let first = frames.first().map_or(0.0, distance);
    let below =
        |share: f64| frames.iter().position(|f| distance(f) <= share * first).unwrap_or(frames.len() - 1);
    [1.0, 2.0 / 3.0, 1.0 / 3.0, 0.0].map(below).to_vec()
}

/// The panels (a) to (d).
pub(super) fn instants(run: &Run, frames: &[FrameRecord]) -> Vec<Panel> {
    let letters = ["a", "b", "c", "d"].into_iter();
    let panels = chosen(frames).into_iter().zip(letters).map(|(place, letter)| {
        let frame = &frames[place];
        let title = format!("({letter}) after {:.1} s", frame.time);
        scene(run, &frames[..=place], &[place]).drawn(title)
    });
    panels.collect()
}

/// All of them in one space.
pub(super) fn whole(run: &Run, frames: &[FrameRecord]) -> Space {
    let mut space = scene(run, frames, &chosen(frames));
    space.caption.push_str(
        "In the frame of the goal, x to the right, y down, z forward, in metres. F1 is the goal's camera; the others are the camera at \
         four instants of its way. Drag to turn, scroll to zoom.",
    );
    space
}

/// The goal's camera, the points, the path, and the camera at some places of it.
fn scene(run: &Run, frames: &[FrameRecord], places: &[usize]) -> Space {
    let mut space = Space::of_camera("Cameras");
    space.axes = ["x, m", "y, m", "z, m"].map(str::to_owned);
    let goal = drawing::camera("goal", "F1", colour::INK, &RelativePose::identity(), DEPTH);
    let path = frames.iter().map(|f| f.position).collect();
    let features = run.points.iter().enumerate().map(|(k, x)| {
        let words = format!("feature {}", k + 1);
        Part { points: vec![(*x, words)], ..Part::new("features", colour::nth(k)) }
    });
    space = features.fold(space.with(goal), Space::with);
    space = space.with(Part { lines: vec![path], ..Part::new("path", colour::of_solver("quest")) });
    for &place in places {
        let Some(frame) = frames.get(place) else { continue };
        let [w, x, y, z] = frame.truth.q_21;
        let q_21 = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
        let pose = RelativePose::new(q_21, frame.truth.t_21.into());
        let word = if places.len() == 1 { "F2".to_owned() } else { format!("{:.1} s", frame.time) };
        let mut camera = drawing::camera("camera", &word, colour::nth(0), &pose, DEPTH);
        // Above the word of the goal's camera, where the two meet.
        camera.words.iter_mut().for_each(|(at, _)| at[1] -= 0.25 * DEPTH);
        space = space.with(camera);
    }
    space
}
