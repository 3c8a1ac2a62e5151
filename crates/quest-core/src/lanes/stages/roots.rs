//! The real roots of polynomials of degree ten in their cells, and a second count of them, in lanes.
//!
//! - In each cell of [`isolation`](crate::lanes::stages::isolation) Newton's iteration finds the root, in the coordinate `t = tan θ` or
//!   `tan(θ − π/2)` within `[−1, 1]`, with bisection where it would leave the cell.
//! - Sturm's theorem counts the roots from the leading coefficients of its chain alone: a lane with another count has
//!   roots too close to each other to be told apart here.

use crate::algebra::vectors::lane::{F, Float, Lanes, M, MAX_F64_LANES as MAX_LANES, Mask};
use crate::algebra::vectors::twice::{Twice, TwiceLanes, twice};
use crate::lanes::stages::isolation::{Cells, MAX_ROOTS};
use crate::lanes::stages::resultant::Polynomial;

/// The polynomial in the coordinate `t` of a chart: `z = t, w = 1`, or `z = 1, w = −t` where the mask is set.
#[inline(always)]
fn in_chart<L: Lanes<f64>>(
    p: &Polynomial<L>,
    mirrored: &Polynomial<L>,
    around_infinity: M<L>,
) -> Polynomial<L> {
    let mut out = *p;
    for k in 0..11 {
        out[k] = mirrored[k].select(around_infinity, p[k]);
    }
    out
}

/// The polynomial in the chart around infinity.
#[inline(always)]
pub(crate) fn mirrored<L: Lanes<f64>>(p: &Polynomial<L>) -> Polynomial<L> {
    let mut out = *p;
    for k in 0..11 {
        out[k] = if k % 2 == 0 { p[10 - k] } else { -p[10 - k] };
    }
    out
}

/// The value and the slope.
#[inline(always)]
fn with_slope<L: Lanes<f64>>(p: &Polynomial<L>, t: F<L>) -> (F<L>, F<L>) {
    let mut slope = p[10];
    let mut value = p[10].mul_add(t, p[9]);
    for k in (0..9).rev() {
        slope = slope.mul_add(t, value);
        value = value.mul_add(t, p[k]);
    }
    (value, slope)
}

/// Newton's steps at most, and the last of them: their convergence is quadratic.
const MAX_STEPS: usize = 12;
const SHORT_STEP: f64 = 1e-6;

/// A root for every lane.
#[derive(Clone, Copy)]
pub(crate) struct Root<L: Lanes<f64>> {
    /// `(z, w)`, the larger of which is one.
    pub(crate) z: F<L>,
    pub(crate) w: F<L>,
    /// Whether the last step was short enough: not where it is no number.
    pub(crate) is_certain: M<L>,
}

/// The roots of the cells in a slot of every lane and in the next one.
#[inline(always)]
pub(crate) fn refine<L: Lanes<f64>>(
    lanes: L,
    p: &Polynomial<L>,
    mirrored: &Polynomial<L>,
    cells: &Cells,
    slot: usize,
    is_there: M<TwiceLanes<L>>,
) -> Root<TwiceLanes<L>> {
    let both = |columns: &[[f64; MAX_LANES]; MAX_ROOTS]| {
        Twice(lanes.load(&columns[slot]), lanes.load(&columns[slot + 1]))
    };
    let lanes = TwiceLanes(lanes);
    let (zero, one, half) = (lanes.splat(0.0), lanes.splat(1.0), lanes.splat(0.5));
    let short = lanes.splat(SHORT_STEP);
    let chart = zero.less(both(&cells.chart));
    let p = in_chart::<TwiceLanes<L>>(&twice(p), &twice(mirrored), chart);
    let (mut low, mut high) = (both(&cells.low), both(&cells.high));
    let (at_low, at_high) = (both(&cells.at_low), both(&cells.at_high));
    let mut t = (high - low).mul_add(at_low / (at_low - at_high), low);
    let mut last = one.select(is_there, zero);
    for _ in 0..MAX_STEPS {
        let (value, slope) = with_slope::<TwiceLanes<L>>(&p, t);
        let above = zero.less(value * at_low);
        low = t.select(above, low);
        high = high.select(above, t);
        let newton = t - value / slope;
        let inside = low.less(newton).and(newton.less(high));
        let next = newton.select(inside, half * (low + high));
        // A lane that has arrived stays where it is, whatever its neighbours do.
        let active = short.less(last);
        last = (next - t).abs().select(active, last);
        t = next.select(active, t);
        if !short.less(last).any() {
            break;
        }
    }
    Root { z: one.select(chart, t), w: (-t).select(chart, one), is_certain: last.less(short + short) }
}

/// The number of real roots by Sturm's theorem: the signs of the leading coefficients of the chain tell how often the sign
/// changes at −∞ and at +∞.
#[inline(always)]
pub(crate) fn count<L: Lanes<f64>>(lanes: L, p: &Polynomial<L>) -> F<L> {
    let (mut g, one) = ([lanes.splat(0.0); 11], lanes.splat(1.0));
    for k in 1..11 {
        g[k - 1] = p[k] * lanes.splat(k as f64 / 10.0);
    }
    // Of degree ten and nine with the same leading coefficient: one change at −∞, none at +∞.
    let mut chain = Chain::<L> { lanes, f: *p, g, count: one };
    chain.step::<10>();
    chain.step::<9>();
    chain.step::<8>();
    chain.step::<7>();
    chain.step::<6>();
    chain.step::<5>();
    chain.step::<4>();
    chain.step::<3>();
    chain.step::<2>();
    chain.count
}

/// Two neighbours in the chain, and the changes of sign ahead of the second at −∞ less those at +∞.
struct Chain<L: Lanes<f64>> {
    lanes: L,
    f: Polynomial<L>,
    g: Polynomial<L>,
    count: F<L>,
}

impl<L: Lanes<f64>> Chain<L> {
    /// Moves on by one, to polynomials of degrees `DEGREE − 1` and `DEGREE − 2`.
    #[inline(always)]
    fn step<const DEGREE: usize>(&mut self) {
        let (f, g, one) = (&self.f, &self.g, self.lanes.splat(1.0));
        let inverse = one / g[DEGREE - 1];
        let slope = f[DEGREE] * inverse;
        let offset = slope.neg_mul_add(g[DEGREE - 2], f[DEGREE - 1]) * inverse;
        let mut rest = [self.lanes.splat(0.0); 11];
        rest[0] = offset.mul_add(g[0], -f[0]);
        for k in 1..DEGREE - 1 {
            rest[k] = offset.mul_add(g[k], slope.mul_add(g[k - 1], -f[k]));
        }
        let leading = rest[DEGREE - 2];
        let change = (g[DEGREE - 1] * leading).less(self.lanes.splat(0.0));
        self.count = self.count + (-one).select(change, one);
        let scale = one / leading.abs();
        for x in &mut rest[..DEGREE - 1] {
            *x = *x * scale;
        }
        (self.f, self.g) = (self.g, rest);
    }
}
