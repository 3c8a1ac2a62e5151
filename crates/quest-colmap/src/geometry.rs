//! What a row of `two_view_geometries` says of a pose.

use nalgebra::{Matrix3, Vector3};
use quest_core::robust::Model;
use quest_core::{Camera, Correspondence, RelativePose};
use serde::Serialize;

use crate::Matches;

/// What a row says of a pair: COLMAP's `config`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "SCREAMING_SNAKE_CASE")]
#[non_exhaustive]
pub enum Config {
    /// No pose.
    Undefined,
    /// An essential matrix.
    Calibrated,
    /// A fundamental matrix: a focal length is a guess.
    Uncalibrated,
    /// A homography, a translation.
    Planar,
    /// A homography, no translation.
    Panoramic,
    /// A homography; which of the two is not known.
    PlanarOrPanoramic,
    /// The matches are those of what is written onto both images.
    Watermark,
}

impl Config {
    /// COLMAP's number.
    #[must_use]
    pub fn code(self) -> i64 {
        match self {
            Self::Undefined => 0,
            Self::Calibrated => 2,
            Self::Uncalibrated => 3,
            Self::Planar => 4,
            Self::Panoramic => 5,
            Self::PlanarOrPanoramic => 6,
            Self::Watermark => 7,
        }
    }

    /// COLMAP's name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Undefined => "UNDEFINED",
            Self::Calibrated => "CALIBRATED",
            Self::Uncalibrated => "UNCALIBRATED",
            Self::Planar => "PLANAR",
            Self::Panoramic => "PANORAMIC",
            Self::PlanarOrPanoramic => "PLANAR_OR_PANORAMIC",
            Self::Watermark => "WATERMARK",
        }
    }
}

/// A row of `two_view_geometries`, from the image with the smaller number to the other.
#[derive(Clone, Debug, PartialEq)]
pub struct TwoViewGeometry {
    /// What the row says.
    pub config: Config,
    /// The inliers, in the order of the matches.
    pub inliers: Matches,
    /// `x2ᵀ F x1 = 0` of pixels without distortion.
    pub fundamental: Option<Matrix3<f64>>,
    /// `x2ᵀ E x1 = 0` of rays.
    pub essential: Option<Matrix3<f64>>,
    /// `x2 ∝ H x1` of pixels without distortion.
    pub homography: Option<Matrix3<f64>>,
    /// The pose; its translation is zero or has length one.
    pub pose: Option<RelativePose>,
}

impl TwoViewGeometry {
    /// No pose.
    #[must_use]
    pub fn undefined() -> Self {
        Self::of_pixels(Config::Undefined, Matches::default())
    }

    /// What says nothing of the pose.
    pub(crate) fn of_pixels(config: Config, inliers: Matches) -> Self {
        Self { config, inliers, fundamental: None, essential: None, homography: None, pose: None }
    }

    /// The row of a pose of calibrated cameras. `rays` are those of `inliers`, where they are at hand: a plane needs them for its
    /// homography.
    #[must_use]
    pub fn calibrated(
        model: Model,
        pose: &RelativePose,
        rays: &[Correspondence],
        inliers: Matches,
        cameras: [&Camera; 2],
    ) -> Self {
        let ks = calibrations(cameras);
        let direction = pose.t_21.try_normalize(0.0).filter(|_| model != Model::PureRotation);
        let Some(direction) = direction else {
            let pose = RelativePose::new(pose.q_21, Vector3::zeros());
            let homography = ks.and_then(|ks| homography(Model::PureRotation, &pose, rays, ks));
            let inliers = turned_alone(&pose, rays, inliers);
            return Self { homography, pose: Some(pose), ..Self::of_pixels(Config::Panoramic, inliers) };
        };
        let pose = RelativePose::new(pose.q_21, direction);
        let essential = pose.essential();
        let config = if model == Model::Planar { Config::Planar } else { Config::Calibrated };
        let of_pixels =
            |[k1, k2]: [Matrix3<f64>; 2]| Some(k2.try_inverse()?.transpose() * essential * k1.try_inverse()?);
        Self {
            fundamental: ks.and_then(of_pixels),
            essential: Some(essential),
            homography: ks.and_then(|ks| homography(model, &pose, rays, ks)),
            pose: Some(pose),
            ..Self::of_pixels(config, inliers)
        }
    }
}

/// The calibration matrices of two perspective cameras; fisheye cameras have none.
pub(crate) fn calibrations(cameras: [&Camera; 2]) -> Option<[Matrix3<f64>; 2]> {
    let k = |camera: &Camera| {
        let ((fx, fy), (cx, cy)) = (camera.focal_lengths(), camera.principal_point());
        (!camera.model().is_fisheye()).then(|| Matrix3::new(fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0))
    };
    Some([k(cameras[0])?, k(cameras[1])?])
}

