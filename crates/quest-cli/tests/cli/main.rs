//! `quest-cli` as its users meet it: arguments and files in, exit status, standard output and error out.
#![expect(clippy::unwrap_used, clippy::expect_used, reason = "helpers of tests fail as tests do")]

mod bad_input;
mod candidates;
#[cfg(feature = "colmap")]
mod colmap;
mod estimate;
#[cfg(target_os = "linux")]
mod faults;
mod features;
mod formats;
mod instructions;
mod lines;
mod many_files;
mod numpy;
mod output;
mod polynomials;
mod readme;
mod replay;
mod resume;
mod servo;
mod shell;
mod simulate;
mod tables;
mod view;

use std::{
    fs,
    io::Write,
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use tempfile::TempDir;

/// What a run left behind.
#[derive(Debug)]
struct Run {
    status: i32,
    stdout: String,
    stderr: String,
}

/// Runs in `directory` with `input` as standard input.
fn run_in(directory: &Path, arguments: &[&str], input: &[u8]) -> Run {
    let mut child = Command::new(env!("CARGO_BIN_EXE_quest-cli"))
        .args(arguments)
        .current_dir(directory)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // A program that does not read its input closes the pipe.
    let _ = child.stdin.take().unwrap().write_all(input);
    let output = child.wait_with_output().unwrap();
    Run {
        status: output.status.code().unwrap(),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    }
}

fn run(arguments: &[&str]) -> Run {
    run_in(Path::new("."), arguments, b"")
}

/// A file of the directory `examples`.
fn example(name: &str) -> String {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(name);
    path.canonicalize().unwrap().to_str().unwrap().to_owned()
}

/// A directory with one file.
fn directory_with(name: &str, text: impl AsRef<[u8]>) -> TempDir {
    let directory = tempfile::tempdir().unwrap();
    fs::write(directory.path().join(name), text).unwrap();
    directory
}

/// The matches of `examples/points.json` as the value of a key.
fn five_matches() -> String {
    let file: serde_json::Value = serde_json::from_slice(&fs::read(example("points.json")).unwrap()).unwrap();
    file["matches"].to_string()
}
