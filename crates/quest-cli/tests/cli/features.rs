//! Tables of Parquet and pictures: where the tool was built with them, and what it says where it was not.

use std::fs;

use super::{example, run_in};

/// Runs in an empty folder, and returns what it wrote beside the file.
fn wrote(arguments: &[&str], file: &str) -> (super::Run, Option<Vec<u8>>) {
    let folder = tempfile::tempdir().unwrap();
    let run = run_in(folder.path(), arguments, b"");
    (run, fs::read(folder.path().join(file)).ok())
}

#[test]
fn poses_are_a_table_of_parquet() {
    let pair = example("tumfr3_98072_98172.json");
    let arguments = ["estimate", &pair, "-o", "poses.parquet", "--quiet"];
    let (run, bytes) = wrote(&arguments, "poses.parquet");
    if cfg!(feature = "parquet") {
        let bytes = bytes.unwrap();
        assert_eq!((run.status, run.stdout.as_str(), run.stderr.as_str()), (0, "", ""));
        assert!(bytes.starts_with(b"PAR1") && bytes.ends_with(b"PAR1"));
        let again = wrote(&arguments, "poses.parquet").1.unwrap();
        assert!(bytes == again, "the same result has the same bytes");
    } else {
        assert_eq!((run.status, bytes), (2, None));
        let message = "error: poses.parquet: cannot be written: this build has no Parquet: cargo install quest-cli --features parquet";
        assert_eq!(run.stderr.trim_end(), message);
    }
}

#[test]
fn a_table_of_parquet_is_read_or_refused() {
    let folder = super::directory_with("pairs.parquet", "PAR1");
    let run = run_in(folder.path(), &["estimate", "pairs.parquet"], b"");
    assert_eq!(run.status, 2);
    let expected = if cfg!(feature = "parquet") {
        "found a damaged file of Parquet"
    } else {
        "this build has no Parquet"
    };
    assert!(run.stderr.starts_with(&format!("error: pairs.parquet: {expected}")), "{}", run.stderr);
}

#[test]
fn only_poses_and_matches_are_tables_of_parquet() {
    let points = example("points.json");
    for arguments in [vec!["solve", &points], vec!["solvers"], vec!["simulate", "--pairs", "1"]] {
        let (run, bytes) = wrote(&[&arguments[..], &["-o", "a.parquet"]].concat(), "a.parquet");
        assert_eq!((run.status, bytes), (2, None));
        assert!(run.stderr.contains("only the results of `quest-cli estimate`"), "{}", run.stderr);
    }
    let pair = example("tumfr3_98072_98172.json");
    let (run, _) = wrote(&["estimate", &pair, "-o", "a.parquet", "--resume"], "a.parquet");
    assert_eq!(run.status, 2);
    assert!(run.stderr.contains("--resume"), "{}", run.stderr);
}

#[test]
fn figures_are_pictures_and_pages() {
    for (file, start) in [("a.png", b"\x89PNG".as_slice()), ("a.pdf", b"%PDF".as_slice())] {
        let (run, bytes) = wrote(&["figures", "-o", file], file);
        if cfg!(feature = "figures") {
            assert_eq!((run.status, run.stderr.as_str()), (0, ""));
            assert!(bytes.unwrap().starts_with(start));
        } else {
            assert_eq!((run.status, bytes), (2, None));
            assert!(run.stderr.contains("cargo install quest-cli --features figures"), "{}", run.stderr);
        }
    }
}
