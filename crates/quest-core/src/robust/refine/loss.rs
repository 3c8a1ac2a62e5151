//! Robust losses for the refinement: a squared residual to its cost and to its weight in the normal equations.

use crate::algebra::vectors::exponential::exp;

/// The 99 % quantile of χ² with two degrees of freedom: what a match counts at most.
pub(crate) const CAP: f64 = 9.21;

/// The scale of the losses of rotations, planes and alternatives, in standard deviations.
pub(crate) const SCALE: f64 = 3.0;

/// A loss `ρ(r²)` with the weight `ρ'(r²)`.
pub(crate) trait RobustLoss: Copy {
    /// The cost, and its derivative by the squared residual.
    fn cost_and_weight(&self, square: f64) -> (f64, f64);
}

/// Least squares up to a limit, nothing beyond it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Truncated {
    pub(crate) square_limit: f64,
}

/// `1 − (1 − r²/c²)³`: Tukey's biweight, smooth up to its limit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Biweight {
    /// `1 / c²`.
    pub(crate) inverse_square: f64,
}

/// `2c² (1 − 1/√(1 + r²/c²))`: between the losses of Cauchy and of Geman and `McClure` (J. T. Barron, *A general and adaptive
/// robust loss function*, CVPR 2019, with `α = −1`).
///
/// Matched points are not equally sharp, so that residuals have heavier tails than any one normal distribution.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HeavyTailed {
    /// `1 / c²`.
    inverse_square: f64,
}

/// Means over normal noise of the influence `ψ = r ρ'(r²)` of a residual.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NormalMeans {
    /// `E[ψ²]`.
    pub(crate) square: f64,
    /// `E[dψ/dr]`.
    pub(crate) slope: f64,
    /// `E[(dψ/dr)²]`.
    pub(crate) square_slope: f64,
}

/// `r² / (1 + r²/c²)`: the loss of Geman and `McClure`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GemanMcClure {
    /// `1 / c²`.
    pub(crate) inverse_square: f64,
}

/// No loss at all.
pub(crate) const LEAST_SQUARES: Truncated = Truncated { square_limit: f64::INFINITY };

impl Truncated {
    pub(crate) fn new(limit: f64) -> Self {
        Self { square_limit: limit * limit }
    }
}

impl Biweight {
    pub(crate) fn new(limit: f64) -> Self {
        Self { inverse_square: 1.0 / (limit * limit) }
    }
}

impl HeavyTailed {
    pub(crate) fn new(scale: f64) -> Self {
        Self { inverse_square: 1.0 / (scale * scale) }
    }

    /// `c²`.
    pub(crate) fn square_scale(self) -> f64 {
        1.0 / self.inverse_square
    }

    /// By the rule of midpoints, which for functions as smooth as these is exact to four digits.
    pub(crate) fn of_normal(self, sigma: f64) -> NormalMeans {
        const REACH: f64 = 6.0;
        const NODES: u32 = 48;
        let mut means = NormalMeans { square: 0.0, slope: 0.0, square_slope: 0.0 };
        let step = REACH / f64::from(NODES);
        for node in 0..NODES {
            let x = (f64::from(node) + 0.5) * step;
            let density = std::f64::consts::FRAC_2_PI.sqrt() * exp(-0.5 * x * x) * step;
            let square = (sigma * x).powi(2);
            let share = 1.0 / (1.0 + square * self.inverse_square);
            let weight = self.cost_and_weight(square).1;
            means.square += density * square * weight * weight;
            let slope = weight * (3.0 * share - 2.0);
            means.slope += density * slope;
            means.square_slope += density * slope * slope;
        }
        means
    }
}

impl GemanMcClure {
    pub(crate) fn new(scale: f64) -> Self {
        Self { inverse_square: 1.0 / (scale * scale) }
    }
}

impl RobustLoss for Truncated {
    #[inline(always)]
    fn cost_and_weight(&self, square: f64) -> (f64, f64) {
        if square < self.square_limit { (square, 1.0) } else { (self.square_limit, 0.0) }
    }
}

impl RobustLoss for Biweight {
    #[inline(always)]
    fn cost_and_weight(&self, square: f64) -> (f64, f64) {
        let rest = (1.0 - square * self.inverse_square).max(0.0);
        (1.0 - rest * rest * rest, 3.0 * self.inverse_square * rest * rest)
    }
}

impl RobustLoss for HeavyTailed {
    #[inline(always)]
    fn cost_and_weight(&self, square: f64) -> (f64, f64) {
        let share = 1.0 / (1.0 + square * self.inverse_square);
        let root = share.sqrt();
        (2.0 * (1.0 - root) / self.inverse_square, share * root)
    }
}

impl RobustLoss for GemanMcClure {
    #[inline(always)]
    fn cost_and_weight(&self, square: f64) -> (f64, f64) {
        let share = 1.0 / (1.0 + square * self.inverse_square);
        (square * share, share * share)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn weight_is_the_derivative(loss: impl RobustLoss) {
        let h = 1e-6;
        for square in [0.0_f64, 0.3, 1.0, 2.5, 3.9, 4.1, 30.0] {
            let square = square + 2.0 * h;
            let difference =
                (loss.cost_and_weight(square + h).0 - loss.cost_and_weight(square - h).0) / (2.0 * h);
            assert!((loss.cost_and_weight(square).1 - difference).abs() < 1e-9, "{square}");
        }
    }

    #[test]
    fn weights_are_derivatives() {
        weight_is_the_derivative(Truncated::new(2.0));
        weight_is_the_derivative(Biweight::new(2.0));
        weight_is_the_derivative(GemanMcClure::new(2.0));
        weight_is_the_derivative(HeavyTailed::new(2.0));
    }

    #[test]
    fn wide_losses_are_least_squares_and_narrow_ones_lose_little() {
        let means = HeavyTailed::new(1e4).of_normal(0.5);
        assert!((means.square / 0.25 - 1.0).abs() < 1e-4 && (means.slope - 1.0).abs() < 1e-4);
        assert!((means.square_slope - 1.0).abs() < 1e-4);
        // Of a normal variable: 1/E[ψ']² and the efficiency by quadrature with 20,000 nodes.
        let means = HeavyTailed::new(2.8).of_normal(1.0);
        let square_slope = means.slope * means.slope;
        assert!((square_slope * 2.273_39 - 1.0).abs() < 1e-4);
        assert!((square_slope / means.square - 0.932_09).abs() < 1e-4);
    }
}
