//! `servo --replay`: archives as `quest_pose.servo.Recorder` writes them, and what is wrong with others.

use super::{
    numpy::{Arrays, archive, array},
    *,
};

const IMAGES: usize = 12;
const FEATURES: usize = 6;

/// Two images start, the others approach the goal; feature 5 is never used and once not seen.
fn a_run() -> Arrays {
    let about =
        br#"{"version": 1, "size": [640, 480], "state": ["starting", "tracking"], "advice": ["", "go on"]}"#;
    let f = |k: usize| k as f64;
    let goal: Vec<f64> = (0..2 * FEATURES).map(|k| 100.0 + 30.0 * f(k)).collect();
    let distance = |image: usize| 1.0 - f(image) / 12.0;
    let mut points: Vec<f64> =
        (0..IMAGES).flat_map(|k| goal.iter().map(move |x| x + 50.0 * distance(k))).collect();
    points[2 * (3 * FEATURES + 5)] = f64::NAN;
    points[2 * (3 * FEATURES + 5) + 1] = f64::NAN;
    let starts = |k: usize| k < 2;
    let pose = |k: usize, values: &[f64]| -> Vec<f64> {
        if starts(k) { vec![f64::NAN; values.len()] } else { values.to_vec() }
    };
    let r = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    let column = |value: &dyn Fn(usize) -> Vec<f64>| (0..IMAGES).flat_map(value).collect::<Vec<f64>>();
    let speed = |k: usize| if starts(k) { 0.0 } else { 0.2 * distance(k) };
    let used: Vec<bool> = (0..IMAGES).flat_map(|k| (0..FEATURES).map(move |n| !starts(k) && n < 5)).collect();
    let states: Vec<i32> = (0..IMAGES).map(|k| i32::from(!starts(k))).collect();
    vec![
        ("about", array(&[about.len()], about)),
        ("goal", array(&[FEATURES, 2], &goal)),
        ("stamp", array(&[IMAGES], &column(&|k| vec![1_000.0 + 0.1 * f(k)]))),
        ("points", array(&[IMAGES, FEATURES, 2], &points)),
        ("inlier_mask", array(&[IMAGES, FEATURES], &used)),
        ("linear", array(&[IMAGES, 3], &column(&|k| vec![0.0, 0.0, speed(k)]))),
        ("angular", array(&[IMAGES, 3], &column(&|_| vec![0.0; 3]))),
        ("R", array(&[IMAGES, 3, 3], &column(&|k| pose(k, &r)))),
        ("t", array(&[IMAGES, 3], &column(&|k| pose(k, &[0.0, 0.0, distance(k)])))),
        ("inliers", array(&[IMAGES], &column(&|k| vec![if starts(k) { 0.0 } else { 5.0 }]))),
        ("state", array(&[IMAGES], &states)),
        ("advice", array(&[IMAGES], &states)),
    ]
}

fn replayed(arrays: &Arrays, more: &[&str]) -> (Run, TempDir) {
    let directory = directory_with("run.npz", archive(arrays));
    let run = run_in(directory.path(), &[&["servo", "--replay", "run.npz"][..], more].concat(), b"");
    (run, directory)
}

#[test]
fn the_states_are_told_one_after_the_other() {
    let (run, _directory) = replayed(&a_run(), &[]);
    assert_eq!((run.status, run.stderr.as_str()), (0, ""));
    for line in [
        "run.npz: 12 images in 1.1 s, 6 features in the goal image",
        "0.1       2     6     0  starting",
        "1.1      10     6     5  tracking\n",
        "at the end      go on",
        "last pose       0.083",
        "largest step    0.167 m/s and 0 rad/s",
    ] {
        assert!(run.stdout.contains(line), "{line}\n{}", run.stdout);
    }
}

