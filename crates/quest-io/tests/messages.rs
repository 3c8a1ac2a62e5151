//! What a bad file is told: the place, what was found, what was expected. And what a good one says.
#![expect(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

use std::{fs, path::Path};

use quest_io::{Format, MOST_BYTES, Pair, ReadError};
use tempfile::TempDir;

fn folder_with(name: &str, text: impl AsRef<[u8]>) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join(name), text).unwrap();
    folder
}

/// All that a file of this name gives.
fn all(name: &str, text: impl AsRef<[u8]>) -> Vec<Result<Pair, ReadError>> {
    let folder = folder_with(name, text);
    quest_io::read(&folder.path().join(name), None).unwrap().collect()
}

/// The one pair of a file.
#[track_caller]
fn pair(name: &str, text: impl AsRef<[u8]>) -> Pair {
    let [found] = <[_; 1]>::try_from(all(name, text)).unwrap();
    found.unwrap()
}

/// The file is refused with this message, after which nothing comes.
#[track_caller]
fn refused(name: &str, text: impl AsRef<[u8]>, expected: &str) {
    let folder = folder_with(name, text);
    let path = folder.path().join(name);
    let found: Vec<_> = match quest_io::read(&path, None) {
        Ok(pairs) => pairs.collect(),
        Err(error) => vec![Err(error)],
    };
    let [found] = <[_; 1]>::try_from(found).unwrap();
    let said = found.and_then(|pair| pair.correspondences()).unwrap_err().to_string();
    assert_eq!(said, format!("{}/{expected}", folder.path().display()));
}

#[test]
fn files_without_text() {
    let nothing = "found an empty file, expected matches as JSON, JSON Lines, CSV or an array of NumPy's";
    refused("a.npy", "", &format!("a.npy: {nothing}"));
    for file in ["a.json", "a.jsonl", "a.csv", "a.txt"] {
        for text in ["", " \n\n", "\u{feff}\n"] {
            refused(file, text, &format!("{file}: {nothing}"));
        }
    }
    let folder = folder_with("a", "");
    let said = |name: &str| quest_io::read(&folder.path().join(name), None).unwrap_err().to_string();
    assert!(said("").ends_with(": found a directory, expected a file"), "{}", said(""));
    assert!(
        said("no.json").ends_with("no.json: cannot be read: No such file or directory"),
        "{}",
        said("no.json")
    );
}

