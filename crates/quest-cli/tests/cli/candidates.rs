//! The answers of `solve`.

use serde_json::{Value, json};

use super::*;

#[track_caller]
fn solved(arguments: &[&str]) -> (Run, Value) {
    let run = run(&[&["solve", "--format", "json"], arguments].concat());
    let result = serde_json::from_str(&run.stdout).unwrap();
    (run, result)
}

fn candidates(result: &Value) -> &[Value] {
    result["candidates"].as_array().unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

/// Matches that coincide in view 1.
fn coincident() -> Value {
    json!([
        [0.1, 0.1, 0.1, 0.2],
        [0.1, 0.1, 0.2, 0.1],
        [0.1, 0.1, 0.3, 0.5],
        [0.1, 0.1, 0.4, 0.3],
        [0.1, 0.1, 0.2, 0.4]
    ])
}

/// A file with these matches, solved.
fn solve_matches(matches: &Value, arguments: &[&str]) -> Run {
    let text = json!({ "matches": matches }).to_string();
    run_in(Path::new("."), &[&["solve", "-", "--solver", "quest-eigen"], arguments].concat(), text.as_bytes())
}

#[test]
fn the_planted_pose_is_found_with_its_length() {
    let (run, result) = solved(&[&example("points.json")]);
    assert_eq!((run.status, &result["degeneracy"]), (0, &Value::Null));
    let error = |c: &Value, key: &str| c[key].as_f64().unwrap();
    let found = candidates(&result)
        .iter()
        .find(|c| error(c, "rotation_error_deg") < 1e-6 && error(c, "translation_error_deg") < 1e-6)
        .unwrap();
    assert_eq!(
        (&found["kind"], &found["in_front"], &found["feasible"]),
        (&json!("exact"), &json!(5), &json!(true))
    );
    assert!(found["residual"].as_f64().unwrap() < 1e-12);
    // The planted translation has the length that solvers give it.
    for (t, truth) in numbers(&found["t_21"]).iter().zip([0.3, -0.1, 0.2]) {
        assert!((t - truth).abs() < 1e-9);
    }
    let depths = [numbers(&found["depths1"]), numbers(&found["depths2"])].concat();
    assert_eq!(depths.len(), 10);
    assert!((depths.iter().sum::<f64>() / 10.0 - 1.0).abs() < 1e-9);
}

#[test]
fn a_real_pair_is_solved_through_its_cameras() {
    let (run, result) = solved(&[&example("tiny_berlin_7in.json")]);
    assert_eq!(run.status, 0);
    let best = &candidates(&result)[0];
    assert!(best["rotation_error_deg"].as_f64().unwrap() < 0.5);
    assert!(best["translation_error_deg"].as_f64().unwrap() < 2.0);
}

#[test]
fn cameras_may_come_from_the_command_line() {
    let file: Value = serde_json::from_slice(&fs::read(example("tiny_berlin_7in.json")).unwrap()).unwrap();
    let rows = file["matches"].as_array().unwrap();
    let rows: Vec<_> =
        rows.iter().map(|m| numbers(m).iter().map(f64::to_string).collect::<Vec<_>>().join(",")).collect();
    let directory = directory_with("pixels.csv", format!("u1,v1,u2,v2\n{}\n", rows.join("\n")));
    let camera = "PINHOLE,1306,979,1135.435732,1135.435732,652.3,489.1";
    let (_, from_json) = solved(&[&example("tiny_berlin_7in.json")]);
    for option in ["--camera1", "--camera"] {
        let arguments = ["solve", "pixels.csv", "--format", "json", option, camera];
        let run = run_in(directory.path(), &arguments, b"");
        let from_csv: Value = serde_json::from_str(&run.stdout).unwrap();
        assert_eq!(candidates(&from_csv)[0]["t_21"], candidates(&from_json)[0]["t_21"]);
    }
}

#[test]
fn candidates_behind_a_camera_are_listed_on_demand() {
    let file = example("points.json");
    let (few, result) = solved(&[&file]);
    assert!(candidates(&result).iter().all(|c| c["feasible"] == true));
    let (all, everything) = solved(&[&file, "--all"]);
    let hidden = candidates(&everything).iter().filter(|c| c["feasible"] == false).count();
    assert_eq!(candidates(&everything).len(), candidates(&result).len() + hidden);
    let note = format!(
        "note: {file}: {hidden} candidates with points behind a camera not listed, --all lists them\n"
    );
    assert_eq!((few.stderr, all.stderr), (note, String::new()));
    assert_eq!(run(&["solve", &file, "--quiet"]).stderr, "");
}

#[test]
fn only_candidates_behind_a_camera_are_no_answer() {
    // Fifteen of these matches are false, and the parallax is small: no pose has all of the points in front.
    let file = example("tumfr3_98072_98172.json");
    let (run, result) = solved(&[&file, "--quiet"]);
    assert_eq!((run.status, candidates(&result).len()), (1, 0));
    let start = format!("no pose: {file}: none of the ");
    let end = "; --all lists them; matches with outliers: quest-cli estimate, quest-cli view --estimate\n";
    assert!(run.stderr.starts_with(&start) && run.stderr.ends_with(end), "{}", run.stderr);
    let (run, result) = solved(&[&file, "--quiet", "--all"]);
    assert_eq!((run.status, run.stderr.as_str()), (0, ""));
    assert!(!candidates(&result).is_empty());
}

#[test]
fn kinds_exact_leaves_the_other_kinds_out() {
    let file = example("points.json");
    let kinds = |result: &Value| candidates(result).iter().map(|c| c["kind"].to_string()).collect::<Vec<_>>();
    assert!(kinds(&solved(&[&file, "--all"]).1).contains(&"\"rotation_only\"".to_owned()));
    assert!(kinds(&solved(&[&file, "--all", "--kinds", "exact"]).1).iter().all(|k| k == "\"exact\""));
}

#[test]
fn kinds_planar_adds_the_motions_of_a_plane() {
    // Points on the plane z = 4 + 0.3 x - 0.2 y, rounded.
    let plane = json!([
        [0.054, 0.116, -0.254, 0.158],
        [0.21, 0.153, -0.114, 0.145],
        [0.162, -0.212, -0.228, -0.143],
        [-0.177, 0.198, -0.436, 0.288],
        [-0.102, -0.04, -0.425, 0.075]
    ]);
    let planar = |kinds: &str| {
        let run = solve_matches(&plane, &["--kinds", kinds, "--format", "csv"]);
        run.stdout.lines().filter(|line| line.contains(",planar,")).count()
    };
    // Of four motions two have the points in front.
    assert_eq!(["exact", "all", "planar"].map(planar), [0, 0, 2]);
}

#[test]
fn matches_without_a_pose() {
    for options in [&[][..], &["--format", "json", "--quiet"], &["--all"]] {
        let run = solve_matches(&coincident(), options);
        let error = "error: standard input: matches: all points coincide in one view, expected matches that determine a \
                     pose\n";
        assert_eq!((run.status, run.stdout.as_str(), run.stderr.as_str()), (2, "", error));
    }
}

#[test]
fn a_pure_rotation_has_a_rotation_and_no_depths() {
    let same = json!([
        [0.1, 0.1, 0.1, 0.1],
        [0.4, 0.1, 0.4, 0.1],
        [-0.3, 0.2, -0.3, 0.2],
        [0.2, -0.3, 0.2, -0.3],
        [0.0, 0.4, 0.0, 0.4]
    ]);
    let run = solve_matches(&same, &["--format", "json"]);
    let result: Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!((run.status, &result["degeneracy"]), (0, &json!("pure_rotation")));
    let candidate = &candidates(&result)[0];
    assert_eq!(
        (&candidate["q_21"], &candidate["t_21"]),
        (&json!([1.0, 0.0, 0.0, 0.0]), &json!([0.0, 0.0, 0.0]))
    );
    assert_eq!(candidate["depths1"], json!([null, null, null, null, null]));
    let table = solve_matches(&same, &[]).stdout;
    assert!(table.starts_with("standard input: 5 matches, solver quest-eigen, pure rotation: "), "{table}");
}

#[test]
fn one_pair_without_a_pose_among_others_is_told_by_the_exit_status() {
    let lines = format!("{{\"matches\": {}}}\n{{\"matches\": {}}}\n", five_matches(), coincident());
    let run = run_in(Path::new("."), &["solve", "-", "--quiet"], lines.as_bytes());
    assert_eq!((run.status, run.stdout.lines().count()), (1, 2));
    assert!(run.stderr.starts_with("no pose: standard input:2: "), "{}", run.stderr);
}

#[test]
fn the_table_shows_what_is_known() {
    let table = run(&["solve", &example("points.json"), "--solver", "quest-eigen"]).stdout;
    assert!(table.starts_with("points: 5 matches, solver quest-eigen\n\n#  kind "), "{table}");
    assert!(table.contains("t error") && !table.contains("px"), "{table}");
    let row = table.lines().find(|line| line.contains("0.3000 -0.1000  0.2000")).unwrap();
    assert!(row.contains("exact") && row.contains("15.000") && row.contains("5/5"), "{row}");
    let table = run(&["solve", &example("points.csv")]).stdout;
    assert!(!table.contains("error"), "{table}");
    let table = run(&["solve", &example("tiny_berlin_7in.json")]).stdout;
    assert!(table.contains("px"), "{table}");
}

#[test]
fn csv_has_a_row_for_each_candidate() {
    let file = example("points.json");
    let count = candidates(&solved(&[&file, "--all"]).1).len();
    let csv = run(&["solve", &file, "--all", "--format", "csv"]).stdout;
    assert_eq!(csv.lines().count(), count + 1);
    assert!(csv.starts_with("pair,name,solver,candidate,kind,qw,qx,qy,qz,tx,ty,tz,residual,"));
    let columns = csv.lines().next().unwrap().split(',').count();
    assert!(csv.lines().all(|line| line.split(',').count() == columns));
}

#[test]
fn theorem_2_lists_fewer_candidates_and_the_true_one() {
    let file = example("points.json");
    let (_, by_depth) = solved(&[&file, "--kinds", "exact"]);
    let (few, by_theorem) = solved(&[&file, "--kinds", "exact", "--feasibility", "theorem-2"]);
    assert_eq!((&by_depth["feasibility"], &by_theorem["feasibility"]), (&Value::Null, &json!("theorem-2")));
    assert!(candidates(&by_theorem).len() <= candidates(&by_depth).len());
    assert!(few.stderr.contains("that theorem 2 rejects"), "{}", few.stderr);
    let is_true = |c: &Value| c["rotation_error_deg"].as_f64().unwrap() < 1e-6;
    assert!(candidates(&by_theorem).iter().any(is_true));
    // (61) is half the angle.
    for c in candidates(&by_theorem) {
        let (degrees, metric) =
            (c["rotation_error_deg"].as_f64().unwrap(), c["rotation_metric_rad"].as_f64().unwrap());
        assert!((degrees.to_radians() / 2.0 - metric).abs() < 1e-9, "{c}");
        assert!((0.0..=1.571).contains(&c["translation_metric_rad"].as_f64().unwrap()));
    }
    let unknown = run(&["solve", &file, "--feasibility", "theorem-3"]);
    assert!(unknown.status == 2 && unknown.stderr.contains("theorem-2"), "{}", unknown.stderr);
}

/// Five points that cameras see which were moved by `t`, and turned about y.
fn five_seen_from(t: [f64; 3], angle: f64) -> Value {
    let points = [[-0.5, 0.3, 2.0], [0.6, -0.4, 2.8], [0.1, 0.5, 3.4], [-0.4, -0.5, 2.5], [0.9, 0.2, 3.1]];
    let (s, c) = angle.sin_cos();
    let matches = points.map(|[x, y, z]| {
        let moved = [c * x + s * z + t[0], y + t[1], -s * x + c * z + t[2]];
        [x / z, y / z, moved[0] / moved[2], moved[1] / moved[2]]
    });
    json!({ "matches": matches, "q_21": [(angle / 2.0).cos(), 0.0, (angle / 2.0).sin(), 0.0], "t_21": t })
}

#[test]
fn a_third_view_puts_the_true_candidate_of_five_points_first() {
    let folder = tempfile::tempdir().unwrap();
    let mut other = five_seen_from([-0.3, 0.2, 0.1], -0.15);
    // Lists need not have the same order.
    other["matches"].as_array_mut().unwrap().reverse();
    fs::write(folder.path().join("12.json"), five_seen_from([0.4, 0.1, -0.2], 0.1).to_string()).unwrap();
    fs::write(folder.path().join("13.json"), other.to_string()).unwrap();
    let with = |arguments: &[&str]| {
        run_in(folder.path(), &[&["solve", "12.json", "--quiet"], arguments].concat(), b"")
    };
    let run = with(&["--third", "13.json", "--format", "json"]);
    assert_eq!((run.status, run.stderr.as_str()), (0, ""));
    let result: Value = serde_json::from_str(&run.stdout).unwrap();
    assert!(candidates(&result).len() > 1);
    assert!(candidates(&result)[0]["rotation_error_deg"].as_f64().unwrap() < 1e-6, "{result}");
    let third = &result["third_view"];
    assert!(
        third["disagreement"].as_f64().unwrap() < 1e-6 && third["next_best"].as_f64().unwrap() > 1e-3,
        "{third}"
    );
    assert!((third["q_31"][0].as_f64().unwrap() - 0.075_f64.cos()).abs() < 1e-9);
    // |(−0.3, 0.2, 0.1)| / |(0.4, 0.1, −0.2)|
    assert!((third["ratio"].as_f64().unwrap() - (14.0_f64 / 21.0).sqrt()).abs() < 1e-6);
    assert!(with(&["--third", "13.json"]).stdout.contains("the first by a third view"));

    let mut strange = five_seen_from([-0.3, 0.2, 0.1], -0.15);
    strange["matches"][0][0] = json!(0.3);
    fs::write(folder.path().join("14.json"), strange.to_string()).unwrap();
    let few = with(&["--third", "14.json"]);
    assert_eq!(few.status, 2);
    assert!(
        few.stderr.contains("4 of its points of view 1") && few.stderr.contains("at least 5"),
        "{}",
        few.stderr
    );
    let lines = run_in(folder.path(), &["solve", "-", "--input-format", "jsonl", "--third", "13.json"], b"");
    assert!(lines.status == 2 && lines.stderr.contains("--third"), "{}", lines.stderr);
    assert_eq!(with(&["--third", "15.json"]).status, 2);
}

#[test]
fn a_rotation_that_is_known_has_its_translation_and_depths() {
    let text = five_seen_from([0.4, 0.1, -0.2], 0.1).to_string();
    let q = format!("{},0,{},0", 0.05_f64.cos(), 0.05_f64.sin());
    let run = run_in(Path::new("."), &["solve", "-", "--format", "json", "--rotation", &q], text.as_bytes());
    assert_eq!((run.status, run.stderr.as_str()), (0, ""));
    let result: Value = serde_json::from_str(&run.stdout).unwrap();
    let [found] = candidates(&result) else { panic!("{result}") };
    assert_eq!((&found["kind"], &found["in_front"]), (&json!("given_rotation"), &json!(5)));
    assert!(found["translation_error_deg"].as_f64().unwrap() < 1e-6);
    // Depths and translation have one scale.
    let (t, z) = (numbers(&found["t_21"]), numbers(&found["depths1"]));
    assert!((z[0] / 2.0 - t[0] / 0.4).abs() < 1e-9 && (z[4] / 3.1 - t[0] / 0.4).abs() < 1e-9);
    for wrong in ["1,0,0", "2,0,0,0", "a,b,c,d"] {
        assert_eq!(run_in(Path::new("."), &["solve", "-", "--rotation", wrong], text.as_bytes()).status, 2);
    }
    let both =
        run_in(Path::new("."), &["solve", "-", "--rotation", &q, "--solver", "nister"], text.as_bytes());
    assert_eq!(both.status, 2);
    let one = json!({ "matches": [[0.1, 0.1, 0.2, 0.1]] }).to_string();
    let few = run_in(Path::new("."), &["solve", "-", "--rotation", &q], one.as_bytes());
    assert!(few.status == 2 && few.stderr.contains("at least 2"), "{}", few.stderr);
}

#[test]
fn the_constraint_matrix_has_names_and_the_norm() {
    let result = run(&["matrix", &example("points.json"), "--format", "json"]);
    let matrix: Value = serde_json::from_str(&result.stdout).unwrap();
    let rows = matrix["rows"].as_array().unwrap();
    assert_eq!((rows.len(), &matrix["columns"][1]), (11, &json!("q1^3 q2")));
    assert_eq!(
        (&rows[0]["triple"], &rows[10]["triple"], &rows[10]["c"]),
        (&json!([0, 1, 2]), &Value::Null, &json!(1.0))
    );
    let table = run(&["matrix", &example("points.json")]).stdout;
    assert!(table.contains("norm") && table.contains("q1 q2 q3 q4"), "{table}");
    let csv = run(&["matrix", &example("points.json"), "--format", "csv", "--no-norm"]).stdout;
    assert_eq!(csv.lines().count(), 11);
    let few = run_in(
        Path::new("."),
        &["matrix", "-"],
        json!({ "matches": [[0.1, 0.1, 0.2, 0.1]] }).to_string().as_bytes(),
    );
    assert!(few.status == 2 && few.stderr.contains("at least 3"), "{}", few.stderr);
}
