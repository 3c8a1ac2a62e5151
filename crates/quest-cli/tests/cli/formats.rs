//! Forms of input, and words beside the result.

use super::*;

/// The result as JSON, whatever the exit status says of candidates.
#[track_caller]
fn json(arguments: &[&str], input: &str) -> serde_json::Value {
    let run = run_in(Path::new("."), &[&["solve", "--format", "json"], arguments].concat(), input.as_bytes());
    serde_json::from_str(&run.stdout).unwrap_or_else(|e| panic!("{e}: {run:?}"))
}

fn pair(extra: &str) -> String {
    format!("{{\"matches\": {}{extra}}}", five_matches())
}

#[test]
fn every_form_gives_the_same_candidates() {
    let from_json = json(&[&example("points.json")], "");
    assert_eq!(from_json["name"], "points");
    assert_eq!(from_json["matches"], 5);
    let csv = fs::read_to_string(example("points.csv")).unwrap();
    let forms = [
        json(&["-"], &fs::read_to_string(example("points.json")).unwrap()),
        json(&[&example("points.csv")], ""),
        json(&["-"], &csv),
        json(&["-", "--input-format", "csv"], &csv),
        json(&["-"], &format!("\u{feff}{}", csv.replace('\n', "\r\n"))),
        json(&["-", "--input-format", "jsonl"], &pair(""))[0].clone(),
    ];
    for form in forms {
        let candidates = |v: &serde_json::Value| v["candidates"].as_array().unwrap().len();
        assert_eq!(candidates(&form), candidates(&from_json));
        for (a, b) in
            form["candidates"].as_array().unwrap().iter().zip(from_json["candidates"].as_array().unwrap())
        {
            assert_eq!((&a["q_21"], &a["t_21"]), (&b["q_21"], &b["t_21"]));
        }
    }
}

#[test]
fn a_header_may_have_other_names() {
    let csv = fs::read_to_string(example("points.csv")).unwrap();
    let (header, rows) = csv.split_once('\n').unwrap();
    assert_eq!(header.trim(), "u1,v1,u2,v2");
    let expected = json(&["-"], &csv);
    for header in ["x1,y1,x2,y2", "X1,Y1,X2,Y2", "x_1,y_1,x_2,y_2", "U1,V1,U2,V2", "# x1,y1,x2,y2"] {
        assert_eq!(json(&["-"], &format!("{header}\n{rows}")), expected, "{header}");
    }
    // Where both are there, ours are meant, and the others are not known.
    let both: String = rows.lines().flat_map(|row| [row, ",9,9,9,9\n"]).collect();
    let text = format!("u1,v1,u2,v2,x1,y1,x2,y2\n{both}");
    assert_eq!(json(&["-"], &text), expected);
    let run = run_in(Path::new("."), &["solve", "-"], text.as_bytes());
    assert!(run.stderr.contains("ignored unknown keys: x1, y1, x2, y2"), "{}", run.stderr);
    // Points of one image.
    let points = |columns: [usize; 2], header: &str| {
        let row = |row: &str| {
            let fields: Vec<_> = row.split(',').collect();
            columns.map(|k| fields[k].trim()).join(",")
        };
        rows.lines().fold(header.to_owned(), |all, line| all + "\n" + &row(line))
    };
    let folder = directory_with("1.csv", points([0, 1], "x,y"));
    fs::write(folder.path().join("2.csv"), points([2, 3], "u,v")).unwrap();
    let run = run_in(folder.path(), &["solve", "1.csv", "--points2", "2.csv", "--format", "json"], b"");
    assert_eq!(serde_json::from_str::<serde_json::Value>(&run.stdout).unwrap(), expected);
}

#[test]
fn json_lines_give_a_line_each() {
    let lines = format!("{}\n\n{}\n", pair(", \"name\": \"a\""), pair(", \"name\": \"b\""));
    let run = run_in(Path::new("."), &["solve", "-"], lines.as_bytes());
    let names: Vec<_> = run
        .stdout
        .lines()
        .map(|line| {
            serde_json::from_str::<serde_json::Value>(line).unwrap()["name"].as_str().unwrap().to_owned()
        })
        .collect();
    assert_eq!(names, ["a", "b"]);
    assert_eq!(json(&["-"], &lines).as_array().unwrap().len(), 2);
}

