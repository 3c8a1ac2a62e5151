//! Files that stand where matches belong and hold none, known by their first bytes.

use super::Format;
use crate::error::Fault;

const PICTURE: &str = "estimate reads matches, not images; see the guide Pose from photographs";

const STRANGERS: [(&[u8], &str, &str); 13] = [
    (b"\x89PNG\r\n", "a PNG image", PICTURE),
    (b"\xff\xd8\xff", "a JPEG image", PICTURE),
    (b"GIF8", "a GIF image", PICTURE),
    (b"II*\0", "a TIFF image", PICTURE),
    (b"MM\0*", "a TIFF image", PICTURE),
    (b"RIFF", "a WebP image or another RIFF file", PICTURE),
    (
        b"SQLite format 3\0",
        "an SQLite database",
        "COLMAP's: quest-cli colmap verify or quest-cli colmap export",
    ),
    (b"\x1f\x8b", "a gzip archive", "unpack it first: gunzip -c FILE | quest-cli estimate -"),
    (b"PK\x03\x04", "a zip archive", "unpack it first; an archive of NumPy's has a name that ends with .npz"),
    (b"\x89HDF\r\n", "an HDF5 file", "write its matches as an array of NumPy's first: numpy.save"),
    (b"\x28\xb5\x2f\xfd", "a zstd archive", "unpack it first: zstd -dc FILE | quest-cli estimate -"),
    (b"%PDF-", "a PDF document", "expected JSON, JSON Lines, CSV or an array of NumPy's"),
    (b"\x7fELF", "a program (ELF)", "expected JSON, JSON Lines, CSV or an array of NumPy's"),
];

/// What a file with this beginning is, where it is none of this form.
pub(super) fn refuse(start: &[u8], format: Format) -> Result<(), Fault> {
    match STRANGERS.iter().find(|(first, ..)| start.starts_with(first)) {
        // An archive of NumPy's is a zip archive.
        Some((b"PK\x03\x04", ..)) if format == Format::Npy => Ok(()),
        Some((_, found, instead)) => Err(Fault::NoMatches { found, instead }),
        None => Ok(()),
    }
}
