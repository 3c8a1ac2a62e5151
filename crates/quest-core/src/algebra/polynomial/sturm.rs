//! Sturm's theorem: along the chain of a polynomial the sign changes at one point, less those at another, are the number of real
//! roots between the two.

use crate::algebra::vectors::two::Two;

/// A square of a gap, relative to the roots, at which rounding in the coefficients begins to decide what is real; one noisy
/// five-point problem in a hundred has it.
const NEARLY_DOUBLE: f64 = 4e-6;

/// How much a chain may magnify an error of its first members, by a bound that is far too wide: for half of the noisy five-point
/// problems it says 1e9, for one in two hundred more than this. The only one of 40,000 whose roots were miscounted had 6e20.
const MAGNIFIED: f64 = 1e19;

/// An end of an interval with the sign changes of the chain there.
#[derive(Clone, Copy)]
pub(super) struct End {
    pub(super) x: f64,
    /// A whole number.
    pub(super) changes: f64,
}

/// A Sturm chain `f_0 = p, f_1 ∝ p', f_{k+2} ∝ −(f_k mod f_{k+1})`, kept as the recurrence
/// `f_k = (slope x + offset) f_{k+1} − weight f_{k+2}` so that an evaluation costs two products a member.
pub(super) struct Chain<const N: usize> {
    /// Scaled to a leading coefficient of one.
    pub(super) p: [f64; N],
    /// `(offset, slope, weight)`; the last two entries are not used.
    links: [[f64; 3]; N],
    /// `f_{D−1}` and the sign of the constant `f_D`.
    last_linear: [f64; 2],
    last: f64,
    /// How often the sign changes along the chain at +∞; along the others of the `D` steps it changes at −∞.
    changes_at_infinity: f64,
    /// By how much an error of the first members may have grown.
    magnified: f64,
}

impl<const N: usize> Chain<N> {
    /// `None` where the chain breaks off: a leading coefficient that vanishes, a root that is exactly double.
    pub(super) fn new(p: &[f64; N]) -> Option<Self> {
        let degree = N - 1;
        let scale = 1.0 / p[degree];
        if !scale.is_finite() {
            return None;
        }
        let p = p.map(|c| c * scale);
        // Two coefficients a block, from the leading one down: where they stand does not depend on the degree.
        let coefficient = |k: usize| if k <= degree { p[degree - k] } else { 0.0 };
        let slope = |k: usize| coefficient(k) * (degree.saturating_sub(k) as f64 / degree as f64);
        let mut f: [Two; N] = std::array::from_fn(|b| Two::new([coefficient(2 * b), coefficient(2 * b + 1)]));
        let mut g: [Two; N] = std::array::from_fn(|b| Two::new([slope(2 * b), slope(2 * b + 1)]));
        let blocks = N.div_ceil(2);
        let mut links = [[0.0; 3]; N];
        // The leading coefficients of all members are ±1, so that divisions are products.
        let mut sign = 1.0;
        let largest = |p: &[Two; N]| p.iter().fold(Two::ZERO, |largest, c| largest.max(c.abs())).to_array();
        let [mut error, mut error_below] = [&f, &g].map(|p| largest(p)[0].max(largest(p)[1]));
        let (mut magnified, mut changes_at_infinity) = (0.0_f64, 0.0);
        for link in &mut links[..degree - 1] {
            let ([f0, f1], [_, g1]) = (f[0].to_array(), g[0].to_array());
            let slope = f0 * sign;
            let offset = (f1 - slope * g1) * sign;
            let mut rest = [Two::ZERO; N];
            for b in 0..blocks {
                let between = Two::new([g[b].to_array()[1], g[b + 1].to_array()[0]]);
                rest[b] = g[b + 1] * slope + between * offset - f[b + 1];
            }
            let leading = rest[0].to_array()[0];
            let weight = leading.abs();
            let inverse = 1.0 / weight;
            if !inverse.is_finite() {
                return None;
            }
            for c in &mut rest[..blocks] {
                *c *= inverse;
            }
            (error, error_below) = (error_below, ((1.0 + offset.abs()) * error_below + error) * inverse);
            magnified = magnified.max(error_below);
            *link = [offset, slope, weight];
            changes_at_infinity += f64::from(u8::from(slope < 0.0));
            sign = 1.0_f64.copysign(leading);
            (f, g) = (g, rest);
        }
        let ([slope, offset], [last, _]) = (f[0].to_array(), g[0].to_array());
        let finite = p.iter().chain([&slope, &offset, &last]).all(|c| c.is_finite());
        changes_at_infinity += f64::from(u8::from((slope < 0.0) != (last < 0.0)));
        finite.then_some(Self {
            p,
            links,
            last_linear: [offset, slope],
            last,
            changes_at_infinity,
            magnified,
        })
    }

    /// Whether the number of real roots may be rounding's: the chain has lost its digits, or nearly breaks off at its end, where
    /// the square of the gap between two close roots stands.
    pub(super) fn is_doubtful(&self) -> bool {
        let root = self.last_linear[0];
        self.magnified > MAGNIFIED || self.links[N - 3][2] < NEARLY_DOUBLE * (1.0 + root * root)
    }

    /// How often the sign changes along the chain at two points, side by side: each member waits for those before.
    #[inline]
    pub(super) fn ends(&self, points: [f64; 2]) -> [End; 2] {
        let x = Two::new(points);
        let (mut upper, mut lower) = (x * self.last_linear[1] + self.last_linear[0], Two::splat(self.last));
        let mut is_negative = upper.simd_lt(Two::ZERO);
        let mut changes = (is_negative ^ lower.simd_lt(Two::ZERO)) & Two::splat(1.0);
        for [offset, slope, weight] in self.links[..N - 2].iter().rev() {
            (upper, lower) = ((x * *slope + *offset) * upper - lower * *weight, upper);
            let was_negative = is_negative;
            is_negative = upper.simd_lt(Two::ZERO);
            changes += (is_negative ^ was_negative) & Two::splat(1.0);
        }
        let [first, second] = changes.to_array();
        [End { x: points[0], changes: first }, End { x: points[1], changes: second }]
    }

    /// A point beyond all roots on the side of `direction` (±1) from `end`; `None` where there are none.
    pub(super) fn bound(&self, direction: f64, end: End) -> Option<End> {
        let (mut bound, rising) = (end, self.changes_at_infinity);
        let at_infinity = if direction < 0.0 { (N - 1) as f64 - rising } else { rising };
        while (bound.changes - at_infinity).abs() > 0.5 {
            [bound, _] = self.ends([4.0 * bound.x.abs().max(1.0) * direction; 2]);
            // A root this far out is one at infinity, of a polynomial of lower degree.
            if bound.x.abs() > 1e12 {
                break;
            }
        }
        ((bound.changes - end.changes).abs() > 0.5).then_some(bound)
    }
}
