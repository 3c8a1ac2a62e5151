//! Relative camera pose from matched image points: the rotation, the translation with its length, and the depths.
//!
//! Two views of the same rigid points determine how the camera moved, up to one common scale. This crate computes
//! that from five or more matches.
//!
//! ```
//! use quest_core::solver::{PoseSolver, Quest};
//! use quest_core::{Candidates, correspondence};
//!
//! // Five matches on the plane z = 1 of each camera.
//! let x1 = [[0.1, 0.2], [-0.3, 0.1], [0.2, -0.2], [-0.1, -0.3], [0.3, 0.3]];
//! let x2 = [[0.16, 0.2], [-0.22, 0.1], [0.25, -0.19], [-0.06, -0.28], [0.35, 0.31]];
//! let matches = correspondence::from_image_points(&x1, &x2)?;
//!
//! let mut candidates = Candidates::new();
//! Quest::default().solve(&matches, &mut candidates);
//! for candidate in candidates.iter() {
//!     println!("{:?} {} {}", candidate.kind, candidate.pose.q_21, candidate.pose.t_21);
//! }
//! # Ok::<(), quest_core::InputError>(())
//! ```
//!
//! # From matches to poses
//! - A [`Correspondence`] is a match: two bearings, from pixels of a [`Camera`], from points on the plane `z = 1`
//!   or as they are. What is wrong with one is an [`InputError`].
//! - A [`solver`] fills [`Candidates`]: a ranked list of fixed capacity, or the [`Degeneracy`] that left it empty.
//!   [`Quest`](solver::Quest) is the default. Solvers take the matches to be correct.
//! - A [`Candidate`] is a [`RelativePose`], `X2 = R_21 X1 + t_21`, with its [`CandidateKind`], its residual and the number of
//!   points in front of both cameras. [`RelativePose::depths`] gives the depths of a match.
//!
//! Frames, signs, scale and units: [`conventions`].
//!
//! # Features
//! None is on by default, and none changes a result.
//!
//! | feature | what it adds |
//! |---|---|
//! | `rayon` | [`robust::estimate_batch`] on all cores |
//! | `serde` | poses, candidates, cameras, estimates and [`robust::Options`] to and from serialised data, in the words of the tool's files |
//! | `mint` | nalgebra's conversions between its types, those of this crate's interface, and `mint`'s, which other mathematics crates share |
//!
//! # The paper
//! K. Fathian, J. Jin, S.-G. Wee, D.-H. Lee, Y.-G. Kim, N. R. Gans, *Camera relative pose estimation for visual servoing
//! using quaternions*, Robotics and Autonomous Systems (2018),
//! [doi 10.1016/j.robot.2018.05.014](https://doi.org/10.1016/j.robot.2018.05.014).
//!
//! | section | what | module |
//! |---|---|---|
//! | 5 | the problem, in quaternions | [`correspondence`], [`pose`], [`quaternion`] |
//! | 6 | quartic constraints on the rotation | [`quaternion::constraint_matrix`] |
//! | 7.1 | rotations as eigenvalues | [`solver::quest_eigen`] |
//! | 8 | translation and depths | [`structure`] |
//! | 9 | random scenes, noise, error metrics | [`simulate`] |
//! | 9.4 | the methods it is compared with | [`solver::nister`], [`solver::stewenius`], [`solver::li_hartley`], [`solver::kukelova`], [`solver::kneip`] |
//! | 10, appendix C | visual servoing: control laws, the closed loop | [`servo`] |
//! | appendix B | which poses are feasible | [`feasibility`] |
//! | not in it | the default solver, right at every parallax | [`solver::quest`] |
//! | not in it | linear methods for more matches | [`solver::eight_point`], [`solver::homography`] |
//! | not in it | camera models; the alignment of bearings | [`camera`], [`alignment`] |
#![forbid(unsafe_code)]

mod algebra;
pub mod alignment;
pub mod camera;
pub mod candidate;
#[doc = include_str!("../CONVENTIONS.md")]
pub mod conventions {}
pub mod correspondence;
mod degeneracy;
pub mod disambiguation;
mod epipolar_frame;
pub mod feasibility;
pub mod lanes;
pub mod pose;
pub mod quaternion;
pub mod robust;
#[cfg(feature = "serde")]
mod serial;
pub mod servo;
pub mod simulate;
pub mod solver;
pub mod structure;

pub use camera::{Camera, CameraError, CameraModel};
pub use candidate::{Candidate, CandidateKind, Candidates, Degeneracy};
pub use correspondence::{Correspondence, InputError, MatchError};
pub use pose::RelativePose;
