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
}

impl CameraModel {
    /// Every model, in COLMAP's order.
    pub const ALL: [Self; 9] = [
        Self::SimplePinhole,
        Self::Pinhole,
        Self::SimpleRadial,
        Self::Radial,
        Self::OpenCv,
        Self::OpenCvFisheye,
        Self::FullOpenCv,
        Self::SimpleRadialFisheye,
        Self::RadialFisheye,
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
            Self::SimpleRadialFisheye => 8,
            Self::RadialFisheye => 9,
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
            Self::SimplePinhole => &["f", "cx", "cy"],
            Self::Pinhole => &["fx", "fy", "cx", "cy"],
            Self::SimpleRadial | Self::SimpleRadialFisheye => &["f", "cx", "cy", "k"],
            Self::Radial | Self::RadialFisheye => &["f", "cx", "cy", "k1", "k2"],
            Self::OpenCv => &["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"],
            Self::OpenCvFisheye => &["fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"],
            Self::FullOpenCv => &["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"],
        }
    }

    /// Whether the model maps the angle from the optical axis, not its tangent, so that it can see beyond
    /// 90 degrees.
    #[must_use]
    pub fn is_fisheye(self) -> bool {
        matches!(self, Self::OpenCvFisheye | Self::SimpleRadialFisheye | Self::RadialFisheye)
    }

    /// How many focal lengths stand at the front of the parameters: 1 or 2.
    pub(super) fn focal_length_count(self) -> usize {
        match self {
            Self::SimplePinhole
            | Self::SimpleRadial
            | Self::Radial
            | Self::SimpleRadialFisheye
            | Self::RadialFisheye => 1,
            Self::Pinhole | Self::OpenCv | Self::OpenCvFisheye | Self::FullOpenCv => 2,
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
