//! Image pairs of COLMAP databases: verified with [`quest_core::robust`], exported, written so that COLMAP reads the truth.
//!
//! ```no_run
//! use std::path::Path;
//! use quest_colmap::{Database, VerifyOptions, verify};
//!
//! let mut database = Database::open(Path::new("database.db"))?;
//! let report = verify(&mut database, &VerifyOptions::default(), &())?;
//! println!("{} of {} pairs have a pose", report.summary.verified, report.summary.pairs);
//! # Ok::<(), quest_colmap::ColmapError>(())
//! ```
//!
//! # What is read and written
//! Databases of COLMAP 3.6 to 4.2. [`verify`] reads `cameras`, `images`, `keypoints` and `matches`, which stay as they are,
//! and writes `two_view_geometries`: all rows in one transaction, or none. What stands in the other tables plays no part.
//!
//! # What a row says
//! | model | `config` | `E` | `F` | `H` | pose |
//! |---|---|---|---|---|---|
//! | general | 2, calibrated | yes | yes | | yes |
//! | planar | 4, planar | yes | yes | `K2 (R + t nᵀ) K1⁻¹` | yes |
//! | pure rotation | 5, panoramic | | | `K2 R K1⁻¹` | `t = 0` |
//! | general, a guessed focal length | 3, uncalibrated | | fitted to the pixels | | |
//! | planar or pure rotation, a guessed focal length | 6, planar or panoramic | | | fitted to the pixels | |
//! | a shift of the image border | 7, watermark | | | | |
//! | no pose | 0, undefined | | | | |
//!
//! `F` and `H` are of pixels without distortion, and absent for fisheye cameras, whose pixels no matrix describes. `t` has length
//! one. What is absent is `NULL`; before COLMAP 4.0 it is zeros, and the identity in place of the pose.
//!
//! # What is not offered
//! Several motions in one pair (`MULTIPLE`), guided matching, the removal of matches that stay where they are, and
//! rigs (`CALIBRATED_RIG`).
//!
//! # Source
//! COLMAP 4.2, `src/colmap/scene/database_sqlite.cc`, `src/colmap/scene/two_view_geometry.h`.
#![forbid(unsafe_code)]

mod camera;
mod database;
mod error;
mod export;
mod geometry;
mod given;
mod image;
mod pairs;
mod pixel_fit;
mod report;
mod schema;
mod verify;
mod watermark;
mod write;

pub use camera::ColmapCamera;
pub use database::{Database, ImageRow};
pub use error::ColmapError;
pub use export::{Exported, PairMatches, PoseEdge, export_each, export_matches, export_poses, write_g2o};
pub use geometry::{Config, TwoViewGeometry};
pub use given::Given;
pub use image::{Matches, Rays};
pub use pairs::{PairId, parse_pairs, read_pairs};
pub use report::{PairReport, Report, Summary};
pub use schema::Schema;
pub use verify::{Existing, Uncalibrated, VerifyOptions, Watch, verify};
pub use write::write_two_view_geometries;
