//! The models without a polynomial, and those with a thin prism.

use std::f64::consts::PI;

use nalgebra::{Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::super::lens::Lens;
use super::{Camera, CameraError, CameraModel, camera, distance};

const SEED_PRISMS: u64 = 0xca3e_0201;

#[test]
fn parameters_out_of_their_range_are_named() {
    for (model, params, expected) in [
        (CameraModel::Fov, &[1.0, 1.0, 0.0, 0.0, PI][..], "omega"),
        (CameraModel::Eucm, &[1.0, 1.0, 0.0, 0.0, 1.1, 1.0], "alpha"),
        (CameraModel::Eucm, &[1.0, 1.0, 0.0, 0.0, -0.1, 1.0], "alpha"),
        (CameraModel::Eucm, &[1.0, 1.0, 0.0, 0.0, 0.5, 0.0], "beta"),
        (CameraModel::Equirectangular, &[0.0, 500.0], "w"),
        (CameraModel::Equirectangular, &[1000.0, -5.0], "h"),
    ] {
        let error = Camera::new(model, params).unwrap_err();
        assert!(
            matches!(error, CameraError::ParameterRange { name, .. } if name == expected),
            "{model} {error}"
        );
    }
}

#[test]
fn a_field_of_view_of_zero_is_a_pinhole() {
    let ray = |omega| {
        let camera = Camera::new(CameraModel::Fov, &[100.0, 100.0, 50.0, 50.0, omega]).unwrap();
        camera.bearing([90.0, 20.0]).unwrap()
    };
    for omega in [0.0, 1e-300, 1e-20, 1e-9] {
        assert!((ray(omega) - Vector3::new(0.4, -0.3, 1.0)).norm() < 1e-15, "{omega}");
    }
    // The model is even in its parameter.
    assert_eq!(ray(-0.9), ray(0.9));
}

#[test]
fn models_of_the_plane_end_where_a_ray_would_leave_it() {
    for (model, params, limit) in [
        // atan ends at π/2.
        (CameraModel::Fov, &[1.0, 1.0, 0.0, 0.0, 0.9][..], PI / 1.8),
        // 1 + k rd² = 0.
        (CameraModel::Division, &[1.0, 1.0, 0.0, 0.0, -0.25], 2.0),
        // rd / (1 + k rd²) has its largest value at 1 / √k.
        (CameraModel::SimpleDivision, &[1.0, 0.0, 0.0, 0.25], 2.0),
        // The distorted radius of an infinite one is 1 / (α √β).
        (CameraModel::Eucm, &[1.0, 1.0, 0.0, 0.0, 0.8, 0.25], 2.5),
    ] {
        let camera = Camera::new(model, params).unwrap();
        let error = camera.bearing([limit + 1e-6, 0.0]).unwrap_err();
        // The plane ends at 6.7e7, 1.5e-8 short of the limit.
        let CameraError::OutOfDomain { limit: named, .. } = error else { panic!("{error}") };
        assert!((named - limit).abs() < 1e-7, "{model} {named} {limit}");
        // The division with a fold ends at a radius of 1, the others where the plane does.
        let border = camera.bearing([0.0, limit - 1e-6]).unwrap();
        assert!(
            border.y > if model == CameraModel::SimpleDivision { 0.999 } else { 1e3 },
            "{model} {border}"
        );
    }
}

/// Thin prism lenses up to absurd ones: 0.1 is a hundred times what lenses have.
fn prism(rng: &mut ChaCha8Rng) -> Camera {
    let mut params = [0.0; 16];
    params[..2].fill(1.0);
    let size = 10f64.powf(rng.random_range(-4.0..-1.0));
    params[4..].fill_with(|| rng.random_range(-size..size));
    let radial: &[usize] = if rng.random_bool(0.5) { &[4, 5, 8, 9] } else { &[4, 5, 6, 7, 8, 9] };
    let mut size = 0.2;
    for k in radial {
        params[*k] = rng.random_range(-size..size);
        size /= 4.0;
    }
    if radial.len() == 4 {
        return Camera::new(CameraModel::ThinPrismFisheye, &params[..12]).unwrap();
    }
    Camera::new(CameraModel::RadTanThinPrismFisheye, &params).unwrap()
}

#[test]
fn a_thin_prism_is_inverted_in_its_whole_disc_and_nowhere_else() {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED_PRISMS);
    for _ in 0..1000 {
        let camera = prism(&mut rng);
        let Lens::Prism(lens) = camera.lens else { panic!("{camera:?}") };
        assert!(lens.max_radius() > 0.5, "{camera:?}");
        for _ in 0..50 {
            let direction = Vector2::from_fn(|_, _| rng.random_range(-1.0..1.0)).normalize();
            let x = direction * (lens.max_radius() * rng.random_range(0.0..0.9999));
            let (y, jacobian) = lens.distort(&x);
            assert!(jacobian.determinant() > 0.0, "{camera:?} {x}");
            let found = lens.undistort(&y);
            // As for the tangential part: at a fold only the residual can be exact to rounding.
            let error = |found: Vector2<f64>| (found - x).norm().min((jacobian * (found - x)).norm());
            assert!(found.is_some_and(|found| error(found) < 1e-13), "{camera:?} {x} {found:?}");
            let pixel: [f64; 2] = (y * rng.random_range(1.0..3.0)).into();
            match camera.bearing(pixel) {
                Ok(ray) => assert!(distance(camera.project(&ray).unwrap(), pixel) < 1e-10),
                Err(CameraError::OutOfDomain { found, limit }) => {
                    assert!(limit > 0.0 && found > limit, "{camera:?} {pixel:?} {found} {limit}");
                }
                Err(error) => panic!("{error}"),
            }
        }
    }
}

#[test]
fn a_panorama_sees_all_directions_and_has_a_border() {
    let camera = camera(CameraModel::Equirectangular, (1000, 500), &[1000.0, 500.0]);
    for (pixel, ray) in [
        ([750.0, 250.0], Vector3::x()),
        ([250.0, 250.0], -Vector3::x()),
        ([500.0, 500.0], Vector3::y()),
        ([500.0, 0.0], -Vector3::y()),
        ([1000.0, 250.0], -Vector3::z()),
        ([0.0, 250.0], -Vector3::z()),
    ] {
        assert!((camera.bearing(pixel).unwrap() - ray).norm() < 1e-15, "{pixel:?}");
    }
    for outside in [[-0.1, 250.0], [1000.1, 250.0], [500.0, -1e-9], [500.0, 501.0]] {
        let error = camera.bearing(outside).unwrap_err();
        assert_eq!(error, CameraError::OutsidePanorama { found: outside, size: [1000.0, 500.0] });
    }
    assert_eq!(camera.project(&Vector3::zeros()), Err(CameraError::NoDirection));
    // At the poles every longitude is right.
    assert!(camera.project(&(-Vector3::y() * 1e300)).unwrap()[1].abs() < 1e-12);
}

#[test]
fn the_border_of_a_panorama_leads_back_into_it() {
    for eighths in 1..4_000 {
        let size = [f64::from(eighths) / 8.0, f64::from(eighths) / 16.0];
        let camera = Camera::new(CameraModel::Equirectangular, &size).unwrap();
        for [x, y] in [[0.0, 0.35], [1.0, 0.35], [0.3, 0.0], [0.3, 1.0], [0.0, 0.0], [1.0, 1.0]] {
            let ray = camera.bearing([x * size[0], y * size[1]]).unwrap();
            let again = camera.bearing(camera.project(&ray).unwrap()).unwrap();
            assert!(ray.angle(&again) < 1e-7, "{size:?}, {x} {y}");
        }
    }
}
