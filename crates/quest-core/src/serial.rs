//! How poses and cameras stand in serialised data (feature `serde`), in the words of the files of `quest-cli`.
//!
//! Input is checked here as everywhere: a camera by [`Camera::new`], and a quaternion must be finite and of length one.

use nalgebra::{Matrix6, Quaternion, UnitQuaternion};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::{Camera, CameraError, CameraModel, RelativePose};

/// How far from one the length of a quaternion may be: four written decimals stay within it, as in the files of `quest-cli`.
const UNIT_TOLERANCE: f64 = 1e-3;

/// A pose: `q_21` scalar first.
#[derive(Serialize, Deserialize)]
pub(crate) struct PoseForm {
    q_21: [f64; 4],
    t_21: [f64; 3],
}

impl From<RelativePose> for PoseForm {
    fn from(pose: RelativePose) -> Self {
        Self { q_21: pose.wxyz(), t_21: pose.t_21.into() }
    }
}

impl TryFrom<PoseForm> for RelativePose {
    type Error = String;

    fn try_from(PoseForm { q_21: [w, x, y, z], t_21 }: PoseForm) -> Result<Self, String> {
        let q = Quaternion::new(w, x, y, z);
        let norm = q.norm();
        let is_near_one = (norm - 1.0).abs() <= UNIT_TOLERANCE; // NaN is not.
        if !is_near_one {
            return Err(format!("q_21 has the length {norm}, expected a unit quaternion w, x, y, z"));
        }
        if let Some(found) = t_21.iter().find(|c| !c.is_finite()) {
            return Err(format!("t_21 holds {found}, expected finite numbers"));
        }
        // What is of length one to rounding comes back as it was.
        let is_unit = (norm - 1.0).abs() <= 4.0 * f64::EPSILON;
        let q_21 = if is_unit { UnitQuaternion::new_unchecked(q) } else { UnitQuaternion::new_normalize(q) };
        Ok(Self::new(q_21, t_21.into()))
    }
}

/// A camera, as in the files that `quest-cli` reads.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct CameraForm {
    model: CameraModel,
    #[serde(skip_serializing_if = "Option::is_none")]
    width: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    height: Option<u32>,
    params: Vec<f64>,
}

impl From<Camera> for CameraForm {
    fn from(camera: Camera) -> Self {
        let (width, height) = camera.size().unzip();
        Self { model: camera.model(), width, height, params: camera.params().to_vec() }
    }
}

impl TryFrom<CameraForm> for Camera {
    type Error = CameraError;

    fn try_from(form: CameraForm) -> Result<Self, CameraError> {
        let camera = Self::new(form.model, &form.params)?;
        match (form.width, form.height) {
            (None, None) => Ok(camera),
            // One without the other is no size.
            (width, height) => camera.with_size(width.unwrap_or(0), height.unwrap_or(0)),
        }
    }
}

/// A covariance by its rows.
pub(crate) mod rows {
    use super::{Deserialize, Deserializer, Matrix6, Serialize, Serializer};

    pub(crate) fn serialize<S: Serializer>(m: &Matrix6<f64>, serializer: S) -> Result<S::Ok, S::Error> {
        // Columns of the transpose are rows.
        let rows: [[f64; 6]; 6] = m.transpose().into();
        rows.serialize(serializer)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Matrix6<f64>, D::Error> {
        let rows = <[[f64; 6]; 6]>::deserialize(deserializer)?;
        Ok(Matrix6::from(rows).transpose())
    }
}

/// A number that may be infinite. JSON has no word for infinity, so it is `null` there.
pub(crate) mod or_infinite {
    use super::{Deserialize, Deserializer, Serialize, Serializer};

    #[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes fields by reference")]
    pub(crate) fn serialize<S: Serializer>(x: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        x.is_finite().then_some(*x).serialize(serializer)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
        Option::deserialize(deserializer).map(|x| x.unwrap_or(f64::INFINITY))
    }
}
