//! Densities that integrate to one, their derivatives, and planted translations.

use super::*;
use crate::Correspondence;
use crate::robust::search::sampling;
use nalgebra::Vector3;
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};

const SIGMA: f64 = 0.7;
const FOCAL: f64 = 500.0;

/// Matches of points that are four to nine units away, the last third of them false, and the rotation between the views.
fn matches(step: &Vector3<f64>) -> (Vec<Correspondence>, UnitQuaternion<f64>) {
    let rng = &mut sampling::generator(0xe71d, 0);
    let q_21 = UnitQuaternion::new(Vector3::new(0.02, -0.01, 0.03));
    let all = (0..150).map(|k| {
        let z = rng.random_range(4.0..9.0);
        let mut place = || Vector3::new(rng.random_range(-0.5..0.5), rng.random_range(-0.5..0.5), 1.0);
        let (x1, other) = (place(), place());
        let seen = q_21 * x1 * z + step;
        let seen = if k < 100 { seen / seen.z } else { other };
        let mut noisy = |x: f64| x + SIGMA / FOCAL * Distribution::<f64>::sample(&StandardNormal, rng);
        Correspondence::from_image_points([noisy(x1.x), noisy(x1.y)], [noisy(seen.x), noisy(seen.y)]).unwrap()
    });
    (all.collect(), q_21)
}

fn likelihood(step: &Vector3<f64>) -> (Likelihood, UnitQuaternion<f64>) {
    let (matches, q_21) = matches(step);
    let all: Vec<u32> = (0..150).collect();
    let observations = Observations::new(&matches, all.clone(), [[FOCAL; 2]; 2], 1.5);
    (Likelihood::new(&observations, &all, &q_21, SIGMA, 0.6), q_21)
}

/// The density of a match, by its ratio to one.
fn density(densities: &Densities, at: [f64; 3], square_spread: f64, near: f64) -> (f64, Explained) {
    let [across, away, along] = at.map(|x| [x; WIDTH]);
    let places = Places { across, away, along, spread: [square_spread; WIDTH], is_in_front: [true; WIDTH] };
    let explained = densities.explain(&[1.0; WIDTH], &places, near);
    (explained.nats[0].exp(), explained)
}

#[test]
fn the_densities_of_true_matches_are_densities() {
    let Densities { outliers, floor, near_norm, .. } = likelihood(&Vector3::zeros()).0.densities;
    let densities = likelihood(&Vector3::zeros()).0.densities;
    assert!((outliers - 0.4).abs() < 1e-15);
    // Rings around the known point.
    let step = 0.01;
    let rings = (0..3_000).map(|k| (f64::from(k) + 0.5) * step);
    let sum: f64 = rings.map(|r| (densities.of_known(r * r) - floor) * 2.0 * PI * r * step).sum();
    assert!((sum - 0.6).abs() < 1e-4, "{sum}");
    // A plane across and along the epipolar line, whatever the spread along it.
    for square_spread in [0.0, 4.0] {
        let step = 0.25;
        let line = || (-60..=60).map(|k| f64::from(k) * step);
        let cells = line().flat_map(|across| line().map(move |away| [across, away, 1.0]));
        let sum: f64 =
            cells.map(|at| (density(&densities, at, square_spread, 0.0).0 - floor) * step * step).sum();
        assert!((sum - 0.6).abs() < 1e-4, "{sum}");
    }
    // Near points are anywhere in front along the line, as far as the false matches are spread.
    let side = (outliers / floor).sqrt();
    let sum: f64 = (0..40_000).map(|k| densities.near((f64::from(k) + 0.5) * side / 40_000.0)).sum();
    assert!((sum * side / 40_000.0 - 1.0).abs() < 1e-3, "{sum}");
    assert!(near_norm > 0.0 && densities.near(-1.0) <= 0.0);
}

