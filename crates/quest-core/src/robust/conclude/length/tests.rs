//! Lengths of planted depths, and their variances by many trials.

use super::*;
use crate::robust::conclude::mixture::of_length;
use crate::robust::search::sampling;
use crate::{Correspondence, RelativePose};
use nalgebra::{Matrix6, UnitQuaternion};
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};

/// A point that seems to be as far away in both views, by inverse depths of this variance.
fn point(rho: f64, variance: f64) -> BothDepths {
    let zero = Vector3::zeros();
    BothDepths { rho: [Differentiated { value: rho, by_rotation: zero, by_direction: zero }; 2], variance }
}

fn no_chance() -> Chance {
    Chance { depths: Vec::new(), each: 0.0, missed: 0.0 }
}

#[test]
fn exact_depths_have_a_mean_of_one_and_the_slope_is_that_of_the_length() {
    let rng = &mut sampling::generator(0x1e_49, 0);
    let motion = Motion {
        q_21: UnitQuaternion::new(Vector3::new(0.1, -0.2, 0.1)),
        direction: Vector3::new(0.7, 0.2, 0.3).normalize(),
    };
    let mut depths = 0.0;
    let all = (0..40).map(|_| {
        let mut number = |from, to| rng.random_range(from..to);
        let x1 = Vector3::new(number(-0.5, 0.5), number(-0.5, 0.5), 1.0) * number(4.0, 9.0);
        let x2 = motion.q_21 * x1 + motion.direction;
        depths += x1.z + x2.z;
        Correspondence::from_image_points([x1.x / x1.z, x1.y / x1.z], [x2.x / x2.z, x2.y / x2.z]).unwrap()
    });
    let matches: Vec<_> = all.collect();
    let inliers: Vec<u32> = (0..40).collect();
    let observations = Observations::new(&matches, inliers.clone(), [[500.0; 2]; 2], 1.0);
    let (none, by_chance) =
        (Columns::of_points(observations.columns.images(), 1.0, std::iter::empty()), ByChance::unknown());
    let noise = Noise { sigma: 1e-4, false_matches: &none, by_chance: &by_chance };
    let of = |motion: &Motion| length(&observations, motion, &inliers, &noise);
    let found = of(&motion);
    // The noise is a millionth of the parallax.
    assert!(found.is_clear && (found.value * depths / 80.0 - 1.0).abs() < 1e-8, "{}", found.value);
    let step = 1e-6;
    for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
        let turned =
            |by: f64| of(&Motion { q_21: UnitQuaternion::new(axis * by) * motion.q_21, ..motion }).value;
        let moved = |by: f64| of(&Motion { direction: motion.direction + axis * by, ..motion }).value;
        let size = found.by_rotation.norm() + found.by_direction.norm();
        let by_rotation = (turned(step) - turned(-step)) / (2.0 * step);
        let by_direction = (moved(step) - moved(-step)) / (2.0 * step);
        assert!((found.by_rotation.dot(&axis) - by_rotation).abs() < 1e-5 * size, "{axis} {by_rotation}");
        assert!((found.by_direction.dot(&axis) - by_direction).abs() < 1e-5 * size, "{axis} {by_direction}");
    }
    assert!(length(&observations, &motion, &[], &noise).value.abs() <= 0.0);
    // Where most points are not clear the slope is that of the mean of the inverse depths.
    let blurred = length(&observations, &motion, &inliers, &Noise { sigma: 50.0, ..noise });
    assert!(!blurred.is_clear && blurred.value > 0.0 && blurred.by_direction.norm() > 0.0);
}

/// The mean of the lengths of many scenes over the truth, and the mean of their squared errors over their variances.
fn trials(
    of_scene: impl Fn(&mut dyn FnMut(f64) -> f64, &mut dyn FnMut() -> f64) -> (Length, f64),
) -> [f64; 2] {
    let [mut noise, mut depths] = [1, 2].map(|index| sampling::generator(0x1e_49, index));
    let mut normal = |sigma: f64| sigma * Distribution::<f64>::sample(&StandardNormal, &mut noise);
    let mut depth = || depths.random_range(0.6..1.5);
    let (mut ratio, mut square) = (0.0, 0.0);
    for _ in 0..400 {
        let (found, truth) = of_scene(&mut normal, &mut depth);
        ratio += found.value / truth / 400.0;
        square += (found.value - truth).powi(2) / found.variance / 400.0;
    }
    [ratio, square]
}

