//! The files that the arguments of a call stand for: files, folders, patterns.

use std::{
    fs,
    path::{Path, PathBuf},
};

use quest_io::Format;

use crate::Failure;

/// What is read.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Sources {
    /// One file, named as such.
    One(PathBuf),
    /// Files each of which is read for itself.
    Several(Vec<PathBuf>),
}

/// The files that `arguments` stand for, without `output`: the result of an earlier run may lie in the folder that is read.
///
/// # Errors
/// A folder or a pattern without files.
pub(crate) fn sources(arguments: &[PathBuf], output: Option<&Path>) -> Result<Sources, Failure> {
    if let [file] = arguments
        && !file.is_dir()
        && !is_pattern(file)
    {
        return Ok(Sources::One(file.clone()));
    }
    let is_output = |file: &Path| {
        output.is_some_and(|output| {
            fs::canonicalize(output).is_ok_and(|output| fs::canonicalize(file).is_ok_and(|f| f == output))
        })
    };
    let mut files = Vec::new();
    for argument in arguments {
        if argument.is_dir() {
            files.extend(of_folder(argument)?.into_iter().filter(|file| !is_output(file)));
        } else if is_pattern(argument) {
            files.extend(of_pattern(argument)?.into_iter().filter(|file| !is_output(file)));
        } else {
            files.push(argument.clone());
        }
    }
    Ok(Sources::Several(files))
}

/// Whether a name that is no file's has signs of a pattern; shells expand patterns that are not quoted, but not that of Windows.
fn is_pattern(argument: &Path) -> bool {
    argument.to_string_lossy().contains(['*', '?', '[']) && !argument.exists()
}

/// The extensions of the files that this build reads.
pub(crate) fn extensions() -> String {
    let built = Format::ALL.into_iter().filter(|format| format.is_built());
    let extensions =
        built.flat_map(|format| format.info().extensions).map(|extension| format!(".{extension}"));
    extensions.collect::<Vec<_>>().join(", ")
}

/// The files of a folder whose extension is known, by their names.
fn of_folder(folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let fail = |fault: String| Failure::Arguments(format!("{}: {fault}", folder.display()));
    let entries = fs::read_dir(folder).map_err(|e| fail(format!("cannot be read: {e}")))?;
    let paths = entries.map(|entry| entry.map(|entry| entry.path())).collect::<Result<Vec<_>, _>>();
    let paths = paths.map_err(|e| fail(format!("cannot be read: {e}")))?;
    let is_known =
        |path: &PathBuf| path.is_file() && Format::from_extension(path).is_some_and(Format::is_built);
    let mut files: Vec<_> = paths.into_iter().filter(is_known).collect();
    files.sort();
    if files.is_empty() {
        let extensions = extensions();
        return Err(fail(format!("found a folder without files of matches, expected one of {extensions}")));
    }
    Ok(files)
}

/// The files of a pattern, by their names.
fn of_pattern(pattern: &Path) -> Result<Vec<PathBuf>, Failure> {
    let fail = |fault: &str| Failure::Arguments(format!("{}: {fault}", pattern.display()));
    let found = glob::glob(&pattern.to_string_lossy()).map_err(|e| fail(&format!("no pattern: {e}")))?;
    let files: Vec<_> = found.filter_map(Result::ok).filter(|path| path.is_file()).collect();
    if files.is_empty() {
        Err(fail("found no file of this pattern, expected at least one"))
    } else {
        Ok(files)
    }
}
