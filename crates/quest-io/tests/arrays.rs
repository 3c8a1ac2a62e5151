//! Arrays of NumPy's and archives of them: what they hold, in whatever type and order, or why not.
#![expect(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

use std::{fs, io::Write};

use quest_io::{MOST_BYTES, Pair, ReadError, unpack_npz};

/// An array as NumPy writes it.
fn array(kind: &str, by_columns: bool, shape: &str, values: &[u8]) -> Vec<u8> {
    let order = if by_columns { "True" } else { "False" };
    let header = format!("{{'descr': '{kind}', 'fortran_order': {order}, 'shape': ({shape}), }}");
    let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    bytes.extend(format!("{header:<117}\n").bytes());
    bytes.extend(values);
    bytes
}

fn doubles(shape: &str, values: &[f64]) -> Vec<u8> {
    array("<f8", false, shape, &values.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>())
}

/// An archive of arrays by name, without compression.
fn archive(arrays: &[(&str, &[u8])]) -> Vec<u8> {
    let mut archive = Vec::new();
    let mut zip = rawzip::ZipArchiveWriter::new(&mut archive);
    for (name, bytes) in arrays {
        let (mut entry, config) = zip.new_file(format!("{name}.npy")).start().unwrap();
        let mut writer = config.wrap(&mut entry);
        writer.write_all(bytes).unwrap();
        let descriptor = writer.finish().unwrap().1;
        entry.finish(descriptor).unwrap();
    }
    zip.finish().unwrap();
    archive
}

fn read(bytes: &[u8]) -> Result<Pair, ReadError> {
    let file = tempfile::Builder::new().suffix(".npy").tempfile().unwrap();
    fs::write(file.path(), bytes).unwrap();
    quest_io::read(file.path(), None).unwrap().next().unwrap()
}

#[track_caller]
fn refused(bytes: &[u8], expected: &str) {
    let error = read(bytes).unwrap_err();
    let place = error.place.file.clone();
    let said = error.to_string().replace(&format!("{place}: "), "");
    assert_eq!(said, expected);
}

const ROWS: [[f64; 4]; 2] = [[1.0, 2.0, 3.0, 4.0], [5.0, 6.0, 7.0, 8.0]];

#[test]
fn numbers_of_every_type_in_both_orders() {
    let rows = [1_u8, 2, 3, 4, 5, 6, 7, 8];
    let columns = [1_u8, 5, 2, 6, 3, 7, 4, 8];
    for (values, by_columns) in [(rows, false), (columns, true)] {
        let all = |bytes: fn(u8) -> Vec<u8>| values.iter().flat_map(|x| bytes(*x)).collect::<Vec<_>>();
        let kinds = [
            ("<f8", all(|x| f64::from(x).to_le_bytes().into())),
            (">f8", all(|x| f64::from(x).to_be_bytes().into())),
            ("<f4", all(|x| f32::from(x).to_le_bytes().into())),
            ("<i8", all(|x| i64::from(x).to_le_bytes().into())),
            ("<i4", all(|x| i32::from(x).to_le_bytes().into())),
            ("<i2", all(|x| i16::from(x).to_le_bytes().into())),
            ("|u1", values.to_vec()),
            ("<u2", all(|x| u16::from(x).to_le_bytes().into())),
            ("<u4", all(|x| u32::from(x).to_le_bytes().into())),
        ];
        for (kind, bytes) in kinds {
            let pair = read(&array(kind, by_columns, "2, 4", &bytes)).unwrap();
            assert_eq!((pair.matches, pair.scores), (ROWS.to_vec(), None), "{kind} {by_columns}");
        }
    }
    let form = "expected rows of u1,v1,u2,v2[,score]";
    refused(&array("|b1", false, "2, 4", &[1; 8]), &format!("found an array of type '|b1', {form}"));
}

#[test]
fn a_fifth_column_is_a_score_and_a_gap_no_bearing() {
    let mut rows = [1.0, 2.0, 3.0, 4.0, 0.5, 5.0, 6.0, f64::NAN, f64::INFINITY, 0.25];
    let pair = read(&doubles("2, 5", &rows)).unwrap();
    assert_eq!(pair.scores, Some(vec![0.5, 0.25]));
    assert_eq!(pair.matches[1].map(f64::is_nan), [false, false, true, true]);
    let gap = pair.first_gap.unwrap();
    assert_eq!(gap.place.key.as_deref(), Some("matches[1].u2"));
    assert_eq!(gap.message, "found \"NaN\", expected a finite number");
    rows[9] = f64::INFINITY;
    refused(&doubles("2, 5", &rows), "matches[1].score: found \"inf\", expected a finite number");
}

