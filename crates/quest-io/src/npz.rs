//! Archives of NumPy's: `numpy.savez` and `savez_compressed`.

use std::collections::BTreeMap;
use std::io::Read;

use flate2::bufread::DeflateDecoder;
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
