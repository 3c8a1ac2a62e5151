//! Relative camera pose from matched image points.
//!
//! Two views of the same rigid points determine the rotation between the cameras, the direction of the
//! translation and the depths of the points up to one common scale. This crate computes them from five or
//! more matches: the QuEst algorithm of Fathian et al. (2018) and the methods it is compared with.
//!
//! ```
//! use quest_core::{Candidates, Correspondence, solver::{PoseSolver, QuestEigen}};
//!
//! // Five matches on the plane z = 1 of each camera.
//! let x1 = [[0.1, 0.2], [-0.3, 0.1], [0.2, -0.2], [-0.1, -0.3], [0.3, 0.3]];
//! let x2 = [[0.16, 0.2], [-0.22, 0.1], [0.25, -0.19], [-0.06, -0.28], [0.35, 0.31]];
//! let matches = quest_core::correspondence::from_image_points(&x1, &x2)?;
//!
//! let mut candidates = Candidates::new();
//! QuestEigen::default().solve(&matches, &mut candidates);
//! for candidate in candidates.iter() {
//!     println!("{:?} {} {}", candidate.kind, candidate.pose.q_21, candidate.pose.t_21);
//! }
//! # Ok::<(), quest_core::InputError>(())
//! ```
#![forbid(unsafe_code)]

mod algebra;
pub mod alignment;
pub mod camera;
pub mod candidate;
pub mod correspondence;
mod degeneracy;
pub mod feasibility;
pub mod pose;
pub mod quaternion;
pub mod simulate;
pub mod solver;
pub mod structure;

pub use camera::{Camera, CameraError, CameraModel};
pub use candidate::{Candidate, CandidateKind, Candidates, Degeneracy};
pub use correspondence::{Correspondence, InputError, MatchError};
pub use pose::RelativePose;
