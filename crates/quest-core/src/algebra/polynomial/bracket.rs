//! Intervals with one root each: found by trisection with the counts of a Sturm chain, narrowed by a safeguarded Laguerre iteration.
#![expect(clippy::inline_always, reason = "a call would leave the instructions of the lanes")]

use super::MAX_STEPS;
use super::sturm::{Chain, End};
use crate::algebra::vectors::abreast::{Work, abreast};
use crate::algebra::vectors::lane::{F, Float, Lanes, MAX_F64_LANES, Mask};
use crate::algebra::vectors::two::Two;

/// The real roots that were found.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RealRoots<const N: usize> {
    pub(super) values: [f64; N],
    pub(super) len: usize,
    /// Whether all of them were told apart and refined.
    pub(crate) certain: bool,
    /// Whether rounding may have moved roots on or off the line: two of them, real or not, are close, or the chain has lost its
    /// digits on the way.
    pub(crate) close: bool,
}

impl<const N: usize> RealRoots<N> {
    pub(crate) fn as_slice(&self) -> &[f64] {
        &self.values[..self.len]
    }
}

/// An interval with one root.
#[derive(Clone, Copy, Debug, Default)]
struct Bracket {
    low: f64,
    high: f64,
    /// Whether the polynomial is negative at `low`.
    negative_below: bool,
}

impl Bracket {
    /// `None` where there is no root, rounding having decided a count.
    #[inline]
    fn new<const N: usize>(p: &[f64; N], low: f64, high: f64) -> Option<Self> {
        let [below, above] = value(p, Two::new([low, high])).to_array();
        let negative_below = below < 0.0;
        (negative_below != (above < 0.0)).then_some(Self { low, high, negative_below })
    }
}

/// The intervals of all roots.
pub(super) struct Brackets<const N: usize> {
    items: [Bracket; N],
    len: usize,
    certain: bool,
}

impl<const N: usize> Brackets<N> {
    pub(super) fn new() -> Self {
        Self { items: [Bracket::default(); N], len: 0, certain: true }
    }

    fn push(&mut self, bracket: Bracket) {
        if let Some(place) = self.items.get_mut(self.len) {
            *place = bracket;
            self.len += 1;
        }
    }

    /// Adds the intervals of the roots between two points, divided into three until each has one, but not more often than `depth`.
    pub(super) fn isolate(&mut self, chain: &Chain<N>, from: End, to: End, depth: u32) {
        let count = from.changes - to.changes;
        if count < 1.0 {
            return;
        }
        if count < 2.0 {
            match Bracket::new(&chain.p, from.x, to.x) {
                Some(bracket) => self.push(bracket),
                None => self.certain = false,
            }
        } else if depth == 0 {
            self.certain = false;
            self.push(Bracket { low: from.x, high: to.x, negative_below: false });
            self.isolate(chain, End { changes: from.changes - 1.0, ..from }, to, depth);
        } else {
            let third = (to.x - from.x) / 3.0;
            let [first, second] = chain.ends([from.x + third, to.x - third]);
            for [from, to] in [[from, first], [first, second], [second, to]] {
                self.isolate(chain, from, to, depth - 1);
            }
        }
    }

    /// The roots: Laguerre's iteration, bisection where it would leave the bracket.
    pub(super) fn refined(&self, p: &[f64; N]) -> RealRoots<N> {
        abreast(Refining { brackets: self, p })
    }
}

/// Groups of roots of a polynomial, two or more in each.
const MAX_GROUPS: usize = 6;

/// The refinement of all roots, as many abreast as there are lanes.
struct Refining<'a, const N: usize> {
    brackets: &'a Brackets<N>,
    p: &'a [f64; N],
}

impl<const N: usize> Work for Refining<'_, N> {
    type Output = RealRoots<N>;

    /// A step of each group in turn: the steps of one root wait for each other, those of different roots do not.
    #[inline(always)]
    fn run<L: Lanes<f64>>(self, lanes: L) -> RealRoots<N> {
        const { assert!(N <= 2 * MAX_GROUPS) }
        let Brackets { items, len, certain } = self.brackets;
        let groups = len.div_ceil(L::COUNT);
        let mut all = [ManyBrackets::new(lanes, &[]); MAX_GROUPS];
        for k in 0..groups {
            all[k] = ManyBrackets::new(lanes, &items[k * L::COUNT..*len]);
        }
        for _ in 0..MAX_STEPS {
            let mut is_done = true;
            for k in 0..groups {
                if all[k].active.any() {
                    all[k].step(lanes, self.p);
                    is_done &= !all[k].active.any();
                }
            }
            if is_done {
                break;
            }
        }
        let mut values = [0.0; N];
        for k in 0..groups {
            let mut roots = [0.0; MAX_F64_LANES];
            all[k].x.store(&mut roots);
            for (value, root) in values[k * L::COUNT..*len].iter_mut().zip(&roots[..L::COUNT]) {
                *value = *root;
            }
        }
        RealRoots { values, len: *len, certain: *certain, close: false }
    }
}

