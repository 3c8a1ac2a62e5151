#![no_main]
//! Databases whose blobs and numbers are anything: verified or refused, pair by pair, and what is written can be read again.
use std::cell::RefCell;
use std::path::PathBuf;

use libfuzzer_sys::fuzz_target;
use quest_colmap::{Database, Existing, Uncalibrated, VerifyOptions, verify};
use quest_core::robust::Options;
use quest_fuzz::Bytes;
use quest_fuzz::hostile::Choices;
use rusqlite::{Connection, params};

const SCHEMA: &str = "
    CREATE TABLE cameras(camera_id INTEGER PRIMARY KEY, model INTEGER, width INTEGER, height INTEGER, params BLOB,
      prior_focal_length INTEGER);
    CREATE TABLE images(image_id INTEGER PRIMARY KEY, name TEXT UNIQUE, camera_id INTEGER);
    CREATE TABLE keypoints(image_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB);
    CREATE TABLE matches(pair_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB);
    CREATE TABLE two_view_geometries(pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL,
      data BLOB, config INTEGER NOT NULL, F BLOB, E BLOB, H BLOB, qvec BLOB, tvec BLOB);
    INSERT INTO images VALUES(1, 'a', 1), (2, 'b', 1);";

const PAIR: i64 = 2_147_483_647 + 2;

thread_local! {
    static FILE: RefCell<Option<(PathBuf, Connection)>> = const { RefCell::new(None) };
}

fuzz_target!(|bytes: &[u8]| FILE.with_borrow_mut(|file| {
    let (path, connection) = file.get_or_insert_with(empty);
    let mut bytes = Bytes(bytes);
    fill(connection, &mut bytes).expect("rows of a database of ours");
    let Ok(mut database) = Database::open(path) else { return };
    let options = VerifyOptions {
        search: Options { max_iterations: 50, min_iterations: 1, threshold: 4.0, ..Options::default() },
        existing: Existing::Overwrite,
        uncalibrated: bytes.pick(&[Uncalibrated::Skip, Uncalibrated::Guess]),
        min_inliers: bytes.pick(&[0, 15]),
        threads: 1,
        ..VerifyOptions::default()
    };
    let Ok(report) = verify(&mut database, &options, &()) else { return };
    assert!(report.summary.verified <= report.summary.pairs);
    let sql = "SELECT F, E, H, qvec, tvec FROM two_view_geometries";
    let mut statement = connection.prepare_cached(sql).expect("a table of ours");
    let mut rows = statement.query([]).expect("a table of ours");
    while let Ok(Some(row)) = rows.next() {
        for column in 0..5 {
            let blob: Option<Vec<u8>> = row.get(column).expect("a blob or none");
            let numbers = blob.iter().flat_map(|b| b.as_chunks::<8>().0).map(|b| f64::from_le_bytes(*b));
            assert!(numbers.into_iter().all(f64::is_finite), "column {column} is {blob:?}");
        }
    }
}));

fn empty() -> (PathBuf, Connection) {
    let path = std::env::temp_dir().join(format!("quest-fuzz-{}.db", std::process::id()));
    let _ = std::fs::remove_file(&path);
    let connection = Connection::open(&path).expect("a file in the directory for temporary files");
    connection.execute_batch("PRAGMA synchronous = OFF").expect("a setting");
    connection.execute_batch(SCHEMA).expect("tables");
    connection.execute_batch("PRAGMA user_version = 4000000").expect("a setting");
    (path, connection)
}

fn fill(connection: &Connection, bytes: &mut Bytes) -> rusqlite::Result<()> {
    connection.execute_batch("BEGIN; DELETE FROM cameras; DELETE FROM keypoints; DELETE FROM matches; DELETE FROM two_view_geometries")?;
    let model = bytes.below(18);
    let params: Vec<u8> = (0..bytes.pick(&[4, 4, 3, 8, 12, 5]))
        .map(|k| match k {
            _ if bytes.unit() < 0.02 => bytes.anything(),
            0 | 1 => bytes.between(300.0, 1500.0),
            2 | 3 => bytes.between(200.0, 800.0),
            _ => bytes.between(-0.1, 0.1),
        })
        .flat_map(f64::to_le_bytes)
        .collect();
    connection.prepare_cached("INSERT INTO cameras VALUES(1, ?1, ?2, ?3, ?4, ?5)")?.execute(params![
        i64::try_from(model).unwrap_or(1),
        bytes.pick(&[1280_i64, 0, -1, i64::MAX]),
        bytes.pick(&[960_i64, 0, -1, i64::MAX]),
        params,
        bytes.pick(&[1_i64, 1, 0]),
    ])?;
    let count = bytes.below(60);
    let (shift, zoom) = (bytes.between(-50.0, 50.0), bytes.pick(&[1.0, 1.1, 0.5]));
    let points: Vec<[f64; 2]> =
        (0..count).map(|_| [bytes.between(0.0, 1280.0), bytes.between(0.0, 960.0)]).collect();
    for image in [1_i64, 2] {
        let mut data = Vec::new();
        for [u, v] in &points {
            let moved = if image == 1 { [*u, *v] } else { [u * zoom + shift, v * zoom + bytes.between(-3.0, 3.0)] };
            for x in moved {
                #[expect(clippy::cast_possible_truncation, reason = "COLMAP keeps f32")]
                let x = if bytes.unit() < 0.01 { bytes.anything() as f32 } else { x as f32 };
                data.extend(x.to_le_bytes());
            }
        }
        torn(&mut data, bytes);
        let rows = size(count, bytes);
        connection
            .prepare_cached("INSERT INTO keypoints VALUES(?1, ?2, ?3, ?4)")?
            .execute(params![image, rows, bytes.pick(&[2_i64, 2, 2, 2, 2, 6, 0, -1]), data])?;
    }
    let pairs = if bytes.unit() < 0.9 { count } else { bytes.below(80) };
    let mut data: Vec<u8> = (0..pairs)
        .flat_map(|k| {
            let index = |bytes: &mut Bytes| {
                if bytes.unit() < 0.02 { u32::try_from(bytes.below(1 << 20)).unwrap_or(0) } else { u32::try_from(k).unwrap_or(0) }
            };
            [index(bytes), index(bytes)]
        })
        .flat_map(u32::to_le_bytes)
        .collect();
    torn(&mut data, bytes);
    let rows = size(pairs, bytes);
    let cols = bytes.pick(&[2_i64, 2, 2, 2, 2, 2, 1, i64::MIN]);
    let key = if bytes.unit() < 0.95 { PAIR } else { i64::from_le_bytes(bytes.word().to_le_bytes()) };
    connection.prepare_cached("INSERT INTO matches VALUES(?1, ?2, ?3, ?4)")?.execute(params![key, rows, cols, data])?;
    connection.execute_batch("COMMIT")
}

/// Sometimes a blob loses its end.
fn torn(data: &mut Vec<u8>, bytes: &mut Bytes) {
    if bytes.unit() < 0.05 {
        data.truncate(bytes.below(data.len() + 1));
    }
}

/// Sometimes a count is not the one of the blob.
fn size(count: usize, bytes: &mut Bytes) -> i64 {
    match bytes.below(24) {
        0 => i64::MAX,
        1 => -1,
        2 => 0,
        _ => i64::try_from(count).unwrap_or(0),
    }
}
