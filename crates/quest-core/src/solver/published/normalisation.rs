//! Hartley's isotropic normalisation, for bearings in any direction.
//!
//! On an image plane the points are moved and scaled until their centroid is the origin and their mean squared distance from
//! it is two (section 4 of *In defense of the eight-point algorithm*). For homogeneous vectors `(x, y, z)` these
//! are conditions on second moments,
//!
//! ```text
//! Σ x z = Σ y z = 0        Σ (x² + y²) = 2 Σ z²
//! ```
//!
//! which make sense for unit bearings too, also at right angles to the optical axis and behind the camera: the `z` axis
//! becomes the principal axis `m` of the bearings, and `T = m mᵀ + s (I − m mᵀ)` scales what is across it. Nothing
//! depends on the frame of the camera. In a narrow field of view it is Hartley's transformation; in a wide one each match
//! counts by its bearings and not by how far from the image centre it is.

use nalgebra::{Matrix3, Vector3};

use crate::algebra::symmetric::smallest_eigenvector_3;

/// The normalising transformation of one view, a symmetric matrix.
pub(crate) struct Normalisation {
    pub(crate) transform: Matrix3<f64>,
    pub(crate) inverse: Matrix3<f64>,
}

impl Normalisation {
    pub(crate) fn new<'a>(bearings: impl Iterator<Item = &'a Vector3<f64>>) -> Self {
        let moments: Matrix3<f64> = bearings.map(|x| x * x.transpose()).sum();
        let trace = moments.trace();
        let rest = Matrix3::from_diagonal_element(trace) - moments;
        let m = smallest_eigenvector_3(&rest).unwrap_or_else(Vector3::z);
        // Bearings that all coincide have nothing across, and are found out by what they leave undetermined.
        let across = m.dot(&(rest * m)).max(f64::EPSILON * trace);
        let along = trace - across;
        let (parallel, scale) = (m * m.transpose(), (2.0 * along / across).sqrt());
        let perpendicular = Matrix3::identity() - parallel;
        Self { transform: parallel + perpendicular * scale, inverse: parallel + perpendicular / scale }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::SymmetricEigen;

    #[test]
    fn moments_are_those_of_hartley() {
        let bearings = [[0.1, 0.4, 1.0], [-0.3, 0.2, 0.9], [0.5, -0.2, -1.1], [0.2, 0.6, 0.8]]
            .map(|x| Vector3::from(x).normalize());
        let normalisation = Normalisation::new(bearings.iter());
        assert!((normalisation.transform * normalisation.inverse - Matrix3::identity()).norm() < 1e-14);
        let moments: Matrix3<f64> =
            bearings.iter().map(|x| normalisation.transform * x).map(|x| x * x.transpose()).sum();
        // One principal moment is half of the sum of the two others.
        let values = SymmetricEigen::new(moments).eigenvalues;
        assert!(values.iter().any(|v| (3.0 * v - values.sum()).abs() < 1e-14 * values.sum()));
    }
}
