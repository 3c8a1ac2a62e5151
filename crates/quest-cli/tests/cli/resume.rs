//! `estimate --resume`: a batch goes on where its records are this run's own, and changes nothing where they are not.

use super::*;

const OPTIONS: [&str; 3] = ["--threshold", "1e-3", "--quiet"];

/// Rows of matches of points in front of a camera that moves, the same but for the number.
fn rows(number: u32) -> String {
    let row = |i: u32| {
        let (x, y) = (f64::from(i % 8) * 0.1, f64::from(i / 8) * 0.1);
        let z = 1.0 + 0.07 * f64::from((i * 7 + number) % 11);
        format!("{x},{y},{},{}\n", x + 0.1 / z, y + 0.03 / z)
    };
    (0..40).map(row).collect()
}

/// A folder with the files `p0.csv` to `p5.csv`.
fn folder() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for number in 0..6 {
        fs::write(folder.path().join(format!("p{number}.csv")), rows(number)).unwrap();
    }
    folder
}

fn estimate(folder: &TempDir, files: &str, more: &[&str]) -> Run {
    let arguments = [&["estimate", files, "-o", "out.jsonl"], &OPTIONS[..], more].concat();
    run_in(folder.path(), &arguments, b"")
}

fn written(folder: &TempDir) -> String {
    fs::read_to_string(folder.path().join("out.jsonl")).unwrap()
}

/// Records without their times.
fn timeless(text: &str) -> Vec<serde_json::Value> {
    let record = |line: &str| {
        let mut record: serde_json::Value = serde_json::from_str(line).unwrap();
        record["elapsed_ms"] = 0.into();
        record
    };
    text.lines().map(record).collect()
}

/// Going on says exactly this first, and leaves the files as they were.
#[track_caller]
fn refused(folder: &TempDir, files: &str, more: &[&str], expected: &str) {
    let before = written(folder);
    let run = estimate(folder, files, &[&["--resume"], more].concat());
    assert!(run.stderr.starts_with(&format!("error: {expected}")), "{}", run.stderr);
    assert_eq!((run.status, run.stderr.lines().count()), (2, 1), "{}", run.stderr);
    assert_eq!(written(folder), before);
    let names = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name());
    let is_input = |name: &std::ffi::OsString| Path::new(name).extension() == Some("csv".as_ref());
    assert_eq!(names.filter(|name| !is_input(name)).collect::<Vec<_>>(), ["out.jsonl"]);
}

#[test]
fn records_of_other_pairs_are_refused() {
    let folder = folder();
    assert_eq!(estimate(&folder, "p[01].csv", &[]).status, 0);
    refused(&folder, "p[345].csv", &[], "out.jsonl:1 is p0.csv, the input begins with p3.csv; --resume ");
    refused(&folder, "p[023].csv", &[], "out.jsonl:2 is p1.csv, pair 2 of the input is p2.csv; ");
    refused(&folder, "p[0].csv", &[], "out.jsonl:2 is p1.csv, the input ends after 1 pairs; ");
    // The same names, other matches.
    fs::write(folder.path().join("p1.csv"), rows(1) + "0.1,0.2,0.3,0.4\n").unwrap();
    let other = "out.jsonl:2 is p1.csv with 40 matches, pair 2 of the input is one with 41; ";
    refused(&folder, "p[012].csv", &[], other);
    fs::write(folder.path().join("out.jsonl"), "{\"old\": 1}\n").unwrap();
    refused(&folder, "p*.csv", &[], "out.jsonl:1 is no record of an estimate; ");
}

