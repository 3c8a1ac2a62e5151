//! Files of cameras, as OpenCV, ROS and COLMAP write them.
#![expect(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

use std::{fs, path::PathBuf};

use proptest::prelude::*;
use quest_core::{Camera, CameraModel};
use quest_io::{ReadError, camera, read_camera};

/// As `cv::FileStorage` of OpenCV 4 writes them.
const YAML: &str = "%YAML:1.0
---
calibration_time: \"Sun Nov 29 07:00:00 2026\"
image_width: 640
image_height: 480
flags: 0
fisheye_model: 0
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 5.3591573396163199e+02, 0., 3.4228315473308373e+02, 0.,
       5.3591573396163199e+02, 2.3557082909788173e+02, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -2.6637260909660682e-01, -3.8588898922304653e-02,
       1.7831947042852964e-03, -2.8122100441115472e-04,
       2.3839153080878486e-01 ]
avg_reprojection_error: 3.9259109564815858e-01
";

const XML: &str = "<?xml version=\"1.0\"?>
<opencv_storage>
<calibration_time>\"Sun Nov 29 07:00:00 2026\"</calibration_time>
<image_width>640</image_width>
<image_height>480</image_height>
<!-- flags: none -->
<fisheye_model>0</fisheye_model>
<camera_matrix type_id=\"opencv-matrix\">
  <rows>3</rows>
  <cols>3</cols>
  <dt>d</dt>
  <data>
    5.3591573396163199e+02 0. 3.4228315473308373e+02 0.
    5.3591573396163199e+02 2.3557082909788173e+02 0. 0. 1.</data></camera_matrix>
<distortion_coefficients type_id=\"opencv-matrix\">
  <rows>5</rows>
  <cols>1</cols>
  <dt>d</dt>
  <data>
    -2.6637260909660682e-01 -3.8588898922304653e-02
    1.7831947042852964e-03 -2.8122100441115472e-04
    2.3839153080878486e-01</data></distortion_coefficients>
</opencv_storage>
";

/// As `camera_calibration_parsers` of ROS writes them.
const ROS: &str = "image_width: 640
image_height: 480
camera_name: narrow_stereo
camera_matrix:
  rows: 3
  cols: 3
  data: [500.0, 0.0, 320.0, 0.0, 510.0, 240.0, 0.0, 0.0, 1.0]
distortion_model: MODEL
distortion_coefficients:
  rows: 1
  cols: 4
  data: [0.1, -0.02, 0.003, 0.004]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
projection_matrix:
  rows: 3
  cols: 4
  data: [400.0, 0.0, 320.0, 0.0, 0.0, 400.0, 240.0, 0.0, 0.0, 0.0, 1.0, 0.0]
";

const COLMAP: &str = "# Camera list with one line of data per camera:
#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]
# Number of cameras: 2
1 SIMPLE_RADIAL 3072 2304 2559.81 1536 1152 -0.0218531
7 PINHOLE 640 480 500 510 320 240
";

fn read(name: &str, bytes: impl AsRef<[u8]>, id: Option<&str>) -> Result<Camera, ReadError> {
    let folder = tempfile::tempdir().unwrap();
    let path: PathBuf = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    read_camera(&path, id)
}

/// What is wrong, without the folder.
#[track_caller]
fn refused(name: &str, bytes: impl AsRef<[u8]>, id: Option<&str>) -> String {
    let error = read(name, bytes, id).unwrap_err().to_string();
    error[error.find(name).unwrap()..].to_owned()
}

fn expected(model: &str, params: &[f64]) -> Camera {
    camera(model, Some((640, 480)), params).unwrap()
}

