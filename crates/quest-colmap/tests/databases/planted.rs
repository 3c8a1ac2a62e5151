//! A database with known poses.

use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Point3, UnitQuaternion, Vector3};
use quest_colmap::PairId;
use quest_core::RelativePose;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rusqlite::{Connection, params};
use tempfile::TempDir;

pub(crate) const SEED: u64 = 0xc01_da7a;

pub(crate) const K: [f64; 4] = [1000.0, 1005.0, 640.0, 480.0];

/// Versions that differ in `two_view_geometries`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Schema {
    /// Without a pose.
    V3_6,
    /// What is absent is zeros.
    V3_9,
    /// What is absent is `NULL`.
    V4_0,
    /// With cameras.
    V4_2,
}

impl Schema {
    fn user_version(self) -> i64 {
        match self {
            Self::V3_6 => 3_060_000,
            Self::V3_9 => 3_090_100,
            Self::V4_0 => 4_000_000,
            Self::V4_2 => 4_020_100,
        }
    }

    fn columns(self) -> &'static str {
        match self {
            Self::V3_6 => "",
            Self::V3_9 | Self::V4_0 => ", qvec BLOB, tvec BLOB",
            Self::V4_2 => ", qvec BLOB, tvec BLOB, camera1 BLOB, camera2 BLOB",
        }
    }
}

/// A database in a folder of its own, and the truth.
pub(crate) struct Planted {
    _folder: TempDir,
    pub(crate) path: PathBuf,
    /// From the world to each image.
    pub(crate) poses: Vec<(UnitQuaternion<f64>, Vector3<f64>)>,
}

/// What stands before the cameras.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum World {
    Volume,
    Plane,
}

const POINTS: usize = 220;

/// A count as SQLite has it.
fn whole(count: usize) -> i64 {
    i64::try_from(count).unwrap()
}

/// Images and cameras around the world; the last image stands where the first one does, and is only turned.
pub(crate) fn poses(count: usize) -> Vec<(UnitQuaternion<f64>, Vector3<f64>)> {
    let mut all: Vec<_> = (0..count)
        .map(|k| {
            let angle = 0.12 * k as f64;
            let eye = Vector3::new(9.0 * angle.sin(), 0.4 * (k % 3) as f64, -9.0 * angle.cos());
            let q = UnitQuaternion::face_towards(&-eye, &Vector3::y()).inverse();
            (q, -(q * eye))
        })
        .collect();
    let turn = UnitQuaternion::from_euler_angles(0.03, -0.05, 0.02);
    let (q, t) = all[0];
    all[count - 1] = (turn * q, turn * t);
    all
}

impl Planted {
    pub(crate) fn new(schema: Schema, world: World, count: usize) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("database.db");
        let connection = empty(&path, schema);
        let poses = poses(count);
        let mut rng = ChaCha8Rng::seed_from_u64(SEED);
        let points: Vec<Vector3<f64>> = (0..POINTS)
            .map(|_| {
                let x = Vector3::from_fn(|_, _| rng.random_range(-2.0..2.0));
                if world == World::Plane { Vector3::new(x.x, x.y, 0.2 * x.x) } else { x }
            })
            .collect();
        connection
            .execute(
                "INSERT INTO cameras VALUES(1, 1, 1280, 960, ?1, 1)",
                [K.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>()],
            )
            .unwrap();
        for (k, (q, t)) in poses.iter().enumerate() {
            let name = format!("image{k}.jpg");
            connection
                .execute(
                    "INSERT INTO images(image_id, name, camera_id) VALUES(?1, ?2, 1)",
                    params![whole(k + 1), name],
                )
                .unwrap();
            let mut data = Vec::new();
            for x in &points {
                let x = q * x + t;
                for pixel in [K[0] * x.x / x.z + K[2], K[1] * x.y / x.z + K[3]] {
                    #[expect(clippy::cast_possible_truncation, reason = "COLMAP keeps f32")]
                    let noisy = (pixel + rng.random_range(-0.8..0.8)) as f32;
                    data.extend(noisy.to_le_bytes());
                }
                data.extend([0u8; 16]);
            }
            connection
                .execute(
                    "INSERT INTO keypoints VALUES(?1, ?2, 6, ?3)",
                    params![whole(k + 1), whole(POINTS), data],
                )
                .unwrap();
        }
        for a in 1..=count {
            for b in a + 1..=count {
                // A fifth of the matches goes anywhere.
                let matches: Vec<[u32; 2]> = (0..u32::try_from(POINTS).unwrap())
                    .map(|i| [i, if i % 5 == 0 { rng.random_range(0..220) } else { i }])
                    .collect();
                write_matches(&connection, (a, b), &matches);
            }
        }
        Self { _folder: folder, path, poses }
    }

    pub(crate) fn connection(&self) -> Connection {
        Connection::open(&self.path).unwrap()
    }

    /// The pose of image `b` relative to image `a`, counted from one.
    pub(crate) fn truth(&self, a: i64, b: i64) -> RelativePose {
        let at = |image: i64| self.poses[usize::try_from(image).unwrap() - 1];
        let ((q1, t1), (q2, t2)) = (at(a), at(b));
        let q = q2 * q1.inverse();
        RelativePose::new(q, t2 - q * t1)
    }
}

