//! Robust losses for the refinement: a squared residual to its cost and to its weight in the normal equations.

/// A loss `ρ(r²)` with the weight `ρ'(r²)`.
pub(super) trait Loss: Copy {
    /// The cost, and its derivative by the squared residual.
    fn cost_and_weight(&self, square: f64) -> (f64, f64);
}

/// Least squares up to a limit, nothing beyond it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Truncated {
    pub(super) square_limit: f64,
}

/// `1 − (1 − r²/c²)³`: Tukey's biweight, smooth up to its limit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Biweight {
    /// `1 / c²`.
    pub(super) inverse_square: f64,
}

/// For sums over matches of `ψ² J Jᵀ` in place of a loss: `ψ = r (1 − r²/c²)²` is the influence of a residual under [`Biweight`].
#[derive(Clone, Copy, Debug)]
pub(super) struct SquaredInfluence(pub(super) Biweight);

/// `r² / (1 + r²/c²)`: the loss of Geman and `McClure`.
#[derive(Clone, Copy, Debug)]
pub(super) struct GemanMcClure {
    /// `1 / c²`.
    pub(super) inverse_square: f64,
}

impl Truncated {
    pub(super) fn new(limit: f64) -> Self {
        Self { square_limit: limit * limit }
    }
}

impl Biweight {
    pub(super) fn new(limit: f64) -> Self {
        Self { inverse_square: 1.0 / (limit * limit) }
    }
}

impl GemanMcClure {
    pub(super) fn new(scale: f64) -> Self {
        Self { inverse_square: 1.0 / (scale * scale) }
    }
}

impl Loss for Truncated {
    #[inline(always)]
    #[expect(clippy::inline_always, reason = "part of a loop that is vectorised as one")]
    fn cost_and_weight(&self, square: f64) -> (f64, f64) {
        if square < self.square_limit { (square, 1.0) } else { (self.square_limit, 0.0) }
    }
}

impl Loss for Biweight {
    #[inline(always)]
    #[expect(clippy::inline_always, reason = "part of a loop that is vectorised as one")]
    fn cost_and_weight(&self, square: f64) -> (f64, f64) {
        let rest = (1.0 - square * self.inverse_square).max(0.0);
        (1.0 - rest * rest * rest, 3.0 * self.inverse_square * rest * rest)
    }
}

impl Loss for SquaredInfluence {
    #[inline(always)]
    #[expect(clippy::inline_always, reason = "part of a loop that is vectorised as one")]
    fn cost_and_weight(&self, square: f64) -> (f64, f64) {
        let rest = (1.0 - square * self.0.inverse_square).max(0.0);
        (0.0, square * (rest * rest) * (rest * rest))
    }
}

impl Loss for GemanMcClure {
    #[inline(always)]
    #[expect(clippy::inline_always, reason = "part of a loop that is vectorised as one")]
    fn cost_and_weight(&self, square: f64) -> (f64, f64) {
        let share = 1.0 / (1.0 + square * self.inverse_square);
        (square * share, share * share)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn weight_is_the_derivative(loss: impl Loss) {
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
    }
}
