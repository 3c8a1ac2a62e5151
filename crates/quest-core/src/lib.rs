//! Relative camera pose from matched image points: the rotation, the translation with its length, and the depths.
//!
//! Two views of the same rigid points determine how the camera moved, up to one common scale. Most users have matches of which
//! some are wrong; [`robust::estimate`] gives one pose for them:
//!
//! ```
//! use quest_core::robust::{self, Options};
//! use quest_core::{Camera, Correspondence};
//! # use quest_core::simulate::{FOCAL_LENGTH, Scene, SceneOptions};
//!
//! let camera: Camera = Camera::new(quest_core::CameraModel::Pinhole, &[1060.0, 1060.0, 512.0, 384.0])?;
//! # let options = SceneOptions { points: 60, noise_px: 0.5, ..SceneOptions::realistic() };
//! # let scene = Scene::generate(&options, 2018, 1)?;
//! # let pixel = |x: &nalgebra::Vector3<f64>| [1060.0 * x.x / x.z + 512.0, 1060.0 * x.y / x.z + 384.0];
//! # let pixels: Vec<_> = scene.matches.iter().map(|m| (pixel(m.bearing1()), pixel(m.bearing2()))).collect();
//! // Pixels of the same points in both images.
//! let matches: Vec<Correspondence> = pixels
//!     .iter()
//!     .map(|&(x1, x2)| Correspondence::from_pixels(&camera, x1, &camera, x2))
//!     .collect::<Result<_, _>>()?;
//!
//! let found = robust::estimate(&matches, &Options::in_pixels(1.5, &camera, &camera))?;
//! println!("{} pose {:?}, {} inliers", found.model.name(), found.pose, found.inlier_count);
//! # assert!(found.pose.rotation_error(&scene.truth) < 0.01);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Where the matches are correct, a [`solver`] gives every pose that explains them, without a heap allocation:
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
//! # Where to begin
//! | you have | begin with |
//! |---|---|
//! | matches, some of them wrong | [`robust::estimate`]; [`robust::estimate_batch`] for many pairs; [`robust::estimate_with_third_view`] where two views leave two answers |
//! | five or more correct matches | a [`solver`], [`solver::Quest`] by default |
//! | millions of minimal samples | [`lanes::BatchSolver`] |
//! | candidates of several views | [`disambiguation`] |
//! | a camera that shall move to a goal image | [`servo`] |
//! | pixels of a real lens | [`Camera`] |
//! | no images yet | [`simulate`] |
//!
//! # From matches to poses
//! - A [`Correspondence`] is a match: two bearings, from pixels of a [`Camera`], from points on the plane `z = 1`
//!   or as they are. What is wrong with one is an [`InputError`].
//! - A [`solver`] fills [`Candidates`]: a ranked list of fixed capacity, or the [`Degeneracy`] that left it empty.
//!   [`Quest`](solver::Quest) is the default. Solvers take the matches to be correct.
//! - A [`Candidate`] is a [`RelativePose`], `X2 = R_21 X1 + t_21`, with its [`CandidateKind`], its residual and the number of
//!   points in front of both cameras. [`RelativePose::depths`] gives the depths of a match.
//! - A [`robust::Estimate`] is one pose with its inliers, its [`robust::Model`], its covariance and the second pose where there is
//!   one.
//!
//! Frames, signs, scale and units: [`conventions`].
//!
//! # The same answer
//! The same matches, options and seed give the same bits in every run, for any number of threads and in any batch. The lanes use
//! the widest vectors of the processor. AVX2 and AVX-512 agree to the last bit on all recorded pairs; SSE2 and portable code agree
//! with them to 1e-12.
//!
//! # Features
//! `faer` is on by default; none changes a result.
//!
//! | feature | what it adds |
//! |---|---|
//! | `faer` | `polynomial_system`: every solution of a system of polynomials, by section 4.2 of the paper |
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
//! | 4.1 | quaternions and rotations | [`pose`] |
//! | 4.2 | systems of polynomials by relinearisation | `polynomial_system` |
//! | 5 | the problem, in quaternions | [`correspondence`], [`pose`], [`quaternion`] |
//! | 6 | quartic constraints on the rotation | [`quaternion::constraint_matrix`] |
//! | 7.1 | rotations as eigenvalues | [`solver::quest_eigen`] |
//! | 4.2, 7.2, appendix A | relinearisation | [`solver::relinearization`] |
//! | 8 | translation and depths | [`structure`] |
//! | 9 | random scenes, noise, error metrics | [`simulate`] |
//! | 9.4 | the methods it is compared with | [`solver::nister`], [`solver::stewenius`], [`solver::li_hartley`], [`solver::kukelova`], [`solver::kneip`] |
//! | 10, appendix C | visual servoing: control laws, the closed loop | [`servo`] |
//! | 10.1 | which of several poses: a third view | [`disambiguation`] |
//! | appendix B | which poses are feasible | [`feasibility`] |
//! | not in it | the default solver, right at every parallax | [`solver::quest`] |
//! | not in it | one pose from matches with outliers | [`robust`] |
//! | not in it | many samples at once in vector registers | [`lanes`] |
//! | not in it | linear methods for more matches | [`solver::eight_point`], [`solver::homography`] |
//! | not in it | camera models; the alignment of bearings | [`camera`], [`alignment`] |
#![forbid(unsafe_code)]

mod algebra;
pub mod alignment;
pub mod camera;
pub mod candidate;
#[doc = include_str!("../CONVENTIONS.md")]
pub mod conventions {}
pub mod coordinates;
pub mod correspondence;
mod degeneracy;
pub mod disambiguation;
mod epipolar_frame;
pub mod feasibility;
pub mod lanes;
#[cfg(feature = "faer")]
pub mod polynomial_system;
pub mod pose;
pub mod quaternion;
pub mod robust;
#[cfg(feature = "serde")]
mod serial;
pub mod servo;
pub mod simulate;
pub mod solver;
pub mod structure;
pub mod tangent;

pub use camera::{Camera, CameraError, CameraModel};
pub use candidate::{Candidate, CandidateKind, Candidates, Degeneracy};
pub use correspondence::{Correspondence, InputError, MatchError};
pub use pose::RelativePose;
