//! What is wrong with a database, a pair, the disk or the other program: an error, and the database as it was.

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use quest_colmap::{ColmapError, Database, Existing, VerifyOptions, Watch, verify};
use quest_core::robust::Options;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::planted::{Planted, SEED, Schema, World, rows, write_matches};

fn options() -> VerifyOptions {
    VerifyOptions { threads: 1, ..VerifyOptions::default() }
}

fn refused(path: &Path) -> String {
    match Database::open(path) {
        Ok(mut database) => verify(&mut database, &options(), &()).unwrap_err().to_string(),
        Err(error) => error.to_string(),
    }
}

#[test]
fn what_is_no_database_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.db");
    assert!(refused(&path).contains("found no file"));
    assert!(!path.exists());
    fs::write(&path, "not a database, but long enough to be read as the head of one".repeat(20)).unwrap();
    assert!(refused(&path).contains("another kind of file"), "{}", refused(&path));
    fs::write(&path, "").unwrap();
    assert!(refused(&path).contains("found no table cameras"), "{}", refused(&path));
}

#[test]
fn another_writer_is_named_and_nothing_changes() {
    let planted = Planted::new(Schema::V4_2, World::Volume, 3);
    let other = planted.connection();
    other.execute_batch("BEGIN IMMEDIATE").unwrap();
    assert!(refused(&planted.path).contains("another program is writing"));
    other.execute_batch("ROLLBACK").unwrap();
    assert!(rows(&other, true).is_empty());
}

#[cfg(unix)]
#[test]
fn a_file_that_is_read_only_is_refused_but_for_a_dry_run() {
    use std::os::unix::fs::PermissionsExt;
    let planted = Planted::new(Schema::V4_2, World::Volume, 3);
    fs::set_permissions(&planted.path, fs::Permissions::from_mode(0o444)).unwrap();
    let is_root = fs::OpenOptions::new().append(true).open(&planted.path).is_ok();
    let mut database = Database::open(&planted.path).unwrap();
    let dry = VerifyOptions { dry_run: true, ..options() };
    assert_eq!(verify(&mut database, &dry, &()).unwrap().summary.verified, 3);
    assert!(rows(&planted.connection(), true).is_empty());
    // Nothing keeps root from writing.
    if !is_root {
        assert!(refused(&planted.path).contains("read-only"), "{}", refused(&planted.path));
    }
}

/// Ends a run after some questions.
struct Impatient(AtomicUsize);

impl Watch for Impatient {
    fn is_cancelled(&self) -> bool {
        self.0.fetch_add(1, Ordering::Relaxed) >= 4
    }
}

#[test]
fn a_run_that_is_ended_writes_nothing() {
    let planted = Planted::new(Schema::V4_2, World::Volume, 4);
    let mut database = Database::open(&planted.path).unwrap();
    let ended = verify(&mut database, &options(), &Impatient(AtomicUsize::new(0)));
    assert!(matches!(ended, Err(ColmapError::Cancelled)), "{ended:?}");
    assert!(rows(&planted.connection(), true).is_empty());
    // The same connection begins again.
    assert_eq!(verify(&mut database, &options(), &()).unwrap().summary.verified, 6);
}

#[test]
fn a_disk_that_is_full_leaves_the_database_as_it_was() {
    let planted = Planted::new(Schema::V4_2, World::Volume, 4);
    let connection = planted.connection();
    let pages: i64 = connection.query_row("PRAGMA page_count", [], |row| row.get(0)).unwrap();
    let mut database = Database::open(&planted.path).unwrap();
    // SQLite says that the disk is full where the database may have no more pages.
    database.limit_pages(pages).unwrap();
    let error = verify(&mut database, &options(), &()).unwrap_err().to_string();
    assert!(error.contains("disk is full"), "{error}");
    drop(database);
    let check: String = connection.query_row("PRAGMA integrity_check", [], |row| row.get(0)).unwrap();
    assert_eq!((check.as_str(), rows(&connection, true).len()), ("ok", 0));
}

