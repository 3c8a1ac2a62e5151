//! Matches of what is written onto the images, not of what they show: one shift of the border.
//!
//! As COLMAP's `DetectWatermarkMatches`: enough of the inliers lie near the border of both images and are moved by one shift.

use quest_core::Camera;

/// The part of the image's diagonal that is its border, as in COLMAP.
const BORDER: f64 = 0.1;

/// Matches that are moved by the shift to so many pixels, as in COLMAP.
const TOLERANCE: f32 = 4.0;

/// Whether at least the part `ratio` of the inliers lies at the border of both images and is moved by the same shift.
pub(crate) fn is_watermark(inliers: &[[[f32; 2]; 2]], cameras: [&Camera; 2], ratio: f64) -> bool {
    let (Some(size1), Some(size2)) = (cameras[0].size(), cameras[1].size()) else { return false };
    let at_border = |m: &&[[f32; 2]; 2]| is_at_border(m[0], size1) && is_at_border(m[1], size2);
    let shifts: Vec<[f32; 2]> =
        inliers.iter().filter(at_border).map(|[a, b]| [b[0] - a[0], b[1] - a[1]]).collect();
    let enough = ratio * inliers.len() as f64;
    if shifts.is_empty() || (shifts.len() as f64) < enough {
        return false;
    }
    let shift = [0, 1].map(|k| median(shifts.iter().map(|s| s[k]).collect()));
    let moved = shifts.iter().filter(|s| (s[0] - shift[0]).hypot(s[1] - shift[1]) <= TOLERANCE);
    moved.count() as f64 >= enough
}

fn is_at_border(pixel: [f32; 2], (width, height): (u32, u32)) -> bool {
    let (width, height) = (f64::from(width), f64::from(height));
    let border = BORDER * width.hypot(height);
    let [u, v] = pixel.map(f64::from);
    u < border || v < border || u > width - border || v > height - border
}

fn median(mut values: Vec<f32>) -> f32 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}

#[cfg(test)]
mod tests {
    use quest_core::CameraModel;

    use super::*;

    #[test]
    fn one_shift_of_the_border_is_a_watermark() {
        let camera = Camera::new(CameraModel::SimplePinhole, &[500.0, 320.0, 240.0]).unwrap();
        let camera = camera.with_size(640, 480).unwrap();
        let cameras = [&camera, &camera];
        let mark: Vec<_> = (0..20u8).map(|i| [[10.0 + 30.0 * f32::from(i), 470.0]; 2]).collect();
        assert!(is_watermark(&mark, cameras, 0.7));
        // The same with a third of the matches in the middle, or with shifts of their own.
        let inside: Vec<_> = (0..10).map(|_| [[300.0, 200.0]; 2]).collect();
        assert!(!is_watermark(&[mark.clone(), inside].concat(), cameras, 0.7));
        let moved: Vec<_> = mark.iter().map(|[a, _]| [*a, [a[0] * 0.8, 470.0]]).collect();
        assert!(!is_watermark(&moved, cameras, 0.7));
        assert!(!is_watermark(&[], cameras, 0.7));
    }
}
