//! `simulate --pairs`: scenes as pairs that other commands read.

use quest_core::simulate::{
    FOCAL_LENGTH, IMAGE_SIZE, PRINCIPAL_POINT, Scene, SceneError, SceneOptions, plane_to_pixel,
};
use quest_core::{CameraModel, InputError};
use quest_io::Output;
use serde::Serialize;

use crate::{Failure, options::Format, rows};

/// What pairs are made of.
#[derive(Clone, Copy, Debug)]
pub(super) struct Planted {
    pub(super) scenes: SceneOptions,
    /// The share of false matches.
    pub(super) outliers: f64,
    pub(super) seed: u64,
    pub(super) count: u32,
}

/// A pair in pixels, with its camera and its truth.
#[derive(Debug, Serialize)]
struct PairRecord {
    name: String,
    camera1: CameraRecord,
    matches: Vec<[f64; 4]>,
    q_21: [f64; 4],
    t_21: [f64; 3],
}

/// The camera of (60).
#[derive(Debug, Serialize)]
struct CameraRecord {
    model: &'static str,
    width: u32,
    height: u32,
    params: [f64; 4],
}

impl PairRecord {
    fn new(index: u64, scene: &Scene) -> Self {
        let pixel = |b: &nalgebra::Vector3<f64>| plane_to_pixel([b.x / b.z, b.y / b.z]);
        let matches = scene.matches.iter().map(|m| {
            let ([u1, v1], [u2, v2]) = (pixel(m.bearing1()), pixel(m.bearing2()));
            [u1, v1, u2, v2]
        });
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "whole numbers of pixels"
        )]
        let [width, height] = IMAGE_SIZE.map(|side| side as u32);
        let [cx, cy] = PRINCIPAL_POINT;
        Self {
            name: format!("scene {index}"),
            camera1: CameraRecord {
                model: CameraModel::Pinhole.name(),
                width,
                height,
                params: [FOCAL_LENGTH, FOCAL_LENGTH, cx, cy],
            },
            matches: matches.collect(),
            q_21: scene.truth.wxyz(),
            t_21: scene.truth.t_21.into(),
        }
    }
}

/// The scenes from 0 on of a seed: a line each, or one as an object.
pub(super) fn write(output: &mut Output, planted: &Planted, format: Format) -> Result<(), Failure> {
    let is_one = match (format, planted.count) {
        (Format::Json, 1) => true,
        (Format::Jsonl, _) => false,
        (Format::Json, _) => {
            return Err(expected(
                "found several pairs and JSON, expected --format jsonl or a name that ends with .jsonl",
            ));
        }
        (Format::Table | Format::Csv, _) => {
            return Err(expected(
                "--pairs writes pairs with cameras, expected --format jsonl or a name that ends with .jsonl, of one pair also json",
            ));
        }
    };
    for index in 0..u64::from(planted.count) {
        let mut scene = Scene::generate(&planted.scenes, planted.seed, index)?;
        if planted.outliers > 0.0 {
            let added = scene.add_outliers(planted.outliers, planted.seed, index);
            added.map_err(|source| SceneError::Image(InputError::Match { index: 0, source }))?;
        }
        let record = PairRecord::new(index, &scene);
        output.write(
            |w| if is_one { quest_io::write_json(w, &record) } else { rows::write_line(w, &record) },
        )?;
    }
    Ok(())
}

fn expected(message: &str) -> Failure {
    Failure::Arguments(message.to_owned())
}

/// A share of the matches.
pub(super) fn parse_share(text: &str) -> Result<f64, String> {
    let share = text.parse::<f64>().ok().filter(|share| (0.0..=1.0).contains(share));
    share.ok_or_else(|| "expected a share of the matches, from 0 to 1".to_owned())
}
