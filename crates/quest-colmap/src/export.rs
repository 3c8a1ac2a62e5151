//! What a database holds for other programs: matches, also as JSON Lines, poses with their covariances as a graph in g2o's form.

use std::io::{self, Write};

use nalgebra::{Matrix3, Matrix6, UnitQuaternion};
use quest_core::robust::Estimate;
use quest_core::{Camera, RelativePose};
use serde::Serialize;

use crate::verify::{Images, VerifyOptions, Watch, read};
use crate::{ColmapError, Database, PairId};

/// Pairs that are read together.
const LOT: usize = 256;

/// How many pairs were written, and how many could not be.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Exported {
    /// Pairs that were written.
    pub written: usize,
    /// The others by the names of their images, with the reasons.
    pub left: Vec<(String, String)>,
}

#[derive(Serialize)]
struct CameraLine<'a> {
    model: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    width: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    height: Option<u32>,
    params: &'a [f64],
}

impl<'a> CameraLine<'a> {
    fn new(camera: &'a Camera) -> Self {
        let (width, height) = camera.size().unzip();
        Self { model: camera.model().name(), width, height, params: camera.params() }
    }
}

#[derive(Serialize)]
struct MatchLine<'a> {
    name: &'a str,
    camera1: CameraLine<'a>,
    camera2: CameraLine<'a>,
    matches: &'a [[f32; 4]],
}

/// The matches of a pair of images.
#[derive(Clone, Debug, PartialEq)]
pub struct PairMatches {
    /// The pair.
    pub key: PairId,
    /// The names of the two images, with a space between.
    pub name: String,
    /// Their cameras.
    pub cameras: [Camera; 2],
    /// `u1, v1, u2, v2` in pixels.
    pub matches: Vec<[f32; 4]>,
}

/// Writes the matches of pairs as JSON Lines, as `quest-cli estimate` reads them: the name is that of the two images, with a space
/// between.
///
/// # Errors
/// [`ColmapError::Sqlite`]; what the writer says, as [`ColmapError::Io`].
pub fn export_matches(
    database: &Database,
    pairs: &[PairId],
    writer: &mut dyn Write,
    watch: &dyn Watch,
) -> Result<Exported, ColmapError> {
    export_each(database, pairs, watch, |pair| {
        let [camera1, camera2] = &pair.cameras;
        let line = MatchLine {
            name: &pair.name,
            camera1: CameraLine::new(camera1),
            camera2: CameraLine::new(camera2),
            matches: &pair.matches,
        };
        writer.write_all((serde_json::to_string(&line)? + "\n").as_bytes())
    })
}

/// Hands the matches of pairs to `write`, one pair after the other.
///
/// # Errors
/// [`ColmapError::Sqlite`]; what `write` says, as [`ColmapError::Io`].
pub fn export_each(
    database: &Database,
    pairs: &[PairId],
    watch: &dyn Watch,
    mut write: impl FnMut(&PairMatches) -> io::Result<()>,
) -> Result<Exported, ColmapError> {
    let failed = |source| ColmapError::Io { file: "output".to_owned(), source };
    let mut exported = Exported::default();
    for (done, &key) in pairs.iter().enumerate() {
        if watch.is_cancelled() {
            return Err(ColmapError::Cancelled);
        }
        let (a, b) = key.images();
        let name = format!("{} {}", database.name(a), database.name(b));
        match matches_of(database, key, name.clone())? {
            Ok(pair) => {
                write(&pair).map_err(failed)?;
                exported.written += 1;
            }
            Err(reason) => exported.left.push((name, reason)),
        }
        watch.progress(done + 1, pairs.len());
    }
    Ok(exported)
}

fn matches_of(
    database: &Database,
    key: PairId,
    name: String,
) -> Result<Result<PairMatches, String>, ColmapError> {
    let (a, b) = key.images();
    let (matches, image1, image2) = (database.matches(key)?, database.keypoints(a)?, database.keypoints(b)?);
    let pair = || {
        let (matches, image1, image2) = (matches?, image1?, image2?);
        let (pixels1, pixels2) = (image1.pixels()?, image2.pixels()?);
        let pixel = |pixels: &[[f32; 2]], index: u32| {
            let found = pixels.get(index as usize).copied();
            found.ok_or_else(|| format!("a match names keypoint {index}, of {}", pixels.len()))
        };
        let row = |&[i, j]: &[u32; 2]| {
            let ([u1, v1], [u2, v2]) = (pixel(&pixels1, i)?, pixel(&pixels2, j)?);
            Ok([u1, v1, u2, v2])
        };
        let matches = matches.0.iter().map(row).collect::<Result<Vec<_>, String>>()?;
        Ok(PairMatches { key, name, cameras: [image1.camera, image2.camera], matches })
    };
    Ok(pair())
}

/// An edge of the graph of poses.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseEdge {
    /// The numbers of the two images.
    pub images: (i64, i64),
    /// Their names.
    pub names: [String; 2],
    /// The pose of image 2 relative to image 1, with the covariance.
    pub estimate: Estimate,
}

