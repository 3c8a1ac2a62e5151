//! The pairs that a subcommand reads: options, cameras of the command line, warnings.

use std::{
    collections::HashSet,
    path::{Path, PathBuf},
};

use clap::Args;
use quest_core::Camera;
use quest_io::{Fault, Pair, Pairs, ReadError};

use crate::{
    Failure,
    options::{OutputOptions, input_format_parser, parse_camera},
    sources::{Sources, extensions, sources},
    words,
};

/// How files of matches are read.
#[derive(Args, Debug)]
pub(crate) struct ReadingOptions {
    /// The points of image 2, a row for each row of FILE, which then holds those of image 1: .csv or .npy.
    #[arg(long, value_name = "FILE")]
    points2: Option<PathBuf>,
    /// The camera of view 1, and of view 2 if `--camera2` is absent. It replaces the cameras of the file. FILE is a calibration of
    /// OpenCV (YAML, XML) or ROS (`camera_info`), or COLMAP's `cameras.txt` or `cameras.bin`; `FILE:ID` is one of its cameras.
    #[arg(long, visible_alias = "camera", value_name = "MODEL,w,h,params|FILE[:ID]", value_parser = parse_camera)]
    camera1: Option<Camera>,
    /// The camera of view 2. It replaces the camera of the file.
    #[arg(long, value_name = "MODEL,w,h,params|FILE[:ID]", value_parser = parse_camera)]
    camera2: Option<Camera>,
    /// The format of the input [default: by the extension, else by the first characters].
    #[arg(long, value_parser = input_format_parser())]
    input_format: Option<quest_io::Format>,
    /// The most bytes that one pair may have: what is larger, or never ends, is an error.
    #[arg(long, value_name = "BYTES", default_value_t = quest_io::MOST_BYTES)]
    max_input: u64,
}

/// Where one pair comes from.
#[derive(Args, Debug)]
pub(crate) struct InputOptions {
    #[arg(help = format!("The file of matches, {}; `-` is standard input", extensions()))]
    file: PathBuf,
    #[command(flatten)]
    reading: ReadingOptions,
}

/// Where pairs come from.
#[derive(Args, Debug)]
pub(crate) struct InputsOptions {
    #[arg(value_name = "FILE", required = true, help = format!(
        "The files of matches, {}, folders of them, or patterns such as 'pairs/*.npz'; `-` is standard input",
        extensions()
    ))]
    files: Vec<PathBuf>,
    #[command(flatten)]
    reading: ReadingOptions,
}

/// The pairs of the input, one after the other, with the cameras of the command line.
pub(crate) struct Input<'a> {
    options: &'a ReadingOptions,
    /// The file that is being read.
    opened: Option<Opened>,
    /// Those after it.
    files: std::vec::IntoIter<PathBuf>,
    /// Whether there may be several pairs, and whether they are of several files.
    is_several: bool,
    is_several_files: bool,
    quiet: bool,
    /// Unknown keys that were already reported.
    told: HashSet<String>,
}

/// A pair that could not be read.
#[derive(Debug)]
pub(crate) struct Unread {
    /// What its record is called.
    pub(crate) name: Option<String>,
    pub(crate) error: ReadError,
}

impl Unread {
    /// The line above its empty table.
    pub(crate) fn heading(&self) -> String {
        let called = self.name.clone().unwrap_or_else(|| self.error.place.to_string());
        words::one_line(&format!("{called}: no pose"))
    }
}

/// A file that is being read.
enum Opened {
    Pairs(Pairs),
    /// The pair of two files of points.
    Points(Box<Pair>),
}

impl InputOptions {
    pub(crate) fn open(&self, quiet: bool) -> Result<Input<'_>, ReadError> {
        self.reading.open(&self.file, quiet)
    }
}

