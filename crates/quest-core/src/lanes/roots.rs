//! All real roots of polynomials of degree ten, in lanes.
//!
//! A root `z/w` is an angle, `(z, w) = (sin θ, cos θ)`, so that infinity is a place like any other. On it the polynomial is a
//! trigonometric sum of `φ = 2θ` with five harmonics:
//!
//! 1. Its signs at [`ANGLES`] equal steps of `φ` are collected as the bits of a word in every lane; so is whether it falls
//!    between them. The four angles `±φ, π ± φ` share their products.
//! 2. A change of sign is a cell with one root. Where the sum comes near zero and turns around, a parabola says whether a
//!    pair of roots may lie there; Newton's iteration on the derivative finds a point between them.
//! 3. In each cell Newton's iteration finds the root, in the coordinate `t = tan θ` or `tan(θ − π/2)` within `[−1, 1]`,
//!    with bisection where it would leave the cell.
//! 4. Sturm's theorem counts the roots from the leading coefficients of its chain alone: a lane with another count has
//!    roots too close to each other to be told apart here.

use std::sync::LazyLock;

use super::lane::{F, Float, Lanes, M, Mask, WordLanes};
use super::resultant::Polynomial;

/// How many angles are looked at.
const ANGLES: usize = 64;
/// Cells of one of the two charts.
const CHART: usize = ANGLES / 2;
/// Of `f64`.
const MAX_LANES: usize = 8;
/// The most roots of a polynomial.
pub(super) const MAX_ROOTS: usize = 10;
/// The most extrema that come near zero.
const MAX_DIPS: usize = 5;

/// Numbers that do not depend on the polynomial.
pub(super) struct Tables {
    /// `cos kφ` for k = 1 to 5, then `sin kφ`, at the angles of the first quadrant with both ends.
    harmonics: [[f64; 10]; ANGLES / 4 + 1],
    /// `t` at the edges of the cells of a chart, with one cell more on either side.
    edges: [f64; CHART + 3],
    /// Coefficient of `cos kφ` in `sin^2i cos^(10−2i)`.
    even: [[f64; 6]; 6],
    /// Coefficient of `sin (k+1)φ` in `sin^(2i+1) cos^(9−2i)`.
    odd: [[f64; 5]; 5],
}

impl Tables {
    /// The tables, computed once.
    pub(super) fn get() -> &'static Self {
        static TABLES: LazyLock<Tables> = LazyLock::new(Tables::new);
        &TABLES
    }

    fn new() -> Self {
        let angle = |k: f64| std::f64::consts::PI * k / CHART as f64;
        let harmonics = std::array::from_fn(|i| {
            std::array::from_fn(|k| {
                let phi = angle((i * (k % 5 + 1)) as f64);
                if k < 5 { phi.cos() } else { phi.sin() }
            })
        });
        let edges = std::array::from_fn(|i| (0.5 * angle(i as f64 - 1.0 - CHART as f64 / 2.0)).tan());
        // The Fourier coefficients of a sum of five harmonics from any eleven or more samples; they are multiples of 2⁻⁹.
        let coefficient = |power: i32, function: fn(f64) -> f64, k: usize| {
            let sample = |n: usize| {
                let phi = angle(n as f64);
                let monomial = (0.5 * phi).sin().powi(power) * (0.5 * phi).cos().powi(10 - power);
                monomial * function(k as f64 * phi)
            };
            let sum: f64 = (0..ANGLES).map(sample).sum();
            let mean = sum / if k == 0 { ANGLES as f64 } else { CHART as f64 };
            (512.0 * mean).round() / 512.0
        };
        let even = [0, 2, 4, 6, 8, 10].map(|i| std::array::from_fn(|k| coefficient(i, f64::cos, k)));
        let odd = [1, 3, 5, 7, 9].map(|i| std::array::from_fn(|k| coefficient(i, f64::sin, k + 1)));
        Self { harmonics, edges, even, odd }
    }
}

/// For every lane a list of cells with one root in each.
pub(super) struct Cells {
    /// How many there are.
    pub(super) count: [usize; MAX_LANES],
    low: [[f64; MAX_LANES]; MAX_ROOTS],
    high: [[f64; MAX_LANES]; MAX_ROOTS],
    /// The values of the polynomial there, up to a common positive factor: of different signs.
    at_low: [[f64; MAX_LANES]; MAX_ROOTS],
    at_high: [[f64; MAX_LANES]; MAX_ROOTS],
    /// 1 in the chart around infinity, 0 in that around zero.
    chart: [[f64; MAX_LANES]; MAX_ROOTS],
}