/// The poses of pairs, estimated again for their covariances; those that have none with their reasons.
///
/// # Errors
/// [`ColmapError::Sqlite`], [`ColmapError::Cancelled`].
pub fn export_poses(
    database: &Database,
    pairs: &[PairId],
    options: &VerifyOptions,
    watch: &dyn Watch,
) -> Result<(Vec<PoseEdge>, Exported), ColmapError> {
    let (mut edges, mut exported) = (Vec::new(), Exported::default());
    let mut images = Images::default();
    let is_cancelled = || watch.is_cancelled();
    for lot in pairs.chunks(LOT) {
        for work in read(database, lot, &mut images, None)? {
            let (a, b) = work.key.images();
            let names = [database.name(a), database.name(b)];
            match work.estimate(options, &is_cancelled)? {
                Ok(estimate) if estimate.inlier_count >= options.min_inliers => {
                    edges.push(PoseEdge { images: (a, b), names, estimate });
                }
                Ok(estimate) => {
                    let reason = format!("found {} inliers", estimate.inlier_count);
                    exported.left.push((names.join(" "), reason));
                }
                Err(reason) => exported.left.push((names.join(" "), reason)),
            }
            watch.progress(edges.len() + exported.left.len(), pairs.len());
        }
    }
    exported.written = edges.len();
    Ok((edges, exported))
}

/// Writes poses as `EDGE_SE3:QUAT` lines of g2o: image 1, image 2, the pose of camera 2 in the frame of camera 1 (`x y z qx qy qz
/// qw`), and the upper triangle of the information of `(x, y, z, qx, qy, qz)` in the frame of camera 2. Each translation has the scale of
/// its own pair. The images are vertices at the identity, for an optimiser to move.
///
/// Returns the pairs whose covariance has no inverse; they are left out.
///
/// # Errors
/// What the writer says.
pub fn write_g2o(edges: &[PoseEdge], writer: &mut dyn Write) -> io::Result<Vec<[String; 2]>> {
    let images: std::collections::BTreeSet<i64> =
        edges.iter().flat_map(|e| [e.images.0, e.images.1]).collect();
    for image in images {
        writeln!(writer, "VERTEX_SE3:QUAT {image} 0 0 0 0 0 0 1")?;
    }
    let mut left = Vec::new();
    for edge in edges {
        let Some(information) = information(&edge.estimate.pose, &edge.estimate.covariance) else {
            left.push(edge.names.clone());
            continue;
        };
        let RelativePose { q_21: q_12, t_21: t_12 } = edge.estimate.pose.inverse();
        let q = UnitQuaternion::into_inner(q_12);
        write!(
            writer,
            "EDGE_SE3:QUAT {} {} {:?} {:?} {:?} {:?} {:?} {:?} {:?}",
            edge.images.0, edge.images.1, t_12.x, t_12.y, t_12.z, q.i, q.j, q.k, q.w
        )?;
        for row in 0..6 {
            for column in row..6 {
                write!(writer, " {:?}", information[(row, column)])?;
            }
        }
        writeln!(writer)?;
    }
    Ok(left)
}

/// The information of g2o's error `(x, y, z, qx, qy, qz)` of `Z⁻¹ (X1⁻¹ X2)`, where Z is the pose of camera 2 in the frame of camera 1.
///
/// With `R' = exp([ω]×) R` and `t' = t + d` of camera 2's coordinates, the pose of camera 2 in camera 1 changes by
/// `exp(-ω)` on its right, and its origin, seen from camera 2, by `-(d - ω × t)`; the vector part of the quaternion is half the
/// rotation vector.
fn information(pose: &RelativePose, covariance: &Matrix6<f64>) -> Option<Matrix6<f64>> {
    let mut jacobian = Matrix6::zeros();
    jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(&-pose.t_21.cross_matrix());
    jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(&-Matrix3::identity());
    jacobian.fixed_view_mut::<3, 3>(3, 0).copy_from(&(-0.5 * Matrix3::identity()));
    let changed = jacobian * covariance * jacobian.transpose();
    let inverse = (0.5 * (changed + changed.transpose())).cholesky()?.inverse();
    inverse.iter().all(|x| x.is_finite()).then_some(inverse)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Vector3, Vector6};

    use super::*;

    #[test]
    fn the_information_is_that_of_the_error_of_g2o() {
        let pose = RelativePose::new(
            UnitQuaternion::from_euler_angles(0.3, -0.2, 0.5),
            Vector3::new(0.1, 0.4, -0.3),
        );
        let error = |delta: &Vector6<f64>| {
            let turned = UnitQuaternion::new(delta.fixed_rows::<3>(0).into_owned()) * pose.q_21;
            let moved = RelativePose::new(turned, pose.t_21 + delta.fixed_rows::<3>(3)).inverse();
            let z = pose.inverse();
            let q = z.q_21.inverse() * moved.q_21;
            let t = z.q_21.inverse() * (moved.t_21 - z.t_21);
            Vector6::new(t.x, t.y, t.z, q.i, q.j, q.k)
        };
        let step = 1e-6;
        let mut jacobian = Matrix6::zeros();
        for k in 0..6 {
            let delta = Vector6::ith(k, step);
            jacobian.set_column(k, &((error(&delta) - error(&-delta)) / (2.0 * step)));
        }
        let root = Matrix6::from_fn(|i, j| if i == j { 0.1 } else { 0.01 * (i as f64 - 2.0 * j as f64) });
        let covariance = root * root.transpose();
        let expected = (jacobian * covariance * jacobian.transpose()).try_inverse().unwrap();
        let found = information(&pose, &covariance).unwrap();
        // Central differences of step 1e-6 are exact to 1e-10.
        assert!((found - expected).norm() < 1e-6 * expected.norm());
    }
}