#[test]
fn no_pair_spoils_another() {
    let clean = Planted::new(Schema::V4_2, World::Volume, 4);
    let spoiled = Planted::new(Schema::V4_2, World::Volume, 4);
    let connection = spoiled.connection();
    // A pair names a keypoint that is not there, a pair has a blob that is cut, an image has a NaN that two matches use.
    write_matches(&connection, (1, 2), &[[0, 0], [1, 999]]);
    connection.execute("UPDATE matches SET data = x'00' WHERE pair_id = 2147483647 + 3", []).unwrap();
    let data: Vec<u8> =
        connection.query_row("SELECT data FROM keypoints WHERE image_id = 4", [], |row| row.get(0)).unwrap();
    let mut data = data;
    data[24..28].copy_from_slice(&f32::NAN.to_le_bytes());
    connection.execute("UPDATE keypoints SET data = ?1 WHERE image_id = 4", [data]).unwrap();
    let run = |planted: &Planted| {
        let mut database = Database::open(&planted.path).unwrap();
        let report = verify(
            &mut database,
            &VerifyOptions { search: Options { seed: SEED, ..options().search }, ..options() },
            &(),
        )
        .unwrap();
        (report, rows(&planted.connection(), true))
    };
    let ((_, all), (report, some)) = (run(&clean), run(&spoiled));
    assert_eq!((report.summary.unreadable, some.len()), (2, 4));
    assert!(report.pairs[0].reason.as_ref().unwrap().contains("keypoint 999 of image 2"), "{report:?}");
    assert!(report.pairs[1].reason.as_ref().unwrap().contains("1 bytes"), "{report:?}");
    let of = |rows: &[super::planted::Row], images| rows.iter().find(|r| r.images == images).cloned();
    assert_eq!(of(&some, (2, 3)), of(&all, (2, 3)));
    assert!(report.summary.invalid >= 3);
    for pair in &report.pairs[2..] {
        assert!(pair.config.is_some_and(|config| config.code() > 1), "{pair:?}");
    }
}

/// The run that [`a_killed_run_leaves_the_old_rows_or_the_new_ones`] kills.
#[test]
#[ignore = "a part of another test, which runs it as a process of its own"]
fn run_to_be_killed() {
    let path = std::env::var_os(TO_BE_KILLED).unwrap();
    let mut database = Database::open(Path::new(&path)).unwrap();
    let more = VerifyOptions { existing: Existing::Overwrite, ..options() };
    verify(&mut database, &more, &()).unwrap();
}

const TO_BE_KILLED: &str = "QUEST_COLMAP_TO_BE_KILLED";

fn child(path: &Path) -> Child {
    Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "trouble::run_to_be_killed", "--ignored"])
        .env(TO_BE_KILLED, path)
        .stdout(Stdio::null())
        .spawn()
        .unwrap()
}

#[test]
fn a_killed_run_leaves_the_old_rows_or_the_new_ones() {
    for mode in ["WAL", "DELETE"] {
        let planted = Planted::new(Schema::V4_2, World::Volume, 5);
        let set = format!("PRAGMA journal_mode = {mode}");
        planted.connection().query_row(&set, [], |_| Ok(())).unwrap();
        let start = Instant::now();
        assert!(child(&planted.path).wait().unwrap().success());
        let whole = start.elapsed();
        let new = rows(&planted.connection(), true);
        assert_eq!(new.len(), 10);
        // What a run finds there is older.
        let mark = || planted.connection().execute("UPDATE two_view_geometries SET config = 1", []).unwrap();
        mark();
        let old = rows(&planted.connection(), true);
        let mut rng = ChaCha8Rng::seed_from_u64(SEED);
        for _ in 0..8 {
            let mut run = child(&planted.path);
            std::thread::sleep(whole.mul_f64(rng.random_range(0.0..1.1)));
            // It may have ended by itself.
            let _ = run.kill();
            run.wait().unwrap();
            let connection = planted.connection();
            let check: String = connection.query_row("PRAGMA integrity_check", [], |row| row.get(0)).unwrap();
            assert_eq!(check, "ok");
            let found = rows(&connection, true);
            assert!(found == old || found == new, "{mode}: {} rows", found.len());
            if found == new {
                mark();
            }
        }
        planted.connection().execute("DELETE FROM two_view_geometries WHERE pair_id % 2 = 0", []).unwrap();
        let mut database = Database::open(&planted.path).unwrap();
        let resume = VerifyOptions { existing: Existing::Resume, ..options() };
        verify(&mut database, &resume, &()).unwrap();
        for (row, new) in rows(&planted.connection(), true).iter().zip(&new) {
            assert!(row.config == 1 || row == new);
        }
    }
}
