//! Results as they stand in files, and the files themselves: whole or as they were.
#![expect(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

use std::{fs, io, path::Path};

use nalgebra::{UnitQuaternion, Vector3};
use quest_core::disambiguation::Choice;
use quest_core::feasibility::Feasibility;
use quest_core::robust::{self, Options, RunnerUp};
use quest_core::solver::{PoseSolver, Quest};
use quest_core::{Candidates, Correspondence, RelativePose};
use quest_io::{
    CandidateRecord, EstimateRecord, Output, PoseRecord, SolveRecord, ThirdViewRecord, Truth, write_json,
};
use serde_json::{Value, json};

/// A camera that turned and moved, and points in space as both views see them on the plane z = 1.
fn planted(count: usize) -> (RelativePose, Vec<Correspondence>) {
    let pose =
        RelativePose::new(UnitQuaternion::from_euler_angles(0.05, -0.1, 0.02), Vector3::new(0.3, 0.05, -0.1));
    let number = |k: usize, by: f64| ((k as f64 + 1.0) * by).sin();
    let matches = (0..count).map(|k| {
        let x1 = Vector3::new(number(k, 1.3), number(k, 2.1), 4.0 + number(k, 0.7));
        let x2 = pose.q_21 * x1 + pose.t_21;
        Correspondence::from_bearings((x1 / x1.z).into(), (x2 / x2.z).into()).unwrap()
    });
    (pose, matches.collect())
}

fn truth(pose: &RelativePose) -> Truth {
    Truth { q_21: Some(pose.q_21), t_21: Some(pose.t_21) }
}

fn options() -> Options {
    Options { threshold: 1e-3, focal_lengths: [[1.0; 2]; 2], ..Options::default() }
}

#[test]
fn an_estimate_is_told_with_all_that_it_found() {
    let (pose, mut matches) = planted(40);
    // The last one is false.
    matches[39] = Correspondence::from_bearings([0.3, 0.9, 1.0], [-0.8, -0.2, 1.0]).unwrap();
    let estimate = robust::estimate(&matches, &options()).unwrap();
    let record = EstimateRecord::new(Some("a".to_owned()), &estimate, &truth(&pose), 1.5);
    assert!(record.rotation_error_deg.unwrap() < 1e-4 && record.translation_error_deg.unwrap() < 1e-3);
    let found = record.found.as_ref().unwrap();
    assert_eq!((found.inlier_count, found.inliers[39], found.inliers.len()), (39, false, 40));
    assert_eq!((record.model, found.iterations), (Some("general"), estimate.iterations));
    assert!((found.pose.parallax - Vector3::from(found.pose.t_21).norm()).abs() < 1e-15);
    for (i, row) in found.covariance.iter().enumerate() {
        for (j, x) in row.iter().enumerate() {
            assert!((x - estimate.covariance[(i, j)]).abs() <= 0.0);
        }
    }
    assert_eq!(found.evidence.general_px, Some(estimate.evidence.general_px));
    assert_eq!(found.runner_up.is_some(), estimate.runner_up.is_some());
    let value = serde_json::to_value(&record).unwrap();
    assert_eq!(
        (&value["name"], &value["model"], &value["elapsed_ms"]),
        (&json!("a"), &json!("general"), &json!(1.5))
    );
    // What there is none of is not there at all, or null.
    let keys = value.as_object().unwrap();
    assert!(["reason", "invalid_count", "third_view"].iter().all(|key| !keys.contains_key(*key)), "{value}");
    assert_eq!(value["normal"], Value::Null);
    let some = EstimateRecord { invalid_count: 2, name: None, ..record };
    let value = serde_json::to_value(&some).unwrap();
    assert_eq!((value["invalid_count"].as_u64(), value.get("name")), (Some(2), None));
}

