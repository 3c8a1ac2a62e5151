//! The answers of `estimate`.

use serde_json::{Value, json};

use super::*;

/// Matches of a camera that moves by `t_21` past points in space; every third is false where `outliers`.
fn pair(t_21: [f64; 3], count: u32, outliers: bool) -> Value {
    let matches: Vec<_> = (0..count)
        .map(|i| {
            // A lattice without planes: multiples of irrational numbers.
            let f = |a: f64| (f64::from(i) * a).fract() - 0.5;
            let x1 = [2.0 * f(0.618_034), 2.0 * f(0.754_878), 4.0 + f(0.569_840) * 2.0];
            let x2 = [x1[0] + t_21[0], x1[1] + t_21[1], x1[2] + t_21[2]];
            let pixel = |x: [f64; 3]| [1000.0 * x[0] / x[2] + 500.0, 1000.0 * x[1] / x[2] + 400.0];
            let (u1, u2) = (pixel(x1), pixel(x2));
            if outliers && i % 3 == 0 {
                let noise = |a: f64| ((f64::from(i) * a).sin() * 43_758.545).rem_euclid(1.0);
                return [
                    1000.0 * noise(12.9),
                    800.0 * noise(78.2),
                    1000.0 * noise(37.7),
                    800.0 * noise(93.1),
                ];
            }
            [u1[0], u1[1], u2[0], u2[1]]
        })
        .collect();
    json!({
        "camera1": {"model": "PINHOLE", "width": 1000, "height": 800, "params": [1000, 1000, 500, 400]},
        "matches": matches, "q_21": [1, 0, 0, 0], "t_21": t_21,
    })
}

fn estimated(pair: &Value, arguments: &[&str]) -> (Run, Value) {
    let all = [&["estimate", "-", "--format", "json"], arguments].concat();
    let run = run_in(Path::new("."), &all, pair.to_string().as_bytes());
    let result = serde_json::from_str(&run.stdout).unwrap_or_default();
    (run, result)
}

#[test]
fn a_planted_pose_is_found_among_outliers() {
    let (run, result) = estimated(&pair([0.5, 0.1, -0.2], 90, true), &[]);
    assert_eq!((run.status, run.stderr.as_str()), (0, ""));
    let number = |key: &str| result[key].as_f64().unwrap();
    assert!(number("rotation_error_deg") < 1e-6 && number("translation_error_deg") < 1e-6);
    assert_eq!(result["model"], "general");
    let inliers = result["inliers"].as_array().unwrap();
    assert_eq!(inliers.len(), 90);
    assert_eq!(result["inlier_count"], inliers.iter().filter(|i| **i == json!(true)).count());
    assert!((60.0..66.0).contains(&number("inlier_count")));
    assert!(number("parallax") > 0.1 && number("score") > 0.6 && number("iterations") >= 1.0);
    assert_eq!(result["covariance"].as_array().map(Vec::len), Some(6));
    assert!(result["evidence"]["rotation_px"].as_f64() > result["evidence"]["general_px"].as_f64());
    assert_eq!(result["runner_up"], Value::Null);
    assert!(number("elapsed_ms") > 0.0);
}

#[test]
fn the_keys_are_those_of_the_interface() {
    let (_, result) = estimated(&pair([0.5, 0.1, -0.2], 60, false), &[]);
    let keys: Vec<_> = result.as_object().unwrap().keys().map(String::as_str).collect();
    let all = "model q_21 R_21 t_21 parallax covariance inliers inlier_count score iterations runner_up evidence normal false_share unmoved elapsed_ms \
               rotation_error_deg translation_error_deg";
    assert!(all.split(' ').all(|key| keys.contains(&key)), "{keys:?}");
}

#[test]
fn the_same_seed_gives_the_same_answer() {
    let answer = |seed: &str| {
        let (_, mut result) = estimated(&pair([0.5, 0.1, -0.2], 60, true), &["--seed", seed]);
        result.as_object_mut().unwrap().remove("elapsed_ms");
        result
    };
    assert_eq!(answer("3"), answer("3"));
}

