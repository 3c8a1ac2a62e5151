//! What keeps a robot safe, and how it is built.

use crate::Camera;
use crate::servo::twist::Limits;

/// Where the features are to stay in the image, on the plane z = 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Border {
    /// The left end.
    pub left: f64,
    /// The right end.
    pub right: f64,
}

/// How fast a command may change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Acceleration {
    /// In m/s².
    pub linear: f64,
    /// In rad/s².
    pub angular: f64,
}

/// When the camera counts as arrived.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrival {
    /// Metres from the goal, with the unit of [`Rig`](crate::servo::Rig).
    pub distance: f64,
    /// Radians from the goal's rotation.
    pub angle: f64,
    /// How long it must be there without interruption, in seconds.
    pub seconds: f64,
}

impl Default for Arrival {
    /// A centimetre and half a degree, for half a second.
    fn default() -> Self {
        Self { distance: 0.01, angle: 0.5_f64.to_radians(), seconds: 0.5 }
    }
}

/// What keeps a robot safe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Safety {
    /// Speed and turn rate.
    pub limits: Limits,
    /// How fast the command may change; `None` where it may change at once.
    pub acceleration: Option<Acceleration>,
    /// The turn about the vertical is changed where it would take features out of the image, at its left and right border.
    pub border: Option<Border>,
    /// A pose is not acted on where the standard deviation of its rotation is larger than this, in radians.
    pub rotation_uncertainty: f64,
    /// The same for the translation, in the unit of the goal's depths.
    pub translation_uncertainty: f64,
    /// The number of images without a pose for which the last command goes on.
    pub coasting_images: usize,
    /// An image that is older than this many seconds is stale, as is one that is not later than the last one; infinite for no
    /// limit. Without stamps no image is stale.
    pub largest_gap: f64,
    /// How far the camera may be moved to the side where the images show no parallax, as a share of the features' depth; 0 for
    /// never, 0.04 suits most scenes.
    pub explore: f64,
    /// Whether the loop holds where the distance to the goal does not fall although motion is commanded.
    pub watchdog: bool,
    /// When the camera counts as arrived.
    pub arrival: Arrival,
}

impl Safety {
    /// These limits alone: no limit of the acceleration, no border, no coasting, no watchdog, no motion to explore. The largest
    /// uncertainty is a quarter of a radian, and a quarter of the goal's depths.
    #[must_use]
    pub fn new(limits: Limits) -> Self {
        Self {
            limits,
            acceleration: None,
            border: None,
            rotation_uncertainty: 0.25,
            translation_uncertainty: 0.25,
            coasting_images: 0,
            largest_gap: f64::INFINITY,
            explore: 0.0,
            watchdog: false,
            arrival: Arrival::default(),
        }
    }

    /// What suits a real robot. It comes to full speed in half a second. It coasts for one image without a pose. An image that is
    /// half a second old is stale. The loop holds where it does not come nearer to the goal.
    #[must_use]
    pub fn for_robot(limits: Limits) -> Self {
        let acceleration = Acceleration { linear: 2.0 * limits.speed, angular: 2.0 * limits.turn_rate };
        Self {
            acceleration: Some(acceleration),
            coasting_images: 1,
            largest_gap: 0.5,
            watchdog: true,
            ..Self::new(limits)
        }
    }
}

impl Border {
    /// How fast a feature outside of the border is brought back, in 1/s.
    const RETURN_RATE: f64 = 3.0;
    /// The fewest features that are kept.
    const FEWEST: usize = 8;

    /// The image of a camera without `margin` pixels at the left and the right. `None` for a camera without a size, or one without
    /// viewing rays at these borders.
    #[must_use]
    pub fn of_camera(camera: &Camera, margin: f64) -> Option<Self> {
        let (width, height) = camera.size()?;
        let at = |u| on_plane(camera, [u, 0.5 * f64::from(height)]);
        Some(Self { left: at(margin)?[0], right: at(f64::from(width) - 1.0 - margin)?[0] })
    }

    /// Of the turn rates that keep enough features within the border, the one closest to what is wanted, in rad/s. A feature
    /// outside of the border is brought back at a rate in proportion to its distance. Where a feature is outside at the goal too,
    /// its place there is its border.
    ///
    /// The border keeps only a quarter of the features, and at least eight. That was measured with features over 50, 70 and 95 % of
    /// the width, 300 starts each. A border for all features let 14 to 41 % of the starts arrive, one for 60 % of them 67 to 71 %,
    /// one for a quarter 87 to 96 %. `bounds` is memory for the rates that features ask for, with room for all.
    pub(crate) fn turn(
        &self,
        wanted: f64,
        features: &[Option<[f64; 2]>],
        goal: &[[f64; 2]],
        bounds: &mut Vec<f64>,
    ) -> f64 {
        bounds.clear();
        let mut free = 0;
        for (seen, goal) in features.iter().zip(goal) {
            let Some([u, _]) = *seen else { continue };
            let (left, right) = (self.left.min(goal[0]), self.right.max(goal[0]));
            // Turning right by w moves a feature to the left by w (1 + u²).
            let outside = if u > right { u - right } else { (u - left).min(0.0) };
            let rate = Self::RETURN_RATE * outside / (1.0 + u * u);
            // Outside on the right it asks for at least this rate, on the left for at most.
            if (outside > 0.0 && wanted < rate) || (outside < 0.0 && wanted > rate) {
                bounds.push(rate);
            } else {
                free += 1;
            }
        }
        let all = free + bounds.len();
        let kept = (all / 4).max(Self::FEWEST).min(all);
        if free >= kept {
            return wanted;
        }
        // The features that ask for the smallest change come first.
        let missing = (kept - free).min(bounds.len());
        bounds.sort_unstable_by(|a, b| (a - wanted).abs().total_cmp(&(b - wanted).abs()));
        let asked = &bounds[..missing];
        // Features on both sides: turning helps none of them.
        let sides = asked
            .iter()
            .fold([false; 2], |[below, above], rate| [below || *rate < wanted, above || *rate > wanted]);
        if sides == [true; 2] { 0.0 } else { asked[missing - 1] }
    }
}

/// A pixel on the plane z = 1 of its camera; `None` where it has no viewing ray in front.
#[must_use]
pub fn on_plane(camera: &Camera, pixel: [f64; 2]) -> Option<[f64; 2]> {
    let ray = camera.bearing(pixel).ok()?;
    (ray.z > 0.0).then(|| [ray.x / ray.z, ray.y / ray.z])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CameraModel;
    use nalgebra::Vector3;

    #[test]
    fn a_border_is_that_of_the_middle_row() {
        let params = [500.0, 510.0, 330.0, 200.0, -0.2, 0.0, 0.0, 0.0];
        let camera = Camera::new(CameraModel::OpenCv, &params).unwrap();
        assert!(Border::of_camera(&camera, 10.0).is_none(), "a camera without a size");
        let camera = camera.with_size(640, 480).unwrap();
        let seen = |pixel: [f64; 2]| {
            let [x, y] = on_plane(&camera, pixel).unwrap();
            let back = camera.project(&Vector3::new(x, y, 1.0)).unwrap();
            assert!((back[0] - pixel[0]).hypot(back[1] - pixel[1]) < 1e-6, "{back:?}");
            x
        };
        let border = Border::of_camera(&camera, 10.0).unwrap();
        assert!((border.left - seen([10.0, 240.0])).abs() < 1e-12);
        assert!((border.right - seen([629.0, 240.0])).abs() < 1e-12);
        assert!(seen([10.0, 0.0]) < border.left, "barrel distortion bends the border");
    }
}