#[test]
fn arrays_of_another_form() {
    let form = "expected rows of u1,v1,u2,v2[,score]";
    let one = "found two columns, the points of one image, expected matches, or --points2 with those of the other image";
    refused(&doubles("4, 2", &[0.0; 8]), one);
    refused(&doubles("4, 1, 2", &[0.0; 8]), one);
    refused(&doubles("2, 3", &[0.0; 6]), &format!("found 2 rows of 3 numbers, {form}"));
    refused(&doubles("3,", &[0.0; 3]), &format!("found 3 rows of 1 numbers, {form}"));
    refused(&doubles("1, 2, 4", &[0.0; 8]), &format!("found an array of shape [1, 2, 4], {form}"));
    refused(&doubles("2, 0", &[]), &format!("found an array of shape [2, 0], {form}"));
    refused(&doubles("", &[1.0]), &format!("found an array of shape [], {form}"));
    refused(&doubles("99, 4", &[]), &format!("found an array of shape [99, 4] in 128 bytes, {form}"));
    let huge = "4294967296, 4294967296, 4294967296";
    refused(&doubles(huge, &[]), &format!("found an array of more numbers than can be counted, {form}"));
    let cut = &doubles("2, 4", &[1.0; 8])[..150];
    assert!(read(cut).unwrap_err().to_string().contains("found an array that is cut: "));
    assert!(read(b"\x93NUMPY\x09\x00").unwrap_err().to_string().contains("found no array of NumPy's: "));
    assert!(read(b"PK\x03\x04").unwrap_err().to_string().contains("found no archive of NumPy's: "));
    assert!(read(&doubles("0, 4", &[])).unwrap().matches.is_empty());
}

#[test]
fn archives() {
    let matches = doubles("2, 4", ROWS.as_flattened());
    let (x1, x2) = (doubles("2, 2", &[1.0, 2.0, 5.0, 6.0]), doubles("2, 2", &[3.0, 4.0, 7.0, 8.0]));
    let (scores, few) = (doubles("2,", &[0.5, 0.25]), doubles("1,", &[0.5]));
    for arrays in [
        &[("arr_0", &matches[..])][..],
        &[("matches", &matches), ("other", &few)],
        &[("x1", &x1), ("x2", &x2), ("matches2", &few)],
    ] {
        let pair = read(&archive(arrays)).unwrap();
        assert_eq!((pair.matches, pair.scores), (ROWS.to_vec(), None));
        let unknown: Vec<_> =
            arrays.iter().map(|(name, _)| *name).filter(|n| ["other", "matches2"].contains(n)).collect();
        assert_eq!(pair.unknown_keys, unknown);
    }
    for arrays in [
        &[("arr_0", &matches[..]), ("scores", &scores)][..],
        &[("x2", &x2), ("x1", &x1), ("scores", &scores)],
    ] {
        let pair = read(&archive(arrays)).unwrap();
        assert_eq!((pair.matches, pair.scores), (ROWS.to_vec(), Some(vec![0.5, 0.25])));
    }
    let form = "expected rows of u1,v1,u2,v2[,score]";
    let count = format!("found 2 rows of matches and 1 of scores, {form}");
    refused(&archive(&[("matches", &matches), ("scores", &few)]), &count);
    let neither = format!("found the arrays x1, y, neither matches nor x1 and x2, {form}");
    refused(&archive(&[("x1", &x1), ("y", &x2)]), &neither);
    let three = doubles("3, 2", &[0.0; 6]);
    let different = format!("found 2 rows of x1 and 3 of x2, {form}");
    refused(&archive(&[("x1", &x1), ("x2", &three)]), &different);
    let bad = array("<f8", false, "1, 1, 1, 1", &[0; 8]);
    refused(
        &archive(&[("x1", &bad), ("x2", &x2)]),
        &format!("x1: found an array of shape [1, 1, 1, 1], {form}"),
    );
    // An array that unpacks to more than was allowed is cut there; one that was changed is refused.
    let mut bytes = archive(&[("a", &matches)]);
    assert_eq!(unpack_npz(&bytes, MOST_BYTES).unwrap()["a"], matches);
    assert_eq!(unpack_npz(&bytes, 100).unwrap()["a"].len(), 100);
    let place = bytes.windows(6).position(|w| w == b"\x93NUMPY").unwrap();
    bytes[place + 130] ^= 1;
    assert!(unpack_npz(&bytes, MOST_BYTES).is_err());
}
