//! What the rows say is the truth.

use nalgebra::{Matrix3, Vector3};
use quest_colmap::{
    Database, Existing, Given, Uncalibrated, VerifyOptions, export_matches, export_poses, verify, write_g2o,
    write_two_view_geometries,
};
use quest_core::robust::Model;

use super::planted::{K, Planted, Row, Schema, World, homogeneous, rows};

fn options() -> VerifyOptions {
    VerifyOptions { threads: 1, ..VerifyOptions::default() }
}

fn verified(planted: &Planted, options: &VerifyOptions) -> Vec<Row> {
    let mut database = Database::open(&planted.path).unwrap();
    verify(&mut database, options, &()).unwrap();
    rows(&planted.connection(), database.schema().has_pose)
}

fn calibration() -> Matrix3<f64> {
    Matrix3::new(K[0], 0.0, K[2], 0.0, K[1], K[3], 0.0, 0.0, 1.0)
}

fn pixels(planted: &Planted) -> Vec<Vec<[f64; 2]>> {
    let connection = planted.connection();
    let mut statement = connection.prepare("SELECT data FROM keypoints ORDER BY image_id").unwrap();
    let read = |data: Vec<u8>| {
        let number = |b: &[u8]| f64::from(f32::from_le_bytes(b.try_into().unwrap()));
        data.chunks_exact(24).map(|k| [number(&k[..4]), number(&k[4..8])]).collect()
    };
    statement.query_map([], |row| row.get(0).map(read)).unwrap().map(Result::unwrap).collect()
}

/// The mean distance in pixels of the inliers from what a matrix takes them to.
fn error(row: &Row, pixels: &[Vec<[f64; 2]>], of: impl Fn(Vector3<f64>, Vector3<f64>) -> f64) -> f64 {
    let at =
        |image: i64, index: u32| homogeneous(pixels[usize::try_from(image).unwrap() - 1][index as usize]);
    let errors = row.inliers.iter().map(|m| of(at(row.images.0, m[0]), at(row.images.1, m[1])));
    errors.sum::<f64>() / row.inliers.len() as f64
}

fn transferred(h: &Matrix3<f64>) -> impl Fn(Vector3<f64>, Vector3<f64>) -> f64 + '_ {
    move |x1, x2| {
        let y = h * x1;
        (y.xy() / y.z - x2.xy()).norm()
    }
}

fn off_the_line(f: &Matrix3<f64>) -> impl Fn(Vector3<f64>, Vector3<f64>) -> f64 + '_ {
    move |x1, x2| {
        let line = f * x1;
        x2.dot(&line).abs() / line.xy().norm()
    }
}

#[test]
fn general_pairs_and_a_rotation_are_told_in_every_schema() {
    for schema in [Schema::V3_6, Schema::V3_9, Schema::V4_0, Schema::V4_2] {
        let planted = Planted::new(schema, World::Volume, 4);
        let pixels = pixels(&planted);
        let rows = verified(&planted, &options());
        assert_eq!(rows.len(), 6);
        for row in &rows {
            let truth = planted.truth(row.images.0, row.images.1);
            assert!(row.inliers.len() >= 170, "{row:?}");
            // Keypoints have the noise of a third of a pixel over f = 1000; the mean of 170 lies well within one.
            if row.images == (1, 4) {
                assert_eq!(row.config, 5);
                assert!(error(row, &pixels, transferred(&row.h.unwrap())) < 1.0);
            } else {
                assert_eq!(row.config, 2, "{schema:?} {:?}", row.images);
                assert!(error(row, &pixels, off_the_line(&row.f.unwrap())) < 1.0);
            }
            if schema != Schema::V3_6 {
                let pose = row.pose();
                assert!(pose.rotation_error(&truth).to_degrees() < 0.3);
                if row.config == 5 {
                    assert_eq!(pose.t_21, Vector3::zeros());
                    let h = calibration() * pose.r_21() * calibration().try_inverse().unwrap();
                    assert!((h - row.h.unwrap()).norm() < 1e-9 * h.norm());
                } else {
                    assert!((pose.t_21.norm() - 1.0).abs() < 1e-12);
                    assert!(pose.translation_error(&truth).unwrap().to_degrees() < 3.0);
                    assert!((pose.essential() - row.e.unwrap()).norm() < 1e-12);
                }
            }
            let absent = if row.config == 5 { row.e } else { row.h };
            let is_null = matches!(schema, Schema::V4_0 | Schema::V4_2);
            assert_eq!(absent, (!is_null).then(Matrix3::zeros), "{schema:?}");
        }
    }
}

#[test]
fn a_plane_has_its_homography_and_its_pose() {
    let planted = Planted::new(Schema::V4_2, World::Plane, 4);
    let pixels = pixels(&planted);
    let rows = verified(&planted, &options());
    assert_eq!(rows.len(), 6);
    // Of images closer to each other a rotation explains the plane within the threshold.
    for row in rows.iter().filter(|row| row.images == (1, 3)) {
        assert_eq!(row.config, 4, "{:?}", row.images);
        assert!(error(row, &pixels, transferred(&row.h.unwrap())) < 1.5, "{:?}", row.images);
        assert!(error(row, &pixels, off_the_line(&row.f.unwrap())) < 1.0);
        // H = R + t nᵀ up to K and a factor: E = [t]× H.
        let k = calibration();
        let h = k.try_inverse().unwrap() * row.h.unwrap() * k;
        let e = row.pose().t_21.cross_matrix() * h;
        assert!((e - row.e.unwrap()).norm() < 1e-9);
    }
}

