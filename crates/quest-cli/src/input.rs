//! The pairs that a subcommand reads: options, cameras of the command line, warnings.

use std::{
    collections::HashSet,
    path::{Path, PathBuf},
};

use clap::Args;
use quest_core::Camera;
use quest_io::{Fault, Pair, Pairs, ReadError};

use crate::{
    options::{input_format_parser, parse_camera},
    words,
};

/// Where the matches come from.
#[derive(Args, Debug)]
pub(crate) struct InputOptions {
    /// The file of matches: .json, .jsonl or .csv; `-` is standard input.
    file: PathBuf,
    /// The camera of view 1, and of view 2 if `--camera2` is absent. It replaces the cameras of the file.
    #[arg(long, value_name = "MODEL,w,h,params", value_parser = parse_camera)]
    camera1: Option<Camera>,
    /// The camera of view 2. It replaces the camera of the file.
    #[arg(long, value_name = "MODEL,w,h,params", value_parser = parse_camera)]
    camera2: Option<Camera>,
    /// The format of the input [default: by the extension, else by the first characters].
    #[arg(long, value_parser = input_format_parser())]
    input_format: Option<quest_io::Format>,
    /// The most bytes that one pair may have: what is larger, or never ends, is an error.
    #[arg(long, value_name = "BYTES", default_value_t = quest_io::MOST_BYTES)]
    max_input: u64,
}

/// The pairs of the input, one after the other, with the cameras of the command line.
pub(crate) struct Input<'a> {
    options: &'a InputOptions,
    pairs: Pairs,
    quiet: bool,
    /// Unknown keys that were already reported.
    told: HashSet<String>,
}

impl InputOptions {
    pub(crate) fn open(&self, quiet: bool) -> Result<Input<'_>, ReadError> {
        self.open_file(&self.file, quiet)
    }

    /// Another file with the same cameras and of the same form.
    pub(crate) fn open_file(&self, file: &Path, quiet: bool) -> Result<Input<'_>, ReadError> {
        let pairs = quest_io::read_within(file, self.input_format, self.max_input)?;
        Ok(Input { options: self, pairs, quiet, told: HashSet::new() })
    }

    /// Cameras of the command line take the place of the file's.
    fn set_cameras(&self, pair: &mut Pair) -> Result<(), ReadError> {
        let cameras = match (self.camera1, self.camera2, pair.cameras) {
            (None, None, cameras) => cameras,
            (Some(camera1), camera2, _) => Some([camera1, camera2.unwrap_or(camera1)]),
            (None, Some(camera2), Some([camera1, _])) => Some([camera1, camera2]),
            (None, Some(_), None) => {
                return Err(pair.place.clone().error(Fault::FirstCameraMissing));
            }
        };
        pair.cameras = cameras;
        Ok(())
    }
}

impl Input<'_> {
    /// Whether there may be several pairs.
    pub(crate) fn is_lines(&self) -> bool {
        self.pairs.format() == quest_io::Format::JsonLines
    }

    /// The next pair. Its unknown keys are reported.
    pub(crate) fn next(&mut self) -> Result<Option<Pair>, ReadError> {
        let Some(pair) = self.pairs.next() else { return Ok(None) };
        let mut pair = pair?;
        pair.unknown_keys.retain(|key| self.told.insert(key.clone()));
        if !pair.unknown_keys.is_empty() && !self.quiet {
            words::say(
                "warning",
                &format!("{}: ignored unknown keys: {}", pair.place, pair.unknown_keys.join(", ")),
            );
        }
        self.options.set_cameras(&mut pair)?;
        Ok(Some(pair))
    }
}
