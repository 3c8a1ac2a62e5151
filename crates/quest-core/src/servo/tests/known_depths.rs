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

fn still() -> Motion {
    Motion { linear: Vector3::zeros(), angular: Vector3::zeros() }
}

#[test]
fn depths_that_say_nothing_leave_a_filter_to_its_images() {
    let points = points(12);
    let (goal, truth) = (goal(&points), pose([0.05, -0.1, 0.2], [0.15, -0.1, 0.25]));
    let image = seen(&points, &truth);
    // None known, all infinitely far, all so near that the mean of their inverses is infinite.
    for depth in [f64::NAN, f64::INFINITY, -1.0, 0.0, 1e-320] {
        let mut filter = DepthFilter::new(&goal, SolverName::Quest, FilterOptions::default());
        filter.set_depths_each(&[depth; 12], &[0.01; 12]);
        if depth.is_nan() || depth > 0.0 {
            filter.reset();
            assert_eq!(filter.estimate(&image).unwrap_err(), HoldReason::Starting, "{depth}");
            assert_eq!(filter.depths().count(), 0, "{depth}");
        }
        filter.set_depths(&[depth; 12], 0.01);
        assert_eq!(filter.estimate(&image).unwrap_err(), HoldReason::Starting, "{depth}");
        let mut tracker = Tracker::new(&goal, SolverName::Quest, FilterOptions::default());
        tracker.set_depths(&[depth; 12], 0.01);
        assert_eq!(tracker.estimate(&image).unwrap_err(), HoldReason::Starting, "{depth}");
        assert!(tracker.depths().all(f64::is_nan), "{depth}");
    }
    // One without depths that is reset has none either.
    let mut filter = DepthFilter::new(&goal, SolverName::Quest, FilterOptions::default());
    filter.reset();
    assert_eq!((filter.depths().count(), filter.hypotheses()), (0, 0));
}

#[test]
fn a_filter_starts_with_the_depths_it_knows_and_one_that_it_does_not() {
    let points = points(12);
    let (goal, truth) = (goal(&points), pose([0.05, -0.1, 0.2], [0.15, -0.1, 0.25]));
    let mut depths: Vec<f64> = points.iter().map(|x| 1e3 * x.z).collect();
    depths[5] = f64::NAN;
    let mut filter = DepthFilter::new(&goal, SolverName::Quest, FilterOptions::default());
    filter.set_depths_each(&depths, &[0.01; 12]);
    let found = settled(&mut filter, &seen(&points, &truth));
    // The unit is the mean of all depths, of which one is a guess.
    assert!(found.rotation_error(&truth) < 1e-2, "{found:?}");
    assert!(found.t_21.angle(&truth.t_21) < 0.05, "{found:?}");
    let precisions: Vec<f64> = filter.depth_precisions().collect();
    assert!(
        precisions.iter().enumerate().all(|(k, p)| (*p < 0.05) == (k != 5) || *p < 0.05),
        "{precisions:?}"
    );
}

#[test]
fn features_that_are_not_seen_at_first_keep_the_depths_that_were_given() {
    let truth = pose([0.05, -0.1, 0.2], [0.15, -0.1, 0.25]);
    for count in [10, 40, 130] {
        let points = points(count);
        let (goal, unit) = (goal(&points), unit(&points));
        let mut tracker = Tracker::new(&goal, SolverName::Quest, FilterOptions::default());
        tracker.set_depths(&points.iter().map(|x| x.z).collect::<Vec<_>>(), 0.01);
        let mut image = seen(&points, &truth);
        (image[2], image[7]) = (None, None);
        assert!(is_near(&settled(&mut tracker, &image), &truth, unit), "{count}");
        for k in 0..30 {
            tracker.moved(&still());
            let found = tracker.estimate(&image).unwrap();
            assert!(is_near(&found.pose, &truth, unit), "{count}, image {k}: {found:?}");
        }
        assert!(!tracker.inliers()[2] && !tracker.inliers()[7]);
        for k in [2, 7] {
            let depth = tracker.depths().nth(k).unwrap();
            assert!((depth * unit / points[k].z - 1.0).abs() < 0.02, "{count}, {k}: {depth}");
        }
        // They count as soon as they are seen.
        tracker.moved(&still());
        let found = tracker.estimate(&seen(&points, &truth)).unwrap();
        assert_eq!(found.inliers, points.len(), "{count}");
    }
}

