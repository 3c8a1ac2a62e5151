//! Many pairs in a file: no line stops the others, and what was answered is kept.

use super::*;

fn pair(name: &str, points: usize) -> String {
    let file: serde_json::Value =
        serde_json::from_slice(&fs::read(example("tumfr3_98072_98172.json")).unwrap()).unwrap();
    let matches: Vec<_> = file["matches"].as_array().unwrap().iter().take(points).collect();
    serde_json::json!({"name": name, "camera1": file["camera1"], "camera2": file["camera2"], "matches": matches})
        .to_string()
}

fn records(text: &str) -> Vec<serde_json::Value> {
    let mut all: Vec<serde_json::Value> =
        text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    // Times differ.
    for record in &mut all {
        record["elapsed_ms"] = 0.into();
    }
    all
}

fn four() -> String {
    [pair("a", 100), "{\"matches\": [[1, 2".to_owned(), pair("b", 3), pair("c", 90)].join("\n") + "\n"
}

#[test]
fn a_line_that_is_bad_gets_its_reason() {
    let folder = directory_with("pairs.jsonl", four());
    let run = run_in(folder.path(), &["estimate", "pairs.jsonl", "-o", "out.jsonl"], b"");
    assert_eq!(run.status, 1, "{}", run.stderr);
    let all = records(&fs::read_to_string(folder.path().join("out.jsonl")).unwrap());
    assert_eq!(all.len(), 4);
    assert!(all[0]["inlier_count"].as_u64().unwrap() > 20);
    assert!(all[1]["reason"].as_str().unwrap().contains("pairs.jsonl:2:"), "{}", all[1]);
    assert!(all[2]["reason"].as_str().unwrap().contains("found 3 matches"), "{}", all[2]);
    assert_eq!((&all[1]["model"], &all[3]["name"]), (&serde_json::Value::Null, &"c".into()));
    // The others have the answers that they have alone.
    let good = [pair("a", 100), pair("x", 80), pair("y", 80), pair("c", 90)].join("\n");
    let alone = run_in(folder.path(), &["estimate", "-", "--input-format", "jsonl"], good.as_bytes());
    let alone = records(&alone.stdout);
    assert_eq!((&alone[0], &alone[3]), (&all[0], &all[3]));
    assert!(!folder.path().join("out.jsonl.part").exists());
}

#[test]
fn where_nothing_can_be_read_it_is_bad_input() {
    let run = run_in(Path::new("."), &["estimate", "-", "--input-format", "jsonl"], b"{\n[1]\n");
    assert_eq!((run.status, run.stdout.lines().count()), (2, 2), "{}", run.stderr);
}

#[test]
fn a_run_goes_on_where_it_was_ended() {
    let folder = directory_with("pairs.jsonl", four());
    let whole = records(&run_in(folder.path(), &["estimate", "pairs.jsonl"], b"").stdout);
    run_in(folder.path(), &["estimate", "pairs.jsonl", "-o", "whole.jsonl"], b"");
    let text = fs::read_to_string(folder.path().join("whole.jsonl")).unwrap();
    let lines: Vec<_> = text.lines().collect();
    // Ended within the third record.
    fs::write(folder.path().join("out.jsonl.part"), format!("{}\n{}\n{{\"na", lines[0], lines[1])).unwrap();
    let run = run_in(folder.path(), &["estimate", "pairs.jsonl", "-o", "out.jsonl", "--resume"], b"");
    assert_eq!(run.status, 1, "{}", run.stderr);
    assert_eq!(records(&fs::read_to_string(folder.path().join("out.jsonl")).unwrap()), whole);
    // Nothing is left to do but what has no pose, which counts.
    let again = run_in(folder.path(), &["estimate", "pairs.jsonl", "-o", "out.jsonl", "--resume"], b"");
    assert_eq!(again.status, 1, "{}", again.stderr);
    assert_eq!(records(&fs::read_to_string(folder.path().join("out.jsonl")).unwrap()), whole);
}

#[test]
fn a_part_of_a_file_has_the_answers_of_the_whole() {
    let pairs = [pair("a", 100), pair("b", 95), pair("c", 90)];
    let run = |text: &str, more: &[&str]| {
        let arguments = [&["estimate", "-", "--input-format", "jsonl"], more].concat();
        records(&run_in(Path::new("."), &arguments, text.as_bytes()).stdout)
    };
    let whole = run(&pairs.join("\n"), &["--threads", "1"]);
    assert_eq!(run(&pairs[2], &["--first-index", "2", "--threads", "3"]), whole[2..]);
}

#[test]
fn a_pixel_without_a_ray_is_an_outlier() {
    let mut file: serde_json::Value = serde_json::from_str(&pair("a", 100)).unwrap();
    file["camera1"] = serde_json::json!({"model": "SIMPLE_RADIAL", "params": [500, 320, 240, -0.05]});
    file["camera2"] = file["camera1"].clone();
    let clean = run_in(Path::new("."), &["estimate", "-", "--format", "json"], file.to_string().as_bytes());
    file["matches"].as_array_mut().unwrap().push(serde_json::json!([1e5, 0, 10, 10]));
    let text = file.to_string();
    let run = |invalid: &str| {
        run_in(Path::new("."), &["estimate", "-", "--format", "json", "--invalid", invalid], text.as_bytes())
    };
    let (clean, found) = (clean.stdout, run("outlier"));
    let [clean, found]: [serde_json::Value; 2] =
        [clean, found.stdout].map(|text| serde_json::from_str(&text).unwrap());
    assert_eq!((&found["q_21"], &found["invalid_count"]), (&clean["q_21"], &1.into()));
    assert_eq!(found["inliers"][100], false);
    let (pair, raise) = (run("pair"), run("raise"));
    assert_eq!((pair.status, raise.status), (1, 2), "{} {}", pair.stderr, raise.stderr);
    assert!(raise.stderr.contains("matches[100]"), "{}", raise.stderr);
}