#[test]
fn calibrations_of_opencv() {
    let (f, cx, cy) = (535.915_733_961_632, 342.283_154_733_083_73, 235.570_829_097_881_73);
    let [k1, k2, p1, p2, k3] = [
        -0.266_372_609_096_606_8,
        -0.038_588_898_922_304_65,
        0.001_783_194_704_285_296_4,
        -0.000_281_221_004_411_154_7,
        0.238_391_530_808_784_86,
    ];
    let camera = expected("FULL_OPENCV", &[f, f, cx, cy, k1, k2, p1, p2, k3, 0.0, 0.0, 0.0]);
    for (name, text) in [("a.yml", YAML), ("a.yaml", YAML), ("a", YAML), ("a.xml", XML), ("b", XML)] {
        assert_eq!(read(name, text, None).unwrap(), camera, "{name}");
    }
    // The names of older versions, four coefficients, a fisheye, no distortion at all.
    // What the beginning says comes before the extension.
    for (name, text) in [("a.txt", YAML), ("a.bin", YAML), ("a.txt", XML), ("a.bin", XML)] {
        assert_eq!(read(name, text, None).unwrap(), camera, "{name}");
    }
    let old = YAML.replace("camera_matrix", "Camera_Matrix").replace("distortion_coef", "Distortion_Coef");
    assert_eq!(read("a.yml", old, None).unwrap(), camera);
    let four = XML.replace("    2.3839153080878486e-01</data>", "</data>");
    assert_eq!(read("a.xml", &four, None).unwrap(), expected("OPENCV", &[f, f, cx, cy, k1, k2, p1, p2]));
    let fisheye = four.replace("<fisheye_model>0", "<fisheye_model>1");
    let model = expected("OPENCV_FISHEYE", &[f, f, cx, cy, k1, k2, p1, p2]);
    assert_eq!(read("a.xml", fisheye, None).unwrap(), model);
    let plain = "K: [[500, 0, 320], [0, 510, 240], [0, 0, 1]]\nimage_size: [640, 480]\n";
    assert_eq!(read("a.yaml", plain, None).unwrap(), expected("PINHOLE", &[500.0, 510.0, 320.0, 240.0]));
    // The same list once more under another key.
    let alias = plain.replace("K: ", "K: &k ").replace("image_size", "other: *k\nimage_size");
    assert_eq!(read("a.yaml", alias, None).unwrap(), expected("PINHOLE", &[500.0, 510.0, 320.0, 240.0]));
}

#[test]
fn one_of_two_cameras_of_a_file() {
    let stereo = "%YAML:1.0\n---\nM1: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 500., 0., 320., 0., 510., 240., \
                  0., 0., 1. ]\nD1: !!opencv-matrix\n   rows: 1\n   cols: 4\n   dt: d\n   data: [ 0.1, 0., 0., 0. ]\nM2: [1, 0, 2, 0, 3, 4, 0, 0, 1]\n";
    let first = camera("OPENCV", None, &[500.0, 510.0, 320.0, 240.0, 0.1, 0.0, 0.0, 0.0]).unwrap();
    let second = camera("PINHOLE", None, &[1.0, 3.0, 2.0, 4.0]).unwrap();
    assert_eq!(read("a.yml", stereo, Some("1")).unwrap(), first);
    assert_eq!(read("a.yml", stereo, Some("2")).unwrap(), second);
    let nested = "left: {K: [500, 0, 320, 0, 510, 240, 0, 0, 1], D: [0.1, 0, 0, 0]}\nright:\n  K: [1, 0, 2, 0, 3, 4, 0, 0, 1]\n";
    assert_eq!(read("a.yml", nested, Some("left")).unwrap(), first);
    assert_eq!(read("a.yml", nested, Some("right")).unwrap(), second);
    let several = "FILE:ID names one of several cameras, K1 and D1 by FILE:1";
    let keys = "expected camera_matrix or K";
    assert_eq!(refused("a.yml", stereo, None), format!("a.yml: found M1, D1, M2, {keys}; {several}"));
    assert_eq!(
        refused("a.yml", stereo, Some("3")),
        format!("a.yml: found M1, D1, M2, {keys} of \"3\"; {several}")
    );
}

#[test]
fn calibrations_of_ros() {
    let k = [500.0, 510.0, 320.0, 240.0];
    let four = [0.1, -0.02, 0.003, 0.004];
    for (name, model) in [("plumb_bob", "OPENCV"), ("equidistant", "OPENCV_FISHEYE"), ("\"\"", "OPENCV")] {
        let found = read("a.yaml", ROS.replace("MODEL", name), None).unwrap();
        assert_eq!(found, expected(model, &[k, four].concat()), "{name}");
    }
    let eight = ROS.replace("MODEL", "rational_polynomial").replace("0.004]", "0.004, 0.5, 0.6, 0.7, 0.8]");
    let found = read("a.yaml", eight, None).unwrap();
    assert_eq!(found, expected("FULL_OPENCV", &[&k[..], &four, &[0.5, 0.6, 0.7, 0.8]].concat()));
    // The message itself, as `ros2 topic echo` prints it.
    let message = "header:\n  frame_id: camera\nheight: 480\nwidth: 640\ndistortion_model: plumb_bob\nd:\n- 0.1\n- -0.02\n- 0.003\n- 0.004\nk:\n- \
                   500.0\n- 0.0\n- 320.0\n- 0.0\n- 510.0\n- 240.0\n- 0.0\n- 0.0\n- 1.0\nr: [1.0]\n---\n";
    assert_eq!(read("a.yaml", message, None).unwrap(), expected("OPENCV", &[k, four].concat()));
}