#[test]
fn json_that_is_cut_mistyped_or_of_another_form() {
    let cut = "found the end of the text inside a list, expected the rest of the JSON";
    refused("a.json", "{\"matches\": [[1, 2, 3, 4],\n [5, 6", &format!("a.json:2:6: matches[1]: {cut}"));
    let file = |value: &str| format!(r#"{{"matches": [[1, 2, 3, 4], [1, {value}, 3, 4]]}}"#);
    let place = "matches[1][1]: found";
    refused("a.json", file("\"x\""), &format!("a.json:1:34: {place} string \"x\", expected a number"));
    refused("a.json", file("NaN"), &format!("a.json:1:32: {place} \"NaN\", expected a JSON value"));
    refused("a.json", file("null"), &format!("a.json:1:35: {place} null, expected a number"));
    let range = "a number out of range, expected one below 1.8e308";
    refused("a.json", file("1e400"), &format!("a.json:1:36: {place} {range}"));
    refused("a.json", "[1, 2]", "a.json:1:1: found a list, expected an object");
    refused("a.json", r#"{"match": []}"#, "a.json:1:13: found no key `matches`, expected one");
    let twice = "a.json:1:25: found the key `matches` twice, expected it once";
    refused("a.json", r#"{"matches": [], "matches": []}"#, twice);
    let more =
        "found more text after the JSON object, expected one object (JSON Lines: the extension .jsonl)";
    refused("a.json", "{\"matches\": []}\n{\"matches\": []}", &format!("a.json:2:1: {more}"));
    let row = |row: &str| format!(r#"{{"matches": [[1, 2, 3, 4], {row}]}}"#);
    refused("a.json", row("[1, 2, 3]"), "a.json:1:36: matches[1]: found 3 numbers, expected 4");
    refused("a.json", row("[1, 2, 3, 4, 5]"), "a.json:1:42: matches[1]: found 5 numbers, expected 4");
    refused("a.json", row("5"), "a.json:1:28: matches[1]: found integer `5`, expected a list of 4 numbers");
    // Where a number is out of range the words that could be a gap stand somewhere else.
    refused(
        "a.json",
        r#"{"matches": [[1, 2, 3, 4]], "t_21": [1, NaN, 2]}"#,
        "a.json:1:41: t_21[1]: found \"NaN\", expected a JSON value",
    );
    let scores = "a.json: scores: found 2 scores, expected 1, one a match";
    refused("a.json", r#"{"matches": [[1, 2, 3, 4]], "scores": [1, 2]}"#, scores);
    let far = "matches[1]: a coordinate in view 2 is 1e9 on the plane z = 1, expected at most 6.7e7";
    refused("a.json", r#"{"matches": [[1, 2, 3, 4], [1, 2, 1e9, 4]]}"#, &format!("a.json: {far}"));
    let byte = "found the byte 0xff, expected UTF-8 text";
    refused("a.json", b"{\"matches\": [],\n\"name\": \"\xff\"}", &format!("a.json:2: {byte}"));
    refused("a.csv", b"u1,v1,u2,v2\n1,2,3,\xff\n", &format!("a.csv:2: {byte}"));
}

#[test]
fn truths_and_cameras_of_json() {
    let unit = |length: &str| {
        format!("a.json: q_21: found a quaternion of length {length}, expected length 1 (w, x, y, z)")
    };
    let q = |values: &str| format!(r#"{{"matches": [], "q_21": [{values}]}}"#);
    refused("a.json", q("2, 0, 0, 0"), &unit("2.0"));
    refused("a.json", q("0.998, 0, 0, 0"), &unit("0.998"));
    refused("a.json", q("1e300, 0, 0, 0"), &unit("inf"));
    // Four written decimals.
    let truth = pair("a.json", r#"{"matches": [], "q_21": [0.9992, 0, 0, 0], "t_21": [0, 2, 0]}"#).truth;
    assert!(truth.q_21.unwrap().angle() < 1e-12);
    assert_eq!(truth.t_21, Some([0.0, 2.0, 0.0].into()));
    let file = |camera: &str| format!(r#"{{"matches": [], "camera1": {camera}}}"#);
    let half = "a.json: camera1: found one of width and height, expected both or none";
    refused("a.json", file(r#"{"model": "PINHOLE", "width": 9, "params": [1, 1, 0, 0]}"#), half);
    refused("a.json", file(r#"{"model": "PINHOLE", "height": 9, "params": [1, 1, 0, 0]}"#), half);
    let count = "a.json: camera1.params: PINHOLE takes 4 parameters (fx, fy, cx, cy), found 3";
    refused("a.json", file(r#"{"model": "PINHOLE", "params": [1, 0, 0]}"#), count);
    let focal =
        "a.json: camera1.params: focal length fx of the camera is 0 pixels, expected a positive number";
    refused("a.json", file(r#"{"model": "PINHOLE", "params": [0, 1, 0, 0]}"#), focal);
    let list = "a.json:1:27: camera1: found a list, expected an object";
    refused("a.json", file(r#"["PINHOLE", 9, 9, [1, 1, 0, 0]]"#), list);
    let second = "a.json: camera2: found a second camera without the first, expected camera1 as well";
    refused("a.json", r#"{"matches": [], "camera2": {"model": "PINHOLE", "params": [1, 1, 0, 0]}}"#, second);
    let said = |camera: &str| {
        let folder = folder_with("a.json", file(camera));
        let mut pairs = quest_io::read(&folder.path().join("a.json"), None).unwrap();
        pairs.next().unwrap().unwrap_err().to_string()
    };
    // A size has no key of its own.
    let size = said(r#"{"model": "PINHOLE", "width": 0, "height": 5, "params": [1, 1, 0, 0]}"#);
    assert!(size.contains("a.json: camera1: "), "{size}");
    let unknown = said(r#"{"model": "FISH", "params": [1, 1, 0, 0]}"#);
    assert!(unknown.contains("camera1.model: unknown camera model \"FISH\""), "{unknown}");
}

#[test]
fn cameras_have_a_mean_focal_length_and_matches_without_them_may_be_pixels() {
    let two = r#"{"matches": [[10, 20, 30, 40]], "camera1": {"model": "PINHOLE", "params": [100, 200, 0, 0]},
        "camera2": {"model": "SIMPLE_PINHOLE", "params": [500, 0, 0]}}"#;
    let found = pair("a.json", two);
    assert_eq!(found.focal_length(), Some(325.0));
    assert!(!found.looks_like_pixels());
    let far = |matches: &str| pair("a.json", format!("{{\"matches\": [{matches}]}}"));
    assert_eq!(far("[1, 2, 3, 4]").focal_length(), None);
    assert!(!far("[1, 2, 3, 10]").looks_like_pixels());
    assert!(!far("[1, 2, 3, 11], [1, 2, 3, 4]").looks_like_pixels());
    assert!(far("[1, 2, 3, -11], [11, 2, 3, 4], [1, 2, 3, 4]").looks_like_pixels());
    let one = pair("a.json", two.replace("camera2", "note"));
    assert_eq!((one.focal_length(), one.unknown_keys), (Some(150.0), vec!["note".to_owned()]));
}

#[test]
fn keys_for_people_are_known_and_others_are_named() {
    let text = r#"{"matches": [], "source": 1, "scene": 2, "inliers_known": 3, "colour": 1,
        "camera1": {"model": "PINHOLE", "params": [1, 1, 0, 0], "fov": 3}, "name": "n"}"#;
    let found = pair("a.json", text);
    assert_eq!(found.unknown_keys, ["colour", "camera1.fov"]);
    assert_eq!(found.name.as_deref(), Some("n"));
    assert_eq!(found.place.line, None);
}

#[test]
fn a_gap_makes_its_match_one_without_a_bearing() {
    let gaps = r#"{"matches": [[1, 2, 3, 4], [NaN, 6, null, -Infinity], [1, 2, 3, 1e5]]}"#;
    let found = pair("a.json", gaps);
    let is_gap = found.matches.iter().map(|m| m.map(f64::is_nan)).collect::<Vec<_>>();
    assert_eq!(is_gap, [[false; 4], [true, false, true, true], [false; 4]]);
    let gap = found.first_gap.clone().unwrap();
    assert_eq!(gap.message, "found \"NaN\", expected a JSON value");
    assert_eq!(found.correspondences().unwrap_err().to_string(), format!("{}: {}", gap.place, gap.message));
    assert_eq!(found.usable().matches.len(), 2);
    let table = pair("a.csv", "u1,v1,u2,v2,score\n1,2,3,4,1\n1,,inf,4,2\n");
    assert_eq!(table.matches[1].map(f64::is_nan), [false, true, true, false]);
    let gap = table.first_gap.unwrap();
    assert!(gap.place.to_string().ends_with("a.csv:3: v1"), "{gap:?}");
    assert_eq!(gap.message, "found \"\", expected a finite number");
    assert_eq!(table.scores, Some(vec![1.0, 2.0]));
}

#[test]
fn tables() {
    let header = "expected u1,v1,u2,v2[,score], or rows of these without a header";
    for names in ["x,y,z,w", "u1,v1,u2,u2", "u1,v1,u2,v2,score,score", "u1,v1,u2", "u1,v1,u2,v2,v2"] {
        refused("a.csv", format!("{names}\n"), &format!("a.csv:1: found the header {names:?}, {header}"));
    }
    for text in ["NaN", "-inf", "1e400", "x", ""] {
        let message = format!("a.csv:3: u2: found {text:?}, expected a finite number");
        refused("a.csv", format!("u1,v1,u2,v2\n1,2,3,4\n1,2,{text},4\n"), &message);
    }
    for text in ["inf", "NaN", "", "x"] {
        let message = format!("a.csv:2: score: found {text:?}, expected a finite number");
        refused("a.csv", format!("u1,v1,u2,v2,score\n1,2,3,4,{text}\n"), &message);
    }
    let short = "a.csv:3: found 3 values, expected 4 as in the first row";
    for text in ["u1,v1,u2,v2\n\n1,2,3\n", "u1,v1,u2,v2\r\n1,2,3,4\r\n1,2,3\r\n", "u1,v1,u2,v2\n \n1,2,3\n"] {
        refused("a.csv", text, short);
    }
    let comma = "a.csv:1: u1: found \"1,5\", expected a number with a decimal point";
    refused("a.csv", "1,5;2;3;4\n", comma);
    refused(
        "a.csv",
        "1,x;2;3;4\n",
        "a.csv:1: found the header \"1,x,2,3,4\", expected u1,v1,u2,v2[,score], or rows of these without a header",
    );
    let columns = "found 3 columns and no header, expected u1,v1,u2,v2[,score], or a header with these names";
    refused("a.csv", "\n1,2,3\n", &format!("a.csv:2: {columns}"));
    refused("a.csv", "1,2,3,4,5,6\n", &format!("a.csv:1: {}", columns.replace('3', "6")));
    let one = "found two columns, the points of one image, expected matches, or --points2 with those of the other image";
    refused("a.csv", "1,2\n", &format!("a.csv:1: {one}"));
    let expected = [[1.0, 2.0, 3.0, 4.0], [-5.0, 6.5, 7e2, 8.0]];
    for separator in [",", ";", "\t", " ", "   ", " , "] {
        let rows = "1 2 3 4\n-5 6.5 7e2 8\n".replace(' ', separator);
        let names = "u1 v1 u2 v2".replace(' ', separator);
        let turned = "v2 u2 v1 u1 tag\n4 3 2 1 0\n8 7e2 6.5 -5 0\n".replace(' ', separator);
        for text in
            [rows.clone(), format!("{names}\n{rows}"), format!("# {names}\n# words\n\n{rows}#end\n"), turned]
        {
            assert_eq!(pair("a.csv", &text).matches, expected, "{text:?}");
            assert_eq!(pair("a.txt", &text).matches, expected, "{text:?}");
        }
    }
    assert_eq!(pair("a.csv", "u1,v1,tag,u2,v2\n1,2,x,3,4\n").unknown_keys, ["tag"]);
    assert_eq!(pair("a.csv", "1,2,3,4,0.5\n").scores, Some(vec![0.5]));
    // A row that begins with a gap is a row; what is no number is no gap.
    let gaps = pair("a.csv", "1,2,3,4\n,,,\n,2,3,4\n");
    assert_eq!(gaps.matches.iter().map(|m| m[0].is_nan()).collect::<Vec<_>>(), [false, true, true]);
    assert!(all("a.csv", "u1,v1,u2,v2\n1,2,x,4\n")[0].is_err());
    let word = "a.csv:2: u1: found \"1,x\", expected a finite number";
    refused("a.csv", "u1;v1;u2;v2\n1,x;2;3;4\n", word);
    refused("a.csv", "1\n2\n", &format!("a.csv:1: {}", columns.replace('3', "1")));
    // A comment that is no header, and a second one that would be.
    assert_eq!(pair("a.csv", "# words\n1,2,3,4\n").matches.len(), 1);
    assert_eq!(pair("a.csv", "1,2,3,4\n# u1,v1,u2,v2\n5,6,7,8\n").matches.len(), 2);
}

#[test]
fn the_form_is_that_of_the_extension_or_of_the_beginning() {
    let form = |name: &str, text: &str| {
        let folder = folder_with(name, text);
        quest_io::read(&folder.path().join(name), None).unwrap().format()
    };
    for (name, format) in [
        ("a.json", Format::Json),
        ("a.JSON", Format::Json),
        ("a.jsonl", Format::JsonLines),
        ("a.ndjson", Format::JsonLines),
        ("a.csv", Format::Csv),
        ("a.npy", Format::Npy),
        ("a.npz", Format::Npy),
    ] {
        assert_eq!(form(name, "1"), format, "{name}");
        assert_eq!(Format::from_extension(Path::new(name)), Some(format));
        assert_eq!(Format::named(format.info().name), Some(format));
        assert!(!format.info().help.is_empty());
    }
    assert_eq!((Format::named("xml"), Format::from_extension(Path::new("json"))), (None, None));
    for format in Format::ALL {
        assert_eq!(format.is_built(), format != Format::Parquet || cfg!(feature = "parquet"), "{format:?}");
    }
    let folder = folder_with("a", "PAR1 and no more");
    let parquet = quest_io::read(&folder.path().join("a"), None).map(Iterator::count).unwrap_err();
    assert!(parquet.to_string().contains("Parquet"), "{parquet}");
    let object = "{\"matches\": [[1, 2, 3, 4]]}";
    for (text, format, count) in [
        (object.to_owned(), Format::Json, 1),
        (format!("\u{feff}\n\n  {object}\n\n"), Format::Json, 1),
        (object.replace(' ', "\n"), Format::Json, 1),
        (format!("{object}\n\n{object}\n"), Format::JsonLines, 2),
        ("1,2,3,4\n".to_owned(), Format::Csv, 1),
        ("[1]\n[2]\n".to_owned(), Format::JsonLines, 2),
    ] {
        assert_eq!(form("a", &text), format, "{text:?}");
        assert_eq!(all("a", &text).len(), count, "{text:?}");
    }
    let folder = folder_with("a.json", object);
    let pairs = quest_io::read(&folder.path().join("a.json"), Some(Format::JsonLines)).unwrap();
    assert_eq!(pairs.format(), Format::JsonLines);
    let words = format!("{pairs:?}");
    assert!(words.contains("JsonLines") && words.contains("line: 0"), "{words}");
}

#[test]
fn a_bad_line_costs_itself_alone() {
    let good = "{\"matches\": [[1, 2, 3, 4]], \"name\": \"a\"}";
    let found = all("a.jsonl", format!("{good}\n\n{{\"matches\": [[1, 2, 3]]}}\n\u{feff}\n{good}\n\n"));
    assert_eq!(found.len(), 3);
    assert_eq!(found[0].as_ref().unwrap().place.line, Some(1));
    assert_eq!(found[2].as_ref().unwrap().place.line, Some(5));
    let error = found[1].as_ref().unwrap_err();
    assert!(error.to_string().ends_with("a.jsonl:3:22: matches[0]: found 3 numbers, expected 4"), "{error}");
    let found = all("a.jsonl", [good.as_bytes(), b"\n{\"\xfe\"\n", good.as_bytes()].concat());
    assert!(found[0].is_ok() && found[2].is_ok() && found.len() == 3);
    let error = found[1].as_ref().unwrap_err();
    assert!(error.to_string().ends_with("a.jsonl:2: found the byte 0xfe, expected UTF-8 text"), "{error}");
}

#[test]
fn a_pair_of_more_bytes_than_were_allowed_is_refused() {
    let good = "{\"matches\": [[1, 2, 3, 4]]}";
    let within = |name: &str, text: &str, most: u64| {
        let folder = folder_with(name, text);
        match quest_io::read_within(&folder.path().join(name), None, most) {
            Ok(pairs) => pairs.collect::<Vec<_>>(),
            Err(error) => vec![Err(error)],
        }
    };
    let said = "found a pair of more than 26 bytes, expected at most as many; --max-input allows more";
    assert_eq!(good.len(), 27);
    for name in ["a.json", "a.csv", "a"] {
        let found = within(name, good, 26);
        assert!(
            found[0].as_ref().unwrap_err().to_string().ends_with(&format!("{name}: {said}")),
            "{found:?}"
        );
        assert_eq!(found.len(), 1);
    }
    assert!(within("a.json", good, 27)[0].is_ok());
    // The first line fits with its end, the second does not: what follows is not looked for.
    let found = within("a.jsonl", &format!("{}\n{good} \n{good}\n", good.replace(", ", ",")), 27);
    assert_eq!(found.len(), 2);
    let error = found[1].as_ref().unwrap_err().to_string();
    assert!(
        found[0].is_ok() && error.contains("a.jsonl: line 2: found a pair of more than 27 bytes"),
        "{error}"
    );
}

#[test]
fn points_of_two_images_stand_in_two_files() {
    let folder = folder_with("one.csv", "u,v\n1,2\n3,\n");
    let path = |name: &str| folder.path().join(name);
    fs::write(path("two.csv"), "v;u;tag\n5;6;0\n7;8;0\n").unwrap();
    fs::write(path("few.csv"), "5,6\n").unwrap();
    fs::write(path("a.json"), "{}").unwrap();
    fs::write(path("three.csv"), "1,2,3\n").unwrap();
    let both = |one: &str, two: &str| quest_io::read_points([&path(one), &path(two)], None, MOST_BYTES);
    let found = both("one.csv", "two.csv").unwrap();
    assert_eq!((found.matches[0], found.unknown_keys), ([1.0, 2.0, 6.0, 5.0], vec!["tag".to_owned()]));
    assert!(found.first_gap.unwrap().place.to_string().ends_with("one.csv:3: v"));
    assert!(
        both("two.csv", "one.csv").unwrap().first_gap.unwrap().place.to_string().ends_with("one.csv:3: v")
    );
    let said = |one: &str, two: &str| both(one, two).unwrap_err().to_string();
    let few = "few.csv: found 1 points, expected 2 as in the file of the first image";
    assert!(said("one.csv", "few.csv").ends_with(few));
    let json = "a.json: found JSON, expected the points of one image as CSV or an array of NumPy's";
    assert!(said("one.csv", "a.json").ends_with(json));
    let three = "three.csv:1: found 3 columns and no header, expected u,v, or a header with these names";
    assert!(said("three.csv", "one.csv").ends_with(three), "{}", said("three.csv", "one.csv"));
}