/// A cell and a chart.
#[derive(Clone, Copy, Default)]
struct Cell {
    low: f64,
    high: f64,
    at_low: f64,
    at_high: f64,
    chart: f64,
}

impl Cells {
    fn new() -> Self {
        // What is in the slots without a cell must be harmless.
        Self {
            count: [0; MAX_LANES],
            low: [[-0.1; MAX_LANES]; MAX_ROOTS],
            high: [[0.1; MAX_LANES]; MAX_ROOTS],
            at_low: [[-1.0; MAX_LANES]; MAX_ROOTS],
            at_high: [[1.0; MAX_LANES]; MAX_ROOTS],
            chart: [[0.0; MAX_LANES]; MAX_ROOTS],
        }
    }

    #[inline(always)]
    fn push(&mut self, lane: usize, cell: Cell) {
        let slot = self.count[lane];
        if slot < MAX_ROOTS {
            self.low[slot][lane] = cell.low;
            self.high[slot][lane] = cell.high;
            self.at_low[slot][lane] = cell.at_low;
            self.at_high[slot][lane] = cell.at_high;
            self.chart[slot][lane] = cell.chart;
            self.count[lane] += 1;
        }
    }
}

/// The values of the polynomial at the angles, and their signs.
struct Grid {
    values: [[f64; MAX_LANES]; ANGLES],
    negative: [u64; MAX_LANES],
    /// Whether it falls towards the next angle.
    falling: [u64; MAX_LANES],
}

#[inline(always)]
fn grid<L: WordLanes>(lanes: L, tables: &Tables, p: &Polynomial<L>) -> Grid {
    let zero = lanes.splat(0.0);
    let (mut c, mut s) = ([zero; 6], [zero; 5]);
    for i in 0..6 {
        for k in 0..6 {
            c[k] = p[2 * i].mul_add(lanes.splat(tables.even[i][k]), c[k]);
        }
    }
    for i in 0..5 {
        for k in 0..5 {
            s[k] = p[2 * i + 1].mul_add(lanes.splat(tables.odd[i][k]), s[k]);
        }
    }
    let mut out = Grid { values: [[0.0; MAX_LANES]; ANGLES], negative: [0; MAX_LANES], falling: [0; MAX_LANES] };
    let (mut negative, mut falling) = (lanes.no_bits(), lanes.no_bits());
    let mut before = [zero; 4];
    const HALF: usize = ANGLES / 2;
    for (i, h) in tables.harmonics.iter().enumerate() {
        let h = h.map(|x| lanes.splat(x));
        let cosine_even = c[4].mul_add(h[3], c[2].mul_add(h[1], c[0]));
        let cosine_odd = c[5].mul_add(h[4], c[3].mul_add(h[2], c[1] * h[0]));
        let sine_odd = s[4].mul_add(h[9], s[2].mul_add(h[7], s[0] * h[5]));
        let sine_even = s[3].mul_add(h[8], s[1] * h[6]);
        let (a, b) = (cosine_even + cosine_odd, cosine_even - cosine_odd);
        let (f, g) = (sine_odd + sine_even, sine_odd - sine_even);
        // At φ, π − φ, π + φ, −φ.
        let now = [a + f, b + g, b - g, a - f];
        // The first two of the four quadrants share their ends, and so do the last two.
        let at = [i, HALF - i, HALF + i, (ANGLES - i) % ANGLES];
        for (quadrant, &j) in at.iter().enumerate() {
            now[quadrant].store(&mut out.values[j]);
            negative = lanes.with_bit(negative, now[quadrant].less(zero), 1 << j);
        }
        if i > 0 {
            falling = lanes.with_bit(falling, now[0].less(before[0]), 1 << (i - 1));
            falling = lanes.with_bit(falling, before[1].less(now[1]), 1 << (HALF - i));
            falling = lanes.with_bit(falling, now[2].less(before[2]), 1 << (HALF + i - 1));
            falling = lanes.with_bit(falling, before[3].less(now[3]), 1 << (ANGLES - i));
        }
        before = now;
    }
    lanes.store_words(negative, &mut out.negative);
    lanes.store_words(falling, &mut out.falling);
    out
}

/// The chart of a cell and its place in it.
#[inline(always)]
fn place(cell: usize) -> (usize, usize) {
    let shifted = (cell + ANGLES / 4) % ANGLES;
    (shifted / CHART, shifted % CHART)
}

/// How near to zero a parabola has to come, against its own curvature, for the extremum to be looked at.
const NEAR: f64 = 0.5;

