//! Where the real roots of polynomials of degree ten are, in lanes: a cell for each of them.
//!
//! A root `z/w` is an angle, `(z, w) = (sin θ, cos θ)`, so that infinity is a place like any other. On it the polynomial is a
//! trigonometric sum of `φ = 2θ` with five harmonics:
//!
//! 1. Its value and slope at [`ANGLES`] equal steps of `φ` make a cubic in every cell between two of them. The signs of the
//!    four Bernstein coefficients of all cubics are collected as bits of words in every lane. The angles `±φ, π ± φ` share
//!    their products.
//! 2. A cell without a change of sign among the four has no root, and one with a single change has one root. A cell with more
//!    changes is divided where the cubic turns around, until each part has one root or none. Few cells need that, so it is done
//!    lane by lane.

use std::sync::LazyLock;

use crate::algebra::vectors::lane::{F, Float, Lanes, MAX_F64_LANES as MAX_LANES, WordLanes};
use crate::lanes::stages::resultant::Polynomial;

/// How many angles are looked at.
const ANGLES: usize = 64;
/// Cells of one of the two charts.
const CHART: usize = ANGLES / 2;
/// The most roots of a polynomial.
pub(crate) const MAX_ROOTS: usize = 10;
/// How often a cell is divided.
const MAX_DIVISIONS: usize = 6;

/// Numbers that do not depend on the polynomial.
pub(crate) struct Tables {
    /// `cos kφ` for k = 1 to 5, then `sin kφ`, at the angles of the first quadrant with both ends.
    harmonics: [[f64; 10]; ANGLES / 4 + 1],
    /// `t` at the edges of the cells of a chart.
    edges: [f64; CHART + 1],
    /// Coefficient of `cos kφ` in `sin^2i cos^(10−2i)`.
    even: [[f64; 6]; 6],
    /// Coefficient of `sin (k+1)φ` in `sin^(2i+1) cos^(9−2i)`.
    odd: [[f64; 5]; 5],
}

