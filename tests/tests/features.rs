//! The features of `quest-core` that only add: `serde` and `mint`.

use std::f64::consts::FRAC_PI_4;
use std::fmt::Debug;

use nalgebra::{UnitQuaternion, Vector3};
use quest_core::robust::{self, Estimate, Options};
use quest_core::simulate::{FOCAL_LENGTH, Scene, SceneOptions};
use quest_core::solver::{Kinds, SolverName};
use quest_core::{Camera, CameraModel, Candidate, CandidateKind, Candidates, Degeneracy, RelativePose};
use serde::Serialize;
use serde::de::DeserializeOwned;

const SEED: u64 = 77;

/// What is written for it, which has to be read as the same.
fn returns<T: Serialize + DeserializeOwned + PartialEq + Debug>(x: &T) -> String {
    let text = serde_json::to_string(x).unwrap_or_default();
    assert_eq!(serde_json::from_str(&text).ok().as_ref(), Some(x), "{text}");
    text
}

#[test]
fn what_is_written_is_read_again() {
    let options = SceneOptions { points: 60, noise_px: 0.5, ..SceneOptions::realistic() };
    let scene = Scene::generate(&options, SEED, 0).unwrap();
    let mut candidates = Candidates::new();
    SolverName::Quest.solve(Kinds::All, &scene.matches[..5], &mut candidates);
    for candidate in candidates.iter() {
        returns::<Candidate>(candidate);
    }
    let focal_lengths = [[FOCAL_LENGTH; 2]; 2];
    let options = Options { threshold: 1.5, focal_lengths, ..Options::default() };
    returns(&options);
    let mut found = robust::estimate(&scene.matches, &options).unwrap();
    let text = returns::<Estimate>(&found);
    assert!(text.contains("\"model\":\"general\"") && text.contains("\"q_21\":["), "{text}");
    (found.evidence.planar_px, found.evidence.rotation_px) = (f64::INFINITY, f64::INFINITY);
    assert!(returns(&found).contains(r#""rotation_px":null,"planar_px":null"#));
    let camera = Camera::new(CameraModel::OpenCvFisheye, &[500.0, 501.0, 320.0, 240.0, 0.1, 0.0, 0.0, 0.0]);
    let text = returns(&camera.unwrap().with_size(640, 480).unwrap());
    assert!(
        text.starts_with(r#"{"model":"OPENCV_FISHEYE","width":640,"height":480,"params":[500.0"#),
        "{text}"
    );
}

#[test]
fn names_are_those_of_files() {
    let same = |x: String, name: &str| assert_eq!(x, format!("\"{name}\""));
    for solver in SolverName::ALL {
        same(returns(&solver), solver.info().name);
    }
    for kinds in Kinds::CHOICES {
        same(returns(&kinds), kinds.name());
    }
    for model in CameraModel::ALL {
        same(returns(&model), model.name());
    }
    for kind in [CandidateKind::Exact, CandidateKind::FromComplex, CandidateKind::RotationOnly] {
        same(returns(&kind), kind.name());
    }
    for reason in [Degeneracy::TooFewMatches, Degeneracy::RankDeficient, Degeneracy::PureRotation] {
        same(returns(&reason), reason.name());
    }
}

#[test]
fn what_is_wrong_is_refused() {
    let refused = |text: &str, words: &str| {
        let error = serde_json::from_str::<RelativePose>(text).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    };
    refused(
        r#"{"q_21": [0, 0, 0, 0], "t_21": [0, 0, 1]}"#,
        "q_21 has the length 0, expected a unit quaternion",
    );
    refused(r#"{"q_21": [0.93, 0, 0, 0.38], "t_21": [0, 0, 1]}"#, "expected a unit quaternion");
    // Four decimals of an eighth of a turn are enough.
    let read: RelativePose =
        serde_json::from_str(r#"{"q_21": [0.9239, 0, 0, 0.3827], "t_21": [0, 0, 1]}"#).unwrap();
    assert!((read.q_21.angle() - FRAC_PI_4).abs() < 1e-4 && (read.q_21.norm() - 1.0).abs() < 1e-15);
    refused(r#"{"q_21": [1e200, 0, 0, 0], "t_21": [0, 0, 1]}"#, "expected a unit quaternion");
    refused(r#"{"q_21": [1, 0, 0], "t_21": [0, 0, 1]}"#, "length 3, expected an array of length 4");
    let seven_digits: RelativePose =
        serde_json::from_str(r#"{"q_21": [0.7071068, 0.7071068, 0, 0], "t_21": [0, 0, 1]}"#).unwrap();
    assert!((seven_digits.q_21.norm() - 1.0).abs() < 1e-15);
    let camera = |text: &str| serde_json::from_str::<Camera>(text).unwrap_err().to_string();
    assert!(camera(r#"{"model": "PINHOLE", "params": [1, 1, 0]}"#).contains("4 parameters"));
    let half = camera(r#"{"model": "PINHOLE", "width": 640, "params": [1, 1, 0, 0]}"#);
    assert!(half.contains("640") && half.contains('0'), "{half}");
    assert!(camera(r#"{"model": "FISH", "params": [1, 1, 0]}"#).contains("unknown variant `FISH`"));
    let error = serde_json::from_str::<Options>(r#"{"treshold": 1}"#).unwrap_err().to_string();
    assert!(error.contains("unknown field `treshold`"), "{error}");
}

#[test]
fn other_crates_types() {
    let q = UnitQuaternion::from_euler_angles(0.1, 0.2, 0.3);
    let pose = RelativePose::new(q, Vector3::new(1.0, 2.0, 3.0));
    let (q_21, t_21): (mint::Quaternion<f64>, mint::Vector3<f64>) = (pose.q_21.into(), pose.t_21.into());
    assert_eq!((q_21.s, q_21.v.x, t_21.z), (q.w, q.i, 3.0));
    let k: mint::RowMatrix3<f64> = [[500.0, 0.0, 320.0], [0.0, 501.0, 240.0], [0.0, 0.0, 1.0]].into();
    let camera = Camera::from_k(&mint::ColumnMatrix3::from(k).into()).unwrap();
    assert_eq!(camera.params(), [500.0, 501.0, 320.0, 240.0]);
}
