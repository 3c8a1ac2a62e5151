//! Several files, folders and patterns: each file costs itself alone.

use super::*;

/// A folder with three good files, a bad one, and one of another kind.
fn folder() -> TempDir {
    let folder = directory_with("b.json", format!("{{\"matches\": {}}}", five_matches()));
    fs::copy(example("points.csv"), folder.path().join("a.csv")).unwrap();
    fs::copy(example("points.json"), folder.path().join("d.json")).unwrap();
    fs::write(folder.path().join("c.json"), "{").unwrap();
    fs::write(folder.path().join("words.md"), "none").unwrap();
    folder
}

fn names(run: &Run) -> Vec<String> {
    let name = |line: &str| serde_json::from_str::<serde_json::Value>(line).unwrap()["name"].to_string();
    run.stdout.lines().map(|line| name(line).trim_matches('"').to_owned()).collect()
}

#[test]
fn a_bad_file_costs_itself_alone() {
    let folder = folder();
    for command in
        [&["solve", "--quiet"][..], &["estimate", "--quiet", "--threshold", "1e-6", "--threads", "2"]]
    {
        let run = run_in(folder.path(), &[command, &["d.json", "c.json", "no.csv", "a.csv"]].concat(), b"");
        assert_eq!(run.status, 1, "{}", run.stderr);
        // The file's own name for the pair is kept.
        assert_eq!(names(&run), ["points", "c.json", "no.csv", "a.csv"]);
        let reasons: Vec<_> = run.stderr.lines().collect();
        assert_eq!(reasons.len(), 2, "{reasons:?}");
        assert!(
            reasons[0].starts_with("no pose: c.json:1:1: ") && reasons[1].starts_with("no pose: no.csv: ")
        );
        // Each has the answer that it has alone.
        let alone = run_in(folder.path(), &[command, &["a.csv", "--format", "jsonl"]].concat(), b"");
        let pose = |line: &str| {
            let record: serde_json::Value = serde_json::from_str(line).unwrap();
            [record["q_21"].clone(), record["candidates"][0]["q_21"].clone()]
        };
        let (found, expected) = (run.stdout.lines().last().unwrap(), alone.stdout.lines().next().unwrap());
        if command[0] == "solve" {
            assert_eq!(pose(found), pose(expected));
        }
        let none = run_in(folder.path(), &[command, &["c.json", "no.csv"]].concat(), b"");
        assert_eq!(none.status, 2, "{}", none.stderr);
    }
}

#[test]
fn every_format_says_which_file_failed() {
    let folder = folder();
    let files = ["no.csv", "c.json", "a.csv", "--quiet"];
    let csv = run_in(
        folder.path(),
        &[&["estimate", "--threshold", "1e-6", "--format", "csv"], &files[..]].concat(),
        b"",
    );
    let rows: Vec<_> = csv.stdout.lines().collect();
    assert!(rows[0].starts_with("pair,name,model,") && rows[0].ends_with(",reason"), "{}", rows[0]);
    assert!(rows[1].starts_with("1,no.csv,,") && rows[1].contains(",no.csv: cannot be read"), "{}", rows[1]);
    assert!(rows[2].starts_with("2,c.json,,") && rows[2].contains("c.json:1:1: "), "{}", rows[2]);
    assert!(rows[3].ends_with(','), "{}", rows[3]);
    for command in [&["estimate", "--threshold", "1e-6"][..], &["solve"]] {
        let run = run_in(folder.path(), &[command, &["--format", "table"], &files].concat(), b"");
        assert!(run.stdout.starts_with("no.csv: no pose\n\nc.json: no pose\n\n"), "{}", run.stdout);
    }
}

