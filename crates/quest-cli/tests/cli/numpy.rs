//! Arrays and archives as NumPy writes them.

use std::io::Write;

use flate2::{Compression, write::DeflateEncoder};
use npyz::{AutoSerialize, WriteOptions, WriterBuilder};
use rawzip::{CompressionMethod, ZipArchiveWriter};

/// The arrays of an archive, by name.
pub(crate) type Arrays = Vec<(&'static str, Vec<u8>)>;

pub(crate) fn array<T: AutoSerialize + Copy>(shape: &[usize], values: &[T]) -> Vec<u8> {
    let shape: Vec<u64> = shape.iter().map(|&n| n as u64).collect();
    let mut bytes = Vec::new();
    let mut writer = WriteOptions::new().default_dtype().shape(&shape).writer(&mut bytes).begin_nd().unwrap();
    writer.extend(values.iter().copied()).unwrap();
    writer.finish().unwrap();
    bytes
}

/// Deflated as NumPy does it, the first array stored as it is.
pub(crate) fn archive(arrays: &Arrays) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut zip = ZipArchiveWriter::new(&mut bytes);
    for (index, (name, array)) in arrays.iter().enumerate() {
        let method = if index == 0 { CompressionMethod::STORE } else { CompressionMethod::DEFLATE };
        let file = format!("{name}.npy");
        let (mut entry, config) = zip.new_file(&file).compression_method(method).start().unwrap();
        let descriptor = if index == 0 {
            let mut writer = config.wrap(&mut entry);
            writer.write_all(array).unwrap();
            writer.finish().unwrap().1
        } else {
            let mut writer = config.wrap(DeflateEncoder::new(&mut entry, Compression::default()));
            writer.write_all(array).unwrap();
            let (encoder, descriptor) = writer.finish().unwrap();
            encoder.finish().unwrap();
            descriptor
        };
        entry.finish(descriptor).unwrap();
    }
    zip.finish().unwrap();
    bytes
}
