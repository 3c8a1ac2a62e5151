//! Estimators that begin with depths that are known, and find their way back after the camera was carried away.

use nalgebra::{UnitQuaternion, Vector3};

use super::*;

/// Points in front of the goal, in metres.
fn points(count: u32) -> Vec<Vector3<f64>> {
    let point = |k: f64| {
        let z = 2.0 + 0.5 * (2.3 * k).sin();
        Vector3::new(0.6 * (1.7 * k).sin(), 0.5 * (2.9 * k + 1.0).cos(), 1.0) * z
    };
    (0..count).map(|k| point(f64::from(k))).collect()
}

fn seen(points: &[Vector3<f64>], pose: &RelativePose) -> Vec<Option<[f64; 2]>> {
    let x2 = points.iter().map(|x1| pose.q_21 * x1 + pose.t_21);
    x2.map(|x2| Some([x2.x / x2.z, x2.y / x2.z])).collect()
}

fn goal(points: &[Vector3<f64>]) -> Vec<[f64; 2]> {
    points.iter().map(|x| [x.x / x.z, x.y / x.z]).collect()
}

/// The harmonic mean of the depths, which is the unit of the loop.
fn unit(points: &[Vector3<f64>]) -> f64 {
    points.len() as f64 / points.iter().map(|x| 1.0 / x.z).sum::<f64>()
}

fn pose(turn: [f64; 3], metres: [f64; 3]) -> RelativePose {
    RelativePose::new(UnitQuaternion::new(turn.into()), metres.into())
}

fn is_near(found: &RelativePose, truth: &RelativePose, unit: f64) -> bool {
    found.rotation_error(truth) < 1e-3 && (found.t_21 * unit - truth.t_21).norm() < 2e-3
}

/// The pose of a camera that stands still, once it is known.
fn settled(estimator: &mut impl PoseEstimator, image: &[Option<[f64; 2]>]) -> RelativePose {
    for _ in 0..4 {
        estimator.moved(&Motion { linear: Vector3::zeros(), angular: Vector3::zeros() });
        match estimator.estimate(image) {
            Ok(found) => return found.pose,
            Err(reason) => assert_eq!(reason, HoldReason::Starting),
        }
    }
    panic!("no pose after four images");
}

#[test]
fn the_first_images_give_the_pose_where_depths_are_known() {
    let truth = pose([0.05, -0.1, 0.2], [0.15, -0.1, 0.25]);
    for count in [8, 40] {
        let points = points(count);
        let (goal, unit) = (goal(&points), unit(&points));
        // In millimetres; one of them is not known.
        let mut depths: Vec<f64> = points.iter().map(|x| 1e3 * x.z).collect();
        depths[3] = f64::NAN;
        let rest: Vec<_> = points.iter().enumerate().filter(|(k, _)| *k != 3).map(|(_, x)| *x).collect();
        let unit_of_known = self::unit(&rest);
        let mut tracker = Tracker::new(&goal, SolverName::Quest, FilterOptions::default());
        tracker.set_depths(&depths, 0.01);
        let found = settled(&mut tracker, &seen(&points, &truth));
        assert!(is_near(&found, &truth, unit_of_known), "{count}: {found:?}");
        assert_eq!((tracker.hypotheses(), tracker.restarts()), (1, 0));
        for (k, (depth, x)) in tracker.depths().zip(&points).enumerate() {
            assert!(k == 3 || (depth * unit_of_known / x.z - 1.0).abs() < 0.02, "{k}: {depth} {x}");
        }
        assert!(tracker.depth_precisions().enumerate().all(|(k, p)| k == 3 || p < 0.02));
        // Depths that say nothing change nothing: the images alone have to start it.
        let mut without = Tracker::new(&goal, SolverName::Quest, FilterOptions::default());
        without.set_depths(&vec![f64::NAN; goal.len()], 0.01);
        without.set_depths(&vec![-1.0; goal.len()], 0.01);
        assert_eq!(without.estimate(&seen(&points, &truth)).unwrap_err(), HoldReason::Starting);
        assert!(without.depths().chain(without.depth_precisions()).all(f64::is_nan));

        let mut filter = DepthFilter::new(&goal, SolverName::Quest, FilterOptions::default());
        depths[3] = 1e3 * points[3].z;
        filter.set_depths(&depths, 0.01);
        let found = settled(&mut filter, &seen(&points, &truth));
        assert!(is_near(&found, &truth, unit), "{count}: {found:?}");
        assert!(filter.depths().zip(&points).all(|(depth, x)| (depth * unit / x.z - 1.0).abs() < 0.02));
        assert!(filter.depth_precisions().all(|p| p > 0.0 && p < 0.02));
        // They are remembered.
        filter.reset();
        assert!(is_near(&settled(&mut filter, &seen(&points, &truth)), &truth, unit));
    }
}

#[test]
fn a_camera_that_was_carried_away_is_found_again() {
    let before = pose([0.0, 0.05, 0.0], [0.1, 0.0, 0.2]);
    let after = pose([0.1, -0.1, 0.9], [-0.3, 0.2, 0.4]);
    for count in [8, 40] {
        let points = points(count);
        let (goal, unit) = (goal(&points), unit(&points));
        let mut tracker = Tracker::new(&goal, SolverName::Quest, FilterOptions::default());
        tracker.set_depths(&points.iter().map(|x| x.z).collect::<Vec<_>>(), 0.01);
        assert!(is_near(&settled(&mut tracker, &seen(&points, &before)), &before, unit));
        let mut found = Vec::new();
        for _ in 0..20 {
            tracker.moved(&Motion { linear: Vector3::zeros(), angular: Vector3::zeros() });
            found.push(tracker.estimate(&seen(&points, &after)));
        }
        // Nothing wrong is said on the way, and it does not begin anew.
        assert!(found.iter().flatten().all(|found| is_near(&found.pose, &after, unit)), "{count}: {found:?}");
        assert!(found[0].is_err() && found[19].is_ok(), "{count}: {found:?}");
        assert_eq!(tracker.restarts(), 0);
        // Features that never fit do.
        let wrong: Vec<_> =
            (0..count).map(|k| Some([(3.1 * f64::from(k)).sin(), (1.9 * f64::from(k)).cos()])).collect();
        for _ in 0..60 {
            tracker.moved(&Motion { linear: Vector3::zeros(), angular: Vector3::zeros() });
            let step = tracker.estimate(&wrong);
            assert!(step.is_err(), "{count}: {step:?}");
        }
        assert!(tracker.restarts() > 0);
    }
}

#[test]
fn a_law_behind_a_reference_is_the_same_law() {
    let mut law = FreeCameraLaw { rate: 0.25, unit: 2.0 };
    let mut other = law;
    let mut behind = &mut other;
    let pose = pose([0.1, -0.2, 0.3], [0.3, 0.1, 0.2]);
    assert_eq!(ControlLaw::command(&mut behind, &pose), law.command(&pose));
    assert_eq!(ControlLaw::turn(&mut behind, &pose), law.turn(&pose));
    assert_eq!(ControlLaw::potential(&behind, &pose), law.potential(&pose));
    for attempt in 0..4 {
        assert_eq!(ControlLaw::exploration(&behind, attempt), law.exploration(attempt));
    }
    ControlLaw::hindered(&mut behind, true);
    ControlLaw::reset(&mut behind);
    assert_eq!(other, law);
}
