//! The camera of section 9: 1024 × 768 pixels, K of (60).

/// The focal length in pixels, in u and v: `K11 = K22` of (60).
pub const FOCAL_LENGTH: f64 = 1060.0;
/// The principal point in pixels: `(K13, K23)` of (60).
pub const PRINCIPAL_POINT: [f64; 2] = [514.0, 384.0];
/// Width and height of the image in pixels.
pub const IMAGE_SIZE: [f64; 2] = [1024.0, 768.0];

/// The pixel of a point on the plane `z = 1`: `K m` with K of (60).
#[must_use]
pub fn plane_to_pixel(m: [f64; 2]) -> [f64; 2] {
    [0, 1].map(|k| FOCAL_LENGTH * m[k] + PRINCIPAL_POINT[k])
}

/// The point on the plane `z = 1` that a pixel shows: `K⁻¹ (u, v, 1)` with K of (60).
#[must_use]
pub fn pixel_to_plane(pixel: [f64; 2]) -> [f64; 2] {
    [0, 1].map(|k| (pixel[k] - PRINCIPAL_POINT[k]) / FOCAL_LENGTH)
}

/// Whether a pixel lies in the image; the centre of the first pixel is (0, 0).
#[must_use]
pub fn is_inside_image(pixel: [f64; 2]) -> bool {
    (0..2).all(|k| (0.0..=IMAGE_SIZE[k] - 1.0).contains(&pixel[k]))
}
