//! Where the models end, and what cannot be broken.

use std::f64::consts::PI;

use nalgebra::{Vector2, Vector3};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::super::{MAX_IMAGE_COORDINATE, MAX_PARAMETER};
use super::{Camera, CameraError, CameraModel, camera, distance, polynomial};

const SEED_CAMERAS: u64 = 0xca3e_0101;
const SEED_PROPERTIES: u64 = 0xca3e_0102;

#[test]
fn the_fold_of_barrel_distortion_is_reported() {
    // r - r³/3 grows up to r = 1, where it is 2/3.
    let camera = camera(CameraModel::SimpleRadial, (1000, 1000), &[600.0, 500.0, 500.0, -1.0 / 3.0]);
    let inside = camera.bearing([500.0 + 600.0 * (2.0 / 3.0 - 1e-9), 500.0]).unwrap();
    // Next to the fold 2/3 - d lies at 1 - √d.
    assert!((inside.x - (1.0 - 1e-9f64.sqrt())).abs() < 1e-8, "{inside}");

    let error = camera.bearing([500.0, 500.0 - 600.0 * 0.7]).unwrap_err();
    let CameraError::OutOfDomain { found, limit } = error else { panic!("{error:?}") };
    assert!((found - 0.7).abs() < 1e-12 && (limit - 2.0 / 3.0).abs() < 1e-12);
    assert!(
        error.to_string().contains("0.700000000") && error.to_string().contains("0.666666667"),
        "{error}"
    );

    let error = camera.project(&Vector3::new(0.0, 2.2, 2.0)).unwrap_err();
    let CameraError::PointOutOfDomain { found, limit, .. } = error else { panic!("{error:?}") };
    assert!((found - 1.1).abs() < 1e-12 && (limit - 1.0).abs() < 1e-10, "{error}");
}

#[test]
fn the_fold_of_a_fisheye_is_reported() {
    // θ - θ³/12 grows up to θ = 2, beyond a right angle.
    let camera = camera(CameraModel::SimpleRadialFisheye, (640, 480), &[100.0, 320.0, 240.0, -1.0 / 12.0]);
    let error = camera.project(&Vector3::new(0.0, 2.1f64.sin(), 2.1f64.cos())).unwrap_err();
    assert!(error.to_string().contains("2.1") && error.to_string().contains("radians"), "{error}");
    assert!((camera.lens.max_radius() - 2.0).abs() < 1e-10);
    assert!(camera.bearing([320.0 + 100.0 * 1.34, 240.0]).is_err());
    assert!(camera.bearing([320.0 + 100.0 * 1.33, 240.0]).unwrap().z < 0.0);
}

#[test]
fn the_pole_of_a_rational_model_ends_its_domain() {
    // h = 1 / (1 - r²) maps the unit disc to the whole plane.
    let mut params = [0.0; 12];
    params[..4].copy_from_slice(&[1.0, 1.0, 0.0, 0.0]);
    params[9] = -1.0;
    let camera = Camera::new(CameraModel::FullOpenCv, &params).unwrap();
    // x / (1 - x²) = 1e6 has the root 2e6 / (1 + √(1 + 4e12)).
    let ray = camera.bearing([1e6, 0.0]).unwrap();
    assert!((ray.x - 2e6 / (1.0 + (1.0 + 4e12f64).sqrt())).abs() < 1e-12, "{ray}");
    assert!(camera.project(&Vector3::new(1.5, 0.0, 1.0)).is_err());
}

/// Cameras of any tangential distortion up to absurd ones: 0.1 is a hundred times what lenses have.
fn tangential(rng: &mut ChaCha8Rng) -> Camera {
    let mut params = [0.0; 12];
    params[..4].copy_from_slice(&[1.0, 1.0, 0.0, 0.0]);
    let p = 10f64.powf(rng.random_range(-4.0..-1.0));
    for (k, range) in [(4, 0.4), (5, 0.2), (6, p), (7, p), (8, 0.1), (9, 0.3), (10, 0.2), (11, 0.1)] {
        params[k] = rng.random_range(-range..range);
    }
    if rng.random_bool(0.5) {
        return Camera::new(CameraModel::OpenCv, &params[..8]).unwrap();
    }
    Camera::new(CameraModel::FullOpenCv, &params).unwrap()
}

