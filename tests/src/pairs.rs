//! Real image pairs with reference poses, where the folder with them lies beside the workspace.

use std::path::Path;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use quest_core::{Camera, CameraModel, Correspondence, RelativePose};
use serde::Deserialize;

/// One image pair, as in its file.
#[derive(Clone, Debug, Deserialize)]
pub struct Pair {
    /// Its name.
    pub name: String,
    /// `general`, `planar`, `small_parallax` or `pure_rotation`.
    pub scene: String,
    camera1: PairCamera,
    camera2: PairCamera,
    matches: Vec<[f64; 4]>,
    q_21: [f64; 4],
    t_21: [f64; 3],
}

#[derive(Clone, Debug, Deserialize)]
struct PairCamera {
    params: [f64; 4],
}

impl Pair {
    /// The reference pose.
    #[must_use]
    pub fn reference(&self) -> RelativePose {
        let [w, x, y, z] = self.q_21;
        let q_21 = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
        RelativePose::new(q_21, Vector3::from(self.t_21))
    }

    /// The matches that agree with the reference, no point used twice: to within one pixel by the Sampson error.
    ///
    /// Where the reference is a rotation alone, which may itself be off by pixels, the better half of the matches by
    /// the distance from the rotated point.
    #[must_use]
    pub fn inliers(&self) -> Vec<Correspondence> {
        let [camera1, camera2] = [&self.camera1, &self.camera2]
            .map(|c| Camera::new(CameraModel::Pinhole, &c.params).expect("a pinhole camera"));
        let pose = self.reference();
        let mut errors: Vec<_> = self.matches.iter().map(|m| self.error_px(&pose, m)).collect();
        let limit = if self.scene == "pure_rotation" {
            let middle = errors.len() / 2;
            *errors.select_nth_unstable_by(middle, f64::total_cmp).1
        } else {
            1.0
        };
        let mut kept: Vec<[f64; 4]> = Vec::new();
        for m in &self.matches {
            let same =
                |a: &[f64; 4], i: usize| (a[i] - m[i]).abs() < 0.01 && (a[i + 1] - m[i + 1]).abs() < 0.01;
            let near = |a: &[f64; 4]| same(a, 0) || same(a, 2);
            if self.error_px(&pose, m) < limit && !kept.iter().any(near) {
                kept.push(*m);
            }
        }
        let correspondence = |m: &[f64; 4]| {
            Correspondence::from_pixels(&camera1, [m[0], m[1]], &camera2, [m[2], m[3]])
                .expect("pixels with viewing rays")
        };
        kept.iter().map(correspondence).collect()
    }

    fn error_px(&self, pose: &RelativePose, m: &[f64; 4]) -> f64 {
        let [[f1, x1], [f2, x2]] =
            [(&self.camera1, [m[0], m[1]]), (&self.camera2, [m[2], m[3]])].map(|(camera, pixel)| {
                let [fx, fy, cx, cy] = camera.params;
                [Vector3::new(fx, fy, 1.0), Vector3::new((pixel[0] - cx) / fx, (pixel[1] - cy) / fy, 1.0)]
            });
        if self.scene == "pure_rotation" {
            let x = pose.q_21 * x1;
            return f2.component_mul(&(x / x.z - x2)).xy().norm();
        }
        let e = pose.essential();
        let (line2, line1) = (e * x1, e.transpose() * x2);
        let gradient = |line: Vector3<f64>, f: Vector3<f64>| line.component_div(&f).xy().norm_squared();
        x2.dot(&line2).abs() / (gradient(line2, f2) + gradient(line1, f1)).sqrt()
    }
}

/// Every pair of the folder `shared/data/pairs` beside the workspace, by name; none where it is absent.
#[must_use]
pub fn load() -> Vec<Pair> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/pairs");
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let parse = |path: &Path| -> Pair {
        let text = std::fs::read_to_string(path).expect("a readable file");
        serde_json::from_str(&text).expect("a pair in JSON")
    };
    let mut pairs: Vec<_> = entries.map(|e| parse(&e.expect("a folder entry").path())).collect();
    pairs.sort_by(|a, b| a.name.cmp(&b.name));
    pairs
}
