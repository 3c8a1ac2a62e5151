//! Bad input is one line on standard error: the place, what was found, what was expected. Exit status 2.

use super::*;

/// Solving `text` under the name `file` says exactly `error: {expected}` and writes nothing.
#[track_caller]
fn refused(file: &str, text: impl AsRef<[u8]>, expected: &str) {
    let directory = directory_with(file, text);
    let run = run_in(directory.path(), &["solve", file], b"");
    assert_eq!(run.stderr, format!("error: {expected}\n"));
    assert_eq!((run.status, run.stdout.as_str()), (2, ""));
}

#[test]
fn files_without_text() {
    let nothing = "found an empty file, expected matches as JSON, JSON Lines, CSV or an array of NumPy's";
    refused("a.npy", "", &format!("a.npy: {nothing}"));
    for file in ["a.json", "a.jsonl", "a.csv", "a.txt"] {
        refused(file, "", &format!("{file}: {nothing}"));
        refused(file, " \n\n", &format!("{file}: {nothing}"));
    }
    let run = run_in(Path::new("."), &["solve", "-"], b"");
    assert_eq!((run.status, run.stderr), (2, format!("error: standard input: {nothing}\n")));
}

#[test]
fn what_is_not_a_file() {
    let directory = tempfile::tempdir().unwrap();
    fs::create_dir(directory.path().join("d.json")).unwrap();
    let run = run_in(directory.path(), &["view", "d.json", "-o", "v.html"], b"");
    assert_eq!((run.status, run.stderr.as_str()), (2, "error: d.json: found a directory, expected a file\n"));
    let run = run_in(directory.path(), &["solve", "no.json"], b"");
    assert_eq!(run.stderr, "error: no.json: cannot be read: No such file or directory\n");
    assert_eq!(run.status, 2);
}

#[test]
fn json_cut_in_the_middle() {
    let cut = "found the end of the text inside a list, expected the rest of the JSON";
    refused("a.json", "{\"matches\": [[1, 2, 3, 4],\n [5, 6", &format!("a.json:2:6: matches[1]: {cut}"));
    let cut = "found the end of the text inside a string, expected the rest of the JSON";
    refused("a.json", "{\"matches\": [], \"na", &format!("a.json:1:19: {cut}"));
}

