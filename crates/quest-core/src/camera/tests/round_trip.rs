//! Pixels to rays and back, and the formulas.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{Matrix3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Camera, CameraModel, camera, distance, realistic, reference};

const SEED_POINTS: u64 = 0xca3e_0001;

#[test]
fn every_model_is_among_the_realistic_cameras() {
    for model in CameraModel::ALL {
        assert!(realistic().iter().any(|camera| camera.model() == model), "{model}");
    }
}

#[test]
fn pixels_return_to_themselves_over_the_whole_image() {
    for camera in realistic() {
        let (width, height) = camera.size().unwrap();
        let steps = |n: u32| (0..=64).map(move |i| f64::from(n) * f64::from(i) / 64.0);
        for u in steps(width) {
            for v in steps(height) {
                let ray = camera.bearing([u, v]).unwrap_or_else(|e| panic!("{camera:?} {u} {v}: {e}"));
                let back = camera.project(&ray).unwrap();
                // A coordinate of 1280 is rounded to 2e-13; the rational model loses two more digits where
                // its terms cancel.
                assert!(distance(back, [u, v]) < 2e-11, "{camera:?} {u} {v} {back:?}");
                if camera.model().is_fisheye() {
                    assert!((ray.norm() - 1.0).abs() < 1e-15);
                } else {
                    assert_eq!(ray.z.to_bits(), 1f64.to_bits());
                }
            }
        }
    }
}

#[test]
fn rays_return_to_themselves_up_to_the_border_of_the_domain() {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED_POINTS);
    for camera in realistic() {
        // The plane is infinite for some models: 3 is 72 degrees off the axis.
        let reach = camera.lens.max_radius().min(if camera.model().is_fisheye() { 3.1 } else { 3.0 });
        for _ in 0..2000 {
            let r = reach * rng.random_range(0.0..0.999);
            let (sin, cos) = rng.random_range(-PI..PI).sin_cos();
            let x = if camera.model().is_fisheye() {
                Vector3::new(r.sin() * cos, r.sin() * sin, r.cos())
            } else {
                Vector3::new(r * cos, r * sin, 1.0)
            };
            let found = camera.bearing(camera.project(&x).unwrap()).unwrap();
            // Pixels of size 2000 over f = 200 are rounded to 2e-15 on the plane. At 0.999 of the border the
            // slope has fallen to some 2e-3, and dividing by it leaves 1e-12, times 10 for cancellation.
            assert!((found - x).amax() < 1e-11 * (1.0 + r), "{camera:?} {x} {found}");
        }
    }
}

#[test]
fn projection_follows_the_formulas() {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED_POINTS + 1);
    for camera in realistic() {
        for _ in 0..1000 {
            let x = Vector3::from_fn(|i, _| rng.random_range(if i == 2 { 1.0..2.0 } else { -0.6..0.6 }));
            let pixel = camera.project(&x).unwrap();
            // Rounding of coordinates of 1000 pixels, a few times.
            assert!(distance(pixel, reference(&camera, &x)) < 5e-12, "{camera:?} {x}");
        }
    }
}

#[test]
fn projection_gives_the_values_computed_by_hand() {
    let size = (100, 100);
    for (camera, x, expected) in [
        // r² = 0.3125, h = 0.96875.
        (
            camera(CameraModel::SimpleRadial, size, &[100.0, 50.0, 40.0, -0.1]),
            Vector3::new(1.0, 0.5, 2.0),
            [98.4375, 64.21875],
        ),
        // h = 1.6 / 1.6; xd = 1 + 3 p2, yd = p1: the order of p1 and p2 shows.
        (
            camera(
                CameraModel::FullOpenCv,
                size,
                &[100.0, 200.0, 10.0, 20.0, 0.1, 0.2, 0.01, 0.02, 0.3, 0.25, 0.25, 0.1],
            ),
            Vector3::new(3.0, 0.0, 3.0),
            [116.0, 22.0],
        ),
        // Straight to the side: θ = π/2.
        (
            camera(CameraModel::RadialFisheye, size, &[100.0, 50.0, 40.0, 0.1, 0.0]),
            Vector3::new(0.0, -7.0, 0.0),
            [50.0, 40.0 - 100.0 * FRAC_PI_2 * (1.0 + 0.1 * FRAC_PI_2 * FRAC_PI_2)],
        ),
    ] {
        assert!(distance(camera.project(&x).unwrap(), expected) < 1e-12, "{camera:?}");
    }
}

#[test]
fn a_fisheye_sees_behind_itself() {
    let camera = camera(CameraModel::SimpleRadialFisheye, (640, 640), &[100.0, 320.0, 320.0, 0.0]);
    let ray = camera.bearing([320.0 + 100.0 * 2.5, 320.0]).unwrap();
    assert!((ray - Vector3::new(2.5f64.sin(), 0.0, 2.5f64.cos())).norm() < 1e-15 && ray.z < 0.0);
    // The full sphere ends at π.
    let error = camera.bearing([320.0, 320.0 + 100.0 * 3.15]).unwrap_err().to_string();
    assert!(error.contains("3.15") && error.contains("3.141592654"), "{error}");
}

#[test]
fn the_principal_point_looks_along_the_axis() {
    for camera in realistic() {
        let (cx, cy) = camera.principal_point();
        assert_eq!(camera.bearing([cx, cy]), Ok(Vector3::z()));
        assert_eq!(camera.project(&(Vector3::z() * 1e-300)), Ok([cx, cy]));
    }
}

#[test]
fn a_calibration_matrix_is_a_pinhole_camera() {
    let k = Matrix3::new(1060.0, 1e-11, 514.0, 0.0, 1050.0, 384.0, 0.0, 0.0, 1.0);
    let camera = Camera::from_k(&k).unwrap();
    assert_eq!(camera, Camera::new(CameraModel::Pinhole, &[1060.0, 1050.0, 514.0, 384.0]).unwrap());
    let ray = camera.bearing([1044.0, 594.0]).unwrap();
    assert!((ray - Vector3::new(0.5, 0.2, 1.0)).norm() < 1e-15);
    assert_eq!((camera.focal_lengths(), camera.size()), ((1060.0, 1050.0), None));
}
