//! `quest-cli simulate`: the same numbers on any number of threads, sound records, charts, bad arguments.

use std::{collections::BTreeSet, fs, path::Path};

use crate::{run, run_in};

/// A few scenes of figure 6: general and coplanar points by turns, parallax from 0.
const QUICK: [&str; 7] = ["simulate", "--figure", "6", "--trials", "3", "--solvers", "quest,nister"];

/// The rows of a CSV file, as the values of their columns by name.
fn rows(text: &str) -> Vec<std::collections::BTreeMap<String, String>> {
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    reader.deserialize().map(Result::unwrap).collect()
}

#[test]
fn numbers_do_not_depend_on_the_number_of_threads() {
    let on = |threads: &str| {
        let found = run(&[&QUICK[..], &["--format", "csv", "--threads", threads]].concat());
        assert_eq!(found.status, 0, "{}", found.stderr);
        found.stdout
    };
    let one = on("1");
    assert_eq!(one, on("3"));
    let other = run(&[&QUICK[..], &["--format", "csv", "--seed", "2"]].concat());
    assert_ne!(one, other.stdout);
}

#[test]
fn every_value_solver_and_reading_has_its_numbers() {
    let rows = rows(&run(&[&QUICK[..], &["--format", "csv"]].concat()).stdout);
    // 101 values, two solvers, three readings, rotation and translation.
    assert_eq!(rows.len(), 101 * 2 * 3 * 2);
    for row in &rows {
        let number = |key: &str| row[key].parse::<f64>().unwrap();
        assert!(row["trials"] == "3" && number("unanswered") <= 3.0);
        if number("unanswered") < 3.0 {
            assert!((0.0..1.6).contains(&number("mean")) && number("ci95") >= 0.0, "{row:?}");
        }
        if row["quantity"] == "translation_rad" && number("value") == 0.0 {
            assert!(number("mean") == 0.0);
        }
    }
    // More candidates cannot be further from the truth.
    for pair in rows.iter().filter(|r| r["reading"] == "exact" && r["unanswered"] == "0") {
        let all = rows.iter().find(|r| {
            r["reading"] == "all" && ["value", "solver", "quantity"].iter().all(|key| r[*key] == pair[*key])
        });
        let [exact, all] = [pair, all.unwrap()].map(|r| r["mean"].parse::<f64>().unwrap());
        assert!(all <= exact, "{pair:?}");
    }
}

#[test]
fn every_solver_is_timed_beside_the_paper() {
    let found = run(&["simulate", "--table", "1", "--trials", "2", "--format", "csv"]);
    let rows = rows(&found.stdout);
    let names: BTreeSet<&str> = rows.iter().map(|row| row["solver"].as_str()).collect();
    assert!(["quest", "quest-eigen", "nister", "stewenius"].iter().all(|name| names.contains(name)));
    for row in &rows {
        assert!(row["smallest"].parse::<f64>().unwrap() > 0.0 && row["quantity"] == "time_ms");
    }
    let quest = rows.iter().find(|row| row["solver"] == "quest").unwrap();
    assert_eq!(quest["paper"], "0.8857");
    // The paper's steps as printed, at each of its numbers of points.
    let literal = rows.iter().filter(|row| row["solver"].ends_with("-literal"));
    let literal: Vec<_> = literal.map(|row| (row["value"].as_str(), row["paper"].as_str())).collect();
    assert_eq!(literal, [("5.0", "0.8857"), ("5.0", "41.511"), ("6.0", "11.2461"), ("7.0", "0.9355")]);
}

#[test]
fn results_and_charts_are_files() {
    let directory = tempfile::tempdir().unwrap();
    let base = ["simulate", "--figure", "7", "--trials", "2", "--solvers", "quest,homography"];
    for plot in ["a.svg", "a.html"] {
        let found = run_in(directory.path(), &[&base[..], &["-o", "a.csv", "--plot", plot]].concat(), b"");
        assert_eq!((found.status, found.stdout.as_str(), found.stderr.as_str()), (0, "", ""));
        let text = fs::read_to_string(directory.path().join(plot)).unwrap();
        assert!(text.contains("Figure 7") && text.contains("homography"));
        assert!(!plot.ends_with("svg") || !text.contains("NaN"));
    }
    assert_eq!(rows(&fs::read_to_string(directory.path().join("a.csv")).unwrap()).len(), 101 * 2 * 3);
}

#[test]
fn the_table_shows_confidence_intervals() {
    let found = run(&QUICK);
    assert!(found.stdout.starts_with("Figure 6") && found.stdout.contains('±'));
    assert!(found.stdout.contains("chosen by 30 more points"));
    // No bar where standard error is no terminal.
    assert_eq!(found.stderr, "");
}