#[test]
fn a_filter_finds_a_camera_that_was_carried_away() {
    let before = pose([0.0, 0.05, 0.0], [0.1, 0.0, 0.2]);
    let after = pose([0.1, -0.1, 0.9], [-0.3, 0.2, 0.4]);
    let points = points(12);
    let (goal, unit) = (goal(&points), unit(&points));
    let mut filter = DepthFilter::new(&goal, SolverName::Quest, FilterOptions::default());
    filter.set_depths(&points.iter().map(|x| x.z).collect::<Vec<_>>(), 0.01);
    assert!(is_near(&settled(&mut filter, &seen(&points, &before)), &before, unit));
    let found: Vec<_> = (0..40).map(|_| filter.estimate(&seen(&points, &after))).collect();
    assert!(found.iter().flatten().all(|found| is_near(&found.pose, &after, unit)), "{found:?}");
    assert!(found[0].is_err() && found[39].is_ok(), "{found:?}");
}

/// Image after image, with a little noise, of a camera that is not commanded.
fn shown(
    tracker: &mut Tracker<SolverName>,
    points: &[Vector3<f64>],
    pose: &RelativePose,
    images: usize,
    rng: &mut ChaCha8Rng,
) -> Vec<Result<Estimate, HoldReason>> {
    let mut all = Vec::new();
    for _ in 0..images {
        let mut image = seen(points, pose);
        for x in image.iter_mut().flatten().flatten() {
            *x += rng.random_range(-1e-3..1e-3);
        }
        tracker.moved(&still());
        all.push(tracker.estimate(&image));
    }
    all
}

#[test]
fn a_camera_that_only_turned_begins_anew_once_it_is_carried_aside_or_lost() {
    let turned = pose([0.1, 0.25, -0.2], [0.0; 3]);
    let points = points(30);
    let rng = &mut scenario::generator(26, 0);
    let mut tracker = Tracker::new(&goal(&points), SolverName::Quest, FilterOptions::default());
    let first = shown(&mut tracker, &points, &turned, 80, rng);
    let last = first.last().unwrap().unwrap();
    assert_eq!((last.support, tracker.restarts()), (Support::RotationOnly, 0), "{last:?}");
    assert!(last.pose.rotation_error(&turned) < 5e-3 && last.pose.t_21.norm() <= 0.0, "{last:?}");
    // Carried aside, by little and by much: the rotation explains the images no more.
    for share in [0.04, 0.05, 0.06, 0.07, 0.1, 0.2, 0.4, 1.0] {
        let mut aside = tracker.clone();
        let moved = pose([0.1, 0.25, -0.2], [0.3, -0.2, 0.1].map(|x| share * x));
        let after = shown(&mut aside, &points, &moved, 80, rng);
        // So little that it may be noise is let pass.
        assert!(share < 0.1 || aside.restarts() > 0, "{share}");
        let last = after.into_iter().rev().flatten().next().unwrap();
        assert!(last.pose.rotation_error(&moved) < 2e-2, "{share}: {last:?}");
        assert!(
            last.support == Support::RotationOnly || last.pose.t_21.angle(&moved.t_21) < 0.5,
            "{share}: {last:?}"
        );
    }
    // Features that are anything: it looks for no place on a map that it does not have.
    for _ in 0..30 {
        let wrong: Vec<_> = (0..30).map(|_| Some([0; 2].map(|_| rng.random_range(-0.5..0.5)))).collect();
        tracker.moved(&still());
        assert!(tracker.estimate(&wrong).is_err());
    }
    assert!(tracker.restarts() > 0);
}

/// Why there is no pose where one half of the features is seen, then the other, by turns.
fn reasons_by_halves(estimator: &mut impl PoseEstimator, image: &[Option<[f64; 2]>]) -> Vec<HoldReason> {
    let mut reason = |k: usize| {
        let half = image.iter().enumerate().map(|(i, x)| x.filter(|_| (i < 6) == k.is_multiple_of(2)));
        estimator.estimate(&half.collect::<Vec<_>>()).unwrap_err()
    };
    (0..8).map(&mut reason).collect()
}

