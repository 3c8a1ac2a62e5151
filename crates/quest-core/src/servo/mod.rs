//! Section 10 and appendix C: a camera that moves to where a goal image was taken, by the poses of its images.
//!
//! Frame 1 is the goal, frame 2 the current camera. In every image the pose `X2 = R X1 + t` of the current camera is estimated
//! from the features that both see; a control law turns it into a velocity; the camera moves; `t` and the rotation go to
//! zero together.
//!
//! ```
//! use quest_core::servo::{DepthFilter, FilterOptions, FreeCameraLaw, Limits, Safety, Servo};
//! use quest_core::solver::SolverName;
//!
//! // The goal image: the features on the plane z = 1.
//! let goal = [[0.1, 0.2], [-0.3, 0.1], [0.2, -0.2], [-0.1, -0.3], [0.3, 0.3]];
//! let filter = DepthFilter::new(&goal, SolverName::Quest, FilterOptions::default());
//! let law = FreeCameraLaw { rate: 0.5, unit: 2.0 };
//! let safety = Safety::new(Limits { speed: 0.2, turn_rate: 0.3 });
//! let mut servo = Servo::new(&goal, filter, law, safety);
//!
//! // In each frame: what the camera sees of them now, in the same order.
//! let now = [[0.16, 0.2], [-0.22, 0.1], [0.25, -0.19], [-0.06, -0.28], [0.35, 0.31]];
//! let step = servo.step(&now.map(Some));
//! match step.estimate {
//!     Ok(_) => println!("move with {} m/s and {} rad/s", step.command.linear, step.command.angular),
//!     Err(reason) => println!("hold: {reason}"),
//! }
//! assert!(step.command.linear.norm() <= 0.2);
//!
//! // Features that are lost stop the camera, they do not send it anywhere.
//! let lost = servo.step(&[None; 5]);
//! assert!(lost.estimate.is_err() && lost.command.linear.norm() == 0.0);
//! ```
//!
//! # Parts
//! | part | what | where |
//! |---|---|---|
//! | [`Servo`] | one image in, one command out: estimator, law, guards, limits | here |
//! | [`ControlLaw`] | [`FreeCameraLaw`] (section 10.1), [`DifferentialDriveLaw`] (appendix C), their stability | [`free_camera`], [`differential_drive`] |
//! | [`PoseEstimator`] | [`Tracker`], which keeps a map of any number of features; [`DepthFilter`], which keeps the goal's depths; [`PerFrame`], which chooses anew as the paper does | [`tracker`], [`depth_filter`], [`per_frame`] |
//! | [`PoseSource`] | where candidates come from: a solver, or anything else | |
//! | [`Plant`] | [`FreeCamera`], [`DifferentialDrive`] | [`plant`] |
//! | [`World`] | the simulated loop, its images and their disturbances | [`closed_loop`], [`scenario`] |
//!
//! # The scale
//! Two images do not tell metres. The depths of the *goal's* view are the same in every frame. If `t` is normalised by them, it has
//! the same unknown unit in the whole run, and a proportional law works with it. If `t` is normalised by the depths of both views,
//! its unit changes on the way. If `t` has the unit norm that an essential matrix gives it, it never goes to zero.
//!
mod controller;
mod estimators;
mod laws;
mod simulation;
#[cfg(test)]
mod tests;
mod twist;

pub use estimators::{depth_filter, per_frame, tracker};
pub use laws::*;
pub use simulation::{closed_loop, plant, scenario};

pub use closed_loop::{Record, World};
pub use controller::Servo;
pub use controller::joints::{JointLimits, JointPosition, joint_velocities};
pub use controller::rig::{Axes, Mount, Rig};
pub use controller::safety::{Acceleration, Arrival, Border, Safety, on_plane};
pub use controller::state::{Advice, State, Status, Step};
pub use depth_filter::DepthFilter;
pub use depth_filter::fit::Plane;
pub use depth_filter::options::FilterOptions;
pub use estimators::estimate::{Estimate, HoldReason, Motion, PoseEstimator, Support};
pub use estimators::source::PoseSource;
pub use per_frame::{Choice, Length, PerFrame};
pub use plant::{DifferentialDrive, FreeCamera, Plant};
pub use simulation::imaging::{Disturbances, Sticky};
pub use tracker::Tracker;
pub use twist::{Limits, Twist};