#[test]
fn a_turn_in_place_has_no_translation() {
    let (run, result) = estimated(&pair([0.0; 3], 60, true), &[]);
    assert_eq!((run.status, &result["model"]), (0, &json!("pure_rotation")));
    // A hundredth of a pixel, the least noise that is assumed, would make 1e-5.
    assert!(result["parallax"].as_f64().unwrap() < 1e-5);
}

#[test]
fn false_matches_have_no_pose() {
    let mut false_ones = pair([0.5, 0.1, -0.2], 120, true);
    let all = false_ones["matches"].as_array().unwrap();
    false_ones["matches"] = all.iter().step_by(3).cloned().collect();
    let (run, result) = estimated(&false_ones, &["--max-iterations", "2000"]);
    assert_eq!((run.status, &result["model"]), (1, &Value::Null));
    assert!(run.stderr.starts_with("no pose: standard input: the best one agrees with "), "{}", run.stderr);
    assert!(result["reason"].as_str().unwrap().contains("of 40 matches"));
    let (run, _) = estimated(&false_ones, &["--max-iterations", "2000", "--max-false-alarms", "inf"]);
    assert_eq!(run.status, 0);
}

#[test]
fn a_threshold_in_another_unit_is_named() {
    let all = pair([0.5, 0.1, -0.2], 60, true);
    let unit =
        "the threshold of 0.0001 is less than the noise of nearly all matches: with cameras it is in pixels";
    let mut noisy = all.clone();
    for (k, row) in noisy["matches"].as_array_mut().unwrap().iter_mut().enumerate() {
        row[3] = json!(row[3].as_f64().unwrap() + 0.3 * (7.0 * k as f64).sin());
    }
    let (run, result) = estimated(&noisy, &["--threshold", "0.0001"]);
    assert_eq!(run.status, 1, "{}", run.stdout);
    assert!(run.stderr.contains(unit) && result["reason"].as_str().unwrap().contains(unit), "{}", run.stderr);
    // Not where it is right, and not where there are too few right matches.
    let (run, _) = estimated(&all, &["--threshold", "0.0001", "--max-false-alarms", "inf"]);
    assert!(!run.stderr.contains(unit), "{}", run.stderr);
}

#[test]
fn lines_are_answered_one_by_one() {
    let mut wrong = pair([0.5, 0.1, -0.2], 120, true);
    wrong["matches"] = wrong["matches"].as_array().unwrap().iter().step_by(3).cloned().collect();
    let right = pair([0.5, 0.1, -0.2], 60, false);
    let lines = format!("{right}\n{wrong}\n{right}\n");
    let arguments = ["estimate", "-", "--max-iterations", "1000"];
    let run = run_in(Path::new("."), &arguments, lines.as_bytes());
    let models: Vec<_> = run
        .stdout
        .lines()
        .map(|line| serde_json::from_str::<Value>(line).unwrap()["model"].clone())
        .collect();
    assert_eq!(models, [json!("general"), Value::Null, json!("general")]);
    assert_eq!((run.status, run.stderr.lines().count()), (1, 1));
}

#[test]
fn bad_input_is_refused() {
    let mut four = pair([0.5, 0.1, -0.2], 4, false);
    let (run, _) = estimated(&four, &[]);
    assert_eq!(run.status, 2);
    assert!(run.stderr.contains("found 4 matches, expected at least 5"), "{}", run.stderr);

    four = pair([0.5, 0.1, -0.2], 20, false);
    for (arguments, word) in [
        (["--threshold", "-1"], "threshold is -1"),
        (["--threshold", "NaN"], "threshold is NaN"),
        (["--confidence", "1"], "confidence is 1"),
        (["--max-iterations", "0"], "iterations"),
        (["--max-false-alarms", "0"], "number of false alarms is 0"),
        (["--solver", "orb"], "orb"),
    ] {
        let (run, _) = estimated(&four, &arguments);
        assert_eq!((run.status, run.stdout.as_str()), (2, ""), "{arguments:?}");
        assert!(run.stderr.contains(word), "{arguments:?}: {}", run.stderr);
    }
}