#[test]
fn first_images_that_show_other_features_every_time_are_too_few() {
    let points = points(12);
    let image = seen(&points, &pose([0.05, -0.1, 0.2], [0.15, -0.1, 0.25]));
    let options = FilterOptions { first_images: 4, ..FilterOptions::default() };
    let mut filter = DepthFilter::new(&goal(&points), SolverName::Quest, options);
    let mut tracker = Tracker::new(&goal(&points), SolverName::Quest, options);
    let of_filter = reasons_by_halves(&mut filter, &image);
    let of_tracker = reasons_by_halves(&mut tracker, &image);
    for reasons in [of_filter, of_tracker] {
        for (k, reason) in reasons.iter().enumerate() {
            let expected = if k % 4 == 3 { HoldReason::TooFewFeatures } else { HoldReason::Starting };
            assert_eq!(*reason, expected, "image {k}: {reasons:?}");
        }
    }
}

#[test]
fn a_pose_in_each_image_needs_depths_that_are_finite_and_an_image_with_all_features() {
    let points = points(8);
    let (goal, truth) = (goal(&points), pose([0.05, -0.1, 0.2], [0.15, -0.1, 0.25]));
    let image = seen(&points, &truth);
    let mut depths: Vec<f64> = points.iter().map(|x| x.z).collect();
    for choice in [Choice::ClosestDepths, Choice::Reprojection, Choice::RotationAxis] {
        let mut estimator = PerFrame::new(&goal, SolverName::Quest, choice, Length::GoalDepths);
        // The first image lacks a feature, so that its depths are no reference yet.
        let mut some = image.clone();
        some[4] = None;
        for _ in 0..2 {
            let found = estimator.estimate(&some).unwrap();
            assert_eq!(found.inliers, 7);
        }
        assert_eq!(estimator.estimate(&image).unwrap().inliers, 8);
        estimator.set_depths(&depths);
        let found = estimator.estimate(&image).unwrap();
        if choice != Choice::RotationAxis {
            assert!(is_near(&found.pose, &truth, unit(&points)), "{choice:?}: {found:?}");
        }
    }
    depths[1] = f64::INFINITY;
    let mut estimator = PerFrame::new(&goal, SolverName::Quest, Choice::ClosestDepths, Length::GoalDepths);
    estimator.set_depths(&depths);
    assert_eq!(estimator.estimate(&image).unwrap_err(), HoldReason::Degenerate);
}

/// A pixel without a viewing ray is no number on the plane z = 1.
#[test]
fn a_goal_feature_that_is_not_a_number_takes_no_part() {
    let truth = pose([0.05, -0.1, 0.2], [0.15, -0.1, 0.25]);
    for count in [9, 20, 40] {
        let points = points(count);
        let (mut goal, image) = (goal(&points), seen(&points, &truth));
        goal[3] = [f64::NAN; 2];
        goal[5] = [0.1, f64::INFINITY];
        let rng = &mut scenario::generator(27, 0);
        let mut tracker = Tracker::new(&goal, SolverName::Quest, FilterOptions::default());
        let mut filter = DepthFilter::new(&goal, SolverName::Quest, FilterOptions::default());
        let mut found = [Err(HoldReason::Starting); 2];
        for _ in 0..60 {
            let mut image = image.clone();
            for x in image.iter_mut().flatten().flatten() {
                *x += rng.random_range(-3e-4..3e-4);
            }
            tracker.moved(&still());
            found = [tracker.estimate(&image), filter.estimate(&image)];
        }
        for (name, found) in ["tracker", "filter"].into_iter().zip(found) {
            let found = found.unwrap_or_else(|reason| panic!("{count}, {name}: {reason}"));
            assert!(found.pose.rotation_error(&truth) < 2e-2, "{count}, {name}: {found:?}");
            assert!(found.pose.t_21.angle(&truth.t_21) < 0.1, "{count}, {name}: {found:?}");
        }
        // Nor does a depth that is given for it.
        let mut known = Tracker::new(&goal, SolverName::Quest, FilterOptions::default());
        known.set_depths(&points.iter().map(|x| x.z).collect::<Vec<_>>(), 0.01);
        assert!(is_near(&settled(&mut known, &image), &truth, unit(&points)), "{count}");
        assert!(known.depths().nth(3).unwrap().is_nan() && !known.inliers()[3], "{count}");
    }
}
