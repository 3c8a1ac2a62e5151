//! Where results go: standard output, or a file that is written whole or not at all.

use std::{
    fs::{self, File, OpenOptions},
    io::{self, Write},
    path::{Path, PathBuf},
};

use tempfile::{Builder, NamedTempFile};

use crate::{earlier::Earlier, error::plain};

/// A result that could not be written.
#[derive(Debug, thiserror::Error)]
#[error("{target}: cannot be written: {}", plain(.source))]
pub struct WriteError {
    /// The file as it was named, or `standard output`.
    pub target: String,
    /// The error of the operating system.
    pub source: io::Error,
}

impl WriteError {
    /// Whether the reader of a pipe has ended, as in `| head`. Nobody would read a message then.
    #[must_use]
    pub fn is_broken_pipe(&self) -> bool {
        self.source.kind() == io::ErrorKind::BrokenPipe
    }
}

/// The target of a result. A file is kept in memory and appears, or is replaced, in [`Output::finish`].
#[derive(Debug)]
pub struct Output {
    name: String,
    target: Target,
}

#[derive(Debug)]
enum Target {
    /// Standard output, which is written at once.
    Stdout,
    /// A device, a pipe, or another file that cannot be replaced.
    Special(File),
    /// A file that is written under another name in the same directory, then renamed.
    File { path: PathBuf, text: Vec<u8> },
    /// Written into `part` as it comes, which is then renamed.
    Growing { path: PathBuf, part: PathBuf, file: File },
    /// Written into another file, which becomes `part` where [`Output::settle`] is called.
    Resuming { path: PathBuf, part: PathBuf, file: NamedTempFile },
}

impl Output {
    /// Standard output for `None`, `-` and `/dev/stdout`, else the file at `path`. The file is not touched yet, but its
    /// directory is checked: it must be writable.
    ///
    /// # Errors
    /// A path that cannot be written to.
    pub fn open(path: Option<&Path>) -> Result<Self, WriteError> {
        match path.filter(|p| *p != Path::new("-") && *p != Path::new("/dev/stdout")) {
            None => Ok(Self { name: "standard output".to_owned(), target: Target::Stdout }),
            Some(path) => {
                let name = path.display().to_string();
                let target =
                    Target::open(path).map_err(|source| WriteError { target: name.clone(), source })?;
                Ok(Self { name, target })
            }
        }
    }

    /// As [`Output::open`], for runs that may be ended: what is written to a file goes at once into another one beside it, with
    /// `.part` at the end of its name, which takes the file's place in [`Output::finish`].
    ///
    /// With `resume` also the lines of an earlier run: those of the part where there is one, else those of the file. `None` where
    /// neither is there, or the target is no file. What is written then is kept apart until [`Output::settle`]: without that call
    /// neither file changes.
    ///
    /// # Errors
    /// A path that cannot be written to, or lines that cannot be read.
    pub fn growing(path: Option<&Path>, resume: bool) -> Result<(Self, Option<Earlier>), WriteError> {
        let output = Self::open(path)?;
        let Target::File { path, .. } = output.target else { return Ok((output, None)) };
        let mut part = path.clone().into_os_string();
        part.push(".part");
        let part = PathBuf::from(part);
        let grow = || {
            let earlier = if resume { Earlier::open(&output.name, &part, &path)? } else { None };
            let file = new_file(directory(&path))?;
            Ok(match earlier {
                Some(earlier) => (Target::Resuming { path, part, file }, Some(earlier)),
                None => (Target::Growing { file: file.persist(&part)?, path, part }, None),
            })
        };
        let (target, earlier) =
            grow().map_err(|source| WriteError { target: output.name.clone(), source })?;
        Ok((Self { name: output.name, target }, earlier))
    }

    /// Makes what was written so far the part of a run that goes on, once the lines of the earlier run are found to be its own.
    ///
    /// # Errors
    /// The error of the target, with its name.
    pub fn settle(&mut self) -> Result<(), WriteError> {
        let target = std::mem::replace(&mut self.target, Target::Stdout);
        let (target, settled) = match target {
            Target::Resuming { path, part, file } => match file.persist(&part) {
                Ok(file) => (Target::Growing { path, part, file }, Ok(())),
                Err(error) => (Target::Resuming { path, part, file: error.file }, Err(error.error)),
            },
            other => (other, Ok(())),
        };
        self.target = target;
        settled.map_err(|source| WriteError { target: self.name.clone(), source })
    }