#[test]
fn the_variance_of_a_length_is_that_of_many_scenes() {
    let [ratio, square] = trials(|normal, depth| {
        let depths: Vec<f64> = (0..50).map(|_| depth()).collect();
        let truth = 50.0 / depths.iter().sum::<f64>();
        let points: Vec<_> = depths.iter().map(|z| point(1.0 / z + normal(0.05), 0.05 * 0.05)).collect();
        (by_depths(&points, &[], &no_chance()), truth)
    });
    assert!((ratio - 1.0).abs() < 0.005 && (0.75..1.35).contains(&square), "{ratio} {square}");
    // Noise that leaves no depth clear, and now and then looks like depths that differ.
    let [ratio, square] = trials(|normal, _| {
        let points: Vec<_> = (0..200).map(|_| point(1.0 + normal(0.5), 0.25)).collect();
        (by_inverse_depths(&points), 1.0)
    });
    assert!((ratio - 1.0).abs() < 0.05 && (0.6..1.7).contains(&square), "{ratio} {square}");
}

#[test]
fn false_and_missing_matches_make_a_length_uncertain() {
    let points = vec![point(1.0, 1e-9); 1_000];
    let one_false = Chance { depths: vec![(3.0, 1.0), (5.0, 0.0)], each: 1.0, missed: 0.0 };
    // One point of depth 3 more: the mean grows by 2 in a thousand. One that never stays changes nothing.
    let found = by_depths(&points, &[], &one_false);
    assert!(
        (found.value - 1.0).abs() < 1e-6 && (found.variance * 2.5e5 - 1.0).abs() < 1e-2,
        "{}",
        found.variance
    );
    // Half of the depths are 0.5, half 1.5. A share of one missing: as many as there are, each off by half.
    let points: Vec<_> = (0..1_000).map(|k| point(if k % 2 == 0 { 2.0 } else { 2.0 / 3.0 }, 1e-9)).collect();
    let missing = Chance { depths: Vec::new(), each: 0.0, missed: 1.0 };
    assert!((by_depths(&points, &[], &missing).variance * 4e3 - 1.0).abs() < 1e-2);
    assert!((0.0026..0.0031).contains(&beyond(3.0)) && beyond(0.1) >= 1.0);
}

#[test]
fn points_that_are_seen_badly_count_as_many_where_their_median_is_clear() {
    let well = vec![point(1.0, 1e-6); 100];
    let badly = vec![point(0.5, 0.01); 100];
    let found = by_depths(&well, &badly, &no_chance());
    assert!((found.value - 1.0 / 1.5).abs() < 1e-4, "{}", found.value);
    // The variance of a median of depths of 2, by which half of the mean scatters.
    let of_median = MEDIAN_VARIANCE * 0.01 / 100.0 / 0.5_f64.powi(4);
    assert!(
        (found.variance / (of_median * 0.25 * found.value.powi(4)) - 1.0).abs() < 0.02,
        "{}",
        found.variance
    );
    // Where it is not clear they are left out.
    let unseen = by_depths(&well, &vec![point(0.1, 4.0); 100], &no_chance());
    assert!((unseen.value - 1.0).abs() < 1e-4);
    // Depths of 0.5 and 1.5. As many others, which may all be in one place, have a mean that is off by half of that deviation.
    let both: Vec<_> = (0..100).map(|k| point(if k % 2 == 0 { 2.0 } else { 2.0 / 3.0 }, 1e-9)).collect();
    let unseen = by_depths(&both, &vec![point(0.1, 4.0); 100], &no_chance());
    assert!((unseen.variance / (0.5_f64 * 0.5).powi(2) - 1.0).abs() < 1e-3, "{}", unseen.variance);
    // A hundredth of the points at the horizon: five times as far away as most.
    let mut far = vec![point(1.0, 1e-6); 99];
    far.push(point(1e-9, 1e-6));
    let with_far = by_depths(&far, &[], &no_chance());
    assert!((with_far.value - 100.0 / 104.0).abs() < 1e-4, "{}", with_far.value);
    assert!(
        (with_far.variance.sqrt() / with_far.value.powi(2) - 0.025).abs() < 1e-3,
        "{}",
        with_far.variance
    );
    let [clear, rest] =
        seen_well_or_badly([well, vec![point(0.5, 0.05); 80], vec![point(0.9, 0.5); 10]].concat());
    assert_eq!([clear.len(), rest.len()], [100, 90]);
    // A usual depth stands clear by twice as many deviations as it takes: of a sixth of it.
    let limits = [vec![point(1.0, 0.027); 60], vec![point(1.0, 0.029); 50]].concat();
    assert_eq!(seen_well_or_badly(limits).map(|some| some.len()), [60, 50]);
    // Few are seen well: those that stand clear themselves.
    let [clear, rest] = seen_well_or_badly([vec![point(1.0, 0.05); 30], vec![point(1.0, 0.5); 10]].concat());
    assert_eq!([clear.len(), rest.len()], [30, 10]);
}