pub(crate) fn write_matches(connection: &Connection, (a, b): (usize, usize), matches: &[[u32; 2]]) {
    let key = PairId::new(whole(a), whole(b)).unwrap();
    let data: Vec<u8> = matches.iter().flatten().flat_map(|i| i.to_le_bytes()).collect();
    let sql = "INSERT OR REPLACE INTO matches VALUES(?1, ?2, 2, ?3)";
    connection.execute(sql, params![key.0, whole(matches.len()), data]).unwrap();
}

fn empty(path: &Path, schema: Schema) -> Connection {
    let connection = Connection::open(path).unwrap();
    connection
        .execute_batch(&format!(
            "CREATE TABLE cameras(camera_id INTEGER PRIMARY KEY, model INTEGER, width INTEGER, height INTEGER, params BLOB,
               prior_focal_length INTEGER);
             CREATE TABLE images(image_id INTEGER PRIMARY KEY, name TEXT UNIQUE, camera_id INTEGER);
             CREATE TABLE keypoints(image_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB);
             CREATE TABLE matches(pair_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB);
             CREATE TABLE two_view_geometries(pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL,
               data BLOB, config INTEGER NOT NULL, F BLOB, E BLOB, H BLOB{});
             PRAGMA user_version = {};",
            schema.columns(),
            schema.user_version()
        ))
        .unwrap();
    connection
}

/// A row of `two_view_geometries`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Row {
    pub(crate) images: (i64, i64),
    pub(crate) inliers: Vec<[u32; 2]>,
    pub(crate) config: i64,
    pub(crate) f: Option<Matrix3<f64>>,
    pub(crate) e: Option<Matrix3<f64>>,
    pub(crate) h: Option<Matrix3<f64>>,
    pub(crate) q: Option<[f64; 4]>,
    pub(crate) t: Option<Vector3<f64>>,
}

impl Row {
    pub(crate) fn pose(&self) -> RelativePose {
        let [w, x, y, z] = self.q.unwrap();
        let q = UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(w, x, y, z));
        RelativePose::new(q, self.t.unwrap())
    }
}

fn numbers(bytes: Option<Vec<u8>>) -> Option<Vec<f64>> {
    let numbers = |bytes: Vec<u8>| bytes.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
    bytes.map(numbers)
}

/// All rows, in the order of their keys.
pub(crate) fn rows(connection: &Connection, has_pose: bool) -> Vec<Row> {
    let pose = if has_pose { "qvec, tvec" } else { "NULL, NULL" };
    let sql =
        format!("SELECT pair_id, data, config, F, E, H, {pose} FROM two_view_geometries ORDER BY pair_id");
    let mut statement = connection.prepare(&sql).unwrap();
    let rows = statement.query_map([], |row| {
        let matrix = |k: usize| -> rusqlite::Result<_> {
            Ok(numbers(row.get(k)?).map(|m| Matrix3::from_row_slice(&m)))
        };
        let data: Vec<u8> = row.get(1)?;
        let index = |bytes: &[u8]| u32::from_le_bytes(bytes.try_into().unwrap());
        Ok(Row {
            images: PairId(row.get(0)?).images(),
            inliers: data.chunks_exact(8).map(|m| [index(&m[..4]), index(&m[4..])]).collect(),
            config: row.get(2)?,
            f: matrix(3)?,
            e: matrix(4)?,
            h: matrix(5)?,
            q: numbers(row.get(6)?).map(|q| q.try_into().unwrap()),
            t: numbers(row.get(7)?).map(|t| Vector3::from_row_slice(&t)),
        })
    });
    rows.unwrap().map(Result::unwrap).collect()
}

/// A pixel as a point.
pub(crate) fn homogeneous(pixel: [f64; 2]) -> Vector3<f64> {
    Point3::new(pixel[0], pixel[1], 1.0).coords
}
