//! Recorded servo runs that once went wrong, replayed open loop: rendered images, real features, real mistakes.
//!
//! The camera of a recording moves as it was driven then, not as the tracker would drive it: the tracker is told the motion that was made.
#![expect(clippy::unwrap_used, reason = "a recording that cannot be read is a failed test")]

use std::collections::HashMap;
use std::fs;
use std::path::PathBuf;
use std::process::Command;

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use quest_core::RelativePose;
use quest_core::servo::{FilterOptions, Limits, Motion, PoseEstimator, Support, Tracker};
use quest_core::solver::SolverName;

/// A recorded run: the features on the plane z = 1, and where the camera was.
struct Case {
    goal: Vec<[f64; 2]>,
    images: Vec<Vec<Option<[f64; 2]>>>,
    /// The current camera (2) relative to the goal (1), in metres.
    truth: Vec<RelativePose>,
    /// A pixel on the plane z = 1.
    pixel: f64,
}

const UNIT: f64 = 1.1;
const LIMITS: Limits = Limits { speed: 0.2, turn_rate: 0.4 };
/// Pixels; descriptors' errors are about this large.
const NOISE_PX: f64 = 0.5;

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared/cases/servo")
}

/// The arrays of a recording by name, read by numpy: a file of its kind is a ZIP of compressed arrays.
fn arrays(name: &str) -> HashMap<String, Vec<f64>> {
    const SCRIPT: &str = "\
import json, sys, numpy
data = numpy.load(sys.argv[1])
numbers = {k: data[k].astype(float).ravel() for k in data.files if data[k].dtype.kind in 'fi'}
print(json.dumps({k: [None if x != x else x for x in v] for k, v in numbers.items()}))
";
    let python = std::env::var("PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let output = Command::new(&python).args(["-c", SCRIPT]).arg(folder().join(name)).output();
    let output = output.unwrap_or_else(|error| panic!("{python} does not start ({error}); set PYTHON"));
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{python} with numpy is needed to read {name}; set PYTHON\n{error}");
    let arrays: HashMap<String, Vec<Option<f64>>> = serde_json::from_slice(&output.stdout).unwrap();
    let known = |x: Option<f64>| x.unwrap_or(f64::NAN);
    arrays.into_iter().map(|(name, x)| (name, x.into_iter().map(known).collect())).collect()
}

impl Case {
    /// All goal features of a recording, or those that the recorded loop was given.
    fn load(name: &str, all: bool) -> Self {
        let arrays = arrays(name);
        let numbers = |name: &str| &arrays[name];
        let k = numbers("K");
        let on_plane = |p: &[f64]| [(p[0] - k[2]) / k[0], (p[1] - k[5]) / k[4]];
        let goal_all = numbers("goal_all");
        let given: Vec<usize> = if all {
            (0..goal_all.len() / 2).collect()
        } else {
            numbers("idx").iter().map(|i| format!("{i:.0}").parse().unwrap()).collect()
        };
        let place = |image: &[f64], i: usize| on_plane(&image[2 * i..2 * i + 2]);
        let goal = given.iter().map(|&i| place(goal_all, i)).collect();
        let seen =
            |image: &[f64], i: usize| Some(place(image, i)).filter(|p| p.iter().all(|c| c.is_finite()));
        let points = numbers("points_all");
        let images =
            points.chunks(goal_all.len()).map(|image| given.iter().map(|&i| seen(image, i)).collect());
        let images = images.collect();
        // X_goal = R X_camera + p.
        let (r, p) = (numbers("R"), numbers("p"));
        let pose = |(r, p): (&[f64], &[f64])| {
            let r = Rotation3::from_matrix_unchecked(Matrix3::from_row_slice(r));
            RelativePose::new(UnitQuaternion::from_rotation_matrix(&r), Vector3::from_row_slice(p)).inverse()
        };
        let truth = r.chunks(9).zip(p.chunks(3)).map(pose).collect();
        Self { goal, images, truth, pixel: 1.0 / k[0] }
    }

    /// The errors of the rotation in degrees of all images with a pose, and how many of those with a translation point away from
    /// the goal while it is further than 5 cm.
    fn replay(&self, noise_px: f64) -> (Vec<f64>, usize) {
        let options = FilterOptions::for_images(noise_px * self.pixel, 1, &LIMITS, 0.1, UNIT);
        let mut tracker = Tracker::new(&self.goal, SolverName::Quest, options);
        let (mut errors, mut wrong_way) = (Vec::new(), 0);
        for (k, (image, truth)) in self.images.iter().zip(&self.truth).enumerate() {
            if k > 0 {
                tracker.moved(&motion(&self.truth[k - 1], truth));
            }
            let Ok(estimate) = tracker.estimate(image) else { continue };
            errors.push(estimate.pose.rotation_error(truth).to_degrees());
            let is_far = truth.t_21.norm() > 0.05;
            let moves = estimate.support != Support::RotationOnly;
            wrong_way += usize::from(is_far && moves && estimate.pose.t_21.dot(&truth.t_21) < 0.0);
        }
        errors.sort_by(f64::total_cmp);
        (errors, wrong_way)
    }
}

/// What takes a camera from one pose to the next, as it would be commanded.
fn motion(from: &RelativePose, to: &RelativePose) -> Motion {
    let turn = to.q_21 * from.q_21.inverse();
    Motion { linear: (turn * from.t_21 - to.t_21) / UNIT, angular: -turn.scaled_axis() }
}

/// By name: whether all goal features are given, the pixels' noise, the largest median of the rotation's error in degrees, and the fewest
/// images with a pose.
const CASES: [(&str, bool, f64, f64, usize); 8] = [
    ("away_from_goal_orb_general0_all400.npz", true, 1.0, 0.5, 40),
    ("wild_general1_raw20.npz", true, NOISE_PX, 0.3, 60),
    ("wild_weak2_raw50.npz", true, NOISE_PX, 2.5, 30),
    ("ol_planar_11.npz", true, NOISE_PX, 0.25, 40),
    ("planar1_estimate_twin.npz", true, NOISE_PX, 0.4, 40),
    ("ol_general_5.npz", false, NOISE_PX, 0.2, 60),
    ("ol_general_5.npz", true, NOISE_PX, 0.2, 60),
    ("ol_klt_14.npz", false, NOISE_PX, 1.0, 60),
];

#[test]
#[ignore = "needs the recorded runs in ../shared/cases/servo; scripts/test runs it where they are"]
fn recorded_runs_that_went_wrong_are_followed() {
    assert!(folder().is_dir(), "there is no folder ../shared/cases/servo beside the workspace");
    let mut failures = Vec::new();
    for (name, all, noise_px, most, fewest) in CASES {
        let (errors, wrong_way) = Case::load(name, all).replay(noise_px);
        let median = errors.get(errors.len() / 2).copied().unwrap_or(f64::NAN);
        let report =
            format!("{name}, all {all}: {median:.2}° of {} poses, {wrong_way} the wrong way", errors.len());
        if median.is_nan() || median > most || errors.len() < fewest || wrong_way > 0 {
            failures.push(report);
        }
    }
    assert!(failures.is_empty(), "{failures:#?}");
}

/// Nine features of which four are wrong: there is no telling which. Whatever it says it must not act for long.
#[test]
#[ignore = "needs the recorded runs in ../shared/cases/servo; scripts/test runs it where they are"]
fn too_many_wrong_matches_are_held() {
    let case = Case::load("wild_klt_general24.npz", false);
    let (errors, wrong_way) = case.replay(NOISE_PX);
    assert!(wrong_way <= case.images.len() / 4, "{wrong_way} of {} poses", errors.len());
}

/// The same two wrong matches of twenty in all images: the loop starts.
#[test]
#[ignore = "needs the recorded runs in ../shared/cases/servo; scripts/test runs it where they are"]
fn two_wrong_matches_of_twenty_do_not_keep_it_from_starting() {
    let text = fs::read_to_string(folder().join("two_wrong_of_20_never_starts.json")).unwrap();
    let case: serde_json::Value = serde_json::from_str(&text).unwrap();
    let k: Vec<Vec<f64>> = serde_json::from_value(case["K"].clone()).unwrap();
    let pixels =
        |value: &serde_json::Value| -> Vec<[f64; 2]> { serde_json::from_value(value.clone()).unwrap() };
    let on_plane = |p: [f64; 2]| [(p[0] - k[0][2]) / k[0][0], (p[1] - k[1][2]) / k[1][1]];
    let goal: Vec<[f64; 2]> = pixels(&case["goal"]).into_iter().map(on_plane).collect();
    let wrong: Vec<usize> = serde_json::from_value(case["wrong"].clone()).unwrap();
    let options = FilterOptions::for_images(NOISE_PX / k[0][0], 1, &LIMITS, 0.1, 1.0);
    let mut tracker = Tracker::new(&goal, SolverName::Quest, options);
    let mut poses = 0;
    for image in case["images"].as_array().unwrap() {
        let image: Vec<_> = pixels(image).into_iter().map(|p| Some(on_plane(p))).collect();
        if tracker.estimate(&image).is_ok() {
            poses += 1;
            assert!(wrong.iter().all(|&i| !tracker.inliers()[i]), "a wrong match is an inlier");
        }
    }
    assert!(poses >= 30, "{poses}");
}