/// For every lane the extrema that come near zero, with the cells on both sides of an angle as their bracket.
struct Dips {
    count: [usize; MAX_LANES],
    low: [[f64; MAX_LANES]; MAX_DIPS],
    high: [[f64; MAX_LANES]; MAX_DIPS],
    at_low: [[f64; MAX_LANES]; MAX_DIPS],
    at_high: [[f64; MAX_LANES]; MAX_DIPS],
    chart: [[f64; MAX_LANES]; MAX_DIPS],
    /// Where the parabola through three values has its vertex.
    vertex: [[f64; MAX_LANES]; MAX_DIPS],
}

impl Dips {
    fn new() -> Self {
        let zero = [[0.0; MAX_LANES]; MAX_DIPS];
        let (low, high, at_low, at_high, chart, vertex) = (zero, zero, zero, zero, zero, zero);
        Self { count: [0; MAX_LANES], low, high, at_low, at_high, chart, vertex }
    }

    /// Adds the extremum near the end of cell `j − 1` unless a parabola says that it stays clear of zero.
    #[inline(always)]
    fn push(&mut self, lane: usize, j: usize, grid: &Grid, tables: &Tables) {
        let at = |k: usize| grid.values[k % ANGLES][lane];
        let (before, here, behind) = (at(j + ANGLES - 1), at(j), at(j + 1));
        let (slope, bend) = (behind - before, behind + before - 2.0 * here);
        let lowest = here - slope * slope / (8.0 * bend);
        let slot = self.count[lane];
        if slot == MAX_DIPS || lowest * here.signum() > NEAR * bend.abs() {
            return;
        }
        let (chart, k) = place(j);
        let (low, high) = (tables.edges[k], tables.edges[k + 2]);
        self.low[slot][lane] = low;
        self.high[slot][lane] = high;
        self.at_low[slot][lane] = before;
        self.at_high[slot][lane] = behind;
        self.chart[slot][lane] = chart as f64;
        self.vertex[slot][lane] = tables.edges[k + 1] - 0.25 * (high - low) * slope / bend;
        self.count[lane] += 1;
    }
}

/// The cells with a root.
#[inline(always)]
pub(super) fn isolate<L: WordLanes>(
    lanes: L,
    tables: &Tables,
    p: &Polynomial<L>,
    mirrored: &Polynomial<L>,
) -> Cells {
    let grid = grid(lanes, tables, p);
    let mut cells = Cells::new();
    let mut dips = Dips::new();
    for lane in 0..L::COUNT {
        let (negative, falling) = (grid.negative[lane], grid.falling[lane]);
        let changes = negative ^ negative.rotate_right(1);
        let mut left = changes;
        while left != 0 {
            let j = left.trailing_zeros() as usize;
            left &= left - 1;
            let (chart, k) = place(j);
            cells.push(
                lane,
                Cell {
                    low: tables.edges[k + 1],
                    high: tables.edges[k + 2],
                    at_low: grid.values[j][lane],
                    at_high: grid.values[(j + 1) % ANGLES][lane],
                    chart: chart as f64,
                },
            );
        }
        // Towards zero before the angle, away from it behind, without a change of sign.
        let towards = falling.rotate_left(1) ^ negative;
        let away = !(falling ^ negative);
        let mut left = towards & away & !changes & !changes.rotate_left(1);
        while left != 0 {
            dips.push(lane, left.trailing_zeros() as usize, &grid, tables);
            left &= left - 1;
        }
    }
    let most = dips.count.iter().copied().max().unwrap_or(0);
    for k in 0..most {
        split(lanes, p, mirrored, &dips, k, &mut cells);
    }
    cells
}

