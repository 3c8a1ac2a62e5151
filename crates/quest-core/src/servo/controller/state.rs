//! What the loop does with an image, and why.

use std::fmt::{self, Display};

use crate::servo::estimators::estimate::{Estimate, HoldReason};
use crate::servo::twist::Twist;

/// What the loop is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum State {
    /// There is a pose, and the command follows it.
    Tracking,
    /// The images show no parallax that stands clear of the noise: only the rotation is commanded.
    RotationOnly,
    /// A deliberate small motion to the side, so that the images show parallax.
    Exploring,
    /// There is a pose, but the camera has not yet been seen to go where it is sent: the command follows it slowly.
    Confirming,
    /// Several poses are alive and command different things: the best is followed slowly until the motion tells them apart.
    Ambiguous,
    /// This image gave no pose. The last command goes on, for as many images as [`Safety`](crate::servo::Safety) allows.
    Coasting,
    /// There is no pose that can be trusted: the command goes to zero.
    Holding(HoldReason),
}

impl State {
    /// The name in files: that of the reason where the loop holds.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Tracking => "tracking",
            Self::RotationOnly => "rotation_only",
            Self::Exploring => "exploring",
            Self::Confirming => "confirming",
            Self::Ambiguous => "ambiguous",
            Self::Coasting => "coasting",
            Self::Holding(reason) => reason.name(),
        }
    }

    /// Whether the command of this image comes from a pose of this image.
    #[must_use]
    pub fn has_pose(self) -> bool {
        !matches!(self, Self::Coasting | Self::Holding(_))
    }
}

/// The loop in numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Status {
    /// Images so far, this one included.
    pub images: u64,
    /// The time of this image in seconds: its stamp, or the images so far times the period.
    pub time: f64,
    /// How many features of the goal this image shows.
    pub seen: usize,
    /// How many of them agree with the pose; 0 where there is none.
    pub inliers: usize,
    /// How many hypotheses about the goal's depths are alive; 0 before the start.
    pub hypotheses: usize,
    /// How many images in a row gave no command of their own.
    pub holding_images: usize,
    /// For how many seconds the loop has been holding.
    pub holding_seconds: f64,
    /// How often the estimator has begun anew.
    pub restarts: usize,
    /// Whether the camera has been at the goal for as long as [`Arrival`](crate::servo::Arrival) asks.
    pub arrived: bool,
    /// Whether the border of the image changed the command.
    pub border_limits: bool,
}

/// What one image led to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// What to do until the next image: finite and within the limits. In the frame of the camera, or of the hand or base
    /// where [`Rig`](crate::servo::Rig) names one.
    pub command: Twist,
    /// The pose of this image, or why there is none that can be trusted.
    pub estimate: Result<Estimate, HoldReason>,
    /// What the loop is doing.
    pub state: State,
    /// The same in numbers.
    pub status: Status,
}

impl Step {
    /// A sentence about the state with its numbers, and what helps.
    #[must_use]
    pub fn advice(&self) -> Advice<'_> {
        Advice(self)
    }
}

/// A sentence that is made when it is written.
#[derive(Clone, Copy, Debug)]
pub struct Advice<'a>(&'a Step);

impl Display for Advice<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Step { state, status, .. } = self.0;
        let Status { seen, inliers, hypotheses, holding_seconds: held, .. } = *status;
        match state {
            State::Tracking if status.arrived => {
                write!(f, "The camera has arrived ({inliers} of {seen} features agree).")
            }
            State::Tracking if status.border_limits => write!(
                f,
                "The loop follows {inliers} of {seen} features; the border of the image limits the turn. A smaller border or a wider lens helps."
            ),
            State::Tracking => write!(f, "The loop follows {inliers} of {seen} features."),
            State::RotationOnly => write!(
                f,
                "The {seen} features show no parallax, so the loop only turns. If the camera is not at the goal, allow `explore`, give `depths`, or start further away."
            ),
            State::Exploring => f.write_str("The loop moves a little to the side to see parallax."),
            State::Confirming => write!(
                f,
                "The loop follows {inliers} of {seen} features, slowly until it has seen that the camera goes where it is sent."
            ),
            State::Ambiguous => write!(
                f,
                "{hypotheses} poses explain the images; the loop moves slowly until its motion tells them apart. More features or known `depths` help."
            ),
            State::Coasting => {
                write!(f, "This image gave no pose ({seen} features seen); the last command goes on.")
            }
            State::Holding(reason) => write!(
                f,
                "The loop has been holding for {held:.1} s: {reason} ({seen} features seen). {}",
                help(*reason)
            ),
        }
    }
}

/// What helps against a reason to hold.
fn help(reason: HoldReason) -> &'static str {
    match reason {
        HoldReason::Starting => {
            "This takes about one to two seconds at 10 Hz, and longer where the features disagree by more than `noise` says."
        }
        HoldReason::TooFewFeatures => {
            "Bring the goal's features into view, or take a goal image with more of them."
        }
        HoldReason::Degenerate => "Use features that do not lie on a line.",
        HoldReason::Inconsistent => "Check the matches and the noise; a moved scene needs a new goal image.",
        HoldReason::Jump => "Check the period and the limits that were given.",
        HoldReason::Uncertain => "Use more features, spread over the image.",
        HoldReason::Diverging => {
            "The motion did not bring the goal nearer: check the axes of the camera, the sign of the commands and the unit."
        }
        HoldReason::Stale => "Send images with rising stamps, not older than the limit.",
    }
}