/// The records of a line of JSON Lines, and of a file, with one coordinate replaced by `text`.
fn with_gap(text: &str) -> [Run; 2] {
    let mut file: serde_json::Value = serde_json::from_str(&pair("a", 100)).unwrap();
    file["matches"].as_array_mut().unwrap().push(serde_json::json!([10, "GAP", 10, 10]));
    let json = file.to_string().replace("\"GAP\"", text);
    let run = |more: &[&str]| {
        run_in(Path::new("."), &[&["estimate", "-", "--format", "jsonl"], more].concat(), json.as_bytes())
    };
    [run(&["--input-format", "jsonl"]), run(&["--input-format", "json"])]
}

#[test]
fn a_number_that_json_does_not_have_is_an_outlier() {
    let clean = run_in(
        Path::new("."),
        &["estimate", "-", "--input-format", "jsonl", "--format", "jsonl"],
        pair("a", 100).as_bytes(),
    );
    let clean = &records(&clean.stdout)[0];
    for text in ["null", "NaN", "-Infinity"] {
        for run in with_gap(text) {
            assert_eq!(run.status, 0, "{text}: {}", run.stderr);
            let found = &records(&run.stdout)[0];
            assert_eq!((&found["q_21"], &found["t_21"]), (&clean["q_21"], &clean["t_21"]), "{text}");
            assert_eq!((&found["invalid_count"], &found["inliers"][100]), (&1.into(), &false.into()));
        }
    }
}

#[test]
fn a_number_that_csv_does_not_have_is_an_outlier() {
    let rows = || {
        (0..40).map(|i| {
            let (x, y) = (f64::from(i % 8) * 0.1, f64::from(i / 8) * 0.1);
            let z = 1.0 + 0.07 * f64::from(i * 7 % 11);
            format!("{x},{y},{},{}", x + 0.1 / z, y + 0.03 / z)
        })
    };
    let estimate = |extra: &[&str], more: &[&str]| {
        let text = ["u1,v1,u2,v2".to_owned()]
            .into_iter()
            .chain(rows())
            .chain(extra.iter().map(|&row| row.to_owned()));
        let text = text.collect::<Vec<_>>().join("\n");
        let arguments = [&["estimate", "-", "--threshold", "1e-4", "--format", "json"], more].concat();
        run_in(Path::new("."), &arguments, text.as_bytes())
    };
    let json = |run: &Run| serde_json::from_str::<serde_json::Value>(&run.stdout).unwrap();
    let clean = json(&estimate(&[], &[]));
    let run = estimate(&["NaN,0,0,0", "0,,0,0", "0,0,-inf,0"], &[]);
    let found = json(&run);
    assert_eq!((run.status, &found["q_21"], &found["invalid_count"]), (0, &clean["q_21"], &3.into()));
    let raise = estimate(&["0,,0,0"], &["--invalid", "raise"]);
    assert_eq!(raise.status, 2);
    assert!(raise.stderr.contains(":42: v1: found \"\", expected a finite number"), "{}", raise.stderr);
    assert_eq!(estimate(&["0,,0,0"], &["--invalid", "pair"]).status, 1);
    assert_eq!(estimate(&["0,x,0,0"], &[]).status, 2);
}

#[test]
fn a_refusal_tells_of_the_matches_that_were_left_out() {
    let rows = "u1,v1,u2,v2\n0,0,0,0\n0.1,0,0.2,0\n0,0.3,0.1,0.2\n0.2,0.1,0.4,0\nNaN,0,0,0\n";
    let run = run_in(Path::new("."), &["estimate", "-", "--threshold", "1e-3"], rows.as_bytes());
    let expected = "; 1 of 5 matches had no bearing and were left out\n";
    assert!(run.status == 2 && run.stderr.ends_with(expected), "{}", run.stderr);
}

#[test]
fn a_nan_and_a_pixel_without_a_ray_spoil_no_other_pair() {
    let barrel = |name: &str, points, spoil: Option<(&str, serde_json::Value)>| {
        let mut file: serde_json::Value = serde_json::from_str(&pair(name, points)).unwrap();
        file["camera1"] = serde_json::json!({"model": "SIMPLE_RADIAL", "params": [500, 320, 240, -0.05]});
        file["camera2"] = file["camera1"].clone();
        if let Some((_, spoiled)) = &spoil {
            file["matches"][7][0] = spoiled.clone();
        }
        let text = file.to_string();
        spoil.map_or(text.clone(), |(word, _)| text.replace("\"GAP\"", word))
    };
    let run = |lines: &[String]| {
        let arguments = ["estimate", "-", "--input-format", "jsonl", "--format", "jsonl"];
        records(&run_in(Path::new("."), &arguments, lines.join("\n").as_bytes()).stdout)
    };
    let mut lines: Vec<_> = (0..9).map(|k| barrel(&k.to_string(), 60 + 5 * k, None)).collect();
    let clean = run(&lines);
    lines[3] = barrel("3", 75, Some(("NaN", "GAP".into())));
    lines[6] = barrel("6", 90, Some(("", 1e5.into())));
    let found = run(&lines);
    for (k, (clean, found)) in clean.iter().zip(&found).enumerate() {
        if matches!(k, 3 | 6) {
            assert_eq!((&found["invalid_count"], &found["inliers"][7]), (&1.into(), &false.into()));
            assert!(found["q_21"].is_array(), "{found}");
        } else {
            assert_eq!(clean, found);
        }
    }
    assert_eq!(found.len(), 9);
}
