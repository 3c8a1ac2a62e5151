//! The camera models by name.

use std::fmt;
use std::str::FromStr;

use super::CameraError;

/// The camera models that are understood, with COLMAP's names and parameter order.
///
/// The formulas stand in the [module documentation](crate::camera).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "SCREAMING_SNAKE_CASE")
)]
#[non_exhaustive]
pub enum CameraModel {
    /// `SIMPLE_PINHOLE`: `f, cx, cy`.
    SimplePinhole,
    /// `PINHOLE`: `fx, fy, cx, cy`.
    Pinhole,
    /// `SIMPLE_RADIAL`: `f, cx, cy, k`.
    SimpleRadial,
    /// `RADIAL`: `f, cx, cy, k1, k2`.
    Radial,
    /// `OPENCV`: `fx, fy, cx, cy, k1, k2, p1, p2`.
    #[cfg_attr(feature = "serde", serde(rename = "OPENCV"))]
    OpenCv,
    /// `OPENCV_FISHEYE`: `fx, fy, cx, cy, k1, k2, k3, k4`.
    #[cfg_attr(feature = "serde", serde(rename = "OPENCV_FISHEYE"))]
    OpenCvFisheye,
    /// `FULL_OPENCV`: `fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6`.
    #[cfg_attr(feature = "serde", serde(rename = "FULL_OPENCV"))]
    FullOpenCv,
    /// `SIMPLE_RADIAL_FISHEYE`: `f, cx, cy, k`.
    SimpleRadialFisheye,
    /// `RADIAL_FISHEYE`: `f, cx, cy, k1, k2`.
    RadialFisheye,
    /// `FOV`: `fx, fy, cx, cy, omega`.
    Fov,
    /// `THIN_PRISM_FISHEYE`: `fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, sx1, sy1`.
    ThinPrismFisheye,
    /// `RAD_TAN_THIN_PRISM_FISHEYE`: `fx, fy, cx, cy, k0, k1, k2, k3, k4, k5, p0, p1, s0, s1, s2, s3`.
    RadTanThinPrismFisheye,
    /// `SIMPLE_DIVISION`: `f, cx, cy, k`.
    SimpleDivision,
    /// `DIVISION`: `fx, fy, cx, cy, k`.
    Division,
    /// `SIMPLE_FISHEYE`: `f, cx, cy`.
    SimpleFisheye,
    /// `FISHEYE`: `fx, fy, cx, cy`.
    Fisheye,
    /// `EUCM`: `fx, fy, cx, cy, alpha, beta`.
    Eucm,
    /// `EQUIRECTANGULAR`: `w, h`, the size of the panorama.
    Equirectangular,
}

impl CameraModel {
    /// Every model of COLMAP 4.2.
    pub const ALL: [Self; 18] = [
        Self::SimplePinhole,
        Self::Pinhole,
        Self::SimpleRadial,
        Self::Radial,
        Self::OpenCv,
        Self::OpenCvFisheye,
        Self::FullOpenCv,
        Self::SimpleRadialFisheye,
        Self::RadialFisheye,
        Self::Fov,
        Self::ThinPrismFisheye,
        Self::RadTanThinPrismFisheye,
        Self::SimpleDivision,
        Self::Division,
        Self::SimpleFisheye,
        Self::Fisheye,
        Self::Eucm,
        Self::Equirectangular,
    ];