#[test]
fn the_weights_are_derivatives_of_the_likelihood() {
    let densities = likelihood(&Vector3::zeros()).0.densities;
    for [across, away] in [[0.3, -0.5], [1.4, 0.9], [-2.2, 1.0]] {
        let nats = |across, away| density(&densities, [across, away, 30.0], 2.0, 0.01).0.ln();
        let explained = density(&densities, [across, away, 30.0], 2.0, 0.01).1;
        // Near points have the widths of the noise for one.
        let step = 1e-5;
        let by_away = (nats(across, away + step) - nats(across, away - step)) / (2.0 * step);
        assert!((by_away + away * explained.along[0]).abs() < 1e-7, "{by_away}");
        let none = |across| density(&densities, [across, away, 30.0], 2.0, 0.0).0.ln();
        let by_across = (none(across + step) - none(across - step)) / (2.0 * step);
        let weight = density(&densities, [across, away, 30.0], 2.0, 0.0).1.across[0];
        assert!((by_across + across * weight).abs() < 1e-7, "{by_across}");
        // What is neither a point of the field nor a near one is false.
        let is_false = densities.floor / nats(across, away).exp();
        assert!((explained.usual[0] + explained.near[0] + is_false - 1.0).abs() < 1e-6);
    }
    // A near point whose probability is not clear counts for nothing, one that is clear has the lever of one.
    let near = |away: f64, along: f64| density(&densities, [0.0, away, along], 0.0, 0.05).1;
    assert!(near(20.0, 20.0).near[0] > BELIEVED && near(20.0, 1e5).near[0] <= 0.0);
    assert!((near(20.0, 20.0).near_across[0] / near(20.0, 20.0).near[0] * SIGMA * SIGMA - 1.0).abs() < 1e-12);
}

#[test]
fn a_translation_is_evident_where_there_is_one() {
    let step = Vector3::new(0.15, -0.05, 0.05);
    let (likelihood, q_21) = likelihood(&step);
    let motion = Motion { q_21, direction: step.normalize() };
    let found = likelihood.of(&motion, ROUNDS);
    // Displacements of ten pixels with noise of one.
    assert!(found.nats > 100.0, "{}", found.nats);
    // The mean of uniform depths from 4 to 9 is ln(9/4)/5, that of the inverse.
    let expected = step.norm() * (9_f64 / 4.0).ln() / 5.0;
    assert!((found.mean_depth / expected - 1.0).abs() < 0.1, "{} {expected}", found.mean_depth);
    let likely = |range: std::ops::Range<usize>| found.is_true[range].iter().filter(|p| **p > 0.5).count();
    assert!(likely(0..100) >= 95 && likely(100..150) <= 5, "{} {}", likely(0..100), likely(100..150));
    assert_eq!(found.is_true.len(), 150);
    // The other way has the same likelihood with the points behind the cameras, and another way explains nothing.
    let of = |direction| likelihood.of(&Motion { q_21, direction }, ROUNDS);
    assert!((of(-motion.direction).mean_depth / found.mean_depth + 1.0).abs() < 0.1);
    assert!(of(Vector3::new(0.1, 1.0, 0.2).normalize()).nats < 0.5 * found.nats);
}

#[test]
fn a_camera_that_stands_still_has_no_evidence() {
    let (likelihood, q_21) = likelihood(&Vector3::zeros());
    for direction in [Vector3::x(), Vector3::y(), Vector3::new(0.3, 0.2, 0.9).normalize()] {
        let found = likelihood.of(&Motion { q_21, direction }, ROUNDS);
        assert!(found.nats < 5.0, "{}", found.nats);
    }
    assert!((without_two(&[5.0, 1.0, 7.0, -2.0]) + 1.0).abs() < 1e-15);
    assert!((without_two(&[-1.0, -2.0]) + 3.0).abs() < 1e-15);
    assert!((without_two(&[-1.0, 4.0, -2.0]) + 3.0).abs() < 1e-15);
}

