//! Whatever a file holds, the reader answers with a pair or with one line.
#![expect(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

use std::{fs, io::Write, path::Path};

use proptest::{prelude::*, sample::Index};
use quest_io::{Format, Pair, ReadError};

const PAIR: &str = r#"{"name": "a", "camera1": {"model": "PINHOLE", "width": 640, "height": 480,
  "params": [500, 510, 320, 240]}, "matches": [[1, 2, 3, 4], [5.5, 6e1, -7, 8]], "scores": [0.5, 1],
  "q_21": [1, 0, 0, 0], "t_21": [0, 0, 1], "note": {"deep": [null, true]}}"#;

/// Reads `bytes` in every form; what comes out has to be in order.
fn read(bytes: &[u8]) -> Vec<Result<Pair, ReadError>> {
    let file = tempfile::NamedTempFile::new().unwrap();
    fs::write(file.path(), bytes).unwrap();
    let formats = [None].into_iter().chain(Format::ALL.map(Some));
    let mut results: Vec<_> = formats.flat_map(|f| read_as(file.path(), f)).collect();
    results.push(quest_io::read_points([file.path(); 2], None, quest_io::MOST_BYTES));
    for result in &results {
        match result {
            Ok(pair) => in_order(pair),
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }
    results
}

fn read_as(path: &Path, format: Option<Format>) -> Vec<Result<Pair, ReadError>> {
    match quest_io::read(path, format) {
        Ok(pairs) => pairs.collect(),
        Err(error) => vec![Err(error)],
    }
}

fn in_order(pair: &Pair) {
    let mut numbers = pair.matches.iter().flatten();
    assert_eq!(numbers.clone().any(|x| x.is_nan()), pair.first_gap.is_some());
    assert!(numbers.all(|x| x.is_finite() || x.is_nan()));
    assert!(pair.scores.as_ref().is_none_or(|s| s.len() == pair.matches.len()));
    assert!(pair.truth.q_21.is_none_or(|q| (q.norm() - 1.0).abs() < 1e-12));
    if let Ok(matches) = pair.correspondences() {
        assert!(pair.first_gap.is_none());
        assert_eq!(matches.len(), pair.matches.len());
    }
}

#[test]
fn the_pair_that_is_changed_is_a_good_one() {
    let results = read(PAIR.replace('\n', " ").as_bytes());
    assert_eq!(results.iter().filter(|r| r.is_ok()).count(), 3);
    let pair = results[0].as_ref().unwrap();
    assert_eq!(pair.matches, [[1.0, 2.0, 3.0, 4.0], [5.5, 60.0, -7.0, 8.0]]);
    assert_eq!(pair.scores.as_deref(), Some(&[0.5, 1.0][..]));
    assert_eq!(pair.unknown_keys, ["note"]);
    assert_eq!(pair.focal_length(), Some(505.0));
}

/// Two rows of matches as NumPy writes them, and an archive of them without compression.
fn arrays() -> [Vec<u8>; 2] {
    let mut array = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 4), }";
    array.extend(format!("{header:<117}\n").bytes());
    array.extend((0..8).flat_map(|k| f64::from(k).to_le_bytes()));
    let mut archive = Vec::new();
    let mut zip = rawzip::ZipArchiveWriter::new(&mut archive);
    let (mut entry, config) = zip.new_file("matches.npy").start().unwrap();
    let mut writer = config.wrap(&mut entry);
    writer.write_all(&array).unwrap();
    let descriptor = writer.finish().unwrap().1;
    entry.finish(descriptor).unwrap();
    zip.finish().unwrap();
    [array, archive]
}

#[test]
fn the_arrays_that_are_changed_are_good_ones() {
    for bytes in arrays() {
        let results = read(&bytes);
        let pair = results[0].as_ref().unwrap();
        assert_eq!(pair.matches, [[0.0, 1.0, 2.0, 3.0], [4.0, 5.0, 6.0, 7.0]]);
    }
}

#[test]
fn deep_nesting_is_refused() {
    for open in ["[", "{\"matches\":"] {
        assert!(read(open.repeat(100_000).as_bytes()).iter().all(Result::is_err));
    }
}

proptest! {
    #[test]
    fn any_bytes(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        read(&bytes);
    }

    #[test]
    fn any_text(text in "[\\[\\]{}\",:.0-9eE+\\-a-z \n]{0,100}") {
        read(text.as_bytes());
    }

    #[test]
    fn a_pair_with_bytes_changed(changes in prop::collection::vec((any::<Index>(), any::<u8>()), 1..4)) {
        let mut bytes = PAIR.as_bytes().to_vec();
        for (index, byte) in changes {
            let index = index.index(bytes.len());
            bytes[index] = byte;
        }
        read(&bytes);
    }

    #[test]
    fn an_array_with_bytes_changed(which in 0..2_usize, changes in prop::collection::vec((any::<Index>(), any::<u8>()), 1..4)) {
        let mut bytes = arrays()[which].clone();
        for (index, byte) in changes {
            let index = index.index(bytes.len());
            bytes[index] = byte;
        }
        read(&bytes);
    }

    #[test]
    fn an_array_of_any_shape_and_type(
        shape in "[0-9]{0,20}(, ?[0-9]{0,20}){0,3}",
        kind in "[<>|=][a-zA-Z?][0-9]{0,3}|\\[\\('a', '<f8'\\)\\]",
        order in "True|False|1",
    ) {
        let header = format!("{{'descr': '{kind}', 'fortran_order': {order}, 'shape': ({shape}), }}\n");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend(u16::try_from(header.len()).unwrap().to_le_bytes());
        bytes.extend(header.bytes());
        bytes.extend([0; 64]);
        read(&bytes);
    }

    #[test]
    fn a_pair_cut_out_and_pasted(from in any::<Index>(), length in 0..40_usize, to in any::<Index>()) {
        let mut bytes = PAIR.as_bytes().to_vec();
        let from = from.index(bytes.len());
        let piece: Vec<_> = bytes.drain(from..(from + length).min(PAIR.len())).collect();
        let to = to.index(bytes.len() + 1);
        bytes.splice(to..to, piece);
        read(&bytes);
    }

    #[test]
    fn a_pair_with_a_value_replaced(index in any::<Index>(), value in "null|true|-1|1e308|1e-400|\"x\"|\\[\\]|\\{\\}|\\[1\\]") {
        let places: Vec<_> = PAIR.match_indices(|c: char| c.is_ascii_digit()).map(|(k, _)| k).collect();
        let k = places[index.index(places.len())];
        read(format!("{}{value}{}", &PAIR[..k], &PAIR[k + 1..]).as_bytes());
    }

    #[test]
    fn csv_with_any_field(field in "[-+.0-9eEinfa,\"\n;]{0,12}") {
        read(format!("u1,v1,u2,v2,score\n1,2,3,4,5\n1,{field},3,4,5\n").as_bytes());
    }
}