/// Divides the brackets of extrema that lie beyond zero into two cells.
#[inline(always)]
fn split<L: Lanes<f64>>(
    lanes: L,
    p: &Polynomial<L>,
    mirrored: &Polynomial<L>,
    dips: &Dips,
    k: usize,
    cells: &mut Cells,
) {
    let (zero, one) = (lanes.splat(0.0), lanes.splat(1.0));
    let p = in_chart::<L>(p, mirrored, zero.less(lanes.load(&dips.chart[k])));
    let (low, high, outside) =
        (lanes.load(&dips.low[k]), lanes.load(&dips.high[k]), lanes.load(&dips.at_low[k]));
    let mut t = lanes.load(&dips.vertex[k]);
    // The vertex, and what one and two of Newton's steps towards the extremum make of it.
    for _ in 0..2 {
        let (value, slope, bend) = with_derivatives::<L>(&p, t);
        let next = t - slope / bend;
        let moves = zero.less(value * outside).and(low.less(next)).and(next.less(high));
        t = next.select(moves, t);
    }
    let mut value = horner::<L>(&p, t);
    let beyond = (value * outside).less(zero);
    if beyond.any() {
        // In the scale of the values at the angles.
        let square = t.mul_add(t, one);
        let fourth = square * square;
        value = value / (fourth * fourth * square);
        let (mut at, mut values, mut found) = ([0.0; MAX_LANES], [0.0; MAX_LANES], [0.0; MAX_LANES]);
        t.store(&mut at);
        value.store(&mut values);
        one.select(beyond, zero).store(&mut found);
        for lane in 0..L::COUNT {
            if k < dips.count[lane] && found[lane] > 0.0 && cells.count[lane] + 2 <= MAX_ROOTS {
                let (low, at_low) = (dips.low[k][lane], dips.at_low[k][lane]);
                let (high, at_high) = (dips.high[k][lane], dips.at_high[k][lane]);
                let (middle, at_middle, chart) = (at[lane], values[lane], dips.chart[k][lane]);
                cells.push(lane, Cell { low, high: middle, at_low, at_high: at_middle, chart });
                cells.push(lane, Cell { low: middle, high, at_low: at_middle, at_high, chart });
            }
        }
    }
}

/// The polynomial in the coordinate `t` of a chart: `z = t, w = 1`, or `z = 1, w = −t` where the mask is set.
#[inline(always)]
fn in_chart<L: Lanes<f64>>(p: &Polynomial<L>, mirrored: &Polynomial<L>, around_infinity: M<L>) -> Polynomial<L> {
    let mut out = *p;
    for k in 0..11 {
        out[k] = mirrored[k].select(around_infinity, p[k]);
    }
    out
}

/// The polynomial in the chart around infinity.
#[inline(always)]
pub(super) fn mirrored<L: Lanes<f64>>(p: &Polynomial<L>) -> Polynomial<L> {
    let mut out = *p;
    for k in 0..11 {
        out[k] = if k % 2 == 0 { p[10 - k] } else { -p[10 - k] };
    }
    out
}

