//! The goal's depths: what every frame has in common.

/// The inverse depths of the features at the goal, and how well they are known.
///
/// The goal's depths are the same in every frame; normalised by them, `t` has the same unit in every frame. The unit used
/// here is the harmonic mean of the depths, `mean(ρ) = 1`: features far away have `ρ` near zero and do no harm.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct DepthReference {
    /// One for each feature of the goal.
    pub(crate) inverse_depths: Vec<f64>,
    /// The information about them: the inverse of their covariance, n rows of n. Knows nothing of their common scale.
    pub(crate) information: Vec<f64>,
}

impl DepthReference {
    /// All depths equal, known to this relative precision.
    pub(crate) fn flat(features: usize, deviation: f64) -> Self {
        let mut reference =
            Self { inverse_depths: vec![1.0; features], information: vec![0.0; features * features] };
        reference.set_flat(deviation);
        reference
    }

    pub(crate) fn len(&self) -> usize {
        self.inverse_depths.len()
    }

    pub(crate) fn set_flat(&mut self, deviation: f64) {
        self.inverse_depths.fill(1.0);
        self.set_information(1.0 / (deviation * deviation));
    }

    /// The same information about each inverse depth, none about several of them together.
    pub(crate) fn set_information(&mut self, information: f64) {
        let n = self.len();
        self.information.fill(0.0);
        (0..n).for_each(|i| self.information[i * n + i] = information);
    }

    /// `Λ (ρ − ρ̂)` of one feature.
    pub(crate) fn pull(&self, feature: usize, inverse_depths: &[f64]) -> f64 {
        let n = self.len();
        let row = &self.information[feature * n..(feature + 1) * n];
        let off = inverse_depths.iter().zip(&self.inverse_depths).map(|(x, mean)| x - mean);
        row.iter().zip(off).map(|(w, off)| w * off).sum()
    }

    /// How exactly each depth is known, relative to it: one standard deviation.
    pub(crate) fn precisions(&self) -> impl Iterator<Item = f64> {
        let n = self.len();
        self.inverse_depths.iter().enumerate().map(move |(i, rho)| {
            self.information[i * n + i].max(f64::MIN_POSITIVE).sqrt().recip() / rho.abs().max(1e-3)
        })
    }

    /// Scales the inverse depths to a mean of 1.
    pub(crate) fn normalise(&mut self) {
        let mean = self.inverse_depths.iter().sum::<f64>() / self.len() as f64;
        self.inverse_depths.iter_mut().for_each(|rho| *rho /= mean);
        self.information.iter_mut().for_each(|w| *w *= mean * mean);
    }
}
