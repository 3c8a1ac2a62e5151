//! Keypoints as viewing rays, computed once an image, and the matches of a pair.

use quest_core::{Camera, Correspondence};

/// The keypoints of an image.
#[derive(Clone, Debug, Default)]
pub struct Rays {
    /// `u, v` in pixels, the centre of the first pixel at (0.5, 0.5).
    pub pixels: Vec<[f32; 2]>,
    /// The viewing rays; NaN for a pixel that has none.
    pub rays: Vec<[f64; 3]>,
}

impl Rays {
    /// The keypoints of the blob `data` of `rows` rows of `cols` numbers, seen by a camera.
    pub(crate) fn new(rows: i64, cols: i64, data: &[u8], camera: &Camera) -> Result<Self, String> {
        let pixels = pixels(rows, cols, data)?;
        let ray = |pixel: &[f32; 2]| camera.bearing(pixel.map(f64::from)).map_or([f64::NAN; 3], Into::into);
        let rays = pixels.iter().map(ray).collect();
        Ok(Self { pixels, rays })
    }
}

/// The pixels of a blob of keypoints.
pub(crate) fn pixels(rows: i64, cols: i64, data: &[u8]) -> Result<Vec<[f32; 2]>, String> {
    let (count, width) = size(rows, cols, data.len(), 4)?;
    if count > 0 && !matches!(width, 2 | 4 | 6) {
        return Err(format!("found {width} numbers a keypoint, expected 2, 4 or 6"));
    }
    if width == 0 {
        return Ok(Vec::new());
    }
    let number = |bytes: &[u8]| <[u8; 4]>::try_from(bytes).map_or(f32::NAN, f32::from_le_bytes);
    let rows = data.chunks_exact(4 * width);
    Ok(rows.map(|row| [number(&row[..4]), number(&row[4..8])]).collect())
}

/// Rows and columns of a blob of numbers of so many bytes, found to fit its length.
fn size(rows: i64, cols: i64, length: usize, bytes: usize) -> Result<(usize, usize), String> {
    let (count, width) = (usize::try_from(rows).ok(), usize::try_from(cols).ok());
    let fits = count
        .zip(width)
        .filter(|(n, w)| n.checked_mul(*w).and_then(|x| x.checked_mul(bytes)) == Some(length));
    fits.ok_or_else(|| format!("found {length} bytes for {rows} rows of {cols} numbers of {bytes} bytes"))
}

/// The matches of a pair: the places of their keypoints in image 1 and in image 2.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Matches(pub Vec<[u32; 2]>);

impl Matches {
    /// From the blob `data` of `rows` rows of `cols` numbers.
    pub(crate) fn new(rows: i64, cols: i64, data: &[u8]) -> Result<Self, String> {
        let (count, width) = size(rows, cols, data.len(), 4)?;
        if count == 0 {
            return Ok(Self::default());
        }
        if width != 2 {
            return Err(format!("found {width} numbers a match, expected 2"));
        }
        let number = |bytes: &[u8]| <[u8; 4]>::try_from(bytes).map_or(0, u32::from_le_bytes);
        Ok(Self(data.chunks_exact(8).map(|row| [number(&row[..4]), number(&row[4..])]).collect()))
    }

    /// The matches whose keypoints both have a viewing ray, with their places among all.
    ///
    /// # Errors
    /// A match that names a keypoint which its image does not have.
    pub(crate) fn usable(
        &self,
        image1: &Rays,
        image2: &Rays,
    ) -> Result<(Vec<Correspondence>, Vec<usize>), String> {
        let mut usable = Vec::with_capacity(self.0.len());
        let mut places = Vec::with_capacity(self.0.len());
        for (place, &[a, b]) in self.0.iter().enumerate() {
            let ray = |image: &Rays, index: u32, which| {
                let found = image.rays.get(index as usize).copied();
                found.ok_or_else(|| {
                    let count = image.rays.len();
                    format!("match {place} names keypoint {index} of image {which}, which has {count}")
                })
            };
            let (ray1, ray2) = (ray(image1, a, 1)?, ray(image2, b, 2)?);
            if let Ok(correspondence) = Correspondence::from_bearings(ray1, ray2) {
                usable.push(correspondence);
                places.push(place);
            }
        }
        Ok((usable, places))
    }

    /// As COLMAP stores them.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        self.0.iter().flatten().flat_map(|index| index.to_le_bytes()).collect()
    }
}

/// The numbers of a blob of `f64`, `None` where its length is no multiple of eight.
pub(crate) fn floats(bytes: &[u8]) -> Option<Vec<f64>> {
    let (numbers, rest) = bytes.as_chunks::<8>();
    rest.is_empty().then(|| numbers.iter().map(|b| f64::from_le_bytes(*b)).collect())
}