#[test]
fn sides_and_positive_means() {
    assert!(are_in_front(&vec![point(1.0, 0.01); 5]) && !are_in_front(&vec![point(-1.0, 0.01); 5]));
    assert!(!are_in_front(&[vec![point(1.0, 0.01); 6], vec![point(-1.0, 0.01); 4]].concat()));
    assert!(!are_in_front(&vec![point(1.0, 1.0); 50]), "none is clear");
    // At zero that of a half normal variable, the same far away.
    assert!((positive(0.0, 4.0).0 - 2.0 * (2.0 / std::f64::consts::PI).sqrt()).abs() < 1e-12);
    assert!((positive(100.0, 1.0).0 - 100.0).abs() < 0.01 && positive(-100.0, 1.0).0 < 0.01);
    for mean in [-1.0, 0.0, 0.5, 3.0] {
        let slope = (positive(mean + 1e-6, 1.5).0 - positive(mean - 1e-6, 1.5).0) / 2e-6;
        assert!((positive(mean, 1.5).1 - slope).abs() < 1e-8, "{mean}");
    }
    let [mut odd, mut even] = [vec![3.0, 1.0, 2.0], vec![4.0, 1.0, 3.0, 2.0]];
    assert_eq!((median(&mut odd), median(&mut even), median(&mut [])), (2.0, 3.0, 0.0));
}

#[test]
fn the_spread_of_logarithms_is_found_beside_the_noise() {
    let rng = &mut sampling::generator(0x1e_49, 3);
    let mut normal = || Distribution::<f64>::sample(&StandardNormal, rng);
    for (spread, noise) in [(0.0, 0.1), (0.5, 0.0), (0.5, 0.1)] {
        let points: Vec<_> = (0..2_000)
            .map(|_| {
                let rho = (spread * normal()).exp();
                point(rho + noise * normal(), noise * noise)
            })
            .collect();
        let found = square_of_logarithms(&points, 1.0);
        assert!((found - spread * spread).abs() < 0.04, "{spread} {noise}: {found}");
    }
    assert!(square_of_logarithms(&[point(1.0, 0.0)], -1.0) <= 0.0);
    // The unit of the depths does not matter.
    let of_unit = |unit: f64| {
        let points: Vec<_> =
            (0..40).map(|k| point(unit * (0.8 + 0.01 * f64::from(k)), 1e-4 * unit * unit)).collect();
        square_of_logarithms(&points, unit)
    };
    assert!(of_unit(1.0) > 0.01 && (of_unit(4.0) / of_unit(1.0) - 1.0).abs() < 1e-12);
}

#[test]
fn a_pose_takes_a_length_with_its_variance() {
    let zero = Vector3::zeros();
    let length =
        |value| Length { value, variance: 0.09, is_clear: true, by_rotation: zero, by_direction: zero };
    let pose = RelativePose::new(UnitQuaternion::identity(), Vector3::new(0.0, 0.5, 0.0));
    let (found, covariance) = of_length((pose, Matrix6::identity()), &length(1.5));
    assert!((found.t_21 - Vector3::y() * 1.5).amax() < 1e-15);
    let expected = Matrix6::from_diagonal(&[1.0, 1.0, 1.0, 9.0, 9.09, 9.0].into());
    assert!((covariance - expected).amax() < 1e-12, "{covariance}");
    for value in [0.0, -1.0, f64::INFINITY, f64::NAN] {
        assert_eq!(of_length((pose, Matrix6::identity()), &length(value)).0, pose);
    }
}
