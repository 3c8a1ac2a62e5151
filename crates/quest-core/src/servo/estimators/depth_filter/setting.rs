//! What every part of the filter is told: the goal, the options, and an image.

use crate::servo::FilterOptions;
use crate::servo::estimators::depth_filter::fit::Problem;
use crate::servo::estimators::depth_filter::reference::DepthReference;

/// What does not change from image to image.
#[derive(Clone, Debug)]
pub(super) struct Setting {
    /// The goal's features on the plane z = 1.
    pub(super) goal: Vec<[f64; 2]>,
    pub(super) options: FilterOptions,
}

/// An image, or the mean of several.
#[derive(Clone, Debug)]
pub(super) struct Image {
    /// The features on the plane z = 1; `None` for those that are not seen.
    pub(super) frame: Vec<Option<[f64; 2]>>,
    /// The noise of a difference from the goal.
    pub(super) sigma: f64,
}

impl Setting {
    /// The image against goal depths that are known so well.
    pub(super) fn problem<'a>(&'a self, image: &'a Image, reference: &'a DepthReference) -> Problem<'a> {
        let plane = self.options.plane;
        Problem { goal: &self.goal, frame: &image.frame, reference, sigma: image.sigma, plane }
    }

    /// Whether noise explains this cost of so many features, whose depths are known or not: χ² of `f` degrees of freedom has the
    /// mean `f` and the deviation `√2f`.
    pub(super) fn passes(&self, cost: f64, features: usize) -> bool {
        let freedom = (2.0 * features as f64 - 6.0).max(1.0);
        cost <= freedom + self.options.gate * (2.0 * freedom).sqrt() + self.options.gate
    }

    /// The noise of a difference between the goal and the mean of this many images.
    pub(super) fn sigma_of_mean(&self, images: usize) -> f64 {
        (self.options.noise / (images.max(1) as f64).sqrt()).hypot(self.options.goal_noise)
    }
}

impl Image {
    pub(super) fn new(features: usize) -> Self {
        Self { frame: vec![None; features], sigma: 0.0 }
    }

    /// Takes over an image, without features at impossible places and without those that have no place in the goal.
    pub(super) fn take(&mut self, features: &[Option<[f64; 2]>], goal: &[[f64; 2]]) {
        self.frame.iter_mut().for_each(|f| *f = None);
        for ((kept, seen), goal) in self.frame.iter_mut().zip(features).zip(goal) {
            let is_placed = goal.iter().all(|c| c.is_finite());
            *kept = seen.filter(|m| is_placed && m.iter().all(|c| c.is_finite() && c.abs() < 1e3));
        }
    }

    /// How many features are seen.
    pub(super) fn seen(&self) -> usize {
        self.frame.iter().flatten().count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_explains_a_cost_up_to_so_many_deviations() {
        let setting =
            Setting { goal: Vec::new(), options: FilterOptions { gate: 4.0, ..FilterOptions::default() } };
        // A hundred degrees of freedom have the deviation √200; one more is for few features.
        let limit = 100.0 + 4.0 * (200_f64.sqrt() + 1.0);
        assert!(setting.passes(limit - 1e-9, 53) && !setting.passes(limit + 1e-9, 53));
    }
}