#[test]
fn cameras_of_colmap() {
    let pinhole = expected("PINHOLE", &[500.0, 510.0, 320.0, 240.0]);
    let radial =
        camera("SIMPLE_RADIAL", Some((3072, 2304)), &[2559.81, 1536.0, 1152.0, -0.021_853_1]).unwrap();
    assert_eq!(read("cameras.txt", COLMAP, Some("7")).unwrap(), pinhole);
    assert_eq!(read("cameras.txt", COLMAP, Some("1")).unwrap(), radial);
    assert_eq!(read("cameras.txt", "7 PINHOLE 640 480 500 510 320 240", None).unwrap(), pinhole);
    let two = "found 2 cameras with the numbers 1, 7, expected FILE:ID with one of them";
    for id in [None, Some("2"), Some("x")] {
        assert_eq!(refused("cameras.txt", COLMAP, id), format!("cameras.txt: {two}"));
    }
    let bytes = binary(&[(1, radial, (3072, 2304)), (7, pinhole, (640, 480))]);
    assert_eq!(read("cameras.bin", &bytes, Some("7")).unwrap(), pinhole);
    assert_eq!(read("cameras.bin", &bytes, Some("1")).unwrap(), radial);
    assert_eq!(read("cameras", binary(&[(7, pinhole, (640, 480))]), None).unwrap(), pinhole);
    assert_eq!(refused("cameras.bin", &bytes, None), format!("cameras.bin: {two}"));
    let cut = "cameras.bin: found a file that ends within a camera, expected COLMAP's cameras.bin";
    for length in [3, 8, 20, bytes.len() - 1] {
        assert_eq!(refused("cameras.bin", &bytes[..length], Some("7")), cut, "{length}");
    }
    let more = refused("cameras.bin", [&bytes[..], b"x"].concat(), Some("7"));
    assert_eq!(more, "cameras.bin: found more bytes after 2 cameras, expected COLMAP's cameras.bin");
    // The extension says it where the beginning does not.
    assert_eq!(refused("cameras.bin", "text", None), cut);
    // A camera without a size.
    let plain = camera("PINHOLE", None, &[500.0, 510.0, 320.0, 240.0]).unwrap();
    for size in ["0 0", "640 0", "0 480"] {
        let text = format!("7 PINHOLE {size} 500 510 320 240");
        assert_eq!(read("cameras.txt", text, None).unwrap(), plain, "{size}");
    }
    assert_eq!(read("cameras.bin", binary(&[(7, plain, (0, 0))]), None).unwrap(), plain);
    // Twenty of the numbers are named.
    let many = |count: usize| {
        let lines = (0..count).map(|k| format!("{k} PINHOLE 640 480 500 510 320 240\n"));
        refused("cameras.txt", lines.collect::<String>(), None)
    };
    assert!(many(20).contains(" 18, 19, expected") && many(21).contains(" 18, 19, …, expected"));
    let mut model = bytes.clone();
    model[12] = 99;
    let unknown =
        "cameras.bin: camera 1: found the model 99, expected COLMAP's cameras.bin with models 0 to 17";
    assert_eq!(refused("cameras.bin", model, Some("7")), unknown);
}

/// As COLMAP writes them.
fn binary(cameras: &[(u32, Camera, (u64, u64))]) -> Vec<u8> {
    let mut bytes = (cameras.len() as u64).to_le_bytes().to_vec();
    for (id, camera, (width, height)) in cameras {
        bytes.extend(id.to_le_bytes());
        bytes.extend(camera.model().colmap_id().to_le_bytes());
        bytes.extend(width.to_le_bytes());
        bytes.extend(height.to_le_bytes());
        bytes.extend(camera.params().iter().flat_map(|x| x.to_le_bytes()));
    }
    bytes
}

