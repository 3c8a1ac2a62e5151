//! Archives of NumPy's: `numpy.savez` and `savez_compressed`.

use std::collections::BTreeMap;
use std::io::Read;

use flate2::bufread::DeflateDecoder;
use npyz::NpyFile;
use rawzip::{CompressionMethod, ZipArchive};

/// The arrays of an archive by name, each as a file `.npy` has it. None is longer than `most` bytes: a small archive may pretend to be
/// a huge one.
///
/// # Errors
/// Bytes that are no such archive, or are cut or changed.
pub fn unpack_npz(bytes: &[u8], most: u64) -> Result<BTreeMap<String, Vec<u8>>, String> {
    unpacked(bytes, most).map_err(|error| error.to_string())
}

fn unpacked(bytes: &[u8], most: u64) -> Result<BTreeMap<String, Vec<u8>>, rawzip::Error> {
    let archive = ZipArchive::from_slice(bytes)?;
    let mut entries = archive.entries();
    let mut arrays = BTreeMap::new();
    while let Some(entry) = entries.next_entry()? {
        let name = String::from_utf8_lossy(entry.file_path().as_bytes()).trim_end_matches(".npy").to_owned();
        let local = archive.get_entry(entry.wayfinder())?;
        let mut array = Vec::new();
        if entry.compression_method() == CompressionMethod::DEFLATE {
            let inflated = DeflateDecoder::new(local.data());
            local.verifying_reader(inflated).take(most).read_to_end(&mut array)?;
        } else {
            local.verifying_reader(local.data()).take(most).read_to_end(&mut array)?;
        }
        arrays.insert(name, array);
    }
    Ok(arrays)
}

/// Brackets within brackets that a header may have: those of records, which are read no further, need three.
const NESTED: usize = 4;

/// An array as a file `.npy` has it.
///
/// # Errors
/// Bytes that are no such array. Its lengths have a product, and brackets in its header are not nested deeply: npyz multiplies the ones
/// before they can be looked at, and takes twice the time for each of the others.
pub fn open_npy(bytes: &[u8]) -> Result<NpyFile<&[u8]>, String> {
    let header = String::from_utf8_lossy(header(bytes)).into_owned();
    if !is_countable(&header) {
        return Err("found an array of more numbers than can be counted".to_owned());
    }
    if nesting(&header) > NESTED {
        return Err("found no array of NumPy's: brackets in its header are nested too deeply".to_owned());
    }
    NpyFile::new(bytes).map_err(|e| format!("found no array of NumPy's: {e}"))
}

/// The text of a header: its length is a number of two bytes in the first version of the format, of four in later ones.
fn header(bytes: &[u8]) -> &[u8] {
    let (length, begin) = match bytes {
        [_, _, _, _, _, _, 1, _, a, b, ..] => (usize::from(u16::from_le_bytes([*a, *b])), 10),
        [_, _, _, _, _, _, _, _, a, b, c, d, ..] => (u32::from_le_bytes([*a, *b, *c, *d]) as usize, 12),
        _ => return &[],
    };
    let rest = &bytes[begin..];
    &rest[..length.min(rest.len())]
}

/// Whether the lengths in a header have a product.
fn is_countable(header: &str) -> bool {
    let shape = header.split_once("shape").and_then(|(_, rest)| rest.split_once('(')).map(|(_, rest)| rest);
    let lengths = shape.unwrap_or_default().split(')').next().unwrap_or_default().split(',');
    let mut lengths = lengths.filter_map(|n| n.trim().parse::<u64>().ok());
    lengths.try_fold(1_u64, u64::checked_mul).is_some()
}

/// How many brackets are open at once.
fn nesting(header: &str) -> usize {
    let (mut open, mut most) = (0_usize, 0);
    for character in header.chars() {
        match character {
            '(' | '[' | '{' => open += 1,
            ')' | ']' | '}' => open = open.saturating_sub(1),
            _ => {}
        }
        most = most.max(open);
    }
    most
}

#[cfg(test)]
mod tests {
    use super::*;

    fn array(version: u8, header: &str) -> Vec<u8> {
        let length = u32::try_from(header.len()).unwrap().to_le_bytes();
        let length = if version == 1 { &length[..2] } else { &length[..] };
        [b"\x93NUMPY", &[version, 0][..], length, header.as_bytes(), &[b'['; 64]].concat()
    }

    #[test]
    fn brackets_in_a_header_take_no_time() {
        // What follows the header may be anything.
        let plain = "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 4), }\n";
        for version in [1, 2, 3] {
            assert_eq!(open_npy(&array(version, plain)).unwrap().shape(), [2, 4]);
            for bracket in ["[", "(", "{", "[(", "{'descr': ["] {
                let nested = format!(
                    "{{'descr': {}'<f8', 'fortran_order': False, 'shape': (2, 4), }}",
                    bracket.repeat(90)
                );
                let error = open_npy(&array(version, &nested)).err().unwrap();
                assert!(error.contains("nested too deeply"), "{error}");
            }
        }
        for cut in [&b""[..], b"\x93NUMPY", b"\x93NUMPY\x01\x00\x10", b"\x93NUMPY\x02\x00\x10\x00\x00"] {
            assert!(open_npy(cut).is_err());
        }
    }

    #[test]
    fn lengths_without_a_product_are_refused() {
        let huge = "{'descr': '<f8', 'fortran_order': False, 'shape': (4294967296, 4294967296), }\n";
        assert!(open_npy(&array(1, huge)).err().unwrap().contains("more numbers than can be counted"));
    }
}