#[test]
fn a_second_pose_has_its_errors_too() {
    let (pose, matches) = planted(40);
    let turned = UnitQuaternion::from_euler_angles(0.0, 0.0, 2.0_f64.to_radians());
    let other = RelativePose::new(turned * pose.q_21, pose.t_21);
    let mut estimate = robust::estimate(&matches, &options()).unwrap();
    estimate.runner_up = Some(RunnerUp { pose: other, score: 0.5, inlier_count: 30 });
    estimate.normal = Some([0.1, -0.0, 0.3]);
    let found = EstimateRecord::new(None, &estimate, &truth(&pose), 0.0).found.unwrap();
    let second = found.runner_up.unwrap();
    assert_eq!((second.inlier_count, second.score, found.normal), (30, 0.5, Some([0.1, 0.0, 0.3])));
    assert!(found.normal.unwrap().iter().all(|x| x.is_sign_positive()), "no zero has a sign");
    assert!((second.rotation_error_deg.unwrap() - 2.0).abs() < 1e-9);
    assert!(second.translation_error_deg.unwrap() < 1e-6);
}

#[test]
fn no_pose_has_its_reason() {
    let few = robust::estimate(&planted(3).1, &options()).unwrap_err();
    let record = EstimateRecord::no_pose(Some("few".to_owned()), &few, 2.0);
    assert_eq!(
        (record.model, record.reason.as_deref(), record.elapsed_ms),
        (None, Some(&*few.to_string()), 2.0)
    );
    assert!(record.found.is_none());
    let same = vec![planted(1).1[0]; 30];
    let degenerate = robust::estimate(&same, &options()).unwrap_err();
    let record = EstimateRecord::no_pose(None, &degenerate, 0.0);
    assert_eq!(record.model, Some("degenerate"), "{degenerate}");
    let record = EstimateRecord::unanswered(None, "because".to_owned());
    let value = serde_json::to_value(&record).unwrap();
    assert_eq!(value, json!({"model": null, "reason": "because", "elapsed_ms": 0.0}));
}

#[test]
fn candidates_are_told_with_their_depths_and_errors() {
    let (pose, matches) = planted(5);
    let mut found = Candidates::new();
    Quest::default().solve(&matches, &mut found);
    let record = SolveRecord::new(None, "quest", &matches, &found, &truth(&pose));
    assert_eq!((record.matches, record.solver, record.candidates.len()), (5, "quest", found.len()));
    let best: &CandidateRecord = record
        .candidates
        .iter()
        .min_by(|a, b| a.rotation_error_deg.unwrap().total_cmp(&b.rotation_error_deg.unwrap()))
        .unwrap();
    assert!(best.rotation_error_deg.unwrap() < 1e-6 && best.feasible && best.in_front == 5);
    // z1 R x1 + t = z2 x2.
    for (k, m) in matches.iter().enumerate() {
        let [z1, z2] = [best.depths1[k].unwrap(), best.depths2[k].unwrap()];
        let r_21 = nalgebra::Matrix3::from_fn(|i, j| best.r_21[i][j]);
        let [x1, x2] = [m.bearing1(), m.bearing2()].map(|b| b / b.z);
        assert!((r_21 * x1 * z1 + Vector3::from(best.t_21) - x2 * z2).norm() < 1e-9, "{k}");
    }
    assert!(record.candidates.iter().all(|c| c.feasible == (c.in_front == 5)));
    let feasible = record.candidates.iter().filter(|c| c.feasible).count();
    let mut judged = record.clone().judged_by(Feasibility::default(), &found, &matches);
    assert_eq!(judged.feasibility, None);
    assert_eq!((judged.drop_unfeasible(), judged.candidates.len()), (found.len() - feasible, feasible));
    let others = Feasibility::CHOICES.into_iter().filter(|f| *f != Feasibility::default());
    for other in others {
        let judged = record.clone().judged_by(other, &found, &matches);
        assert_eq!(judged.feasibility, Some(other.name()));
        for (record, candidate) in judged.candidates.iter().zip(found.iter()) {
            assert_eq!(record.feasible, other.accepts(candidate, &matches));
        }
    }
    let none = SolveRecord::unanswered(Some("n".to_owned()), "nister", "because".to_owned());
    let value = serde_json::to_value(&none).unwrap();
    let expected = json!({"name": "n", "solver": "nister", "matches": 0, "reason": "because", "degeneracy": null, "candidates": []});
    assert_eq!(value, expected);
}

