//! Matches as arrays of NumPy's, as tables with and without a header, and as two files of points.

use super::{
    numpy::{archive, array},
    *,
};

/// The matches of `examples/points.json`.
fn rows() -> Vec<[f64; 4]> {
    serde_json::from_str(&five_matches()).unwrap()
}

fn lines(rows: &[[f64; 4]], separator: &str) -> String {
    let line = |row: &[f64; 4]| row.map(|x| x.to_string()).join(separator);
    rows.iter().map(line).collect::<Vec<_>>().join("\n") + "\n"
}

/// The columns `from..` of the matches as an array of `width` columns.
fn columns(from: usize, width: usize) -> Vec<u8> {
    let values: Vec<f64> = rows().iter().flat_map(|row| row[from..from + width].to_vec()).collect();
    array(&[5, width], &values)
}

/// What `solve` answers for a file, with further arguments.
#[track_caller]
fn solved(folder: &TempDir, arguments: &[&str]) -> serde_json::Value {
    let run = run_in(folder.path(), &[&["solve", "--quiet", "--format", "json"], arguments].concat(), b"");
    assert_eq!((run.status, run.stderr.as_str()), (0, ""), "{arguments:?}");
    let record: serde_json::Value = serde_json::from_str(&run.stdout).unwrap();
    let poses = |c: &serde_json::Value| serde_json::json!([c["q_21"], c["t_21"]]);
    record["candidates"].as_array().unwrap().iter().map(poses).collect()
}

fn expected() -> serde_json::Value {
    solved(&directory_with("a", ""), &[&example("points.csv")])
}

#[test]
fn arrays_and_archives_are_read() {
    let scores = array(&[5], &[5_i64, 4, 3, 2, 1]);
    let files = [
        ("a.npy", columns(0, 4)),
        ("no_extension", columns(0, 4)),
        ("alone.npz", archive(&vec![("arr_0", columns(0, 4))])),
        ("named.npz", archive(&vec![("matches", columns(0, 4)), ("scores", scores.clone())])),
        ("two.npz", archive(&vec![("x1", columns(0, 2)), ("x2", columns(2, 2)), ("scores", scores)])),
    ];
    for (name, bytes) in files {
        assert_eq!(solved(&directory_with(name, bytes), &[name]), expected(), "{name}");
    }
    // In the order of columns, as NumPy writes a transposed array.
    let mut by_columns = columns(0, 4);
    let header = b"'fortran_order': False";
    let at = by_columns.windows(header.len()).position(|w| w == header).unwrap();
    by_columns[at..at + header.len()].copy_from_slice(b"'fortran_order': True ");
    let start = by_columns.len() - 20 * 8;
    let values =
        (0..4).flat_map(|k| rows().iter().flat_map(move |row| row[k].to_le_bytes()).collect::<Vec<_>>());
    let values: Vec<u8> = values.collect();
    by_columns[start..].copy_from_slice(&values);
    assert_eq!(solved(&directory_with("f.npy", by_columns), &["f.npy"]), expected());
}

#[test]
fn a_score_stands_in_the_fifth_column() {
    let mut values: Vec<f64> = rows().iter().flat_map(|row| [row.as_slice(), &[0.5]].concat()).collect();
    let folder = directory_with("a.npy", array(&[5, 5], &values));
    assert_eq!(solved(&folder, &["a.npy"]), expected());
    values[9] = f64::NAN;
    refused(
        "a.npy",
        &array(&[5, 5], &values),
        "a.npy: matches[1].score: found \"NaN\", expected a finite number",
    );
}

#[test]
fn tables_need_no_header_and_no_commas() {
    for separator in [",", ";", "\t", " ", "   ", " , "] {
        for name in ["a.csv", "a.txt"] {
            let folder = directory_with(name, lines(&rows(), separator));
            assert_eq!(solved(&folder, &[name]), expected(), "{separator:?}");
            let header = ["u1", "v1", "u2", "v2"].join(separator);
            for mark in ["", "# "] {
                let folder =
                    directory_with(name, format!("{mark}{header}\n# words\n{}", lines(&rows(), separator)));
                assert_eq!(solved(&folder, &[name]), expected(), "{mark}{separator:?}");
            }
        }
    }
}