impl Tables {
    /// The tables, computed once.
    pub(crate) fn get() -> &'static Self {
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
        let edges = std::array::from_fn(|i| (0.5 * angle(i as f64 - 0.5 * CHART as f64)).tan());
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
pub(crate) struct Cells {
    /// How many there are.
    pub(crate) count: [usize; MAX_LANES],
    pub(crate) low: [[f64; MAX_LANES]; MAX_ROOTS],
    pub(crate) high: [[f64; MAX_LANES]; MAX_ROOTS],
    /// The values of the polynomial there, up to a common positive factor: of different signs.
    pub(crate) at_low: [[f64; MAX_LANES]; MAX_ROOTS],
    pub(crate) at_high: [[f64; MAX_LANES]; MAX_ROOTS],
    /// 1 in the chart around infinity, 0 in that around zero.
    pub(crate) chart: [[f64; MAX_LANES]; MAX_ROOTS],
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
    /// No cells.
    pub(crate) fn new() -> Self {
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

/// The polynomial at the angles.
pub(crate) struct Grid {
    values: [[f64; MAX_LANES]; ANGLES],
    /// The derivatives by `φ`, times a third of the step.
    slopes: [[f64; MAX_LANES]; ANGLES],
    /// The signs of the values, which begin and end the Bernstein coefficients of a cell, and of the coefficients next to them
    /// in the cells behind and before.
    negative: [u64; MAX_LANES],
    negative_behind: [u64; MAX_LANES],
    negative_before: [u64; MAX_LANES],
}

impl Grid {
    /// A grid to be filled.
    pub(crate) fn new() -> Self {
        let (nothing, none) = ([[0.0; MAX_LANES]; ANGLES], [0; MAX_LANES]);
        Self {
            values: nothing,
            slopes: nothing,
            negative: none,
            negative_behind: none,
            negative_before: none,
        }
    }
}

/// Fills a grid.
#[inline(always)]
fn fill<L: WordLanes>(lanes: L, tables: &Tables, p: &Polynomial<L>, out: &mut Grid) {
    const HALF: usize = ANGLES / 2;
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
    // The derivatives of `c cos kφ + s sin kφ` by `φ` are `k s cos kφ − k c sin kφ`.
    let (mut cs, mut ss) = ([zero; 6], [zero; 5]);
    for k in 1..6 {
        let order = lanes.splat(k as f64 * std::f64::consts::TAU / (3 * ANGLES) as f64);
        cs[k] = order * s[k - 1];
        ss[k - 1] = -(order * c[k]);
    }
    let (mut at, mut behind, mut before) = (lanes.no_bits(), lanes.no_bits(), lanes.no_bits());
    for (i, h) in tables.harmonics.iter().enumerate() {
        let h = h.map(|x| lanes.splat(x));
        let values = at_four_angles::<L>(&c, &s, &h);
        let slopes = at_four_angles::<L>(&cs, &ss, &h);
        // The first two of the four quadrants share their ends, and so do the last two.
        let angles = [i, HALF - i, HALF + i, (ANGLES - i) % ANGLES];
        for (quadrant, &j) in angles.iter().enumerate() {
            let (value, slope) = (values[quadrant], slopes[quadrant]);
            value.store(&mut out.values[j]);
            slope.store(&mut out.slopes[j]);
            at = lanes.with_bit(at, value.less(zero), 1 << j);
            behind = lanes.with_bit(behind, value.less(-slope), 1 << j);
            before = lanes.with_bit(before, value.less(slope), 1 << j);
        }
    }
    lanes.store_words(at, &mut out.negative);
    lanes.store_words(behind, &mut out.negative_behind);
    lanes.store_words(before, &mut out.negative_before);
}

/// A sum of five harmonics at `φ, π − φ, π + φ, −φ`, by those of `φ`.
#[inline(always)]
fn at_four_angles<L: Lanes<f64>>(c: &[F<L>; 6], s: &[F<L>; 5], h: &[F<L>; 10]) -> [F<L>; 4] {
    let cosine_even = c[4].mul_add(h[3], c[2].mul_add(h[1], c[0]));
    let cosine_odd = c[5].mul_add(h[4], c[3].mul_add(h[2], c[1] * h[0]));
    let sine_odd = s[4].mul_add(h[9], s[2].mul_add(h[7], s[0] * h[5]));
    let sine_even = s[3].mul_add(h[8], s[1] * h[6]);
    let (a, b) = (cosine_even + cosine_odd, cosine_even - cosine_odd);
    let (f, g) = (sine_odd + sine_even, sine_odd - sine_even);
    [a + f, b + g, b - g, a - f]
}

/// The chart of a cell and its place in it.
#[inline(always)]
fn place(cell: usize) -> (usize, usize) {
    let shifted = (cell + ANGLES / 4) % ANGLES;
    (shifted / CHART, shifted % CHART)
}

/// Finds the cells with a root.
#[inline(always)]
pub(crate) fn isolate<L: WordLanes>(
    lanes: L,
    tables: &Tables,
    p: &Polynomial<L>,
    mirrored: &Polynomial<L>,
    grid: &mut Grid,
    cells: &mut Cells,
) {
    fill(lanes, tables, p, grid);
    let mut polynomials = [[[0.0; MAX_LANES]; 11]; 2];
    for k in 0..11 {
        p[k].store(&mut polynomials[0][k]);
        mirrored[k].store(&mut polynomials[1][k]);
    }
    cells.count = [0; MAX_LANES];
    for lane in 0..L::COUNT {
        let (first, second) = (grid.negative[lane], grid.negative_behind[lane]);
        let (third, last) = (grid.negative_before[lane].rotate_right(1), first.rotate_right(1));
        let changes = [first ^ second, second ^ third, third ^ last];
        let several = (changes[0] & changes[1]) | (changes[0] & changes[2]) | (changes[1] & changes[2]);
        let mut simple = (first ^ last) & !several;
        while simple != 0 {
            let j = simple.trailing_zeros() as usize;
            simple &= simple - 1;
            let (chart, k) = place(j);
            let (low, high) = (tables.edges[k], tables.edges[k + 1]);
            let (at_low, at_high) = (grid.values[j][lane], grid.values[(j + 1) % ANGLES][lane]);
            cells.push(lane, Cell { low, high, at_low, at_high, chart: chart as f64 });
        }
        let mut several = several;
        while several != 0 {
            let j = several.trailing_zeros() as usize;
            several &= several - 1;
            let (chart, k) = place(j);
            let end = |j: usize, t: f64| End::new(t, grid.values[j][lane], grid.slopes[j][lane]);
            let (low, high) = (end(j, tables.edges[k]), end((j + 1) % ANGLES, tables.edges[k + 1]));
            let p = polynomials[chart].map(|coefficient| coefficient[lane]);
            let divided = Divided { p, chart: chart as f64, lane };
            divided.divide(&low, &high, MAX_DIVISIONS, cells);
        }
    }
}

/// An end of a cell: the polynomial and its derivative there.
#[derive(Clone, Copy)]
struct End {
    t: f64,
    value: f64,
    slope: f64,
}

impl End {
    /// By the value of the sum of harmonics and its derivative as [`Grid`] has it: with `t = tan θ` the polynomial is
    /// `(1 + t²)⁵` times that sum.
    fn new(t: f64, value: f64, slope: f64) -> Self {
        let by_phi = slope * (3 * ANGLES) as f64 / std::f64::consts::TAU;
        let square = t * t + 1.0;
        let fourth = square * square * (square * square);
        Self { t, value: fourth * square * value, slope: fourth * (2.0 * by_phi + 10.0 * t * value) }
    }
}

/// A cell to be divided, in one lane.
struct Divided {
    p: [f64; 11],
    chart: f64,
    lane: usize,
}

impl Divided {
    /// Adds the parts of a cell with a root each.
    fn divide(&self, low: &End, high: &End, divisions: usize, cells: &mut Cells) {
        let third = (high.t - low.t) / 3.0;
        let b = [low.value, low.value + third * low.slope, high.value - third * high.slope, high.value];
        let changes = b.windows(2).filter(|pair| (pair[0] < 0.0) != (pair[1] < 0.0)).count();
        match changes {
            0 => {}
            1 => self.push(low, high, cells),
            _ if divisions == 0 => {
                if (low.value < 0.0) != (high.value < 0.0) {
                    self.push(low, high, cells);
                }
            }
            _ => {
                let middle = self.end(low.t + turning_point(&b) * (high.t - low.t));
                self.divide(low, &middle, divisions - 1, cells);
                self.divide(&middle, high, divisions - 1, cells);
            }
        }
    }

    fn push(&self, low: &End, high: &End, cells: &mut Cells) {
        let (at_low, at_high) = (low.value, high.value);
        cells.push(self.lane, Cell { low: low.t, high: high.t, at_low, at_high, chart: self.chart });
    }

    fn end(&self, t: f64) -> End {
        let (mut value, mut slope) = (self.p[10], 0.0);
        for c in self.p[..10].iter().rev() {
            slope = slope * t + value;
            value = value * t + c;
        }
        End { t, value, slope }
    }
}

/// Where in `(0, 1)` a cubic with these Bernstein coefficients has the extremum that is furthest beyond zero, or closest to it,
/// as seen from its first value; the middle where it has none.
fn turning_point(b: &[f64; 4]) -> f64 {
    let [first, second, third] = [b[1] - b[0], b[2] - b[1], b[3] - b[2]];
    let root = (second * second - first * third).sqrt();
    let bend = first - 2.0 * second + third;
    let value = |x: f64| {
        let y = 1.0 - x;
        let cubic = y * y * (y * b[0] + 3.0 * x * b[1]) + x * x * (3.0 * y * b[2] + x * b[3]);
        cubic * b[0].signum()
    };
    let mut best = (f64::INFINITY, 0.5);
    for x in [(first - second + root) / bend, (first - second - root) / bend] {
        if x > 0.01 && x < 0.99 && value(x) < best.0 {
            best = (value(x), x);
        }
    }
    best.1
}