#[test]
fn what_is_no_calibration_says_what_it_is() {
    let k = |matrix: &str| refused("a.yaml", format!("K: [{matrix}]\n"), None);
    assert_eq!(k("1, 2"), "a.yaml: K: found 2 numbers, expected the 9 of a matrix");
    assert_eq!(k("1, 0, 2, 0, x, 4, 0, 0, 1"), "a.yaml: K: found \"x\", expected a finite number");
    for matrix in [
        "1, 9, 2, 0, 3, 4, 0, 0, 1",
        "1, 0, 2, 9, 3, 4, 0, 0, 1",
        "1, 0, 2, 0, 3, 4, 9, 0, 1",
        "1, 0, 2, 0, 3, 4, 0, 9, 1",
        "1, 0, 2, 0, 3, 4, 0, 0, 2",
    ] {
        assert!(k(matrix).ends_with("expected fx, 0, cx, 0, fy, cy, 0, 0, 1"), "{matrix}");
    }
    let three = refused("a.yaml", "K: [1, 0, 2, 0, 3, 4, 0, 0, 1]\nimage_size: [640, x]\n", None);
    assert_eq!(three, "a.yaml: image_size: found \"x\", expected pixels");
    let three = refused("a.yaml", "K: [1, 0, 2, 0, 3, 4, 0, 0, 1]\nimage_size: [640]\n", None);
    assert_eq!(three, "a.yaml: image_size: found one of width and height, expected both or none");
    let fisheye = refused("a.yaml", "K: [1, 0, 2, 0, 3, 4, 0, 0, 1]\nfisheye: maybe\n", None);
    assert_eq!(fisheye, "a.yaml: fisheye: found \"maybe\", expected 0 or 1");
    let none = read("a.yaml", "K: [1, 0, 2, 0, 3, 4, 0, 0, 1]\nimage_width: 0\nimage_height: 0\n", None);
    assert_eq!(none.unwrap(), camera("PINHOLE", None, &[1.0, 3.0, 2.0, 4.0]).unwrap());
    let focal = k("0, 0, 2, 0, 3, 4, 0, 0, 1");
    assert!(focal.starts_with("a.yaml: K: focal length fx of the camera is 0 pixels"), "{focal}");
    let three = ROS.replace("MODEL", "plumb_bob").replace(", 0.004]", "]");
    let count = "found 3 coefficients of the distortion, expected 0, 4, 5, 8, 12 or 14";
    assert_eq!(refused("a.yaml", three, None), format!("a.yaml: distortion_coefficients: {count}"));
    let model = "distortion_model: found \"omni\", expected plumb_bob, rational_polynomial or equidistant";
    assert_eq!(refused("a.yaml", ROS.replace("MODEL", "omni"), None), format!("a.yaml: {model}"));
    let half = refused("a.yaml", "K: [1, 0, 2, 0, 3, 4, 0, 0, 1]\nwidth: 3\n", None);
    assert_eq!(half, "a.yaml: found one of width and height, expected both or none");
    let line = refused("a.yml", "%YAML:1.0\n---\nK: [1, 2\nD: }\n", None);
    assert!(line.starts_with("a.yml:4: found no YAML: "), "{line}");
    let line = refused("a.xml", "<opencv_storage>\n<K>\n</opencv_storage>", None);
    assert!(line.starts_with("a.xml:3: found no XML: "), "{line}");
    let empty = "a.yml: found an empty file, expected a calibration of OpenCV or ROS, or COLMAP's cameras";
    assert_eq!(refused("a.yml", " \n", None), empty);
    let words = refused("cameras.txt", "# words\n1 PINHOLE 640\n", None);
    let form = "expected COLMAP's CAMERA_ID MODEL WIDTH HEIGHT PARAMS";
    assert_eq!(words, format!("cameras.txt:2: found \"1 PINHOLE 640\", {form}"));
    let deep = refused("a.yml", "[".repeat(1_000), None);
    assert!(deep.starts_with("a.yml:1: found no YAML: "), "{deep}");
}

#[test]
fn every_model_of_colmap_is_read_back() {
    for (index, model) in CameraModel::ALL.into_iter().enumerate() {
        let names = model.param_names();
        // Focal lengths, a centre, and small coefficients; a panorama has its size.
        let value = |name: &&str| match *name {
            "w" => 640.0,
            "h" => 480.0,
            "f" | "fx" | "fy" => 500.0,
            "cx" | "cy" => 240.0,
            "alpha" | "beta" => 0.5,
            _ => 0.01,
        };
        let params: Vec<f64> = names.iter().map(value).collect();
        let camera = expected(model.name(), &params);
        let bytes = binary(&[(u32::try_from(index).unwrap(), camera, (640, 480))]);
        assert_eq!(read("cameras.bin", bytes, None).unwrap(), camera, "{}", model.name());
    }
}

proptest! {
    #[test]
    fn any_bytes_are_a_camera_or_an_error(bytes in prop::collection::vec(any::<u8>(), 0..200), name in "a\\.(yml|xml|txt|bin|x)") {
        let _ = read(&name, bytes, None);
    }

    #[test]
    fn a_file_with_bytes_changed_is_a_camera_or_an_error(
        which in 0..4_usize,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
    ) {
        let mut bytes = [YAML, XML, ROS, COLMAP][which].as_bytes().to_vec();
        for (index, byte) in changes {
            let index = index.index(bytes.len());
            bytes[index] = byte;
        }
        let _ = read(["a.yml", "a.xml", "b.yaml", "cameras.txt"][which], bytes, Some("1"));
    }
}
