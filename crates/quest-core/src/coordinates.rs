//! What coordinates probably are where they cannot be what they are said to be: pixels given without a camera, and points of the
//! plane `z = 1` given with one. Both have a pose that looks like any other and is wrong.

use crate::Camera;
use crate::robust::MIN_MATCHES;

/// A point there is 84 degrees off the axis.
const FAR: f64 = 10.0;

/// No image's features all lie within so many pixels of its corner, and no lens has a focal length of so few.
const CORNER: f64 = 2.0;
const SHORT: f64 = 20.0;

/// Whether coordinates that are said to be of the plane `z = 1` are probably pixels: most rows have one that is farther from the axis
/// than a camera sees. A row has the coordinates of a point, or of a match.
#[must_use]
pub fn look_like_pixels<const N: usize>(rows: &[[f64; N]]) -> bool {
    let far = rows.iter().filter(|row| row.iter().any(|x| x.abs() > FAR)).count();
    2 * far > rows.len()
}

/// Whether coordinates that are said to be pixels of a camera are probably of the plane `z = 1`: all finite rows, of which there are
/// enough for a pose, are within two pixels of the corner of the image.
#[must_use]
pub fn look_like_image_points<const N: usize>(rows: &[[f64; N]], camera: &Camera) -> bool {
    let (fx, fy) = camera.focal_lengths();
    let mut finite = rows.iter().filter(|row| row.iter().all(|x| x.is_finite()));
    let are_near = finite.clone().all(|row| row.iter().all(|x| x.abs() < CORNER));
    are_near && fx.min(fy) > SHORT && finite.nth(MIN_MATCHES - 1).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CameraModel;

    #[test]
    fn pixels_and_points_of_the_plane_are_told_apart() {
        let camera = |f, c| Camera::new(CameraModel::SimplePinhole, &[f, c, c]).unwrap();
        let pixels = [[640.0, 12.0], [3.0, 300.0], [0.5, 0.5], [0.1, 0.2], [90.0, 80.0], [700.0, 11.0]];
        let points = [[0.3, -0.2], [1.5, 0.1], [0.0, 0.0], [0.4, 0.4], [-0.9, 0.3]];
        assert!(look_like_pixels(&pixels) && !look_like_pixels(&points));
        // Half of the rows is not most of them.
        assert!(!look_like_pixels(&[[1.0, 2.0, 3.0, 11.0], [1.0, 2.0, 3.0, 4.0]]));
        assert!(look_like_image_points(&points, &camera(900.0, 640.0)));
        let with_nan = [&[[f64::NAN, 0.1]], &points[..]].concat();
        assert!(look_like_image_points(&with_nan, &camera(900.0, 640.0)));
        assert!(!look_like_image_points(&points[..4], &camera(900.0, 640.0)));
        assert!(!look_like_image_points(&pixels, &camera(900.0, 640.0)));
        assert!(!look_like_image_points(&points, &camera(1.0, 0.0)));
    }
}
