//! Where the noise of a view lives, and the frames around its points that take errors to pixels.

use nalgebra::Vector3;

use crate::epipolar_frame::tangent_basis;

/// Where the noise of a view lives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Image {
    /// On the plane `z = 1`, with the focal lengths in pixels.
    Plane([f64; 2]),
    /// On the sphere, with the pixels in a radian.
    Sphere(f64),
}

/// An image around one of its points: `e` takes a vector to pixels, `n` is what it is divided by, `d` takes pixels back.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    pub(crate) e: [Vector3<f64>; 2],
    pub(crate) n: Vector3<f64>,
    pub(crate) d: [Vector3<f64>; 2],
}

/// A match as vectors, with the frames of both views around them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FramedMatch {
    pub(crate) x1: Vector3<f64>,
    pub(crate) x2: Vector3<f64>,
    pub(crate) frame1: Frame,
    pub(crate) frame2: Frame,
}

impl Image {
    pub(crate) fn scaled(self, b: &Vector3<f64>) -> Vector3<f64> {
        match self {
            Self::Plane([fx, fy]) => Vector3::new(fx * b.x / b.z, fy * b.y / b.z, 1.0),
            Self::Sphere(f) => b * f,
        }
    }

    pub(crate) fn inverse_scale(self) -> [f64; 3] {
        match self {
            Self::Plane([fx, fy]) => [1.0 / fx, 1.0 / fy, 1.0],
            Self::Sphere(f) => [1.0 / f; 3],
        }
    }

    pub(crate) fn square_focal_length(self) -> f64 {
        match self {
            Self::Plane([fx, fy]) => fx * fy,
            Self::Sphere(f) => f * f,
        }
    }

    pub(crate) fn frame(self, b: &Vector3<f64>) -> Frame {
        match self {
            Self::Plane([fx, fy]) => Frame {
                e: [Vector3::x() * fx, Vector3::y() * fy],
                n: Vector3::z(),
                d: [Vector3::x() / fx, Vector3::y() / fy],
            },
            Self::Sphere(f) => {
                let tangent = tangent_basis(b);
                Frame { e: tangent.map(|e| e * f), n: *b, d: tangent.map(|e| e / f) }
            }
        }
    }
}