#[test]
fn what_is_not_a_number_in_json() {
    let file = |value: &str| format!(r#"{{"matches": [[1, 2, 3, 4], [1, {value}, 3, 4]]}}"#);
    let place = "matches[1][1]: found";
    refused("a.json", file("\"x\""), &format!("a.json:1:34: {place} string \"x\", expected a number"));
    refused("a.json", file("null"), &format!("a.json:1:35: {place} null, expected a number"));
    refused("a.json", file("NaN"), &format!("a.json:1:32: {place} \"NaN\", expected a JSON value"));
    let range = "a number out of range, expected one below 1.8e308";
    refused("a.json", file("1e400"), &format!("a.json:1:36: {place} {range}"));
}

#[test]
fn lists_of_the_wrong_length() {
    let file = |row: &str| format!(r#"{{"matches": [[1, 2, 3, 4], {row}]}}"#);
    refused("a.json", file("[1, 2, 3]"), "a.json:1:36: matches[1]: found 3 numbers, expected 4");
    refused("a.json", file("[1, 2, 3, 4, 5]"), "a.json:1:42: matches[1]: found 5 numbers, expected 4");
    let scores = "a.json: scores: found 2 scores, expected 1, one a match";
    refused("a.json", r#"{"matches": [[1, 2, 3, 4]], "scores": [1, 2]}"#, scores);
    let few = "a.json: matches: found 1 matches, expected at least 5";
    refused("a.json", r#"{"matches": [[1, 2, 3, 4]]}"#, few);
}

#[test]
fn json_of_another_form() {
    refused("a.json", "[1, 2]", "a.json:1:1: found a list, expected an object");
    refused("a.json", r#"{"match": []}"#, "a.json:1:13: found no key `matches`, expected one");
    let twice = "a.json:1:25: found the key `matches` twice, expected it once";
    refused("a.json", r#"{"matches": [], "matches": []}"#, twice);
    let more =
        "found more text after the JSON object, expected one object (JSON Lines: the extension .jsonl)";
    refused("a.json", "{\"matches\": []}\n{\"matches\": []}", &format!("a.json:2:1: {more}"));
}

#[test]
fn truths_that_are_no_rotation() {
    let unit = "found a quaternion of length 2.0, expected length 1 (w, x, y, z)";
    refused("a.json", r#"{"matches": [], "q_21": [2, 0, 0, 0]}"#, &format!("a.json: q_21: {unit}"));
    let unit = "found a quaternion of length inf, expected length 1 (w, x, y, z)";
    refused("a.json", r#"{"matches": [], "q_21": [1e300, 0, 0, 0]}"#, &format!("a.json: q_21: {unit}"));
    refused("a.json", r#"{"matches": [], "t_21": [1, 2]}"#, "a.json:1:30: t_21: found 2 numbers, expected 3");
}

#[test]
fn cameras_that_are_not_understood() {
    let file = |camera: &str| format!(r#"{{"matches": [], "camera1": {camera}}}"#);
    let half = "a.json: camera1: found one of width and height, expected both or none";
    refused("a.json", file(r#"{"model": "PINHOLE", "width": 9, "params": [1, 1, 0, 0]}"#), half);
    let names = "SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, OPENCV_FISHEYE, FULL_OPENCV, \
                 SIMPLE_RADIAL_FISHEYE, RADIAL_FISHEYE, FOV, THIN_PRISM_FISHEYE, RAD_TAN_THIN_PRISM_FISHEYE, \
                 SIMPLE_DIVISION, DIVISION, SIMPLE_FISHEYE, FISHEYE, EUCM, EQUIRECTANGULAR";
    let unknown = format!("a.json: camera1.model: unknown camera model \"FISH\", expected one of {names}");
    refused("a.json", file(r#"{"model": "FISH", "params": [1, 1, 0, 0]}"#), &unknown);
    let count = "a.json: camera1.params: PINHOLE takes 4 parameters (fx, fy, cx, cy), found 3";
    refused("a.json", file(r#"{"model": "PINHOLE", "params": [1, 0, 0]}"#), count);
    let focal =
        "a.json: camera1.params: focal length fx of the camera is 0 pixels, expected a positive number";
    refused("a.json", file(r#"{"model": "PINHOLE", "params": [0, 1, 0, 0]}"#), focal);
    let list = "a.json:1:27: camera1: found a list, expected an object";
    refused("a.json", file(r#"["PINHOLE", 9, 9, [1, 1, 0, 0]]"#), list);
    let second = "a.json: camera2: found a second camera without the first, expected camera1 as well";
    let camera2 = r#"{"matches": [], "camera2": {"model": "PINHOLE", "params": [1, 1, 0, 0]}}"#;
    refused("a.json", camera2, second);
}

#[test]
fn csv() {
    let header = "expected u1,v1,u2,v2[,score], or rows of these without a header";
    refused("a.csv", "x,y,z,w\n", &format!("a.csv:1: found the header \"x,y,z,w\", {header}"));
    refused("a.csv", "u1,v1,u2,u2\n", &format!("a.csv:1: found the header \"u1,v1,u2,u2\", {header}"));
    for text in ["NaN", "-inf", "1e400", "x", ""] {
        let message = format!("a.csv:3: u2: found {text:?}, expected a finite number");
        refused("a.csv", format!("u1,v1,u2,v2\n1,2,3,4\n1,2,{text},4\n"), &message);
    }
    let short = "a.csv:3: found 3 values, expected 4 as in the first row";
    refused("a.csv", "u1,v1,u2,v2\n\n1,2,3\n", short);
    refused("a.csv", "u1,v1,u2,v2\r\n1,2,3,4\r\n1,2,3\r\n", short);
    refused("a.csv", "u1,v1,u2,v2\n \n1,2,3\n", short);
}

#[test]
fn text_that_is_not_utf8() {
    refused(
        "a.json",
        b"{\"matches\": [],\n\"name\": \"\xff\"}",
        "a.json:2: found the byte 0xff, expected UTF-8 text",
    );
    refused("a.csv", b"u1,v1,u2,v2\n1,2,3,\xff\n", "a.csv:2: found the byte 0xff, expected UTF-8 text");
}

#[test]
fn other_kinds_of_files_are_called_by_what_they_are() {
    let image = "estimate reads matches, not images; see the guide Pose from photographs";
    refused(
        "a.png",
        b"\x89PNG\r\n\x1a\n\0\0",
        &format!("a.png: found a PNG image, expected matches; {image}"),
    );
    refused("a.csv", b"\xff\xd8\xff\xe0", &format!("a.csv: found a JPEG image, expected matches; {image}"));
    let colmap = "COLMAP's: quest-cli colmap verify or quest-cli colmap export";
    let expected = format!("a.db: found an SQLite database, expected matches; {colmap}");
    refused("a.db", b"SQLite format 3\0\x10\0", &expected);
    for (start, found) in [
        (&b"\x1f\x8b\x08"[..], "a gzip archive"),
        (b"PK\x03\x04", "a zip archive"),
        (b"\x7fELF", "a program"),
    ] {
        let directory = directory_with("a.jsonl", start);
        let run = run_in(directory.path(), &["estimate", "a.jsonl"], b"");
        assert!(run.stderr.starts_with(&format!("error: a.jsonl: found {found}")), "{}", run.stderr);
        assert_eq!(run.status, 2);
    }
}

#[test]
fn points_without_a_bearing() {
    let far = "matches[1]: a coordinate in view 2 is 1e9 on the plane z = 1, expected at most 6.7e7";
    refused("a.json", r#"{"matches": [[1, 2, 3, 4], [1, 2, 1e9, 4]]}"#, &format!("a.json: {far}"));
}

#[test]
fn names_of_files_cannot_break_the_line() {
    let run = run(&["solve", "a\nb.json"]);
    assert_eq!(run.stderr, "error: a\\nb.json: cannot be read: No such file or directory\n");
}

#[test]
fn cameras_of_the_command_line() {
    let file = example("tumfr3_98072_98172.json");
    let given = |camera: &str| run(&["solve", &file, "--camera1", camera]);
    let upper = given("PINHOLE,640,480,535.4,539.2,320.1,247.6");
    let lower = given("pinhole,640,480,535.4,539.2,320.1,247.6");
    assert_eq!((lower.status, &lower.stdout), (upper.status, &upper.stdout), "{}", lower.stderr);
    assert!(given("fish,640,480,5").stderr.contains("unknown camera model \"fish\""));
    let missing = given("camera.yml").stderr;
    assert!(
        missing.contains("found no file of this name, expected the file of a camera, or MODEL,"),
        "{missing}"
    );
}

#[test]
fn arguments() {
    for arguments in [
        &["solve"][..],
        &["solve", "-", "--solver", "no-such-solver"],
        &["solve", "-", "--kinds", "some"],
        &["solve", "-", "--format", "xml"],
        &["solve", "-", "--camera1", "PINHOLE,640,480,500"],
        &["solve", "-", "--camera1", "PINHOLE,640,480,500,nan,320,240"],
        &["solve", "-", "--camera1", "PINHOLE,640.5,480,500,500,320,240"],
        &["no-such-command"],
    ] {
        let run = run(arguments);
        assert_eq!((run.status, run.stdout.as_str()), (2, ""), "{arguments:?}");
        assert!(run.stderr.starts_with("error: "), "{arguments:?}: {}", run.stderr);
    }
    let run = run(&["solve", &example("points.csv"), "--camera2", "PINHOLE,640,480,500,500,320,240"]);
    assert!(run.stderr.ends_with("found a second camera without the first, expected camera1 as well\n"));
    assert_eq!(run.status, 2);
}
