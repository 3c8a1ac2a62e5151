//! Tests of the camera as a whole.

mod domain;
mod errors;
mod nine;
mod round_trip;

use std::f64::consts::{PI, TAU};

use nalgebra::Vector3;

use super::distortion::Distortion;
use super::lens::Lens;
use super::{Camera, CameraError, CameraModel};

/// A camera as used in practice, with the size of its images.
fn camera(model: CameraModel, (width, height): (u32, u32), params: &[f64]) -> Camera {
    Camera::new(model, params).unwrap().with_size(width, height).unwrap()
}

/// At least one camera of each model, every pixel of which has a viewing ray.
fn realistic() -> Vec<Camera> {
    use CameraModel as M;
    vec![
        camera(M::SimplePinhole, (1280, 720), &[1000.0, 640.0, 360.0]),
        camera(M::Pinhole, (1024, 768), &[1060.0, 1055.0, 514.0, 384.0]),
        // Strong barrel distortion: the corners lie at 0.67, the fold at 0.70.
        camera(M::SimpleRadial, (1280, 720), &[1100.0, 640.0, 360.0, -0.3]),
        // Pincushion.
        camera(M::SimpleRadial, (1280, 720), &[900.0, 650.0, 340.0, 0.4]),
        camera(M::Radial, (1280, 720), &[800.0, 640.0, 360.0, -0.3, 0.12]),
        // A machine vision camera of a drone (the order of magnitude of the EuRoC data set).
        camera(M::OpenCv, (752, 480), &[458.7, 457.3, 367.2, 248.4, -0.283, 0.074, 1.9e-4, 1.8e-5]),
        // Decentering a hundred times as strong.
        camera(M::OpenCv, (1280, 720), &[900.0, 920.0, 630.0, 370.0, 0.1, -0.02, 0.02, -0.015]),
        // A depth camera: a rational model whose numerator and denominator nearly cancel.
        camera(
            M::FullOpenCv,
            (1280, 720),
            &[605.0, 604.0, 637.0, 366.0, 0.45, -2.61, 4e-4, -2e-4, 1.52, 0.33, -2.44, 1.44],
        ),
        camera(
            M::FullOpenCv,
            (1280, 720),
            &[700.0, 700.0, 640.0, 360.0, -0.25, 0.05, 0.01, -0.02, 0.01, 0.02, 0.01, 0.0],
        ),
        // Fisheye lenses that see 108 degrees off the axis in the corners.
        camera(M::OpenCvFisheye, (512, 512), &[191.0, 191.0, 254.9, 256.9, 0.0035, 0.0007, -0.0021, 0.0002]),
        camera(M::SimpleRadialFisheye, (640, 480), &[220.0, 320.0, 240.0, -0.01]),
        camera(M::RadialFisheye, (640, 480), &[210.0, 322.0, 238.0, 0.03, -0.002]),
        camera(M::SimpleFisheye, (640, 480), &[200.0, 320.0, 240.0]),
        camera(M::Fisheye, (640, 480), &[200.0, 205.0, 322.0, 238.0]),
        // A lens of 160 degrees.
        camera(M::Fov, (1280, 720), &[580.0, 582.0, 640.0, 360.0, 0.93]),
        camera(
            M::ThinPrismFisheye,
            (640, 480),
            &[240.0, 241.0, 321.0, 239.0, 0.03, -0.01, 4e-4, -3e-4, 0.002, -1e-4, 5e-4, -6e-4],
        ),
        // A headset: the orders of magnitude of Project Aria's lenses.
        camera(
            M::RadTanThinPrismFisheye,
            (640, 480),
            &[
                260.0, 260.0, 321.0, 237.0, -0.026, 0.098, -0.067, 0.0138, 0.0013, -0.0007, 5e-4, -3e-4,
                8e-4, -1e-4, -5e-4, 2e-5,
            ],
        ),
        // A wide lens with barrel distortion, and pincushion distortion.
        camera(M::SimpleDivision, (1280, 720), &[700.0, 640.0, 360.0, -0.25]),
        camera(M::Division, (1280, 720), &[900.0, 905.0, 630.0, 365.0, 0.1]),
        camera(M::Eucm, (1280, 720), &[640.0, 641.0, 640.0, 360.0, 0.6, 1.1]),
        camera(M::Equirectangular, (2000, 1000), &[2000.0, 1000.0]),
    ]
}

