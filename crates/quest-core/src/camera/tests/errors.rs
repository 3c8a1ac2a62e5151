//! Every error, and what it says.

use nalgebra::{Matrix3, Vector2, Vector3};

use super::{Camera, CameraError, CameraModel};
use crate::camera::prism::Prism;

fn pinhole() -> Camera {
    Camera::new(CameraModel::Pinhole, &[100.0, 100.0, 50.0, 50.0]).unwrap()
}

#[test]
fn a_wrong_number_of_parameters_is_answered_with_their_names() {
    for model in CameraModel::ALL {
        let expected = model.param_names().len();
        for found in [0, expected - 1, expected + 1, 40] {
            let error = Camera::new(model, &vec![1.0; found]).unwrap_err();
            assert_eq!(error, CameraError::ParameterCount { model, expected, found });
        }
    }
    let message = Camera::new(CameraModel::Radial, &[1.0, 2.0]).unwrap_err().to_string();
    assert_eq!(message, "RADIAL takes 5 parameters (f, cx, cy, k1, k2), found 2");
}

#[test]
fn bad_parameters_are_named() {
    let error = |params: [f64; 5]| Camera::new(CameraModel::Radial, &params).unwrap_err();
    for bad in [f64::NAN, f64::INFINITY, -1e31] {
        let found = error([1.0, 0.0, 0.0, bad, 0.0]);
        assert!(matches!(found, CameraError::ParameterNotFinite { name: "k1", .. }), "{found}");
    }
    for focal in [0.0, -0.0, -600.0] {
        let expected = CameraError::FocalLength { name: "f", found: focal };
        assert_eq!(error([focal, 0.0, 0.0, 0.0, 0.0]), expected);
    }
    let found = Camera::new(CameraModel::Pinhole, &[1.0, -2.0, 0.0, 0.0]).unwrap_err();
    assert_eq!(found.to_string(), "focal length fy of the camera is -2 pixels, expected a positive number");
}

#[test]
fn a_matrix_that_is_not_a_calibration_matrix_is_refused() {
    let k = Matrix3::new(100.0, 0.0, 50.0, 0.0, 100.0, 50.0, 0.0, 0.0, 1.0);
    for (row, column, found, expected) in
        [(0, 1, 0.5, 0.0), (1, 0, 3.0, 0.0), (2, 0, f64::NAN, 0.0), (2, 1, 1e-9, 0.0), (2, 2, 2.0, 1.0)]
    {
        let mut bad = k;
        bad[(row, column)] = found;
        let message = Camera::from_k(&bad).unwrap_err().to_string();
        let start =
            format!("entry ({row}, {column}) of the calibration matrix is {found}, expected {expected}");
        assert!(message.starts_with(&start), "{message}");
    }
    let mut bad = k;
    bad[(0, 0)] = f64::NAN;
    assert!(matches!(Camera::from_k(&bad), Err(CameraError::ParameterNotFinite { name: "fx", .. })));
    bad[(0, 0)] = -100.0;
    assert_eq!(Camera::from_k(&bad), Err(CameraError::FocalLength { name: "fx", found: -100.0 }));
}

#[test]
fn coefficients_of_opencv_are_counted() {
    let k = [600.0, 610.0, 320.0, 240.0];
    let of = |count: usize| (0..count).map(|i| if i < 8 { 0.01 * i as f64 } else { 0.0 }).collect::<Vec<_>>();
    for (is_fisheye, count, model, used) in [
        (false, 0, CameraModel::Pinhole, 0),
        (false, 4, CameraModel::OpenCv, 4),
        (false, 5, CameraModel::FullOpenCv, 8),
        (false, 8, CameraModel::FullOpenCv, 8),
        (false, 12, CameraModel::FullOpenCv, 8),
        (false, 14, CameraModel::FullOpenCv, 8),
        (true, 0, CameraModel::OpenCvFisheye, 4),
        (true, 4, CameraModel::OpenCvFisheye, 4),
    ] {
        let camera = Camera::from_opencv(k, &of(count), is_fisheye).unwrap();
        let mut params = [&k[..], &of(count)].concat();
        params.resize(4 + used, 0.0);
        assert_eq!(camera, Camera::new(model, &params).unwrap());
    }
    for (is_fisheye, found, expected) in [(false, 3, "0, 4, 5, 8, 12 or 14"), (true, 5, "0 or 4")] {
        let error = Camera::from_opencv(k, &of(found), is_fisheye).unwrap_err();
        assert_eq!(error, CameraError::DistortionCount { found, expected });
    }
    let mut prism = of(12);
    prism[9] = 0.5;
    assert_eq!(Camera::from_opencv(k, &prism, false), Err(CameraError::ThinPrism { found: 0.5 }));
}

#[test]
fn an_image_without_pixels_is_refused() {
    for (width, height) in [(640, 0), (0, 480), (0, 0)] {
        let error = pinhole().with_size(width, height).unwrap_err().to_string();
        assert_eq!(error, format!("the size of the image is {width} x {height}, expected at least 1 x 1"));
    }
}

#[test]
fn pixels_and_points_that_are_not_finite_are_refused() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let error = pinhole().bearing([1.0, bad]).unwrap_err();
        assert_eq!(error.to_string(), format!("a coordinate is {bad}, expected a finite number"));
        assert!(matches!(
            pinhole().project(&Vector3::new(0.0, bad, 1.0)),
            Err(CameraError::NotFinite { .. })
        ));
    }
}

#[test]
fn points_that_are_not_in_front_are_refused() {
    for z in [0.0, -2.0] {
        assert_eq!(pinhole().project(&Vector3::new(0.1, 0.2, z)), Err(CameraError::BehindCamera { z }));
    }
    // In front, but so far to the side that the quotient overflows.
    let error = pinhole().project(&Vector3::new(1e200, 0.0, 1e-200)).unwrap_err();
    assert!(matches!(error, CameraError::PointOutOfDomain { found, .. } if found.is_finite()), "{error}");
    assert!(error.to_string().contains("from the optical axis (on the plane z = 1)"), "{error}");

    let fisheye = Camera::new(CameraModel::SimpleRadialFisheye, &[100.0, 50.0, 50.0, 0.0]).unwrap();
    for x in [Vector3::zeros(), -Vector3::z()] {
        assert_eq!(fisheye.project(&x), Err(CameraError::NoDirection));
    }
}

#[test]
fn what_is_not_a_number_is_not_undistorted() {
    for prism in [Prism::thin([0.0; 8]), Prism::radial_tangential([0.0; 12])] {
        assert_eq!(prism.undistort(&Vector2::new(f64::NAN, 0.1)), None);
        let x = Vector2::new(0.3, -0.2);
        assert!((prism.undistort(&x).unwrap() - x).norm() < 1e-12);
    }
}
