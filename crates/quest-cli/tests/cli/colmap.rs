//! Databases of COLMAP: what the tool says where there is no pose to be had.

use super::*;

/// A folder with `database.db`: two images of one camera whose focal length is a guess, and so many pairs of them with matches.
fn folder(pairs: usize) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let connection = rusqlite::Connection::open(folder.path().join("database.db")).unwrap();
    connection
        .execute_batch(
            "CREATE TABLE cameras(camera_id INTEGER PRIMARY KEY, model INTEGER, width INTEGER, height INTEGER, params BLOB,
               prior_focal_length INTEGER);
             CREATE TABLE images(image_id INTEGER PRIMARY KEY, name TEXT UNIQUE, camera_id INTEGER);
             CREATE TABLE keypoints(image_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB);
             CREATE TABLE matches(pair_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB);
             CREATE TABLE two_view_geometries(pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL,
               cols INTEGER NOT NULL, data BLOB, config INTEGER NOT NULL, F BLOB, E BLOB, H BLOB, qvec BLOB, tvec BLOB);
             INSERT INTO images VALUES (1, 'a.jpg', 1), (2, 'b.jpg', 1);",
        )
        .unwrap();
    let params: Vec<u8> = [500.0_f64, 500.0, 320.0, 240.0].iter().flat_map(|x| x.to_le_bytes()).collect();
    connection.execute("INSERT INTO cameras VALUES (1, 1, 640, 480, ?1, 0)", [params]).unwrap();
    for _ in 0..pairs {
        let data: Vec<u8> = [0_u32, 0].iter().flat_map(|x| x.to_le_bytes()).collect();
        connection.execute("INSERT INTO matches VALUES (2147483649, 1, 2, ?1)", [data]).unwrap();
    }
    folder
}

fn colmap(folder: &TempDir, arguments: &[&str]) -> Run {
    run_in(folder.path(), &[&["colmap", arguments[0], "database.db"], &arguments[1..]].concat(), b"")
}

#[test]
fn a_guessed_focal_length_says_how_a_camera_is_declared() {
    let run = colmap(&folder(1), &["verify"]);
    assert_eq!(run.status, 1, "{}", run.stderr);
    for words in [
        "1 have a guessed focal length",
        "UPDATE cameras SET prior_focal_length = 1",
        "has_prior_focal_length",
    ] {
        assert!(run.stdout.contains(words), "{}", run.stdout);
    }
}

#[test]
fn a_database_without_matches_is_said() {
    let folder = folder(0);
    for command in ["verify", "export"] {
        let run = colmap(&folder, &[command]);
        let expected =
            "no pose: database.db: found no pair with matches, expected those of a matcher of COLMAP's\n";
        assert_eq!((run.status, run.stderr.as_str()), (1, expected));
    }
}

#[test]
fn a_list_of_pairs_is_named_with_its_line() {
    let folder = folder(1);
    fs::write(folder.path().join("pl.txt"), "# two names a line\n\na.jpg b.jpg\na.jpg c.jpg\n").unwrap();
    for command in ["verify", "export"] {
        let run = colmap(&folder, &[command, "--pairs", "pl.txt"]);
        assert!(run.stderr.starts_with("error: pl.txt:4: found no image \"c.jpg\""), "{}", run.stderr);
        assert_eq!(run.status, 2);
    }
}