#[test]
fn a_third_view_is_told() {
    let (pose, _) = planted(5);
    let choice = Choice { pose_21: 1, pose_31: 0, disagreement: 0.5, next_best: f64::INFINITY, ratio: 2.0 };
    let record = ThirdViewRecord::chosen(&pose, &choice);
    let plain = PoseRecord::new(&pose);
    assert_eq!((record.q_31, record.r_31, record.t_31), (plain.q_21, plain.r_21, plain.t_21));
    assert_eq!((record.disagreement, record.next_best, record.ratio), (Some(0.5), None, Some(2.0)));
    let record = ThirdViewRecord::chosen(&pose, &Choice { next_best: 3.0, ..choice });
    assert_eq!(record.next_best, Some(3.0));
}

fn write(output: &mut Output, text: &str) {
    output.write(|writer| writer.write_all(text.as_bytes())).unwrap();
}

fn names(folder: &Path) -> Vec<String> {
    let names = fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<_> = names.collect();
    names.sort();
    names
}

#[test]
fn a_file_appears_whole_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.txt");
    let mut output = Output::open(Some(&path)).unwrap();
    write(&mut output, "one");
    assert!(names(folder.path()).is_empty());
    drop(output);
    assert!(names(folder.path()).is_empty());
    let mut output = Output::open(Some(&path)).unwrap();
    write(&mut output, "two\n");
    write(&mut output, "three\n");
    output.finish().unwrap();
    assert_eq!(fs::read_to_string(&path).unwrap(), "two\nthree\n");
    assert_eq!(names(folder.path()), ["a.txt"]);
    // What fails leaves the old one.
    let mut output = Output::open(Some(&path)).unwrap();
    let error = output.write(|_| Err(io::ErrorKind::BrokenPipe.into())).unwrap_err();
    assert!(error.is_broken_pipe());
    assert_eq!(error.to_string(), format!("{}: cannot be written: broken pipe", path.display()));
    let other = output.write(|_| Err(io::Error::other("no"))).unwrap_err();
    assert!(!other.is_broken_pipe());
    assert_eq!(fs::read_to_string(&path).unwrap(), "two\nthree\n");
}

#[test]
fn places_that_cannot_be_written_to_are_refused_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let said = |path: &Path| Output::open(Some(path)).unwrap_err().to_string();
    assert!(said(folder.path()).ends_with("cannot be written: is a directory"), "{}", said(folder.path()));
    assert!(said(&folder.path().join("no/a")).contains("cannot be written: "));
    let locked = folder.path().join("locked");
    fs::write(&locked, "old").unwrap();
    let mut permissions = fs::metadata(&locked).unwrap().permissions();
    permissions.set_readonly(true);
    fs::set_permissions(&locked, permissions).unwrap();
    assert!(said(&locked).ends_with("cannot be written: permission denied"), "{}", said(&locked));
    for path in [None, Some(Path::new("-")), Some(Path::new("/dev/stdout"))] {
        let mut output = Output::open(path).unwrap();
        let error = output.write(|_| Err(io::Error::other("no"))).unwrap_err();
        assert_eq!(error.target, "standard output");
        output.finish().unwrap();
    }
}

#[cfg(unix)]
#[test]
fn links_stay_links_and_devices_stay_devices() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::create_dir(path("in")).unwrap();
    symlink("in/b.txt", path("a.txt")).unwrap();
    symlink("a.txt", path("c.txt")).unwrap();
    symlink("round", path("round")).unwrap();
    // Not there yet, then there with permissions of its own.
    for text in ["one", "two"] {
        let mut output = Output::open(Some(&path("c.txt"))).unwrap();
        write(&mut output, text);
        output.finish().unwrap();
        assert_eq!(fs::read_to_string(path("in/b.txt")).unwrap(), text);
        assert!(fs::symlink_metadata(path("c.txt")).unwrap().is_symlink());
        let mode = fs::metadata(path("in/b.txt")).unwrap().permissions().mode();
        assert!(text == "one" || mode & 0o777 == 0o600, "{mode:o}");
        fs::set_permissions(path("in/b.txt"), fs::Permissions::from_mode(0o600)).unwrap();
    }
    let error = Output::open(Some(&path("round"))).unwrap_err();
    assert!(
        error.to_string().ends_with("found a link that leads back to itself, expected a file"),
        "{error}"
    );
    let mut null = Output::open(Some(Path::new("/dev/null"))).unwrap();
    write(&mut null, "nothing");
    null.finish().unwrap();
    // A pipe with a name stays a pipe.
    if std::process::Command::new("mkfifo").arg(path("pipe")).status().is_ok_and(|status| status.success()) {
        use std::os::unix::fs::FileTypeExt;
        // Open on both sides: nothing waits for the other.
        let mut both = fs::OpenOptions::new().read(true).write(true).open(path("pipe")).unwrap();
        let mut output = Output::open(Some(&path("pipe"))).unwrap();
        write(&mut output, "one");
        output.finish().unwrap();
        assert!(fs::metadata(path("pipe")).unwrap().file_type().is_fifo());
        let mut text = [0; 3];
        io::Read::read_exact(&mut both, &mut text).unwrap();
        assert_eq!(&text, b"one");
    }
    let (mut null, earlier) = Output::growing(Some(Path::new("/dev/null")), true).unwrap();
    write(&mut null, "nothing");
    assert!(earlier.is_none());
}