#[test]
fn points_without_cameras_need_a_threshold() {
    let arguments = ["estimate", &example("points.csv")];
    let refused = run(&arguments);
    assert_eq!(refused.status, 2);
    assert!(refused.stderr.contains("--threshold"), "{}", refused.stderr);
    let found = run(&[&arguments[..], &["--threshold", "0.001"]].concat());
    assert_eq!((found.status, found.stderr.as_str()), (0, ""));
    // Five matches have more than one pose.
    assert!(found.stdout.contains("runner-up") && found.stdout.contains("z = 1"), "{}", found.stdout);
}

#[test]
fn tables_and_rows() {
    let text = pair([0.5, 0.1, -0.2], 60, true).to_string();
    let with = |format: &str| run_in(Path::new("."), &["estimate", "-", "--format", format], text.as_bytes());
    let table = with("table");
    assert!(table.stdout.starts_with("standard input: 60 matches, "), "{}", table.stdout);
    assert!(table.stdout.contains("general") && table.stdout.contains("noise"));
    let csv = with("csv");
    let rows: Vec<_> = csv.stdout.lines().collect();
    assert_eq!(rows.len(), 2);
    assert_eq!(rows[0].split(',').count(), rows[1].split(',').count());
    assert!(rows[0].starts_with("pair,name,model,qw"));
}

/// Twenty points on a line in view 1, and where `view2` takes them.
fn on_a_line(view2: impl Fn(f64) -> [f64; 2]) -> Value {
    let mut line = pair([0.5, 0.1, -0.2], 1, false);
    let matches: Vec<_> = (0..20)
        .map(|i| {
            let s = f64::from(i);
            let [u2, v2] = view2(s);
            [100.0 + 30.0 * s, 200.0 + 10.0 * s, u2, v2]
        })
        .collect();
    line["matches"] = json!(matches);
    line
}

#[test]
fn matches_that_determine_no_pose_are_refused_with_the_reason() {
    let both = on_a_line(|s| [150.0 + 20.0 * s + s * s, 300.0 + 10.0 * s + 0.5 * s * s]);
    let same = on_a_line(|_| [400.0, 300.0]);
    for (degenerate, reason) in [(&both, "lie on a line"), (&same, "coincide")] {
        let (run, _) = estimated(degenerate, &[]);
        assert_eq!((run.status, run.stdout.as_str()), (2, ""), "{reason}");
        assert!(run.stderr.contains(reason), "{}", run.stderr);
    }
    // On a line in view 1, anywhere in view 2.
    let (run, result) = estimated(&on_a_line(|s| [(s * 337.0) % 1000.0, (s * 253.0) % 800.0]), &[]);
    assert_eq!((run.status, &result["model"], &result["q_21"]), (1, &Value::Null, &Value::Null));
    // Among lines they are no reason to stop.
    let lines = format!("{both}\n{}\n", pair([0.5, 0.1, -0.2], 60, false));
    let run = run_in(Path::new("."), &["estimate", "-"], lines.as_bytes());
    let results: Vec<Value> = run.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!((run.status, results.len()), (1, 2));
    assert_eq!((&results[0]["model"], &results[0]["q_21"]), (&json!("degenerate"), &Value::Null));
    assert!(results[0]["reason"].as_str().unwrap().contains("line"));
    assert_eq!(results[1]["model"], "general");
}