#[test]
fn guessed_focal_lengths_are_left_or_get_a_matrix_of_pixels() {
    let planted = Planted::new(Schema::V4_2, World::Volume, 4);
    planted.connection().execute("UPDATE cameras SET prior_focal_length = 0", []).unwrap();
    let mut database = Database::open(&planted.path).unwrap();
    let report = verify(&mut database, &options(), &()).unwrap();
    assert_eq!((report.summary.uncalibrated, rows(&planted.connection(), true).len()), (6, 0));
    let guess =
        [1536.0, 1536.0, 640.0, 480.0].iter().flat_map(|x: &f64| x.to_le_bytes()).collect::<Vec<u8>>();
    planted.connection().execute("UPDATE cameras SET params = ?1", [guess]).unwrap();
    let pixels = pixels(&planted);
    let rows = verified(&planted, &VerifyOptions { uncalibrated: Uncalibrated::Guess, ..options() });
    let k = calibration();
    for row in rows.iter().filter(|row| row.images != (1, 4) && row.config != 0) {
        assert_eq!((row.config, row.e, row.q, row.t), (3, None, None, None));
        let f = row.f.unwrap();
        assert!(error(row, &pixels, off_the_line(&f)) < 1.0);
        // The true focal length makes an essential matrix of it: two equal singular values, the third zero.
        let e = k.transpose() * f * k;
        let s = e.svd(false, false).singular_values;
        let (large, middle) = (s.max(), s.sum() - s.max() - s.min());
        assert!(middle / large > 0.8, "{s}");
    }
    assert!(rows.iter().filter(|row| row.config == 3).count() >= 4, "{rows:?}");
}

#[test]
fn rows_that_are_there_are_kept_replaced_or_an_error() {
    let planted = Planted::new(Schema::V4_2, World::Volume, 4);
    let pair = |a: &str, b: &str| (format!("{a}.jpg"), format!("{b}.jpg"));
    let some =
        VerifyOptions { pairs: Some(vec![pair("image2", "image0"), pair("image0", "image1")]), ..options() };
    assert_eq!(verified(&planted, &some).iter().map(|r| r.images).collect::<Vec<_>>(), [(1, 2), (1, 3)]);
    let mut database = Database::open(&planted.path).unwrap();
    let error = verify(&mut database, &options(), &()).unwrap_err().to_string();
    assert!(error.contains("2 of 6 pairs") && error.contains("--resume"), "{error}");
    planted.connection().execute("UPDATE two_view_geometries SET config = 1", []).unwrap();
    let resumed = verified(&planted, &VerifyOptions { existing: Existing::Resume, ..options() });
    assert_eq!(resumed.iter().map(|r| r.config).collect::<Vec<_>>(), [1, 1, 5, 2, 2, 2]);
    let replaced = verified(&planted, &VerifyOptions { existing: Existing::Overwrite, ..options() });
    // A pair's row does not depend on which other pairs there are, nor on the number of threads.
    let fresh = Planted::new(Schema::V4_2, World::Volume, 4);
    assert_eq!(replaced, verified(&fresh, &VerifyOptions { threads: 3, ..options() }));
}

#[test]
fn poses_that_were_estimated_elsewhere_are_written() {
    let planted = Planted::new(Schema::V4_2, World::Volume, 3);
    let mut database = Database::open(&planted.path).unwrap();
    let inliers: Vec<bool> = (0..220).map(|i| i % 5 != 0).collect();
    let truth = planted.truth(2, 1);
    let images = ("image1.jpg".to_owned(), "image0.jpg".to_owned());
    let given = Given { images, pose: Some((Model::General, truth)), inliers };
    let row = database.geometry(&given).unwrap();
    write_two_view_geometries(&mut database, &[row], false).unwrap();
    let written = rows(&planted.connection(), true);
    let expected = planted.truth(1, 2);
    assert_eq!((written[0].images, written[0].inliers.len()), ((1, 2), 176));
    assert!(written[0].pose().rotation_error(&expected) < 1e-12);
    assert!(written[0].pose().translation_error(&expected).unwrap() < 1e-7);
    let short = Given { inliers: vec![true; 3], ..given };
    assert!(database.geometry(&short).unwrap_err().to_string().contains("3 flags for 220 matches"));
}

#[test]
fn matches_and_poses_are_exported() {
    let planted = Planted::new(Schema::V3_9, World::Volume, 3);
    let database = Database::open(&planted.path).unwrap();
    let pairs: Vec<_> = database.matched_pairs().unwrap().into_iter().collect();
    let mut text = Vec::new();
    let exported = export_matches(&database, &pairs, &mut text, &()).unwrap();
    assert_eq!((exported.written, exported.left.len()), (3, 0));
    let lines: Vec<serde_json::Value> =
        String::from_utf8(text).unwrap().lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(lines[0]["name"], "image0.jpg image1.jpg");
    assert_eq!(lines[0]["camera1"]["model"], "PINHOLE");
    assert_eq!(lines[0]["matches"].as_array().unwrap().len(), 220);
    let (edges, _) = export_poses(&database, &pairs, &options(), &()).unwrap();
    let mut graph = Vec::new();
    let left = write_g2o(&edges, &mut graph).unwrap();
    let graph = String::from_utf8(graph).unwrap();
    let edges = graph.lines().filter(|line| line.starts_with("EDGE_SE3:QUAT ")).count();
    assert_eq!(edges + left.len(), 3);
    let first = graph.lines().find(|line| line.starts_with("EDGE")).unwrap();
    assert_eq!(first.split(' ').count(), 1 + 2 + 7 + 21);
}
