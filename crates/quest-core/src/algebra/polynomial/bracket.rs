//! Intervals with one root each: found by trisection with the counts of a Sturm chain, narrowed by a safeguarded Laguerre iteration.

use super::MAX_STEPS;
use super::sturm::{Chain, End};
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
    ///
    /// A step of each two in turn: the steps of one root wait for each other, those of different roots do not.
    pub(super) fn refined(&self, p: &[f64; N]) -> RealRoots<N> {
        let mut pairs = [TwoBrackets::default(); N];
        let pairs = &mut pairs[..self.len.div_ceil(2)];
        for (pair, brackets) in pairs.iter_mut().zip(self.items[..self.len].chunks(2)) {
            *pair = TwoBrackets::new(&brackets[0], &brackets[brackets.len() - 1]);
        }
        for _ in 0..MAX_STEPS {
            let mut is_done = true;
            for pair in &mut *pairs {
                if !pair.is_found.all() {
                    is_done &= pair.step(p);
                }
            }
            if is_done {
                break;
            }
        }
        let mut values = [0.0; N];
        for (values, pair) in values.chunks_mut(2).zip(pairs) {
            let roots = pair.x.to_array();
            values.copy_from_slice(&roots[..values.len()]);
        }
        RealRoots { values, len: self.len, certain: self.certain, close: false }
    }
}

/// Two intervals with one root each, side by side.
#[derive(Clone, Copy, Default)]
struct TwoBrackets {
    low: Two,
    high: Two,
    /// The best estimates.
    x: Two,
    /// Masks: whether the polynomial is positive at `low`, and whether the estimate is good to all digits.
    positive_below: Two,
    is_found: Two,
}

impl TwoBrackets {
    #[inline]
    fn new(first: &Bracket, second: &Bracket) -> Self {
        let low = Two::new([first.low, second.low]);
        let high = Two::new([first.high, second.high]);
        let sign = [first, second].map(|bracket| if bracket.negative_below { -1.0 } else { 1.0 });
        Self {
            low,
            high,
            x: (low + high) * 0.5,
            positive_below: Two::new(sign).simd_gt(Two::ZERO),
            is_found: Two::ZERO,
        }
    }

    /// A step of each that is not found already. Whether both are then.
    #[inline]
    fn step<const N: usize>(&mut self, p: &[f64; N]) -> bool {
        let Self { x, .. } = *self;
        let (value, laguerre) = laguerre(p, x);
        let is_below = value.simd_lt(Two::ZERO) ^ self.positive_below;
        self.low = is_below.select(x, self.low);
        self.high = is_below.select(self.high, x);
        // Convergence is cubic: a step of a third of the digits is the last one. At a root rounding decides on which side it is.
        let short = (x.abs() + 1e-4) * 1e-5;
        let inside = laguerre.simd_gt(self.low) & laguerre.simd_lt(self.high);
        let is_taken = inside | (laguerre - x).abs().simd_le(short);
        let next = is_taken.select(laguerre, (self.low + self.high) * 0.5);
        self.x = self.is_found.select(x, next);
        self.is_found |= (next - x).abs().simd_le(short);
        self.is_found.all()
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
#[inline]
fn laguerre<const N: usize>(p: &[f64; N], x: Two) -> (Two, Two) {
    let y = x * x;
    let [[mut e0, mut e1, mut e2], [mut o0, mut o1, mut o2]] = [[Two::ZERO; 3]; 2];
    for k in (0..N.div_ceil(2)).rev() {
        (e2, e1, e0) = (e2 * y + e1, e1 * y + e0, e0 * y + p[2 * k]);
        if 2 * k + 1 < N {
            (o2, o1, o0) = (o2 * y + o1, o1 * y + o0, o0 * y + p[2 * k + 1]);
        }
    }
    let value = e0 + x * o0;
    let slope = o0 + (x + x) * (e1 + x * o1);
    let half_bend = e1 + x * o1 * 3.0 + y * (e2 + x * o2) * 4.0;
    let (n, less) = ((N - 1) as f64, (N - 2) as f64);
    let square = (slope * slope * less - value * half_bend * (2.0 * n)) * less;
    let root = square.max(Two::ZERO).sqrt().copysign(slope);
    (value, x - value * n / (slope + root))
}
