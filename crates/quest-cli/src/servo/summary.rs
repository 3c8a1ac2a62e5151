//! A run in a few lines.

use std::io::{self, Write};

use quest_core::RelativePose;
use quest_core::servo::Record;
use serde::Serialize;

use super::frame::Pose;
use crate::table::short;

/// The goal counts as reached within these: metres and degrees.
const POSITION: f64 = 0.02;
const ANGLE: f64 = 1.0;

/// What became of a run.
#[derive(Debug, Serialize)]
pub(super) struct Summary {
    solver: &'static str,
    pub(super) reached: bool,
    images: usize,
    /// Images without a command, by reason.
    holds: Vec<(&'static str, usize)>,
    /// The true pose at the start, in metres.
    start: Pose,
    /// The first pose that was found, with the length that makes the sum of the goal's depths 1, as the paper has it.
    first: Option<Pose>,
    /// The goal's depths with that sum.
    goal_depths: Vec<f64>,
    /// The last pose that was found, in the same unit.
    last: Option<Pose>,
    /// Where the camera ended, in metres and degrees from the goal.
    position_error: f64,
    rotation_error_deg: f64,
    /// The unit of the poses above in metres.
    unit: f64,
    #[serde(skip)]
    scale: f64,
}

impl Summary {
    pub(super) fn new(solver: &'static str, depths: &[f64], start: &RelativePose) -> Self {
        let sum: f64 = depths.iter().sum();
        let harmonic_mean = depths.len() as f64 / depths.iter().map(|z| 1.0 / z).sum::<f64>();
        Self {
            solver,
            reached: false,
            images: 0,
            holds: Vec::new(),
            start: Pose::from(start),
            first: None,
            goal_depths: depths.iter().map(|z| z / sum).collect(),
            last: None,
            position_error: f64::INFINITY,
            rotation_error_deg: f64::INFINITY,
            unit: sum,
            scale: harmonic_mean / sum,
        }
    }

    pub(super) fn add(&mut self, record: &Record) {
        self.images += 1;
        match &record.step.estimate {
            Ok(estimate) => {
                let pose = RelativePose::new(estimate.pose.q_21, estimate.pose.t_21 * self.scale);
                self.first.get_or_insert_with(|| Pose::from(&pose));
                self.last = Some(Pose::from(&pose));
            }
            Err(reason) => match self.holds.iter_mut().find(|(name, _)| *name == reason.name()) {
                Some((_, count)) => *count += 1,
                None => self.holds.push((reason.name(), 1)),
            },
        }
    }

    pub(super) fn finish(&mut self, end: &RelativePose) {
        self.position_error = end.t_21.norm();
        self.rotation_error_deg = end.rotation_error(&RelativePose::identity()).to_degrees();
        self.reached = self.position_error < POSITION && self.rotation_error_deg < ANGLE;
    }
}

pub(super) fn write(writer: &mut dyn Write, summary: &Summary) -> io::Result<()> {
    let list = |values: &[f64], decimals: usize| {
        values.iter().map(|x| format!("{x:.decimals$}")).collect::<Vec<_>>().join(" ")
    };
    let pose = |pose: &Pose| format!("q {}   t {}", list(&pose.q_21, 4), list(&pose.t_21, 6));
    let reached = if summary.reached { "goal reached" } else { "goal not reached" };
    writeln!(writer, "{}: {reached} after {} images", summary.solver, summary.images)?;
    writeln!(writer, "start, true, in m   {}", pose(&summary.start))?;
    if let (Some(first), Some(last)) = (&summary.first, &summary.last) {
        let in_metres = first.t_21.map(|x| x * summary.unit);
        writeln!(writer, "first estimate      {}", pose(first))?;
        writeln!(writer, "  its t in m        {}", list(&in_metres, 4))?;
        writeln!(writer, "last estimate       {}", pose(last))?;
    }
    if summary.goal_depths.len() <= 10 {
        writeln!(writer, "goal depths         {}   (sum 1)", list(&summary.goal_depths, 3))?;
    }
    writeln!(
        writer,
        "end, true           {} m and {}° from the goal",
        short(summary.position_error),
        short(summary.rotation_error_deg)
    )?;
    for (reason, count) in &summary.holds {
        writeln!(writer, "held                {count} images: {reason}")?;
    }
    Ok(())
}