#[test]
fn every_image_is_a_row_of_csv_and_a_line_of_json() {
    let (run, _directory) = replayed(&a_run(), &["--format", "csv"]);
    let rows: Vec<csv::StringRecord> =
        csv::Reader::from_reader(run.stdout.as_bytes()).records().map(Result::unwrap).collect();
    assert_eq!(rows.len(), IMAGES);
    assert_eq!((&rows[3][1], &rows[3][3], &rows[4][3]), ("tracking", "5", "6"));
    let (run, _directory) = replayed(&a_run(), &["--format", "jsonl"]);
    let lines: Vec<serde_json::Value> =
        run.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!(lines[0]["tz"].is_null() && lines[2]["tz"].as_f64().unwrap() > 0.8);
    let (run, _directory) = replayed(&a_run(), &["--format", "json"]);
    let summary: serde_json::Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!((summary["states"].as_array().unwrap().len(), &summary["images"]), (2, &12.into()));
}

#[test]
fn the_page_shows_paths_states_and_what_was_left_out() {
    let (run, directory) = replayed(&a_run(), &["--plot", "run.html"]);
    assert_eq!(run.status, 0, "{}", run.stderr);
    let page = fs::read_to_string(directory.path().join("run.html")).unwrap();
    for words in
        ["Features in the image", "left out", "Distance from the goal", "Path of the camera", "tracking"]
    {
        assert!(page.contains(words), "{words}");
    }
    let (run, directory) = replayed(&a_run(), &["--plot", "run.svg"]);
    assert_eq!(run.status, 0, "{}", run.stderr);
    assert!(fs::read_to_string(directory.path().join("run.svg")).unwrap().contains("turn rate"));
}

/// The run with one array replaced, or taken away.
fn changed(name: &str, bytes: Option<Vec<u8>>) -> Arrays {
    let others = a_run().into_iter().filter(|(n, _)| *n != name);
    let given = bytes.map(|b| (a_run().iter().find(|(n, _)| *n == name).unwrap().0, b));
    others.chain(given).collect()
}

#[test]
fn archives_that_are_no_runs_are_named() {
    let mut short = array(&[IMAGES, 3], &[0.0; 3 * IMAGES]);
    short.truncate(150);
    let about = |text: &str| Some(array(&[text.len()], text.as_bytes()));
    for (name, bytes, words) in [
        ("points", None, "has no column points, expected what Recorder writes"),
        ("points", Some(array(&[2, 2], &[0.0; 4])), "points has the shape [2, 2], expected (12, 6, 2)"),
        ("inlier_mask", Some(array(&[1, 1], &[true])), "inlier_mask has the shape [1, 1], expected (12, 6)"),
        (
            "linear",
            Some(array(&[2, 3], &[0.0; 6])),
            "linear has the shape [2, 3], expected 12 rows of 3 numbers",
        ),
        ("linear", Some(short), "linear"),
        ("goal", Some(array(&[2], &[1_i32, 2])), "goal: found an array of '<i4'"),
        ("state", Some(array(&[IMAGES], &[7_i32; IMAGES])), "state has words that about does not list"),
        ("about", about(r#"{"version": 2}"#), "found version 2, expected 1"),
        ("about", about("{"), "about: EOF"),
    ] {
        let (run, _directory) = replayed(&changed(name, bytes), &[]);
        assert_eq!((run.status, run.stdout.as_str()), (2, ""), "{words}");
        assert!(run.stderr.contains("run.npz: ") && run.stderr.contains(words), "{words}\n{}", run.stderr);
    }
}

#[test]
fn files_that_are_no_archives_and_options_of_simulations_are_refused() {
    let directory = directory_with("run.npz", "u1,v1,u2,v2\n");
    fs::write(directory.path().join("run.parquet"), "PAR1").unwrap();
    for (arguments, words) in [
        (&["servo", "--replay", "run.npz"][..], "expected an archive that quest_pose.servo.Recorder wrote"),
        (&["servo", "--replay", "run.parquet"], "found Parquet, expected .npz"),
        (&["servo", "--replay", "nowhere.npz"], "nowhere.npz: cannot be read"),
        (&["servo", "--replay", "run.npz", "--noise", "1"], "cannot be used with"),
    ] {
        let run = run_in(directory.path(), arguments, b"");
        assert_eq!((run.status, run.stdout.as_str()), (2, ""), "{arguments:?}");
        assert!(run.stderr.contains(words), "{words}\n{}", run.stderr);
    }
}