/// The formulas of the module's table, coordinate by coordinate, without any check.
fn reference(camera: &Camera, ray: &Vector3<f64>) -> [f64; 2] {
    let x = ray;
    let (fx, fy) = camera.focal_lengths();
    let (cx, cy) = camera.principal_point();
    let p = camera.params();
    let (x, y) = if camera.model().is_fisheye() {
        let theta = x.xy().norm().atan2(x.z);
        (theta * x.x / x.xy().norm(), theta * x.y / x.xy().norm())
    } else {
        (x.x / x.z, x.y / x.z)
    };
    let r2 = x * x + y * y;
    let tangential = |p1: f64, p2: f64| {
        [2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x), 2.0 * p2 * x * y + p1 * (r2 + 2.0 * y * y)]
    };
    let (h, [tx, ty]) = match camera.model() {
        CameraModel::SimplePinhole
        | CameraModel::Pinhole
        | CameraModel::SimpleFisheye
        | CameraModel::Fisheye => (1.0, [0.0; 2]),
        CameraModel::SimpleRadial | CameraModel::SimpleRadialFisheye => (1.0 + p[3] * r2, [0.0; 2]),
        CameraModel::Radial | CameraModel::RadialFisheye => (1.0 + p[3] * r2 + p[4] * r2.powi(2), [0.0; 2]),
        CameraModel::OpenCv => (1.0 + p[4] * r2 + p[5] * r2.powi(2), tangential(p[6], p[7])),
        CameraModel::OpenCvFisheye => {
            (1.0 + p[4] * r2 + p[5] * r2.powi(2) + p[6] * r2.powi(3) + p[7] * r2.powi(4), [0.0; 2])
        }
        CameraModel::FullOpenCv => {
            let numerator = 1.0 + p[4] * r2 + p[5] * r2.powi(2) + p[8] * r2.powi(3);
            let denominator = 1.0 + p[9] * r2 + p[10] * r2.powi(2) + p[11] * r2.powi(3);
            (numerator / denominator, tangential(p[6], p[7]))
        }
        CameraModel::Equirectangular => {
            let (longitude, latitude) = (ray.x.atan2(ray.z), (ray.y / ray.norm()).asin());
            return [p[0] * (longitude / TAU + 0.5), p[1] * (latitude / PI + 0.5)];
        }
        CameraModel::Fov => ((2.0 * r2.sqrt() * (0.5 * p[4]).tan()).atan() / (p[4] * r2.sqrt()), [0.0; 2]),
        CameraModel::SimpleDivision | CameraModel::Division => {
            let k = p[p.len() - 1];
            (2.0 / (1.0 + (1.0 - 4.0 * k * r2).sqrt()), [0.0; 2])
        }
        CameraModel::Eucm => (1.0 / (p[4] * (p[5] * r2 + 1.0).sqrt() + 1.0 - p[4]), [0.0; 2]),
        CameraModel::ThinPrismFisheye => {
            let h = 1.0 + p[4] * r2 + p[5] * r2.powi(2) + p[8] * r2.powi(3) + p[9] * r2.powi(4);
            let [tx, ty] = tangential(p[6], p[7]);
            (h, [tx + p[10] * r2, ty + p[11] * r2])
        }
        CameraModel::RadTanThinPrismFisheye => {
            let h = 1.0 + r2 * p[4..10].iter().rev().fold(0.0, |sum, k| sum * r2 + k);
            let (x, y, r2) = (h * x, h * y, h * h * r2);
            let tx = 2.0 * p[11] * x * y + p[10] * (r2 + 2.0 * x * x) + p[12] * r2 + p[13] * r2 * r2;
            let ty = 2.0 * p[10] * x * y + p[11] * (r2 + 2.0 * y * y) + p[14] * r2 + p[15] * r2 * r2;
            (h, [tx, ty])
        }
    };
    [fx * (x * h + tx) + cx, fy * (y * h + ty) + cy]
}

/// The distortion of a camera whose model is a quotient of polynomials.
fn polynomial(camera: &Camera) -> Distortion {
    let Lens::Polynomial(distortion) = camera.lens else { panic!("{camera:?}") };
    distortion
}

/// The larger of the differences of the coordinates, in pixels.
fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).abs().max((a[1] - b[1]).abs())
}