#[test]
fn lines_keep_their_order_and_have_random_numbers_of_their_own() {
    let noisy = pair([0.5, 0.1, -0.2], 60, true);
    let lines: Vec<_> = (0..40)
        .map(|i| {
            let mut line = if i % 7 == 0 { pair([0.5, 0.1, -0.2], 300, true) } else { noisy.clone() };
            line["name"] = json!(format!("pair {i}"));
            line.to_string()
        })
        .collect();
    let run = run_in(Path::new("."), &["estimate", "-"], lines.join("\n").as_bytes());
    let results: Vec<Value> = run.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!((run.status, results.len()), (0, 40));
    for (i, result) in results.iter().enumerate() {
        assert_eq!(result["name"], format!("pair {i}"));
    }
    // The first line is what the pair alone gives.
    let (_, alone) = estimated(&pair([0.5, 0.1, -0.2], 300, true), &[]);
    assert_eq!(results[0]["t_21"], alone["t_21"]);
}

#[test]
fn a_third_view_decides_between_the_poses_of_a_plane() {
    // Points of a slanted plane, seen by cameras that were moved by t.
    let seen = |t: [f64; 3], order: &dyn Fn(u32) -> u32| {
        let mut views = pair(t, 1, false);
        let matches: Vec<_> = (0..50)
            .map(|i| {
                let f = |a: f64| (f64::from(order(i)) * a).fract() - 0.5;
                let (x, y) = (2.0 * f(0.618_034), 1.6 * f(0.754_878));
                let x1 = [x, y, 4.0 + 0.5 * x - 0.3 * y];
                let pixel = |x: [f64; 3]| [1000.0 * x[0] / x[2] + 500.0, 1000.0 * x[1] / x[2] + 400.0];
                let (u1, u2) = (pixel(x1), pixel([x1[0] + t[0], x1[1] + t[1], x1[2] + t[2]]));
                [u1[0], u1[1], u2[0], u2[1]]
            })
            .collect();
        views["matches"] = json!(matches);
        views
    };
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("12.json"), seen([0.4, 0.1, -0.3], &|i| i).to_string()).unwrap();
    fs::write(folder.path().join("13.json"), seen([-0.3, 0.3, 0.2], &|i| 60 - i).to_string()).unwrap();
    let with = |format: &str| {
        run_in(folder.path(), &["estimate", "12.json", "--third", "13.json", "--format", format], b"")
    };
    let run = with("json");
    assert_eq!((run.status, run.stderr.as_str()), (0, ""));
    let result: Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!(result["model"], "planar");
    assert!(result["rotation_error_deg"].as_f64().unwrap() < 0.01, "{result}");
    let third = &result["third_view"];
    assert!(third["disagreement"].as_f64().unwrap() < 0.1, "{third}");
    assert!((third["q_31"][0].as_f64().unwrap() - 1.0).abs() < 1e-6);
    // |(−0.3, 0.3, 0.2)| / |(0.4, 0.1, −0.3)| = √(22/26)
    assert!((third["ratio"].as_f64().unwrap() - (22.0_f64 / 26.0).sqrt()).abs() < 0.01, "{third}");
    assert!(with("table").stdout.contains("third view"));

    let lines =
        run_in(folder.path(), &["estimate", "-", "--input-format", "jsonl", "--third", "13.json"], b"");
    assert_eq!(lines.status, 2);
    assert!(lines.stderr.contains("--third"), "{}", lines.stderr);
    let missing = run_in(folder.path(), &["estimate", "12.json", "--third", "14.json"], b"");
    assert_eq!(missing.status, 2);
    assert!(missing.stderr.contains("14.json"), "{}", missing.stderr);
}