#[test]
fn points_of_two_images_stand_in_two_files() {
    let folder = directory_with("one.npy", columns(0, 2));
    // As OpenCV has them.
    let second: Vec<f64> = rows().iter().flat_map(|row| [row[2], row[3]]).collect();
    fs::write(folder.path().join("two.npy"), array(&[5, 1, 2], &second)).unwrap();
    let text = |from: usize, separator: &str, order: [usize; 2]| {
        let line = |row: &[f64; 4]| order.map(|k| row[from + k].to_string()).join(separator);
        rows().iter().map(line).collect::<Vec<_>>().join("\n")
    };
    fs::write(folder.path().join("two.txt"), text(2, " ", [0, 1])).unwrap();
    fs::write(folder.path().join("one.csv"), format!("v,u\n{}", text(0, ",", [1, 0]))).unwrap();
    for (one, two) in [("one.npy", "two.npy"), ("one.npy", "two.txt"), ("one.csv", "two.npy")] {
        assert_eq!(solved(&folder, &[one, "--points2", two]), expected(), "{one} {two}");
    }
    fs::write(folder.path().join("few.txt"), "1 2\n3 4\n").unwrap();
    let run = |arguments: &[&str]| run_in(folder.path(), &[&["solve"], arguments].concat(), b"").stderr;
    let few = "error: few.txt: found 2 points, expected 5 as in the file of the first image\n";
    assert_eq!(run(&["one.npy", "--points2", "few.txt"]), few);
    let one = "found two columns, the points of one image, expected matches, or --points2 with those of the other image\n";
    assert_eq!(run(&["one.npy"]), format!("error: one.npy: {one}"));
    assert_eq!(run(&["two.txt"]), format!("error: two.txt:1: {one}"));
    let json = example("points.json");
    let words = "expected the points of one image as CSV or an array of NumPy's\n";
    assert_eq!(run(&[&json, "--points2", "two.npy"]), format!("error: {json}: found JSON, {words}"));
    let several = run(&["one.npy", "one.csv", "--points2", "two.npy"]);
    assert!(several.contains("found several files and --points2"), "{several}");
}

#[track_caller]
fn refused(file: &str, bytes: &[u8], expected: &str) {
    let run = run_in(directory_with(file, bytes).path(), &["solve", file], b"");
    assert_eq!((run.status, run.stderr), (2, format!("error: {expected}\n")));
}

#[test]
fn what_is_no_table_of_matches_says_what_it_is() {
    let rows_of = "expected rows of u1,v1,u2,v2[,score]";
    refused("a.npy", &columns(0, 3), &format!("a.npy: found 5 rows of 3 numbers, {rows_of}"));
    let shape = array(&[5, 2, 2], &[0.0; 20]);
    refused("a.npy", &shape, &format!("a.npy: found an array of shape [5, 2, 2], {rows_of}"));
    let two = archive(&vec![("a", columns(0, 4)), ("x1", columns(0, 2))]);
    let names = "found the arrays a, x1, neither matches nor x1 and x2";
    refused("a.npz", &two, &format!("a.npz: {names}, {rows_of}"));
    let unequal = archive(&vec![("x1", columns(0, 2)), ("x2", array(&[4, 2], &[0.0; 8]))]);
    refused("a.npz", &unequal, &format!("a.npz: found 5 rows of x1 and 4 of x2, {rows_of}"));
    let cut = columns(0, 4);
    let run = run_in(directory_with("a.npy", &cut[..cut.len() - 8]).path(), &["solve", "a.npy"], b"");
    assert!(run.status == 2 && run.stderr.contains(rows_of), "{}", run.stderr);

    let text = "1;2;3;4\n1;2,5;3;4\n";
    refused("a.csv", text.as_bytes(), "a.csv:2: v1: found \"2,5\", expected a number with a decimal point");
    let header = "expected u1,v1,u2,v2[,score], or a header with these names";
    refused("a.csv", b"\n1,2,3\n", &format!("a.csv:2: found 3 columns and no header, {header}"));
    let comment = b"# made by hand\n1 2 3 4\n# once more\n\n1 2 x 4\n";
    refused("a.txt", comment, "a.txt:5: u2: found \"x\", expected a finite number");
}

