//! The files of `quest-cli` and its companions: image pairs in, results out.
//!
//! ```no_run
//! use std::path::Path;
//!
//! for pair in quest_io::read(Path::new("pair.json"), None)? {
//!     let pair = pair?;
//!     let matches = pair.correspondences()?;
//!     println!("{}: {} matches", pair.place, matches.len());
//! }
//! # Ok::<(), quest_io::ReadError>(())
//! ```
//!
//! - [`read`] opens a file or standard input and yields [`Pair`]s. A bad file is a [`ReadError`]: one line with the place, what
//!   was found and what was expected.
//! - [`read_camera`] opens a calibration of OpenCV or ROS, or COLMAP's cameras.
//! - [`SolveRecord`] and [`EstimateRecord`] are the results of a solve and of an estimate as they stand in files.
//! - With the feature `parquet` files of Parquet are read, and `MatchesTable` and `PosesTable` write them.
//! - [`Output`] writes a file whole or not at all; [`write_json`] writes JSON for people.
#![forbid(unsafe_code)]

mod camera;
mod earlier;
mod error;
mod estimate_record;
mod json_text;
mod npz;
mod output;
mod pair;
#[cfg(feature = "parquet")]
mod parquet;
mod read;
mod record;

pub use camera::{camera, read_camera};
pub use earlier::Earlier;
pub use error::{Fault, Place, ReadError};
pub use estimate_record::{
    EstimateRecord, EvidenceRecord, FoundRecord, PoseRecord, RunnerUpRecord, ThirdViewRecord,
};
pub use json_text::write_json;
pub use npz::{open_npy, unpack_npz};
pub use output::{Output, WriteError};
pub use pair::{Gap, Pair, Truth};
#[cfg(feature = "parquet")]
pub use parquet::{MatchesTable, PosesTable};
pub use read::{Format, FormatInfo, MOST_BYTES, Pairs, STANDARD_INPUT, read, read_points, read_within};
pub use record::{CandidateRecord, SolveRecord};