/// What takes the pixels of a plane, or of all points where the camera turns in place, to those of the other image; `None` of points in
/// space.
pub(crate) fn homography(
    model: Model,
    pose: &RelativePose,
    rays: &[Correspondence],
    ks: [Matrix3<f64>; 2],
) -> Option<Matrix3<f64>> {
    let of_rays = match model {
        Model::PureRotation => pose.r_21(),
        Model::Planar => {
            let pose = RelativePose::new(pose.q_21, pose.t_21.try_normalize(0.0)?);
            pose.r_21() + pose.t_21 * normal(&pose, rays)?.transpose()
        }
        _ => return None,
    };
    of_pixels(&of_rays, ks)
}

/// `K2 H K1⁻¹`.
fn of_pixels(h: &Matrix3<f64>, [k1, k2]: [Matrix3<f64>; 2]) -> Option<Matrix3<f64>> {
    Some(k2 * h * k1.try_inverse()?)
}

/// A match further from a rotation than so many medians is a false one: seven standard deviations of noise in both coordinates,
/// whose median length is 1.18 of them.
const FALSE: f64 = 6.0;

/// The inliers that the rotation explains too. An estimate keeps those on their epipolar lines, of which a few are false; readers
/// of the row transfer them by its homography.
fn turned_alone(pose: &RelativePose, rays: &[Correspondence], inliers: Matches) -> Matches {
    if rays.len() != inliers.0.len() || rays.is_empty() {
        return inliers;
    }
    let angles: Vec<f64> = rays.iter().map(|m| (pose.q_21 * m.bearing1()).angle(m.bearing2())).collect();
    let mut sorted = angles.clone();
    let (_, median, _) = sorted.select_nth_unstable_by(angles.len() / 2, f64::total_cmp);
    let reach = (FALSE * *median).max(f64::EPSILON.sqrt());
    Matches(inliers.0.into_iter().zip(angles).filter(|(_, angle)| *angle <= reach).map(|(m, _)| m).collect())
}

/// Rounds in which matches off the plane lose their weight.
const ROUNDS: usize = 4;

/// The vector `n` with `n · X1 = 1` on the plane of the matches, in the frame of camera 1 and in units of `t_21`.
///
/// `b × (R a + t (n · a)) = 0` for every match is linear in `n`. What does not lie on the plane is weighed down by Tukey's
/// biweight at three standard deviations, which the median absolute residual measures.
fn normal(pose: &RelativePose, matches: &[Correspondence]) -> Option<Vector3<f64>> {
    if matches.is_empty() {
        return None;
    }
    let residual = |m: &Correspondence, n: &Vector3<f64>| {
        let (a, b) = (m.bearing1(), m.bearing2());
        let moved = pose.q_21 * a + pose.t_21 * n.dot(a);
        b.cross(&moved).norm() / moved.norm().max(f64::MIN_POSITIVE)
    };
    let mut weights = vec![1.0; matches.len()];
    let mut found = None;
    for _ in 0..ROUNDS {
        let (mut left, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for (m, weight) in matches.iter().zip(&weights) {
            let (a, b) = (m.bearing1(), m.bearing2());
            let u = b.cross(&pose.t_21);
            left += a * a.transpose() * (weight * u.norm_squared());
            right -= a * (weight * u.dot(&b.cross(&(pose.q_21 * a))));
        }
        let n = left.cholesky()?.solve(&right);
        let residuals: Vec<f64> = matches.iter().map(|m| residual(m, &n)).collect();
        let mut sorted = residuals.clone();
        let (_, median, _) = sorted.select_nth_unstable_by(matches.len() / 2, f64::total_cmp);
        let reach = (3.0 * 1.4826 * *median).max(f64::EPSILON);
        weights = residuals.iter().map(|r| (1.0 - (r / reach).powi(2)).max(0.0).powi(2)).collect();
        found = Some(n);
    }
    found.filter(|n| n.iter().all(|x| x.is_finite()))
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;

    #[test]
    fn the_normal_of_a_plane_is_found_with_points_off_it() {
        let pose = RelativePose::new(
            UnitQuaternion::from_euler_angles(0.05, -0.1, 0.02),
            Vector3::new(0.8, 0.1, -0.2),
        );
        let truth = Vector3::new(0.02, -0.05, 0.2);
        let mut matches = Vec::new();
        for i in 0..60 {
            let (u, v) = (f64::from(i % 8) * 0.1 - 0.4, f64::from(i / 8) * 0.1 - 0.35);
            let ray = Vector3::new(u, v, 1.0);
            let off = if i % 10 == 0 { 1.4 } else { 1.0 };
            let x1 = ray * (off / truth.dot(&ray));
            let x2 = pose.q_21 * x1 + pose.t_21;
            matches.push(Correspondence::from_bearings(x1.into(), x2.into()).unwrap());
        }
        let found = normal(&pose, &matches).unwrap();
        // Points off the plane have weight zero in the end: what is left is rounding.
        assert!((found - truth).norm() < 1e-9, "{found}");
    }
}
