//! The answers of `solve`.

use serde_json::Value;

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

#[test]
#[ignore = "needs a solver"]
fn the_planted_pose_is_found_with_its_length() {
    let (run, result) = solved(&[&example("points.json")]);
    assert_eq!(run.status, 0);
    let best = candidates(&result)
        .iter()
        .find(|c| {
            c["rotation_error_deg"].as_f64().unwrap() < 1e-6
                && c["translation_error_deg"].as_f64().unwrap() < 1e-6
        })
        .unwrap();
    assert_eq!(
        (&best["kind"], &best["in_front"], &best["feasible"]),
        (&"exact".into(), &5.into(), &true.into())
    );
    // The planted translation has the length that solvers give it.
    for (t, truth) in numbers(&best["t_21"]).iter().zip([0.3, -0.1, 0.2]) {
        assert!((t - truth).abs() < 1e-9);
    }
    let depths = [numbers(&best["depths1"]), numbers(&best["depths2"])].concat();
    assert_eq!(depths.len(), 10);
    assert!((depths.iter().sum::<f64>() / 10.0 - 1.0).abs() < 1e-9);
}