#[test]
fn tangential_distortion_is_inverted_in_the_whole_disc_and_nowhere_else() {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED_CAMERAS);
    for _ in 0..1000 {
        let camera = tangential(&mut rng);
        let distortion = polynomial(&camera);
        let disc = distortion.max_radius().min(5.0);
        for _ in 0..50 {
            let direction = Vector2::from_fn(|_, _| rng.random_range(-1.0..1.0)).normalize();
            let x = direction * (disc * rng.random_range(0.0..0.9999));
            let (y, jacobian) = distortion.distort(&x);
            assert!(jacobian.symmetric_eigenvalues().min() > 0.0, "{camera:?} {x}");
            let found = distortion.undistort(&y);
            // The root or the residual is exact to rounding: at the fold only the residual can be (the least
            // eigenvalue falls to 1e-4 of its size), at a pole only the root.
            let error = |found: Vector2<f64>| (found - x).norm().min((jacobian * (found - x)).norm());
            assert!(found.is_some_and(|found| error(found) < 1e-13), "{camera:?} {x} {found:?}");

            let pixel = y * rng.random_range(1.0..3.0);
            match camera.bearing(pixel.into()) {
                Ok(ray) => assert!(ray.xy().norm() <= distortion.max_radius()),
                Err(CameraError::OutOfDomain { found, limit }) => {
                    assert!(found > limit, "{camera:?} {pixel} {found} {limit}");
                }
                Err(error) => panic!("{error}"),
            }
        }
    }
}

#[test]
fn a_search_that_runs_into_the_border_starts_again_from_the_centre() {
    // Found by the property below, once in 750,000 cases.
    let (numerator, denominator) = ([0.232_446, -0.783_817, -0.034_844], [-0.298_948, -0.760_861, 0.287_367]);
    let [[k1, k2, k3], [k4, k5, k6]] = [numerator, denominator];
    let params = [1.0, 1.0, 0.0, 0.0, k1, k2, 0.398_325, 0.0, k3, k4, k5, k6];
    let camera = Camera::new(CameraModel::FullOpenCv, &params).unwrap();
    let pixel = [-2.275_611_020_005_351_6, 0.0];
    let ray = camera.bearing(pixel).unwrap();
    assert!(distance(camera.project(&ray).unwrap(), pixel) < 1e-12);
}

#[test]
fn the_disc_of_barrel_distortion_is_the_largest_possible() {
    let k = [1.0, 1.0, 0.0, 0.0, -0.3, 0.0, 0.02, -0.01];
    let distortion = polynomial(&Camera::new(CameraModel::OpenCv, &k).unwrap());
    // Opposite to w = (p2, p1) the Jacobian becomes singular on the border.
    let border = Vector2::new(0.01, -0.02).normalize() * distortion.max_radius();
    assert!(distortion.distort(&border).1.determinant().abs() < 1e-9);
    assert!((distortion.distort(&border).0.norm() - distortion.max_distorted()).abs() < 1e-12);
}

#[test]
fn far_pixels_are_errors_that_name_the_limit() {
    for model in CameraModel::ALL {
        let mut params = vec![0.0; model.param_names().len()];
        params[..2].fill(1.0);
        into_range(model, &mut params);
        let camera = Camera::new(model, &params).unwrap();
        for far in [1e308, -f64::MAX, 1e9] {
            let error = camera.bearing([far, 0.0]).unwrap_err();
            if model == CameraModel::Equirectangular {
                assert_eq!(error, CameraError::OutsidePanorama { found: [far, 0.0], size: [1.0; 2] });
                continue;
            }
            let CameraError::OutOfDomain { found, limit } = error else { panic!("{error:?}") };
            let expected = if model.is_fisheye() { PI } else { MAX_IMAGE_COORDINATE };
            assert!(found.is_finite() && found > limit && (limit - expected).abs() <= 1e-9 * expected);
            assert!(error.to_string().len() < 160, "{error}");
        }
    }
    // The quotient overflows.
    let camera = Camera::new(CameraModel::SimplePinhole, &[1e-10, 0.0, 0.0]).unwrap();
    let error = camera.bearing([1e308, 1e308]).unwrap_err();
    assert!(matches!(error, CameraError::OutOfDomain { found, .. } if found.is_finite()), "{error}");
}

