//! One image of a run, as a row.

use std::{
    io::{self, Write},
    iter,
};

use quest_core::RelativePose;
use quest_core::servo::{Estimate, Record};
use serde::Serialize;

use crate::rows::{self, text};

/// Rotation and translation as files have them.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct Pose {
    pub(super) q_21: [f64; 4],
    pub(super) t_21: [f64; 3],
}

impl From<&RelativePose> for Pose {
    fn from(pose: &RelativePose) -> Self {
        Self { q_21: pose.wxyz(), t_21: pose.t_21.into() }
    }
}

/// What one image showed and what came of it. Frame 1 is the goal, frame 2 the camera.
#[derive(Clone, Debug, Serialize)]
pub(super) struct FrameRecord {
    /// In seconds.
    pub(super) time: f64,
    /// What the loop does: `tracking`, or why the robot holds.
    state: &'static str,
    /// The true pose, in metres.
    pub(super) truth: Pose,
    /// The position of the camera in the goal's frame, in metres.
    pub(super) position: [f64; 3],
    /// The pose that the command is based on, in the unit of the goal's depths.
    pub(super) estimate: Option<Pose>,
    inliers: usize,
    alternatives: usize,
    /// In m/s and rad/s, in the camera's frame.
    pub(super) linear: [f64; 3],
    pub(super) angular: [f64; 3],
    /// The pose of the essential matrix, of unit length.
    pub(super) essential: Option<Pose>,
    /// The pose of the homography, for features on a plane.
    pub(super) homography: Option<Pose>,
    /// The features in the image.
    pub(super) pixels: Vec<Option<[f64; 2]>>,
}

impl FrameRecord {
    pub(super) fn new(record: &Record, essential: Option<&Estimate>, homography: Option<&Estimate>) -> Self {
        let estimate = record.step.estimate.as_ref();
        let pose = |e: Option<&Estimate>| e.map(|e| Pose::from(&e.pose));
        Self {
            time: record.time,
            state: record.step.state.name(),
            truth: Pose::from(&record.truth),
            position: record.truth.inverse().t_21.into(),
            estimate: pose(estimate.ok()),
            inliers: estimate.map_or(0, |e| e.inliers),
            alternatives: estimate.map_or(0, |e| e.alternatives),
            linear: record.step.command.linear.into(),
            angular: record.step.command.angular.into(),
            essential: pose(essential),
            homography: pose(homography),
            pixels: record.pixels.clone(),
        }
    }

    fn row(&self) -> Vec<String> {
        let mut row = vec![text(self.time), self.state.to_owned()];
        row.extend(pose(Some(&self.truth)));
        row.extend(self.position.map(text));
        row.extend(pose(self.estimate.as_ref()));
        row.extend([self.inliers.to_string(), self.alternatives.to_string()]);
        row.extend(self.linear.iter().chain(&self.angular).map(|&x| text(x)));
        row.extend(pose(self.essential.as_ref()));
        row.extend(pose(self.homography.as_ref()));
        row.extend(
            self.pixels.iter().flat_map(|p| p.map_or([String::new(), String::new()], |p| p.map(text))),
        );
        row
    }
}

/// A header and a row for each image.
pub(super) fn write_csv(writer: &mut dyn Write, frames: &[FrameRecord]) -> io::Result<()> {
    let header = header(frames.first().map_or(0, |f| f.pixels.len()));
    rows::write_rows(writer, iter::once(header).chain(frames.iter().map(FrameRecord::row)))
}

fn header(features: usize) -> Vec<String> {
    const POSE: [&str; 7] = ["qw", "qx", "qy", "qz", "tx", "ty", "tz"];
    let of = |prefix: &str| POSE.map(|name| format!("{prefix}{name}"));
    let mut header = vec!["time".to_owned(), "state".to_owned()];
    header.extend(of("true_"));
    header.extend(["x", "y", "z"].map(str::to_owned));
    header.extend(of(""));
    header.extend(["inliers", "alternatives", "vx", "vy", "vz", "wx", "wy", "wz"].map(str::to_owned));
    header.extend(of("essential_"));
    header.extend(of("homography_"));
    header.extend((1..=features).flat_map(|k| [format!("u{k}"), format!("v{k}")]));
    header
}

fn pose(pose: Option<&Pose>) -> [String; 7] {
    let Some(Pose { q_21: [w, x, y, z], t_21: [tx, ty, tz] }) = pose else { return Default::default() };
    [w, x, y, z, tx, ty, tz].map(|&c| text(c))
}
