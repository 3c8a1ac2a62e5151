//! Intervals with one root each: found by trisection with the counts of a Sturm chain, narrowed by a safeguarded Newton iteration.

use super::real::RealRoots;
use super::sturm::{Chain, End};
use super::{MAX_STEPS, value_and_slope};
use crate::algebra::two::Two;

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

    /// The roots: Newton's iteration, bisection where it would leave the bracket.
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
                if !pair.is_near.all() {
                    is_done &= pair.step(p);
                }
            }
            if is_done {
                break;
            }
        }
        let mut values = [0.0; N];
        for (values, pair) in values.chunks_mut(2).zip(pairs) {
            let roots = pair.root(p).to_array();
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
    /// The best estimates, and how far the last steps moved them.
    x: Two,
    moved: Two,
    /// Masks: whether the polynomial is positive at `low`, and whether the estimate is good to a third of its digits.
    positive_below: Two,
    is_near: Two,
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
            moved: high - low,
            positive_below: Two::new(sign).simd_gt(Two::ZERO),
            is_near: Two::ZERO,
        }
    }

    /// A step of each that is not near already. Whether both are then.
    #[inline]
    fn step<const N: usize>(&mut self, p: &[f64; N]) -> bool {
        let Self { x, .. } = *self;
        let (value, slope) = value_and_slope(p, x);
        let is_below = value.simd_lt(Two::ZERO) ^ self.positive_below;
        self.low = is_below.select(x, self.low);
        self.high = is_below.select(self.high, x);
        let newton = x - value / slope;
        let inside = newton.simd_gt(self.low) & newton.simd_lt(self.high);
        let next = inside.select(newton, (self.low + self.high) * 0.5);
        let moved = (next - x).abs();
        self.x = self.is_near.select(x, next);
        self.moved = self.is_near.select(self.moved, moved);
        // Convergence is quadratic: a step of a third of the digits leaves a third, the last one none.
        self.is_near |= moved.simd_le((next.abs() + 1e-3) * 1e-5);
        self.is_near.all()
    }

    /// The roots, by one more step from near.
    #[inline]
    fn root<const N: usize>(&self, p: &[f64; N]) -> Two {
        let (value, slope) = value_and_slope(p, self.x);
        let last = self.x - value / slope;
        (last - self.x).abs().simd_le(self.moved).select(last, self.x)
    }
}

#[inline]
fn value<const N: usize>(p: &[f64; N], x: Two) -> Two {
    value_and_slope(p, x).0
}