#[test]
fn bad_arguments_are_named() {
    for (arguments, expected) in [
        (&["--figure", "3"][..], "4, 5, 6, 7 or 8"),
        (&["--table", "2"], "2 is not in 1..=1"),
        (&["--figure", "4", "--trials", "0"], "0 is not in"),
        (&["--figure", "4", "--plot", "a.gif"], ".svg, .png, .pdf or .html"),
        (&["--figure", "4", "--solvers", "eight-point"], "eight-point needs 8 points"),
        (&["--figure", "4", "--solvers", "none"], "none"),
        (&["--figure", "4", "--trials", "1", "-o", "/no/such/directory/a.csv"], "/no/such/directory/a.csv"),
        (
            &["--figure", "4", "--trials", "1", "--plot", "/no/such/directory/a.svg"],
            "/no/such/directory/a.svg",
        ),
    ] {
        let found = run(&[&["simulate"], arguments].concat());
        assert_eq!((found.status, found.stdout.as_str()), (2, ""), "{arguments:?}");
        assert!(found.stderr.contains(expected), "{arguments:?}: {}", found.stderr);
    }
}

#[test]
fn scenes_are_pairs_that_solve_reads() {
    let arguments = ["simulate", "--pairs", "3", "--seed", "7", "--scenes", "realistic"];
    let lines =
        run(&[&arguments[..], &["--points-box", "-1,1,-1,1,5,9", "--translation-box", "1,0,0.5"]].concat());
    assert_eq!((lines.status, lines.stdout.lines().count(), lines.stderr.as_str()), (0, 3, ""));
    for line in lines.stdout.lines() {
        let pair: serde_json::Value = serde_json::from_str(line).unwrap();
        assert_eq!(pair["t_21"][1], 0.0);
    }
    let solved = run_in(
        Path::new("."),
        &["solve", "-", "--input-format", "jsonl", "--quiet"],
        lines.stdout.as_bytes(),
    );
    assert_eq!(solved.status, 0, "{}", solved.stderr);
    for line in solved.stdout.lines() {
        let result: serde_json::Value = serde_json::from_str(line).unwrap();
        let errors = result["candidates"]
            .as_array()
            .unwrap()
            .iter()
            .map(|c| c["rotation_error_deg"].as_f64().unwrap());
        assert!(errors.fold(f64::INFINITY, f64::min) < 1e-6);
    }
    let impossible = [
        &["--points-box", "1,-1,-1,1,2,4"][..],
        &["--points-box", "1,2"],
        &["--translation-box", "0,0,0"],
        &["--figure", "4"],
        &["--format", "csv"],
        &["--format", "json"],
        &["--outliers", "1.5"],
        &["--parallax", "-0.1"],
        // Without effect.
        &["--threads", "2"],
        &["--solvers", "quest"],
        &["--kinds", "all"],
    ];
    for wrong in impossible {
        let refused = run(&[&arguments[..], wrong].concat());
        assert!(refused.status == 2 && !refused.stderr.is_empty(), "{wrong:?} {}", refused.stderr);
    }
    for alone in [&["--noise", "1"][..], &["--outliers", "0.1"], &["--parallax", "0.1"], &["--coplanar"]] {
        assert_eq!(run(&[&["simulate"], alone].concat()).status, 2, "{alone:?}");
        let beside = run(&[&["simulate", "--figure", "4", "--trials", "1"], alone].concat());
        assert_eq!(beside.status, 2, "{alone:?}");
    }
}

#[test]
fn a_plot_of_no_figure_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let run = run_in(folder.path(), &["simulate", "--table", "1", "--trials", "1", "--plot", "a.svg"], b"");
    assert!(run.status == 2 && run.stderr.contains("expected a --figure to draw"), "{}", run.stderr);
    assert!(!folder.path().join("a.svg").exists());
}

#[test]
fn a_planted_pair_is_estimated() {
    let folder = tempfile::tempdir().unwrap();
    let planted = [
        "simulate",
        "--pairs",
        "1",
        "--scenes",
        "realistic",
        "--points",
        "200",
        "--noise",
        "0.5",
        "-o",
        "a.json",
    ];
    let estimated = |more: &[&str]| {
        let run = run_in(folder.path(), &[&planted[..], more].concat(), b"");
        assert_eq!((run.status, run.stdout.as_str(), run.stderr.as_str()), (0, "", ""));
        // The camera gives the threshold its unit.
        let run = run_in(folder.path(), &["estimate", "a.json", "--format", "json"], b"");
        assert_eq!((run.status, run.stderr.as_str()), (0, ""));
        serde_json::from_str::<serde_json::Value>(&run.stdout).unwrap()
    };
    let found = estimated(&["--outliers", "0.4", "--parallax", "0.2"]);
    assert!(found["rotation_error_deg"].as_f64().unwrap() < 0.2, "{found}");
    assert!((found["parallax"].as_f64().unwrap() - 0.2).abs() < 0.05, "{}", found["parallax"]);
    let inliers = found["inlier_count"].as_u64().unwrap();
    assert!((90..=126).contains(&inliers), "{inliers} of 120 with the threshold at two deviations");
    let pair: serde_json::Value =
        serde_json::from_slice(&fs::read(folder.path().join("a.json")).unwrap()).unwrap();
    assert_eq!(pair["camera1"]["params"], serde_json::json!([1060.0, 1060.0, 514.0, 384.0]));
    let t = pair["t_21"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap().powi(2)).sum::<f64>().sqrt();
    assert!((t - 0.2).abs() < 1e-9, "{t}");
    assert_eq!(estimated(&["--coplanar"])["model"], "planar");
    assert_eq!(estimated(&["--parallax", "0"])["model"], "pure_rotation");
}
