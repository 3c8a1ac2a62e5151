//! `polynomials`: systems in, solutions or the reason for none out.

use std::path::Path;

use super::{example, run, run_in};

fn solve(system: &str, arguments: &[&str]) -> super::Run {
    run_in(Path::new("."), &[&["polynomials", "-"], arguments].concat(), system.as_bytes())
}

/// x² + y² = 4 and x y = 1.
const CIRCLE: &str = r#"{"unknowns": ["x", "y"],
    "equations": [[[1, [2, 0]], [1, [0, 2]], [-4, [0, 0]]], [[1, [1, 1]], [-1, [0, 0]]]]}"#;

#[test]
fn every_solution_is_listed() {
    let found = solve(CIRCLE, &["--format", "json"]);
    assert_eq!(found.status, 0, "{}", found.stderr);
    let record: serde_json::Value = serde_json::from_str(&found.stdout).unwrap();
    assert_eq!(record["unknowns"], serde_json::json!(["x", "y"]));
    let solutions = record["solutions"].as_array().unwrap();
    // The solutions come in pairs ±(x, y), of which one is listed.
    assert_eq!((solutions.len(), &record["grading"]), (2, &serde_json::json!(2)));
    for solution in solutions {
        let [x, y] = [0, 1].map(|k| solution["re"][k].as_f64().unwrap());
        assert!((x * x + y * y - 4.0).abs() < 1e-12 && (x * y - 1.0).abs() < 1e-12);
    }
    let table = run(&["polynomials", &example("three_quadrics.json")]).stdout;
    assert!(table.contains("8 solutions listed, 0 at infinity") && table.contains("nullity 8"), "{table}");
    let csv = solve(CIRCLE, &["--format", "csv"]).stdout;
    assert!(csv.starts_with("solution,unknown,re,im,residual,multiplicity\n1,x,"), "{csv}");
}

#[test]
fn what_is_wrong_is_said() {
    for (system, expected) in [
        ("{", "EOF while parsing"),
        (r#"{"unknowns": 1, "equations": [[[1, [1, 0]]]]}"#, "equation 0, term 0 has 2 exponents"),
        (r#"{"unknowns": 1, "equations": [[[0, [1]]]]}"#, "equation 0 is 0 = 0"),
        (r#"{"unknowns": 1, "equations": [[[1, [-1]]]]}"#, "expected"),
        (r#"{"unknowns": 1, "equatons": []}"#, "unknown field `equatons`"),
    ] {
        let refused = solve(system, &[]);
        assert_eq!((refused.status, refused.stdout.as_str()), (2, ""), "{system}");
        assert!(refused.stderr.contains(expected), "{}", refused.stderr);
    }
    let curve = solve(r#"{"unknowns": 2, "equations": [[[1, [1, 0]], [1, [0, 1]], [1, [0, 0]]]]}"#, &[]);
    assert_eq!((curve.status, curve.stdout.as_str()), (1, ""));
    assert!(
        curve.stderr.contains("not overdetermined enough: 1 equations for 2 unknowns"),
        "{}",
        curve.stderr
    );
}