    /// Whether the target is a file, in whose place the whole result is put.
    #[must_use]
    pub fn is_file(&self) -> bool {
        !matches!(self.target, Target::Stdout | Target::Special(_))
    }

    /// Runs `write` on the target.
    ///
    /// # Errors
    /// The error of the target, with its name.
    pub fn write(&mut self, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), WriteError> {
        let result = match &mut self.target {
            Target::Stdout => write(&mut io::stdout().lock()),
            Target::Special(file) | Target::Growing { file, .. } => write(file),
            Target::Resuming { file, .. } => write(file),
            Target::File { text, .. } => write(text),
        };
        result.map_err(|source| WriteError { target: self.name.clone(), source })
    }

    /// Puts the result in its place. Without this call a file stays as it was, and so it does where a run that goes on did not
    /// [`settle`](Self::settle).
    ///
    /// # Errors
    /// The error of the target, with its name. A file is then as it was before.
    pub fn finish(self) -> Result<(), WriteError> {
        let result = match self.target {
            Target::Stdout => io::stdout().flush(),
            Target::Special(mut file) => file.flush(),
            Target::File { path, text } => replace(&path, &text),
            Target::Growing { path, part, file } => grown(&path, &part, &file),
            // What the earlier run left stays as it is.
            Target::Resuming { .. } => Ok(()),
        };
        result.map_err(|source| WriteError { target: self.name, source })
    }
}

impl Target {
    fn open(path: &Path) -> io::Result<Self> {
        // `/dev/stderr` and `/dev/fd/3` may lead to regular files that others hold open: not to be replaced.
        let existing = fs::metadata(path).ok();
        let is_special = existing.as_ref().is_some_and(|m| !m.is_file() && !m.is_dir());
        if is_special || path.starts_with("/dev") {
            return Ok(Self::Special(OpenOptions::new().append(true).open(path)?));
        }
        if existing.as_ref().is_some_and(fs::Metadata::is_dir) {
            return Err(io::ErrorKind::IsADirectory.into());
        }
        if existing.as_ref().is_some_and(|m| m.permissions().readonly()) {
            return Err(io::ErrorKind::PermissionDenied.into());
        }
        // A link stays a link: the file it leads to is the one that is replaced.
        let path = if existing.is_some() { fs::canonicalize(path)? } else { led_to(path)? };
        tempfile::tempfile_in(directory(&path))?;
        Ok(Self::File { path, text: Vec::new() })
    }
}

/// Where a file is that is not there yet: where a link leads to, if it is one.
fn led_to(path: &Path) -> io::Result<PathBuf> {
    /// As many as Linux follows.
    const LINKS: usize = 40;
    let mut path = path.to_owned();
    for _ in 0..LINKS {
        match fs::read_link(&path) {
            Ok(target) => path = directory(&path).join(target),
            Err(_) => return Ok(path),
        }
    }
    Err(io::Error::other("found a link that leads back to itself, expected a file"))
}

fn directory(path: &Path) -> &Path {
    path.parent().filter(|d| !d.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn grown(path: &Path, part: &Path, file: &File) -> io::Result<()> {
    if let Ok(existing) = fs::metadata(path) {
        file.set_permissions(existing.permissions())?;
    }
    file.sync_all()?;
    fs::rename(part, path)
}

fn replace(path: &Path, text: &[u8]) -> io::Result<()> {
    let mut file = new_file(directory(path))?;
    file.write_all(text)?;
    if let Ok(existing) = fs::metadata(path) {
        file.as_file().set_permissions(existing.permissions())?;
    }
    // A full disk may say so only here.
    file.as_file().sync_all()?;
    file.persist(path)?;
    Ok(())
}

/// A temporary file that has the permissions of an ordinary new file instead of private ones.
fn new_file(directory: &Path) -> io::Result<NamedTempFile> {
    let mut builder = Builder::new();
    builder.prefix(".quest-");
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(directory)
}