/// The output of a run that goes on, with the lines of the earlier one, and how many they are.
fn resumed(path: &Path) -> (Output, usize) {
    let (mut output, earlier) = Output::growing(Some(path), true).unwrap();
    let lines: Vec<_> = earlier.unwrap().map(Result::unwrap).collect();
    for (index, (place, line)) in lines.iter().enumerate() {
        assert_eq!(place.line, Some(index + 1));
        write(&mut output, str::from_utf8(line).unwrap());
    }
    (output, lines.len())
}

#[test]
fn a_run_that_is_ended_goes_on_where_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.jsonl");
    let part = folder.path().join("a.jsonl.part");
    fs::write(&path, "old 1\nold 2\nhal").unwrap();
    let (mut output, count) = resumed(&path);
    assert_eq!(count, 2);
    write(&mut output, "3\n");
    // Before the lines are found to be its own nothing changes.
    assert!(!part.exists());
    output.settle().unwrap();
    write(&mut output, "4\n");
    drop(output);
    assert_eq!(fs::read_to_string(&part).unwrap(), "old 1\nold 2\n3\n4\n");
    assert_eq!(fs::read_to_string(&path).unwrap(), "old 1\nold 2\nhal");
    // The part comes before the file.
    let (mut output, count) = resumed(&path);
    assert_eq!(count, 4);
    write(&mut output, "5\n");
    output.finish().unwrap();
    assert_eq!(fs::read_to_string(&part).unwrap(), "old 1\nold 2\n3\n4\n");
    assert_eq!(fs::read_to_string(&path).unwrap(), "old 1\nold 2\nhal");
    let (mut output, _) = resumed(&path);
    output.settle().unwrap();
    output.finish().unwrap();
    assert_eq!(fs::read_to_string(&path).unwrap(), "old 1\nold 2\n3\n4\n");
    assert_eq!(names(folder.path()), ["a.jsonl"]);
    // Without being asked to go on it begins anew.
    let (mut output, earlier) = Output::growing(Some(&path), false).unwrap();
    write(&mut output, "new\n");
    output.finish().unwrap();
    assert_eq!((earlier.is_none(), fs::read_to_string(&path).unwrap()), (true, "new\n".to_owned()));
    let (_, earlier) = Output::growing(Some(&folder.path().join("none")), true).unwrap();
    assert!(earlier.is_none());
    let (_, earlier) = Output::growing(None, true).unwrap();
    assert!(earlier.is_none());
    // A part that is there and cannot be read is not begun anew.
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("c.part", folder.path().join("c.part")).unwrap();
        assert!(Output::growing(Some(&folder.path().join("c")), true).is_err());
    }
    fs::create_dir(folder.path().join("b.part")).unwrap();
    assert!(Output::growing(Some(&folder.path().join("b")), true).is_err());
}

#[test]
fn json_ends_in_a_newline_and_a_writer_that_fails_says_so() {
    struct Full;
    impl io::Write for Full {
        fn write(&mut self, _: &[u8]) -> io::Result<usize> {
            Err(io::ErrorKind::StorageFull.into())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }
    let mut text = Vec::new();
    write_json(&mut text, &json!({"a": {"b": [1, 2]}})).unwrap();
    assert_eq!(String::from_utf8(text).unwrap(), "{\n  \"a\": {\n    \"b\": [1, 2]\n  }\n}\n");
    assert!(write_json(&mut Full, &json!([1])).is_err());
}