#[inline(always)]
fn horner<L: Lanes<f64>>(p: &Polynomial<L>, t: F<L>) -> F<L> {
    let mut value = p[10];
    for k in (0..10).rev() {
        value = value.mul_add(t, p[k]);
    }
    value
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

/// The value and the first two derivatives.
#[inline(always)]
fn with_derivatives<L: Lanes<f64>>(p: &Polynomial<L>, t: F<L>) -> (F<L>, F<L>, F<L>) {
    let mut half_bend = p[10];
    let linear = p[10].mul_add(t, p[9]);
    let mut slope = p[10].mul_add(t, linear);
    let mut value = linear.mul_add(t, p[8]);
    for k in (0..8).rev() {
        half_bend = half_bend.mul_add(t, slope);
        slope = slope.mul_add(t, value);
        value = value.mul_add(t, p[k]);
    }
    (value, slope, half_bend + half_bend)
}

/// Newton's steps at most.
const MAX_STEPS: usize = 12;

/// A root for every lane.
#[derive(Clone, Copy)]
pub(super) struct Root<L: Lanes<f64>> {
    /// `(z, w)`, the larger of which is one.
    pub(super) z: F<L>,
    pub(super) w: F<L>,
    /// Whether the last step was short enough.
    pub(super) is_certain: M<L>,
}

/// The roots of cells `slot` to `slot + K`, several at once: the steps of one wait for each other.
#[inline(always)]
pub(super) fn refine<L: Lanes<f64>, const K: usize>(
    lanes: L,
    p: &Polynomial<L>,
    mirrored: &Polynomial<L>,
    cells: &Cells,
    slot: usize,
    is_there: &[M<L>; K],
    tolerance: f64,
) -> [Root<L>; K] {
    let (zero, one, half) = (lanes.splat(0.0), lanes.splat(1.0), lanes.splat(0.5));
    let tolerance = lanes.splat(tolerance);
    let never = one.less(zero);
    let mut low = [zero; K];
    let (mut high, mut at_low, mut t, mut last) = (low, low, low, low);
    let mut chart = [never; K];
    let mut polynomials = [*p; K];
    for k in 0..K {
        let slot = slot + k;
        chart[k] = zero.less(lanes.load(&cells.chart[slot]));
        polynomials[k] = in_chart::<L>(p, mirrored, chart[k]);
        low[k] = lanes.load(&cells.low[slot]);
        high[k] = lanes.load(&cells.high[slot]);
        at_low[k] = lanes.load(&cells.at_low[slot]);
        let at_high = lanes.load(&cells.at_high[slot]);
        t[k] = (high[k] - low[k]).mul_add(at_low[k] / (at_low[k] - at_high), low[k]);
        last[k] = one.select(is_there[k], zero);
    }
    for _ in 0..MAX_STEPS {
        let mut moving = never;
        for k in 0..K {
            let (value, slope) = with_slope::<L>(&polynomials[k], t[k]);
            let above = zero.less(value * at_low[k]);
            low[k] = t[k].select(above, low[k]);
            high[k] = high[k].select(above, t[k]);
            let newton = t[k] - value / slope;
            let inside = low[k].less(newton).and(newton.less(high[k]));
            let next = newton.select(inside, half * (low[k] + high[k]));
            // A lane that has arrived stays where it is, whatever its neighbours do.
            let active = tolerance.less(last[k]);
            last[k] = (next - t[k]).abs().select(active, last[k]);
            t[k] = next.select(active, t[k]);
            moving = moving.or(tolerance.less(last[k]));
        }
        if !moving.any() {
            break;
        }
    }
    let mut roots = [Root { z: zero, w: zero, is_certain: never }; K];
    for k in 0..K {
        roots[k] = Root {
            z: one.select(chart[k], t[k]),
            w: (-t[k]).select(chart[k], one),
            // Also false where it is not a number.
            is_certain: last[k].less(tolerance + tolerance),
        };
    }
    roots
}

/// The number of real roots by Sturm's theorem: the signs of the leading coefficients of the chain tell how often the sign
/// changes at −∞ and at +∞.
#[inline(always)]
pub(super) fn count<L: Lanes<f64>>(lanes: L, p: &Polynomial<L>) -> F<L> {
    let (zero, one) = (lanes.splat(0.0), lanes.splat(1.0));
    let (mut f, mut g) = (*p, [zero; 11]);
    for k in 1..11 {
        g[k - 1] = p[k] * lanes.splat(k as f64 / 10.0);
    }
    // Of degree ten and nine with the same leading coefficient: one change at −∞, none at +∞.
    let mut count = one;
    for degree in (2..=10).rev() {
        let inverse = one / g[degree - 1];
        let slope = f[degree] * inverse;
        let offset = slope.neg_mul_add(g[degree - 2], f[degree - 1]) * inverse;
        let mut rest = [zero; 11];
        rest[0] = offset.mul_add(g[0], -f[0]);
        for k in 1..degree - 1 {
            rest[k] = offset.mul_add(g[k], slope.mul_add(g[k - 1], -f[k]));
        }
        let leading = rest[degree - 2];
        count = count + (-one).select((g[degree - 1] * leading).less(zero), one);
        let scale = one / leading.abs();
        for x in &mut rest[..degree - 1] {
            *x = *x * scale;
        }
        (f, g) = (g, rest);
    }
    count
}

#[cfg(test)]
mod scratch {
    use super::super::portable::Portable;
    use super::*;

    #[test]
    fn planted() {
        let lanes = Portable::<1>;
        let _ = lanes;
        use rand::{RngExt, SeedableRng};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let mut shown = 0;
        for _ in 0..3000 {
            let a: f64 = rng.random_range(-1.0..1.0);
            let d: f64 = 0.02 * rng.random_range(0.0..1.0);
            let mut p = vec![1.0];
            let mul = |p: &mut Vec<f64>, f: &[f64]| {
                let mut o = vec![0.0; p.len() + f.len() - 1];
                for i in 0..p.len() { for j in 0..f.len() { o[i + j] += p[i] * f[j]; } }
                *p = o;
            };
            for r in [a, a + d, -3.0, 2.0] { mul(&mut p, &[-r, 1.0]); }
            for _ in 0..3 { mul(&mut p, &[rng.random_range(1.0..2.0), 0.4, 1.0]); }
            let poly: Polynomial<Portable<1>> = std::array::from_fn(|k| lanes.splat(p[k]));
            let mirrored = mirrored::<Portable<1>>(&poly);
            let cells = isolate(lanes, Tables::get(), &poly, &mirrored);
            if cells.count[0] != 4 && shown < 10 {
                shown += 1;
                let grid = grid(lanes, Tables::get(), &poly);
                println!("{a} {d} {}", cells.count[0]);
                let j = (a.atan() / std::f64::consts::PI * 64.0).rem_euclid(64.0) as usize;
                for j in j.saturating_sub(1)..(j + 4).min(64) { println!("{j} {} {} {}", grid.values[j][0], grid.negative[0] >> j & 1, grid.falling[0] >> j & 1); }
            }
        }
    }
}