/// Moves the parameters that have a range of their own into it.
fn into_range(model: CameraModel, params: &mut [f64]) {
    if let (CameraModel::Fov, [.., omega]) = (model, &mut *params) {
        *omega = omega.clamp(-3.1, 3.1);
    }
    if let (CameraModel::Eucm, [.., alpha, beta]) = (model, params) {
        *alpha = alpha.abs().min(1.0);
        *beta = beta.abs().max(1e-30);
    }
}

/// Any number, among them NaN, infinities and subnormal ones, or one of ordinary size.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        prop::num::f64::ANY,
        -2.0..2.0,
        -2000.0..2000.0,
        Just(0.0),
        Just(MAX_PARAMETER),
        Just(f64::MAX)
    ]
}

fn fixed(cases: u32) -> ProptestConfig {
    let rng_seed = RngSeed::Fixed(SEED_PROPERTIES);
    ProptestConfig { cases, rng_seed, failure_persistence: None, ..ProptestConfig::default() }
}

fn check_outcome(camera: &Camera, pixel: [f64; 2], x: [f64; 3]) {
    match camera.bearing(pixel) {
        Ok(ray) => assert!(ray.iter().all(|c| c.is_finite()) && ray != Vector3::zeros()),
        Err(CameraError::OutOfDomain { found, .. }) => assert!(found.is_finite()),
        Err(error) => {
            let expected =
                matches!(error, CameraError::NotFinite { .. } | CameraError::OutsidePanorama { .. });
            assert!(expected, "{error}");
        }
    }
    if let Ok(pixel) = camera.project(&x.into()) {
        assert!(pixel.iter().all(|c| c.is_finite()));
    }
}

proptest! {
    #![proptest_config(fixed(20_000))]

    #[test]
    fn nothing_panics_and_nothing_is_infinite(
        model in prop::sample::select(&CameraModel::ALL[..]),
        params in prop::array::uniform16(number()),
        pixel in prop::array::uniform2(number()),
        x in prop::array::uniform3(number()),
    ) {
        let count = model.param_names().len();
        if let Ok(camera) = Camera::new(model, &params[..count]) {
            check_outcome(&camera, pixel, x);
        }
        // Most of the above are refused: the same with parameters that are within bounds.
        let bounded = params.map(|p| if p.is_finite() { p.clamp(-MAX_PARAMETER, MAX_PARAMETER) } else { 0.5 });
        let mut bounded = bounded[..count].to_vec();
        bounded[..2].iter_mut().for_each(|f| *f = f.abs().max(f64::MIN_POSITIVE));
        into_range(model, &mut bounded);
        check_outcome(&Camera::new(model, &bounded).unwrap(), pixel, x);
    }

    #[test]
    fn every_ray_returns_to_its_pixel(
        model in prop::sample::select(&CameraModel::ALL[..]),
        k in prop::array::uniform12(-1.0..1.0),
        pixel in prop::array::uniform2(-3.0..3.0),
    ) {
        let mut params = vec![1.0, 1.0, 0.0, 0.0];
        if model.param_names()[0] == "f" {
            params.remove(0);
        }
        params.extend(k);
        params.truncate(model.param_names().len());
        into_range(model, &mut params);
        let camera = Camera::new(model, &params).unwrap();
        match camera.bearing(pixel) {
            // A residual of 1e-11 is what the inverse accepts; wild rational models cancel that many digits.
            Ok(ray) => prop_assert!(distance(camera.project(&ray).unwrap(), pixel) < 1e-10),
            Err(error) => {
                let beyond = match error {
                    CameraError::OutOfDomain { found, limit } => found > limit,
                    CameraError::OutsidePanorama { found, .. } => found.iter().any(|x| !(0.0..=1.0).contains(x)),
                    _ => false,
                };
                prop_assert!(beyond, "{error}");
            }
        }
    }
}