    /// COLMAP's name, as in files: `SIMPLE_PINHOLE`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::SimplePinhole => "SIMPLE_PINHOLE",
            Self::Pinhole => "PINHOLE",
            Self::SimpleRadial => "SIMPLE_RADIAL",
            Self::Radial => "RADIAL",
            Self::OpenCv => "OPENCV",
            Self::OpenCvFisheye => "OPENCV_FISHEYE",
            Self::FullOpenCv => "FULL_OPENCV",
            Self::SimpleRadialFisheye => "SIMPLE_RADIAL_FISHEYE",
            Self::RadialFisheye => "RADIAL_FISHEYE",
            Self::Fov => "FOV",
            Self::ThinPrismFisheye => "THIN_PRISM_FISHEYE",
            Self::RadTanThinPrismFisheye => "RAD_TAN_THIN_PRISM_FISHEYE",
            Self::SimpleDivision => "SIMPLE_DIVISION",
            Self::Division => "DIVISION",
            Self::SimpleFisheye => "SIMPLE_FISHEYE",
            Self::Fisheye => "FISHEYE",
            Self::Eucm => "EUCM",
            Self::Equirectangular => "EQUIRECTANGULAR",
        }
    }

    /// COLMAP's number of the model, as in its databases and binary files.
    #[must_use]
    pub fn colmap_id(self) -> i32 {
        match self {
            Self::SimplePinhole => 0,
            Self::Pinhole => 1,
            Self::SimpleRadial => 2,
            Self::Radial => 3,
            Self::OpenCv => 4,
            Self::OpenCvFisheye => 5,
            Self::FullOpenCv => 6,
            Self::Fov => 7,
            Self::SimpleRadialFisheye => 8,
            Self::RadialFisheye => 9,
            Self::ThinPrismFisheye => 10,
            Self::RadTanThinPrismFisheye => 11,
            Self::SimpleDivision => 12,
            Self::Division => 13,
            Self::SimpleFisheye => 14,
            Self::Fisheye => 15,
            Self::Eucm => 16,
            Self::Equirectangular => 17,
        }
    }

    /// The model with this number of COLMAP's, where there is one.
    #[must_use]
    pub fn from_colmap_id(id: i32) -> Option<Self> {
        Self::ALL.into_iter().find(|model| model.colmap_id() == id)
    }

    /// The names of the parameters in the order in which [`Camera::new`](super::Camera::new) takes them.
    #[must_use]
    pub fn param_names(self) -> &'static [&'static str] {
        match self {
            Self::SimplePinhole | Self::SimpleFisheye => &["f", "cx", "cy"],
            Self::Pinhole | Self::Fisheye => &["fx", "fy", "cx", "cy"],
            Self::SimpleRadial | Self::SimpleRadialFisheye | Self::SimpleDivision => &["f", "cx", "cy", "k"],
            Self::Radial | Self::RadialFisheye => &["f", "cx", "cy", "k1", "k2"],
            Self::OpenCv => &["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"],
            Self::OpenCvFisheye => &["fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"],
            Self::FullOpenCv => &["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"],
            Self::Fov => &["fx", "fy", "cx", "cy", "omega"],
            Self::ThinPrismFisheye => {
                &["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "sx1", "sy1"]
            }
            Self::RadTanThinPrismFisheye => &[
                "fx", "fy", "cx", "cy", "k0", "k1", "k2", "k3", "k4", "k5", "p0", "p1", "s0", "s1", "s2",
                "s3",
            ],
            Self::Division => &["fx", "fy", "cx", "cy", "k"],
            Self::Eucm => &["fx", "fy", "cx", "cy", "alpha", "beta"],
            Self::Equirectangular => &["w", "h"],
        }
    }

    /// Whether the model maps the angle from the optical axis, not its tangent, so that it can see beyond
    /// 90 degrees. A panorama counts as one.
    #[must_use]
    pub fn is_fisheye(self) -> bool {
        matches!(
            self,
            Self::OpenCvFisheye
                | Self::SimpleRadialFisheye
                | Self::RadialFisheye
                | Self::ThinPrismFisheye
                | Self::RadTanThinPrismFisheye
                | Self::SimpleFisheye
                | Self::Fisheye
                | Self::Equirectangular
        )
    }

    /// How many focal lengths stand at the front of the parameters: 1 or 2, and none for a panorama.
    pub(super) fn focal_length_count(self) -> usize {
        match self {
            Self::SimplePinhole
            | Self::SimpleRadial
            | Self::Radial
            | Self::SimpleRadialFisheye
            | Self::RadialFisheye
            | Self::SimpleDivision
            | Self::SimpleFisheye => 1,
            Self::Pinhole
            | Self::OpenCv
            | Self::OpenCvFisheye
            | Self::FullOpenCv
            | Self::Fov
            | Self::ThinPrismFisheye
            | Self::RadTanThinPrismFisheye
            | Self::Division
            | Self::Fisheye
            | Self::Eucm => 2,
            Self::Equirectangular => 0,
        }
    }
}

impl fmt::Display for CameraModel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for CameraModel {
    type Err = CameraError;

    /// The model of that name, spelled as COLMAP does.
    fn from_str(name: &str) -> Result<Self, CameraError> {
        let model = Self::ALL.into_iter().find(|model| model.name() == name);
        model.ok_or_else(|| CameraError::UnknownModel { found: name.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_back_and_agree() {
        for model in CameraModel::ALL {
            assert_eq!(model.to_string().parse(), Ok(model));
            assert_eq!(CameraModel::from_colmap_id(model.colmap_id()), Some(model));
            let focal = model.param_names().iter().filter(|name| name.starts_with('f'));
            assert_eq!(focal.count(), model.focal_length_count());
        }
        assert_eq!(format!("{:>8}", CameraModel::Pinhole), " PINHOLE");
    }

    #[test]
    fn an_unknown_name_is_answered_with_all_known_ones() {
        let message = "Pinhole".parse::<CameraModel>().unwrap_err().to_string();
        assert!(message.contains("\"Pinhole\""), "{message}");
        for model in CameraModel::ALL {
            assert!(message.contains(model.name()), "{message}");
        }
    }
}
