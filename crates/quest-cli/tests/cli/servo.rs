//! `servo`: what a simulated run says and writes.

use super::*;

/// The rows of a CSV file by the names of its columns.
fn column(text: &str, name: &str) -> Vec<String> {
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let index = reader.headers().unwrap().iter().position(|h| h == name).unwrap();
    reader.records().map(|r| r.unwrap()[index].to_owned()).collect()
}

#[test]
fn the_paper_s_first_pose_is_printed() {
    let run = run(&["servo"]);
    assert_eq!((run.status, run.stderr.as_str()), (0, ""));
    for line in [
        "quest: goal reached after 1400 images",
        "first estimate      q 0.9430 -0.1100 -0.2230 -0.2210",
        "goal depths         0.178 0.175 0.180 0.233 0.233   (sum 1)",
    ] {
        assert!(run.stdout.contains(line), "{line}\n{}", run.stdout);
    }
    assert!(run.stdout.contains("its t in m        1.0972 -0.640"), "{}", run.stdout);
}

#[test]
fn every_image_is_a_row() {
    let directory = tempfile::tempdir().unwrap();
    let arguments = ["servo", "--scenario", "robot", "--coplanar", "--noise", "0.5", "--features", "20"];
    let run = run_in(directory.path(), &[&arguments[..], &["-o", "run.csv"]].concat(), b"");
    assert_eq!(run.stdout, "");
    let text = fs::read_to_string(directory.path().join("run.csv")).unwrap();
    let times = column(&text, "time");
    assert_eq!((times.len(), times[0].as_str()), (1_800, "0.0"));
    let is_number = |text: &String| text.parse::<f64>().is_ok_and(f64::is_finite);
    for name in ["true_qw", "x", "vz", "wy", "essential_tx", "homography_tx", "u20", "v20"] {
        assert!(column(&text, name).iter().all(is_number), "{name}");
    }
    // The first ten images are averaged before there is a pose, and their candidates tried.
    let is_tracking: Vec<bool> = column(&text, "state").iter().map(|state| state == "tracking").collect();
    let first = is_tracking.iter().position(|&t| t).unwrap();
    assert!((10..40).contains(&first), "{first}");
    for name in ["qw", "tz"] {
        let has_pose: Vec<bool> = column(&text, name).iter().map(is_number).collect();
        assert_eq!(has_pose, is_tracking, "{name}");
    }
    let turn = column(&text, "wy");
    assert!(turn.iter().all(|w| w.parse::<f64>().unwrap().abs() <= 0.6));
    // The same seed is the same run, another one is not.
    let again = |seed: &str| {
        run_in(Path::new("."), &[&arguments[..], &["--seed", seed, "--format", "csv"]].concat(), b"").stdout
    };
    assert!(again("0") == text && again("1") != text);
}

#[test]
fn a_translation_without_length_does_not_arrive() {
    let run = run(&["servo", "--scenario", "robot", "--translation", "unit"]);
    assert_eq!(run.status, 1);
    assert!(run.stdout.contains("goal not reached"), "{}", run.stdout);
}

#[test]
fn impossible_arguments_are_refused() {
    for arguments in [
        &["servo", "--noise", "-1"][..],
        &["servo", "--noise", "nan"],
        &["servo", "--scenario", "sea"],
        &["servo", "--solver", "magic"],
        &["servo", "--features", "3"],
    ] {
        let run = run(arguments);
        assert_eq!((run.status, run.stdout.as_str()), (2, ""), "{arguments:?}");
        assert!(run.stderr.contains("error: "), "{}", run.stderr);
    }
}
