//! Tables of Parquet, written and read.
#![cfg(feature = "parquet")]
#![expect(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

use std::fs;

use quest_core::{Camera, CameraModel};
use quest_io::{EstimateRecord, MatchesTable, PosesTable, read};

fn camera(f: f64) -> Camera {
    Camera::new(CameraModel::Pinhole, &[f, f, 320.0, 240.0]).unwrap()
}

/// As many pairs with as many matches as their numbers.
fn table(count: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut table = MatchesTable::new().unwrap();
    for key in 0..count {
        let matches: Vec<_> = (0..key % 7).map(|k| [k as f32, 0.1, f32::NAN, 3.5]).collect();
        let cameras = [&camera(500.0), &camera(600.0)];
        table.write(u64::MAX - key, &format!("{key}.jpg b.jpg"), cameras, &matches, &mut bytes).unwrap();
    }
    table.finish(&mut bytes).unwrap();
    bytes
}

#[test]
fn pairs_of_parquet_are_read_as_they_were_written() {
    let folder = tempfile::tempdir().unwrap();
    // By its first bytes, and over several groups of rows.
    let path = folder.path().join("pairs");
    fs::write(&path, table(2500)).unwrap();
    let pairs: Vec<_> = read(&path, None).unwrap().collect::<Result<_, _>>().unwrap();
    assert_eq!(pairs.len(), 2500);
    for (key, pair) in pairs.iter().enumerate() {
        assert_eq!(pair.key, Some(u64::MAX - key as u64));
        assert_eq!(pair.name.as_deref(), Some(format!("{key}.jpg b.jpg").as_str()));
        assert_eq!(pair.cameras, Some([camera(500.0), camera(600.0)]));
        assert_eq!(pair.matches.len(), key % 7);
        for (k, [u1, v1, u2, v2]) in pair.matches.iter().enumerate() {
            assert_eq!((*u1, *v1, *v2), (k as f64, f64::from(0.1_f32), 3.5));
            assert!(u2.is_nan());
        }
        assert_eq!(pair.first_gap.is_some(), key % 7 > 0);
    }
}

#[test]
fn a_damaged_file_of_parquet_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("pairs.parquet");
    let whole = table(20);
    let read = |bytes: &[u8]| {
        fs::write(&path, bytes).unwrap();
        read(&path, None).and_then(Iterator::collect::<Result<Vec<_>, _>>)
    };
    assert!(read(&whole).is_ok());
    for end in (0..whole.len()).step_by(7) {
        let error = read(&whole[..end]).unwrap_err().to_string();
        assert!(error.contains("pairs.parquet: found "), "{end}: {error}");
    }
    // A byte that is another one is an error, or another number.
    for index in (0..whole.len()).step_by(5) {
        let mut bytes = whole.clone();
        bytes[index] ^= 0x55;
        let _ = read(&bytes);
    }
}

#[test]
fn other_columns_of_parquet_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("poses.parquet");
    let mut bytes = Vec::new();
    let mut poses = PosesTable::new().unwrap();
    poses.write(&EstimateRecord::unanswered(None, "none".to_owned()), &mut bytes).unwrap();
    poses.finish(&mut bytes).unwrap();
    fs::write(&path, &bytes).unwrap();
    let error = read(&path, None).unwrap().next().unwrap().unwrap_err().to_string();
    assert!(error.contains("found the columns pair, model, reason, q_wxyz"), "{error}");
    assert!(error.ends_with("expected also x1 and x2"), "{error}");
}
