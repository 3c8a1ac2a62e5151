//! When a run has arrived: after that its curves say nothing, and methods without a length jump.

use crate::servo::frame::FrameRecord;

/// A camera that stays this close to the goal, relative to its first distance, and turned by less than this, has arrived.
const CLOSE: f64 = 0.03;
const TURNED: f64 = 0.02;

/// What is shown after the arrival, as a share of the time before it.
const AFTER: f64 = 0.12;

/// How many frames are shown: up to shortly after the arrival, or all.
pub(super) fn shown(frames: &[FrameRecord]) -> usize {
    let distance = |frame: &FrameRecord| frame.position.iter().map(|x| x * x).sum::<f64>().sqrt();
    let angle = |frame: &FrameRecord| 2.0 * frame.truth.q_21[0].abs().min(1.0).acos();
    let first = frames.first().map_or(0.0, distance);
    let is_away = |frame: &FrameRecord| distance(frame) > CLOSE * first || angle(frame) > TURNED;
    let arrived = frames.iter().rposition(is_away).map_or(0, |last| last + 1);
    if arrived >= frames.len() {
        return frames.len();
    }
    let after = frames[arrived].time * (1.0 + AFTER);
    frames.iter().position(|frame| frame.time > after).unwrap_or(frames.len()).max(arrived + 1)
}
