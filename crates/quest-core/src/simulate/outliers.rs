//! False matches among true ones.

use rand::RngExt;
use rand::seq::SliceRandom;

use super::sampling;
use super::{IMAGE_SIZE, Scene, pixel_to_plane};
use crate::{Correspondence, MatchError};

/// Keeps the random numbers of outliers apart from those of the scene of the same seed and index.
const OUTLIERS: u64 = 0x6f75_746c_6965_7273;

impl Scene {
    /// Replaces a share of the matches, chosen at random, by false ones: their points in view 2 are uniform in the image.
    /// Returns which matches are true. The points of the scene stay as they are.
    ///
    /// # Errors
    /// [`MatchError`] where a point of view 1 has no image in front of the camera.
    pub fn add_outliers(&mut self, share: f64, seed: u64, index: u64) -> Result<Vec<bool>, MatchError> {
        let mut rng = sampling::generator(seed ^ OUTLIERS, index);
        let count = self.matches.len();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a share of the matches, not negative"
        )]
        let outliers = ((share.clamp(0.0, 1.0) * count as f64).round() as usize).min(count);
        let mut is_true: Vec<bool> = (0..count).map(|i| i >= outliers).collect();
        is_true.shuffle(&mut rng);
        for (m, _) in self.matches.iter_mut().zip(&is_true).filter(|(_, is_true)| !**is_true) {
            let pixel = IMAGE_SIZE.map(|size| rng.random_range(0.0..=size - 1.0));
            let x1 = [m.bearing1().x / m.bearing1().z, m.bearing1().y / m.bearing1().z];
            *m = Correspondence::from_image_points(x1, pixel_to_plane(pixel))?;
        }
        Ok(is_true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::SceneOptions;

    #[test]
    fn the_share_asked_for_is_false() {
        let options = SceneOptions { points: 100, ..SceneOptions::realistic() };
        let clean = Scene::generate(&options, 7, 0).unwrap();
        let mut scene = clean.clone();
        let is_true = scene.add_outliers(0.3, 7, 0).unwrap();
        assert_eq!(is_true.iter().filter(|t| !**t).count(), 30);
        for ((a, b), is_true) in clean.matches.iter().zip(&scene.matches).zip(&is_true) {
            assert_eq!(a == b, *is_true);
        }
        let mut again = clean.clone();
        assert_eq!(again.add_outliers(0.3, 7, 0).unwrap(), is_true);
        assert_eq!(again, scene);
        assert_eq!(again.add_outliers(0.0, 7, 1).unwrap(), [true; 100]);
    }
}
