//! Rows of poses that were estimated elsewhere.

use quest_core::RelativePose;
use quest_core::robust::Model;

use crate::{ColmapError, Database, Matches, PairId, TwoViewGeometry};

/// A pose that was estimated from the matches of a pair as the database has them.
#[derive(Clone, Debug, PartialEq)]
pub struct Given {
    /// The names of image 1 and image 2, in the order of the pose.
    pub images: (String, String),
    /// The model, and the pose of image 2 relative to image 1; `None` where there is no pose.
    pub pose: Option<(Model, RelativePose)>,
    /// Which of the matches are inliers, in the order of the row in `matches`.
    pub inliers: Vec<bool>,
}

impl Database {
    /// The row of a pose that was estimated elsewhere, from the image with the smaller number to the other.
    ///
    /// # Errors
    /// [`ColmapError::Given`] where the images, their cameras or the number of matches do not fit; [`ColmapError::Sqlite`].
    pub fn geometry(&self, given: &Given) -> Result<(PairId, TwoViewGeometry), ColmapError> {
        let (first, second) = &given.images;
        let refuse = |found: String, expected| {
            Err(ColmapError::Given { pair: format!("{first} {second}"), found, expected })
        };
        let numbers = self.numbers();
        let key = numbers.get(first).zip(numbers.get(second));
        let Some(key) = key.and_then(|(a, b)| PairId::new(*a, *b)) else {
            return refuse("not two images of the database".to_owned(), "the names of two images");
        };
        let (a, b) = key.images();
        let needed = (self.matches(key)?, self.keypoints(a)?, self.keypoints(b)?);
        let (matches, image1, image2) = match needed {
            (Ok(matches), Ok(image1), Ok(image2)) => (matches, image1, image2),
            (Err(reason), ..) | (_, Err(reason), _) | (.., Err(reason)) => {
                return refuse(reason, "matches and keypoints that can be read");
            }
        };
        if given.inliers.len() != matches.0.len() {
            let found = format!("{} flags for {} matches", given.inliers.len(), matches.0.len());
            return refuse(found, "one a match");
        }
        let Some((model, pose)) = given.pose else { return Ok((key, TwoViewGeometry::undefined())) };
        // The row goes from the smaller number to the larger.
        let pose = if numbers.get(first) == Some(&a) { pose } else { pose.inverse() };
        let chosen = matches.0.iter().zip(&given.inliers).filter(|(_, is_inlier)| **is_inlier);
        let inliers = Matches(chosen.map(|(m, _)| *m).collect());
        let rays = image1.rays().and_then(|rays1| inliers.usable(&rays1, &image2.rays()?));
        match rays {
            Ok((rays, _)) => {
                let cameras = [&image1.camera, &image2.camera];
                Ok((key, TwoViewGeometry::calibrated(model, &pose, &rays, inliers, cameras)))
            }
            Err(reason) => refuse(reason, "keypoints that its matches name"),
        }
    }
}