impl InputsOptions {
    /// The pairs of all files, of which that of the output is none.
    pub(crate) fn open(&self, output: &OutputOptions) -> Result<Input<'_>, Failure> {
        match sources(&self.files, output.file())? {
            Sources::One(file) => Ok(self.reading.open(&file, output.quiet)?),
            Sources::Several(_) if self.reading.points2.is_some() => {
                let found = "found several files and --points2, expected one file, of the points of image 1";
                Err(Failure::Arguments(found.to_owned()))
            }
            Sources::Several(files) => Ok(Input {
                options: &self.reading,
                opened: None,
                files: files.into_iter(),
                is_several: true,
                is_several_files: true,
                quiet: output.quiet,
                told: HashSet::new(),
            }),
        }
    }

    /// Another file of matches with the same cameras and of the same form.
    pub(crate) fn open_other(&self, file: &Path, quiet: bool) -> Result<Input<'_>, ReadError> {
        self.reading.open_matches(file, quiet)
    }
}

impl ReadingOptions {
    fn open(&self, file: &Path, quiet: bool) -> Result<Input<'_>, ReadError> {
        let Some(second) = &self.points2 else { return self.open_matches(file, quiet) };
        let pair = quest_io::read_points([file, second.as_path()], self.input_format, self.max_input)?;
        Ok(self.input(Opened::Points(Box::new(pair)), quiet))
    }

    fn open_matches(&self, file: &Path, quiet: bool) -> Result<Input<'_>, ReadError> {
        Ok(self.input(Opened::Pairs(self.pairs(file)?), quiet))
    }

    fn pairs(&self, file: &Path) -> Result<Pairs, ReadError> {
        quest_io::read_within(file, self.input_format, self.max_input)
    }

    /// The pairs of one file.
    fn input(&self, opened: Opened, quiet: bool) -> Input<'_> {
        let is_lines = matches!(&opened, Opened::Pairs(pairs) if pairs.format().holds_several());
        Input {
            options: self,
            opened: Some(opened),
            files: Vec::new().into_iter(),
            is_several: is_lines,
            is_several_files: false,
            quiet,
            told: HashSet::new(),
        }
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
    pub(crate) fn is_several(&self) -> bool {
        self.is_several
    }

    /// What is known of a pair that could not be read, where others may follow it: of another line, or of another file.
    ///
    /// # Errors
    /// The same error where none may follow.
    pub(crate) fn alone(&self, error: ReadError) -> Result<Unread, ReadError> {
        if self.is_several_files {
            Ok(Unread { name: Some(error.place.file.clone()), error })
        } else if self.is_several && error.place.line.is_some() {
            Ok(Unread { name: None, error })
        } else {
            Err(error)
        }
    }

    /// The next pair. Its unknown keys are reported.
    pub(crate) fn next(&mut self) -> Result<Option<Pair>, ReadError> {
        let Some(mut pair) = self.next_read().transpose()? else { return Ok(None) };
        pair.unknown_keys.retain(|key| self.told.insert(key.clone()));
        if !pair.unknown_keys.is_empty() && !self.quiet {
            words::say(
                "warning",
                &format!("{}: ignored unknown keys: {}", pair.place, pair.unknown_keys.join(", ")),
            );
        }
        if self.is_several_files {
            // Records of several files are told apart by their names.
            pair.name.get_or_insert_with(|| pair.place.to_string());
        }
        self.options.set_cameras(&mut pair)?;
        if pair.looks_like_pixels() {
            return Err(pair.place.error(Fault::Pixels));
        }
        if pair.looks_like_image_points() {
            return Err(pair.place.error(Fault::PointsOfThePlane));
        }
        Ok(Some(pair))
    }

    fn next_read(&mut self) -> Option<Result<Pair, ReadError>> {
        loop {
            match self.opened.take() {
                Some(Opened::Points(pair)) => return Some(Ok(*pair)),
                Some(Opened::Pairs(mut pairs)) => {
                    if let Some(pair) = pairs.next() {
                        self.opened = Some(Opened::Pairs(pairs));
                        return Some(pair);
                    }
                }
                None => match self.options.pairs(&self.files.next()?) {
                    Ok(pairs) => self.opened = Some(Opened::Pairs(pairs)),
                    Err(error) => return Some(Err(error)),
                },
            }
        }
    }
}