#[test]
fn every_search_takes_the_same_options() {
    let options = |arguments: &[&str]| -> Vec<String> {
        let help = run(arguments).stdout;
        let all = help.lines().filter_map(|line| line.trim_start().split_once("--"));
        all.map(|(_, rest)| rest.split([' ', ',']).next().unwrap_or_default().to_owned()).collect()
    };
    let [estimate, verify, export] = [
        options(&["estimate", "--help"]),
        options(&["colmap", "verify", "--help"]),
        options(&["colmap", "export", "--help"]),
    ];
    let searching = [
        "threshold",
        "confidence",
        "min-iterations",
        "max-iterations",
        "max-false-alarms",
        "seed",
        "solver",
        "loss",
    ];
    for option in searching {
        let has = |all: &[String]| all.iter().any(|one| one == option);
        assert!(has(&estimate), "estimate --{option}: {estimate:?}");
        if cfg!(feature = "colmap") {
            assert!(has(&verify) && has(&export), "colmap --{option}: {verify:?} {export:?}");
        }
    }
}

/// The options are one text with other defaults: those of COLMAP are 10,000 samples and a confidence of 0.999.
#[test]
fn every_search_has_its_own_defaults() {
    let default_of = |arguments: &[&str], option: &str| -> String {
        let help = run(arguments).stdout;
        let (_, after) = help.split_once(option).expect(option);
        let (_, default) = after.split_once("[default: ").expect("a default");
        default.split(']').next().unwrap_or_default().to_owned()
    };
    assert_eq!(default_of(&["estimate", "--help"], "--max-iterations"), "100000");
    assert_eq!(default_of(&["estimate", "--help"], "--confidence"), "0.9999");
    if cfg!(feature = "colmap") {
        for command in ["verify", "export"] {
            assert_eq!(default_of(&["colmap", command, "--help"], "--max-iterations"), "10000");
            assert_eq!(default_of(&["colmap", command, "--help"], "--confidence"), "0.999");
        }
    }
}

#[test]
fn at_least_and_at_most_so_many_samples_are_drawn() {
    let pair = pair([0.5, 0.1, -0.2], 90, false);
    let iterations = |arguments: &[&str]| estimated(&pair, arguments).1["iterations"].as_u64().unwrap();
    assert!(iterations(&["--min-iterations", "2000"]) >= 2000);
    assert!(iterations(&["--min-iterations", "1", "--max-iterations", "20"]) <= 20);
}

#[test]
fn an_initial_pose_needs_no_sample() {
    let pair = pair([0.5, 0.1, -0.2], 90, true);
    let limits = ["--min-iterations", "1", "--max-iterations", "1", "--initial-pose"];
    let (run, result) = estimated(&pair, &[&limits[..], &["1,0.001,0,0,0.5,0.1,-0.2"]].concat());
    assert_eq!((run.status, run.stderr.as_str()), (0, ""));
    assert!(
        result["rotation_error_deg"].as_f64().unwrap() < 1e-6 && result["inlier_count"].as_u64() >= Some(60)
    );
    let (run, _) = estimated(&pair, &["--initial-pose", "1,0,0"]);
    assert!(run.status == 2 && run.stderr.contains("W,X,Y,Z,TX,TY,TZ"), "{}", run.stderr);
    let line = pair.to_string() + "\n";
    let arguments = ["estimate", "-", "--input-format", "jsonl", "--initial-pose", "1,0,0,0,1,0,0"];
    let run = run_in(Path::new("."), &arguments, line.as_bytes());
    assert!(run.status == 2 && run.stderr.contains("several pairs and --initial-pose"), "{}", run.stderr);
}

#[test]
fn a_known_direction_rules_poses_out() {
    let pair = pair([0.5, 0.1, -0.2], 90, true);
    let (run, result) = estimated(&pair, &["--known-direction", "0,1,0,2"]);
    assert!(run.status == 0 && result["rotation_error_deg"].as_f64().unwrap() < 1e-6, "{}", run.stderr);
    // Nothing turned: no pose of these matches takes x to y.
    let (run, result) = estimated(&pair, &["--known-direction", "1,0,0,0,1,0,5", "--max-iterations", "2000"]);
    assert_eq!((run.status, &result["model"]), (1, &Value::Null), "{}", run.stderr);
}