/// Points around an inverse depth of one, one in ten a near one, and one in five false: EM finds the numbers that they were made with.
#[test]
fn rounds_find_where_most_inverse_depths_are() {
    let rng = &mut sampling::generator(0xe71d, 1);
    let mut normal = |deviation: f64| deviation * Distribution::<f64>::sample(&StandardNormal, rng);
    let (spread, step) = (0.2, Vector3::new(0.03, -0.01, 0.02));
    let all = (0..1_000).map(|k| {
        let place = f64::from(k);
        let x1 = Vector3::new(0.5 * (2.1 * place).sin(), 0.5 * (3.7 * place).cos(), 1.0);
        let rho = if k % 10 == 0 { 5.0 } else { 1.0 + normal(spread) };
        let seen = x1 + step * rho;
        let seen = if k % 5 == 1 {
            [0.5 * (1.3 * place).sin(), 0.5 * (5.1 * place).cos()]
        } else {
            [seen.x / seen.z, seen.y / seen.z]
        };
        // Both views have the noise, and all of it is in the second; one keypoint in ten is less sharp.
        let sigma = 2_f64.sqrt() * if k % 10 == 7 { 3.0 } else { 1.0 } * SIGMA;
        Correspondence::from_image_points([x1.x, x1.y], seen.map(|x| x + normal(sigma / FOCAL))).unwrap()
    });
    let matches: Vec<_> = all.collect();
    let all: Vec<u32> = (0..1_000).collect();
    let observations = Observations::new(&matches, all.clone(), [[FOCAL; 2]; 2], 1.5);
    let still = UnitQuaternion::identity();
    let likelihood = Likelihood::new(&observations, &all, &still, SIGMA, 0.8);
    let r_21 = rows(&still.to_rotation_matrix().into_inner());
    let all = widest(Splitting { likelihood: &likelihood, r_21, t_21: step.into() });
    let first = likelihood.first_depths(&all);
    // By median and quartiles, near points and all.
    assert!((first.mean - 1.0).abs() < 0.1 && (first.square_spread.sqrt() - spread).abs() < 0.1, "{first:?}");
    let found = (0..30).fold(first, |depths, _| likelihood.next_depths(&all, &depths));
    // Three deviations of 700 points, and of 100 near ones among 800.
    assert!((found.mean - 1.0).abs() < 0.03, "{found:?}");
    assert!((found.square_spread.sqrt() - spread).abs() < 0.03, "{found:?}");
    assert!((found.near - 0.125).abs() < 0.04, "{found:?}");
    // From anywhere else the same.
    let elsewhere = Depths { mean: 1.6, square_spread: 0.3, near: 0.4 };
    let other = (0..60).fold(elsewhere, |depths, _| likelihood.next_depths(&all, &depths));
    assert!((other.mean - found.mean).abs() < 1e-3 && (other.near - found.near).abs() < 1e-3, "{other:?}");
}

#[test]
fn a_match_is_true_as_likely_as_its_densities_say() {
    let step = Vector3::new(0.15, -0.05, 0.05);
    let (likelihood, q_21) = likelihood(&step);
    let r_21 = rows(&q_21.to_rotation_matrix().into_inner());
    let all = widest(Splitting { likelihood: &likelihood, r_21, t_21: step.into() });
    let depths = Depths { near: 0.0, ..likelihood.first_depths(&all) };
    let [is_true, nats] = widest(Probabilities { likelihood: &likelihood, all: &all, depths });
    let floor = likelihood.densities.floor;
    for ((is_true, nats), still) in is_true.iter().zip(&nats).zip(&likelihood.still) {
        for j in 0..WIDTH {
            assert!((0.0..=1.0).contains(&is_true[j]), "{}", is_true[j]);
            let density = nats[j].exp() / still[j];
            assert!((density * (1.0 - is_true[j]) / floor - 1.0).abs() < 1e-9, "{density} {}", is_true[j]);
        }
    }
}