#[test]
fn records_of_other_options_are_refused() {
    let folder = folder();
    assert_eq!(estimate(&folder, "p[012].csv", &[]).status, 0);
    let camera = ["--camera1", "SIMPLE_PINHOLE,640,480,15,0,0"];
    for more in [&["--threshold", "3e-3"][..], &["--min-iterations", "500"], &camera] {
        // The last of an option twice would be an error: the first ones are left out.
        let arguments = [&["estimate", "p*.csv", "-o", "out.jsonl", "--quiet", "--resume"], more].concat();
        let threshold = if more[0] == "--threshold" { &[][..] } else { &OPTIONS[..2] };
        let before = written(&folder);
        let run = run_in(folder.path(), &[&arguments, threshold].concat(), b"");
        assert!(run.stderr.contains("out.jsonl:1 has another "), "{more:?}: {}", run.stderr);
        assert_eq!((run.status, written(&folder)), (2, before), "{more:?}");
    }
}

#[test]
fn what_failed_is_tried_again_in_its_place() {
    let folder = folder();
    fs::write(folder.path().join("p1.csv"), "u1,v1\n").unwrap();
    fs::write(folder.path().join("p2.csv"), "none").unwrap();
    assert_eq!(estimate(&folder, "p[0123].csv", &[]).status, 1);
    // What fails again counts.
    let again = estimate(&folder, "p[0123].csv", &["--resume"]);
    assert_eq!((again.status, again.stderr.lines().count()), (1, 2), "{}", again.stderr);
    // One is repaired, and has a name of its own now.
    let kept: Vec<String> = written(&folder).lines().map(str::to_owned).collect();
    fs::write(folder.path().join("p1.csv"), rows(1)).unwrap();
    assert_eq!(estimate(&folder, "p[0123].csv", &["--resume"]).status, 1);
    let text = written(&folder);
    let lines: Vec<_> = text.lines().collect();
    assert_eq!((lines.len(), lines[0], lines[3]), (4, &*kept[0], &*kept[3]));
    assert!(lines[1].contains("q_21") && lines[2].contains("reason"), "{text}");
    fs::write(folder.path().join("p2.csv"), rows(2)).unwrap();
    let run = estimate(&folder, "p*.csv", &["--resume"]);
    assert_eq!(run.status, 0, "{}", run.stderr);
    let resumed = timeless(&written(&folder));
    assert_eq!(estimate(&folder, "p*.csv", &[]).status, 0);
    assert_eq!(timeless(&written(&folder)), resumed);
}

#[test]
fn a_line_that_is_repaired_may_have_a_name() {
    let pair = |name: &str| format!("{{\"name\": \"{name}\", \"matches\": {}}}\n", five_matches());
    let folder = directory_with("pairs.jsonl", pair("a") + "{\"name\": \"b\n" + &pair("c"));
    let estimate = || {
        let arguments =
            ["estimate", "pairs.jsonl", "-o", "out.jsonl", "--resume", "--threshold", "1e-3", "--quiet"];
        run_in(folder.path(), &arguments, b"")
    };
    estimate();
    fs::write(folder.path().join("pairs.jsonl"), pair("a") + &pair("b") + &pair("c")).unwrap();
    let run = estimate();
    assert_ne!(run.status, 2, "{}", run.stderr);
    let names: Vec<_> = timeless(&written(&folder)).iter().map(|record| record["name"].clone()).collect();
    assert_eq!(names, ["a", "b", "c"]);
    // A line in front moves the others.
    fs::write(folder.path().join("pairs.jsonl"), pair("z") + &pair("a")).unwrap();
    assert!(estimate().stderr.contains("out.jsonl:1 is a, the input begins with z"));
}

#[test]
fn nothing_goes_on_in_what_is_no_file() {
    let folder = folder();
    let arguments = [&["estimate", "p*.csv", "-o", "-", "--resume"], &OPTIONS[..]].concat();
    let run = run_in(folder.path(), &arguments, b"");
    assert_eq!((run.status, run.stdout.as_str()), (2, ""));
    assert!(run.stderr.starts_with("error: found --resume and an output that is no file"), "{}", run.stderr);
}

#[test]
fn the_help_says_what_it_needs() {
    let help = run(&["estimate", "--help"]).stdout;
    assert!(help.contains("--resume needs JSON Lines"), "{help}");
}
