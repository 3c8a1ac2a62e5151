//! Whatever a file holds, the reader answers with a pair or with one line.
#![expect(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

use std::{fs, path::Path};

use proptest::{prelude::*, sample::Index};
use quest_io::{Format, Pair, ReadError};

const PAIR: &str = r#"{"name": "a", "camera1": {"model": "PINHOLE", "width": 640, "height": 480,
  "params": [500, 510, 320, 240]}, "matches": [[1, 2, 3, 4], [5.5, 6e1, -7, 8]], "scores": [0.5, 1],
  "q_21": [1, 0, 0, 0], "t_21": [0, 0, 1], "note": {"deep": [null, true]}}"#;

/// Reads `bytes` in every form; what comes out has to be in order.
fn read(bytes: &[u8]) -> Vec<Result<Pair, ReadError>> {
    let file = tempfile::NamedTempFile::new().unwrap();
    fs::write(file.path(), bytes).unwrap();
    let formats = [None, Some(Format::Json), Some(Format::JsonLines), Some(Format::Csv)];
    let results: Vec<_> = formats.iter().flat_map(|&f| read_as(file.path(), f)).collect();
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