#[test]
fn a_camera_may_be_a_file() {
    let folder =
        directory_with("cameras.txt", "1 PINHOLE 640 480 500 510 320 240\n2 PINHOLE 640 480 9 9 0 0\n");
    let yaml = "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\nK: [500., 0., 320., 0., 510., 240., 0., 0., 1.]\n";
    fs::write(folder.path().join("camera.yml"), yaml).unwrap();
    let pixels: Vec<f64> = rows()
        .iter()
        .flat_map(|r| {
            [500.0 * r[0] + 320.0, 510.0 * r[1] + 240.0, 500.0 * r[2] + 320.0, 510.0 * r[3] + 240.0]
        })
        .collect();
    fs::write(folder.path().join("a.npy"), array(&[5, 4], &pixels)).unwrap();
    let with = |cameras: &[&str]| solved(&folder, &[&["a.npy"], cameras].concat());
    let given = with(&["--camera1", "PINHOLE,640,480,500,510,320,240"]);
    assert_eq!(with(&["--camera1", "camera.yml"]), given);
    assert_eq!(with(&["--camera1", "cameras.txt:1", "--camera2", "camera.yml"]), given);
    for (camera, words) in [
        (
            "cameras.txt",
            "cameras.txt: found 2 cameras with the numbers 1, 2, expected FILE:ID with one of them",
        ),
        ("no.yml", "found no file of this name, expected the file of a camera, or MODEL,width,height,params"),
        ("FISH,640,480,1,1,1", "unknown camera model \"FISH\""),
    ] {
        let run = run_in(folder.path(), &["solve", "a.npy", "--camera1", camera], b"");
        assert!(run.status == 2 && run.stderr.contains(words), "{}", run.stderr);
    }
}

#[test]
fn pixels_without_a_camera_are_told_from_points_of_the_plane() {
    let pixels: Vec<f64> = rows().iter().flatten().map(|x| 500.0 * x + 320.0).collect();
    let folder = directory_with("a.npy", array(&[5, 4], &pixels));
    for command in [&["solve", "a.npy"][..], &["estimate", "a.npy", "--threshold", "1"], &["matrix", "a.npy"]]
    {
        let run = run_in(folder.path(), command, b"");
        assert_eq!(run.status, 2, "{command:?}");
        assert!(run.stderr.contains("these look like pixels: give --camera1"), "{}", run.stderr);
    }
    // The camera that the message names takes them as they are.
    for camera in ["SIMPLE_PINHOLE,1,1,1,0,0", "SIMPLE_PINHOLE,640,640,500,320,320"] {
        let run = run_in(folder.path(), &["solve", "a.npy", "--camera1", camera], b"");
        assert_eq!(run.status, 0, "{}", run.stderr);
    }
    // Nor are points of the plane taken for pixels.
    let points: Vec<f64> = rows().iter().flatten().copied().collect();
    fs::write(folder.path().join("b.npy"), array(&[5, 4], &points)).unwrap();
    let run =
        run_in(folder.path(), &["solve", "b.npy", "--camera1", "SIMPLE_PINHOLE,640,640,500,320,320"], b"");
    let words = "within 2 pixels of the corner of the image";
    assert!(run.status == 2 && run.stderr.contains(words), "{}", run.stderr);
}