/// Intervals with one root each, abreast.
#[derive(Clone, Copy)]
struct ManyBrackets<V: Float<f64>> {
    low: V,
    high: V,
    /// The best estimates.
    x: V,
    /// The sign of the polynomial at `low`.
    sign: V,
    /// Where the estimate is not good to all digits yet.
    active: V::Mask,
}

impl<V: Float<f64>> ManyBrackets<V> {
    /// The first of some intervals; what is left of the lanes repeats the first, or has none.
    #[inline(always)]
    fn new<L: Lanes<f64, Float = V>>(lanes: L, brackets: &[Bracket]) -> Self {
        let mut columns = [[0.0; MAX_F64_LANES]; 3];
        for k in 0..L::COUNT {
            if let Some(bracket) = brackets.get(k).or(brackets.first()) {
                let sign = if bracket.negative_below { -1.0 } else { 1.0 };
                [columns[0][k], columns[1][k], columns[2][k]] = [bracket.low, bracket.high, sign];
            }
        }
        let [low, high, sign] = columns.each_ref().map(|column| lanes.load(column));
        let active = lanes.splat(0.0).less(lanes.splat(1.0));
        Self { low, high, x: (low + high) * lanes.splat(0.5), sign, active }
    }

    /// A step of each that is not found already.
    #[inline(always)]
    fn step<L: Lanes<f64, Float = V>, const N: usize>(&mut self, lanes: L, p: &[f64; N]) {
        let Self { x, .. } = *self;
        let (value, laguerre) = laguerre(lanes, p, x);
        let is_below = lanes.splat(0.0).less(value * self.sign);
        self.low = x.select(is_below, self.low);
        self.high = self.high.select(is_below, x);
        // Convergence is cubic: a step of a third of the digits is the last one. At a root rounding decides on which side it is.
        let short = (x.abs() + lanes.splat(1e-4)) * lanes.splat(1e-5);
        let inside = self.low.less(laguerre).and(laguerre.less(self.high));
        let is_taken = inside.or((laguerre - x).abs().less(short));
        let next = laguerre.select(is_taken, (self.low + self.high) * lanes.splat(0.5));
        self.x = next.select(self.active, x);
        self.active = self.active.and(short.less((next - x).abs()));
    }
}

/// The value, by the even and the odd powers apart, which do not wait for each other: with `y = x²` `p = e(y) + x o(y)`.
#[inline]
fn value<const N: usize>(p: &[f64; N], x: Two) -> Two {
    let (y, [mut even, mut odd]) = (x * x, [Two::ZERO; 2]);
    for k in (0..N.div_ceil(2)).rev() {
        even = even * y + p[2 * k];
        if 2 * k + 1 < N {
            odd = odd * y + p[2 * k + 1];
        }
    }
    even + x * odd
}

/// The value, and where a step of Laguerre's iteration leads: with `n` the degree
///
/// ```text
/// x − n p / (p' ± √((n − 1) ((n − 1) p'² − n p p'')))
/// p' = o + 2 x (e' + x o')        p'' / 2 = e' + 3 x o' + 4 y (e'' / 2 + x o'' / 2)
/// ```
#[inline(always)]
fn laguerre<L: Lanes<f64>, const N: usize>(lanes: L, p: &[f64; N], x: F<L>) -> (F<L>, F<L>) {
    let (y, zero) = (x * x, lanes.splat(0.0));
    let [[mut e0, mut e1, mut e2], [mut o0, mut o1, mut o2]] = [[zero; 3]; 2];
    for k in (0..N.div_ceil(2)).rev() {
        (e2, e1, e0) = (e2.mul_add(y, e1), e1.mul_add(y, e0), e0.mul_add(y, lanes.splat(p[2 * k])));
        if 2 * k + 1 < N {
            (o2, o1, o0) = (o2.mul_add(y, o1), o1.mul_add(y, o0), o0.mul_add(y, lanes.splat(p[2 * k + 1])));
        }
    }
    let value = x.mul_add(o0, e0);
    let slope = (x + x).mul_add(x.mul_add(o1, e1), o0);
    let half_bend = (y * lanes.splat(4.0)).mul_add(x.mul_add(o2, e2), (x * lanes.splat(3.0)).mul_add(o1, e1));
    let (n, less) = (lanes.splat((N - 1) as f64), lanes.splat((N - 2) as f64));
    let square = (slope * slope * less - value * half_bend * (n + n)) * less;
    let root = square.select(zero.less(square), zero).sqrt();
    (value, x - value * n / (slope + (-root).select(slope.less(zero), root)))
}