#[test]
fn folders_and_patterns_are_read_by_name() {
    let folder = folder();
    let path = folder.path().to_str().unwrap().to_owned();
    let in_folder = |name: &str| Path::new(&path).join(name).to_str().unwrap().to_owned();
    let run = run(&["solve", "--quiet", &path]);
    assert_eq!(
        names(&run),
        [in_folder("a.csv"), in_folder("b.json"), in_folder("c.json"), "points".to_owned()]
    );
    let run = run_in(folder.path(), &["solve", "--quiet", "[ab].*"], b"");
    assert_eq!(
        (run.status, names(&run)),
        (0, vec!["a.csv".to_owned(), "b.json".to_owned()]),
        "{}",
        run.stderr
    );
    // The result of an earlier run is no input.
    for _ in 0..2 {
        let run = run_in(folder.path(), &["solve", "--quiet", ".", "-o", "results.jsonl"], b"");
        assert_eq!(run.status, 1, "{}", run.stderr);
        let text = fs::read_to_string(folder.path().join("results.jsonl")).unwrap();
        assert_eq!(text.lines().count(), 4);
    }
}

#[test]
fn what_stands_for_no_file_is_an_error() {
    let empty = directory_with("words.md", "");
    let run = |argument: &str| run_in(empty.path(), &["estimate", argument], b"");
    let (folder, pattern) = (run("."), run("*.npz"));
    assert_eq!((folder.status, pattern.status), (2, 2));
    let extensions = "expected one of .json, .jsonl, .ndjson, .csv, .npy, .npz";
    let parquet = if cfg!(feature = "parquet") { ", .parquet" } else { "" };
    let expected = format!("error: .: found a folder without files of matches, {extensions}{parquet}\n");
    assert_eq!(folder.stderr, expected);
    assert_eq!(pattern.stderr, "error: *.npz: found no file of this pattern, expected at least one\n");
}

#[test]
fn what_the_call_lacks_is_said_once_with_its_count() {
    let folder = tempfile::tempdir().unwrap();
    for number in 0..4 {
        fs::copy(example("points.csv"), folder.path().join(format!("{number}.csv"))).unwrap();
    }
    let why =
        "found no camera and no --threshold, expected a camera, or a threshold in units of the plane z = 1";
    let run = run_in(folder.path(), &["estimate", ".", "--quiet"], b"");
    let expected = format!(
        "no pose: ./0.csv: {why}\nerror: none of the 4 pairs can be read, all for the reason above\n"
    );
    assert_eq!((run.status, run.stderr), (2, expected));
    // The others are counted where one pair has an answer.
    let some = [&example("tumfr3_98072_98172.json"), ".", "--quiet"];
    let run = run_in(folder.path(), &[&["estimate"], &some[..]].concat(), b"");
    let expected = format!("no pose: ./0.csv: {why}\nno pose: 3 more for the same reason: {why}\n");
    assert_eq!((run.status, run.stderr, run.stdout.lines().count()), (1, expected, 5));
}

#[test]
fn coordinates_of_another_unit_are_said_once_with_their_count() {
    let folder = tempfile::tempdir().unwrap();
    for number in 0..4 {
        fs::copy(example("points.csv"), folder.path().join(format!("{number}.csv"))).unwrap();
    }
    let camera = ["--camera1", "SIMPLE_PINHOLE,640,640,500,320,320"];
    let run = run_in(folder.path(), &[&["estimate", ".", "--quiet"], &camera[..]].concat(), b"");
    assert_eq!(
        (run.status, run.stderr.matches("within 2 pixels of the corner").count()),
        (2, 1),
        "{}",
        run.stderr
    );
    assert!(
        run.stderr.ends_with("none of the 4 pairs can be read, all for the reason above\n"),
        "{}",
        run.stderr
    );
}

#[test]
fn a_pair_without_a_scale_costs_itself_alone() {
    let folder = folder();
    let files = [example("tumfr3_98072_98172.json"), "a.csv".to_owned()];
    let run = run_in(folder.path(), &["estimate", &files[0], &files[1]], b"");
    assert_eq!((run.status, run.stdout.lines().count()), (1, 2), "{}", run.stderr);
    assert!(run.stderr.starts_with("no pose: a.csv: found no camera and no --threshold"), "{}", run.stderr);
}