#[test]
fn a_bad_line_costs_itself_alone() {
    let lines = format!("{}\n\n{{\"matches\": [[1, 2, 3]]}}\n{}\n", pair(""), pair(""));
    let run = run_in(Path::new("."), &["solve", "-", "--quiet"], lines.as_bytes());
    assert_eq!((run.status, run.stdout.lines().count()), (1, 3));
    let reason = "standard input:3:22: matches[0]: found 3 numbers, expected 4";
    assert_eq!(run.stderr, format!("no pose: {reason}\n"));
    let records: Vec<serde_json::Value> =
        run.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!((&records[1]["reason"], &records[1]["candidates"]), (&reason.into(), &serde_json::json!([])));
    assert_eq!(records[0], records[2]);
    // Where nothing could be read it is bad input.
    let none = run_in(Path::new("."), &["solve", "-", "--input-format", "jsonl"], b"{}\n{\n");
    assert_eq!(none.status, 2, "{}", none.stderr);
}

#[test]
fn unknown_keys_are_named_once() {
    let keys = ", \"source\": 1, \"colour\": 1, \"camera1\": {\"model\": \"PINHOLE\", \"params\": [1, 1, 0, 0], \"fov\": 3}";
    let lines = format!("{}\n{}\n", pair(keys), pair(keys));
    let words = run_in(Path::new("."), &["solve", "-"], lines.as_bytes()).stderr;
    let warnings: Vec<_> = words.lines().filter(|l| l.starts_with("warning:")).collect();
    assert_eq!(warnings, ["warning: standard input:1: ignored unknown keys: colour, camera1.fov"]);
    let quiet = run_in(Path::new("."), &["solve", "-", "--quiet"], lines.as_bytes());
    assert!(!quiet.stderr.contains("warning") && !quiet.stderr.contains("note"), "{}", quiet.stderr);
}

#[test]
fn columns_of_csv_are_found_by_name() {
    let text = "score,v2,u2,v1,u1,tag\n1,0.4,0.3,0.2,0.1,x\n";
    let words = run_in(Path::new("."), &["solve", "-"], text.as_bytes()).stderr;
    let (warning, error) = words.split_once('\n').unwrap_or_default();
    // The warning comes before the matches are counted.
    assert_eq!(warning, "warning: standard input: ignored unknown keys: tag");
    assert_eq!(error, "error: standard input: matches: found 1 matches, expected at least 5\n");
}

#[test]
fn solvers_in_every_format() {
    let table = run(&["solvers", "--no-times"]);
    assert_eq!((table.status, table.stderr.as_str()), (0, ""));
    let list: serde_json::Value =
        serde_json::from_str(&run(&["solvers", "--no-times", "--format", "json"]).stdout).unwrap();
    let lines = run(&["solvers", "--no-times", "--format", "jsonl"]).stdout;
    let csv = run(&["solvers", "--no-times", "--format", "csv"]).stdout;
    assert_eq!(csv.lines().next(), Some("name,min_matches,max_candidates,reference,lost"));
    for (index, solver) in list.as_array().unwrap().iter().enumerate() {
        let name = solver["name"].as_str().unwrap();
        assert!(table.stdout.contains(name));
        assert!(csv.lines().nth(index + 1).unwrap().starts_with(name));
        // The forms as printed lose poses, and say which, below the table.
        let lost = solver["lost"].as_str().unwrap();
        assert_eq!(lost.contains("parallax"), name.ends_with("-literal"));
        assert!(lost.is_empty() || table.stdout.contains(&format!("{name} loses {lost}")));
        assert_eq!(
            &serde_json::from_str::<serde_json::Value>(lines.lines().nth(index).unwrap()).unwrap(),
            solver
        );
    }
}

#[test]
fn solvers_are_timed() {
    let csv = run(&["solvers", "--format", "csv"]).stdout;
    assert_eq!(csv.lines().next(), Some("name,min_matches,max_candidates,time_us,reference,lost"));
    let list: serde_json::Value =
        serde_json::from_str(&run(&["solvers", "--format", "json"]).stdout).unwrap();
    for solver in list.as_array().unwrap() {
        // Between the fastest solver's own time and a tenth of a second.
        let time_us = solver["time_us"].as_f64().unwrap();
        assert!((0.1..1e5).contains(&time_us), "{solver}");
    }
}

#[test]
fn help_and_version() {
    for arguments in [&["--help"][..], &["solve", "--help"], &["solvers", "--help"]] {
        let run = run(arguments);
        assert_eq!((run.status, run.stderr.as_str()), (0, ""));
        assert!(run.stdout.contains("Examples:\n"), "{}", run.stdout);
    }
    assert_eq!(run(&["--version"]).stdout, format!("quest-cli {}\n", env!("CARGO_PKG_VERSION")));
}
