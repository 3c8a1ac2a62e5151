//! The roots of a real polynomial of small fixed degree.
//!
//! Real roots by Sturm's theorem: the sign changes of a chain of polynomials count the roots in an interval, bisection
//! isolates them, and a safeguarded Newton iteration refines each. Complex roots of what is left: by Laguerre's method, the last four
//! in closed form.
//!
//! Coefficients stand from the constant up; a polynomial of degree `D` has `N = D + 1` of them.

use nalgebra::Complex;

use super::number::{Number, TwoComplex};
use super::two::Two;

/// Where trisection gives up on telling two roots apart: at a third of a third of an interval, and so on.
const MAX_DEPTH: u32 = 28;

/// Steps to refine a root; seven are usual.
const MAX_STEPS: usize = 80;

/// Where the line is first divided, by even angles on the circle that it closes to at infinity. None of these is a likely root,
/// as zero is where a basis vector is itself a solution: there rounding decides the sign.
const SPLITS: [[f64; 2]; 4] = [[-4.7, -1.53], [-0.66, -0.19], [0.21, 0.69], [1.48, 5.1]];

/// A square of a gap, relative to the roots, at which rounding in the coefficients begins to decide what is real; one noisy
/// five-point problem in two hundred has it.
const NEARLY_DOUBLE: f64 = 1e-6;

/// How much a chain may magnify an error of its first members, by a bound that is far too wide: for half of the noisy five-point
/// problems it says 1e9, for one in two hundred more than this. The only one of 40,000 whose roots were miscounted had 6e20.
const MAGNIFIED: f64 = 1e19;

/// The real roots that were found.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RealRoots<const N: usize> {
    values: [f64; N],
    len: usize,
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

/// All real roots of `p`, in increasing order.
pub(crate) fn real_roots<const N: usize>(p: &[f64; N]) -> RealRoots<N> {
    let Some(chain) = Chain::new(p) else {
        return RealRoots { values: [0.0; N], len: 0, certain: false, close: false };
    };
    let mut brackets = Brackets { items: [Bracket::default(); N], len: 0, certain: true };
    let ends = SPLITS.map(|x| chain.ends(x));
    let ends = ends.as_flattened();
    let (first, last) = (ends[0], ends[ends.len() - 1]);
    if let Some(below) = chain.bound(-1.0, first) {
        chain.isolate(below, first, MAX_DEPTH, &mut brackets);
    }
    for pair in ends.windows(2) {
        chain.isolate(pair[0], pair[1], MAX_DEPTH, &mut brackets);
    }
    if let Some(above) = chain.bound(1.0, last) {
        chain.isolate(last, above, MAX_DEPTH, &mut brackets);
    }
    RealRoots { close: chain.is_doubtful(), ..brackets.refined(&chain.p) }
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
struct Brackets<const N: usize> {
    items: [Bracket; N],
    len: usize,
    certain: bool,
}

impl<const N: usize> Brackets<N> {
    fn push(&mut self, bracket: Bracket) {
        if let Some(place) = self.items.get_mut(self.len) {
            *place = bracket;
            self.len += 1;
        }
    }

    /// The roots: Newton's iteration, bisection where it would leave the bracket.
    ///
    /// A step of each two in turn: the steps of one root wait for each other, those of different roots do not.
    fn refined(&self, p: &[f64; N]) -> RealRoots<N> {
        let mut pairs = [TwoBrackets::default(); N];
        let pairs = &mut pairs[..self.len.div_ceil(2)];
        for (pair, brackets) in pairs.iter_mut().zip(self.items[..self.len].chunks(2)) {
            *pair = TwoBrackets::new(&brackets[0], &brackets[brackets.len() - 1]);
        }
        for _ in 0..MAX_STEPS {
            let mut is_done = true;
            for pair in &mut *pairs {
                is_done &= pair.step(p);
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

    /// A step of both unless they are near already. Whether they are then.
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

/// An end of an interval with the sign changes of the chain there.
#[derive(Clone, Copy)]
struct End {
    x: f64,
    /// A whole number.
    changes: f64,
}

/// A Sturm chain `f_0 = p, f_1 ∝ p', f_{k+2} ∝ −(f_k mod f_{k+1})`, kept as the recurrence
/// `f_k = (slope x + offset) f_{k+1} − weight f_{k+2}` so that an evaluation costs two products a member.
struct Chain<const N: usize> {
    /// Scaled to a leading coefficient of one.
    p: [f64; N],
    /// `(offset, slope, weight)`; the last two entries are not used.
    links: [[f64; 3]; N],
    /// `f_{D−1}` and the sign of the constant `f_D`.
    last_linear: [f64; 2],
    last: f64,
    /// By how much an error of the first members may have grown.
    magnified: f64,
}

impl<const N: usize> Chain<N> {
    /// `None` where the chain breaks off: a leading coefficient that vanishes, a root that is exactly double.
    fn new(p: &[f64; N]) -> Option<Self> {
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
        let mut magnified = 0.0_f64;
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
            sign = 1.0_f64.copysign(leading);
            (f, g) = (g, rest);
        }
        let ([slope, offset], [last, _]) = (f[0].to_array(), g[0].to_array());
        let finite = p.iter().chain([&slope, &offset, &last]).all(|c| c.is_finite());
        finite.then_some(Self { p, links, last_linear: [offset, slope], last, magnified })
    }

    /// Whether the number of real roots may be rounding's: the chain has lost its digits, or nearly breaks off at its end, where
    /// the square of the gap between two close roots stands.
    fn is_doubtful(&self) -> bool {
        let root = self.last_linear[0];
        self.magnified > MAGNIFIED || self.links[N - 3][2] < NEARLY_DOUBLE * (1.0 + root * root)
    }

    /// How often the sign changes along the chain at two points, side by side: each member waits for those before.
    #[inline]
    fn ends(&self, points: [f64; 2]) -> [End; 2] {
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
    fn bound(&self, direction: f64, end: End) -> Option<End> {
        // At ±∞ the leading terms decide: x, and the slopes of the recurrence.
        let mut at_infinity = u32::from((self.last_linear[1] * direction < 0.0) != (self.last < 0.0));
        for [_, slope, _] in &self.links[..N - 2] {
            at_infinity += u32::from(slope * direction < 0.0);
        }
        let (mut bound, at_infinity) = (end, f64::from(at_infinity));
        while (bound.changes - at_infinity).abs() > 0.5 {
            [bound, _] = self.ends([4.0 * bound.x.abs().max(1.0) * direction; 2]);
            // A root this far out is one at infinity, of a polynomial of lower degree.
            if bound.x.abs() > 1e12 {
                break;
            }
        }
        ((bound.changes - end.changes).abs() > 0.5).then_some(bound)
    }

    fn isolate(&self, from: End, to: End, depth: u32, brackets: &mut Brackets<N>) {
        let count = from.changes - to.changes;
        if count < 1.0 {
            return;
        }
        if count < 2.0 {
            match Bracket::new(&self.p, from.x, to.x) {
                Some(bracket) => brackets.push(bracket),
                None => brackets.certain = false,
            }
        } else if depth == 0 {
            brackets.certain = false;
            brackets.push(Bracket { low: from.x, high: to.x, negative_below: false });
            self.isolate(End { changes: from.changes - 1.0, ..from }, to, depth, brackets);
        } else {
            let third = (to.x - from.x) / 3.0;
            let [first, second] = self.ends([from.x + third, to.x - third]);
            for [from, to] in [[from, first], [first, second], [second, to]] {
                self.isolate(from, to, depth - 1, brackets);
            }
        }
    }
}

#[inline]
fn value<const N: usize>(p: &[f64; N], x: Two) -> Two {
    value_and_slope(p, x).0
}

/// By the even and the odd powers apart, which do not wait for each other: with `y = x²`
/// `p = e(y) + x o(y)` and `p' = o(y) + 2 x (e'(y) + x o'(y))`.
#[inline]
fn value_and_slope<const N: usize>(p: &[f64; N], x: Two) -> (Two, Two) {
    let y = x * x;
    let ([mut even, mut odd], [mut even_slope, mut odd_slope]) = ([Two::ZERO; 2], [Two::ZERO; 2]);
    for k in (0..N.div_ceil(2)).rev() {
        even_slope = even_slope * y + even;
        even = even * y + p[2 * k];
        if 2 * k + 1 < N {
            odd_slope = odd_slope * y + odd;
            odd = odd * y + p[2 * k + 1];
        }
    }
    (even + x * odd, odd + (x + x) * (even_slope + x * odd_slope))
}

/// One of each pair of complex roots of `p`, that with the positive imaginary part, given all its real roots.
///
/// Returns how many stand in `out`.
pub(crate) fn complex_roots<const N: usize>(
    p: &[f64; N],
    real: &[f64],
    out: &mut [Complex<f64>; N],
) -> usize {
    let mut rest = *p;
    let mut degree = N - 1;
    for &root in real {
        divide_linear(&mut rest, degree, root);
        degree -= 1;
    }
    let mut found = 0;
    while let Some(root) = laguerre(&rest, degree) {
        divide_quadratic(&mut rest, degree, 2.0 * root.re, root.norm_sqr());
        degree -= 2;
        out[found] = root;
        found += 1;
    }
    if degree == 4 {
        [out[found], out[found + 1]] = quartic_roots(&rest);
        found += 2;
    } else if degree == 2 {
        out[found] = quadratic_root(0.5 * rest[1] / rest[2], rest[0] / rest[2]);
        found += 1;
    }
    for roots in out[..found].chunks_mut(2) {
        let steps = newton_step(p, TwoComplex::new([roots[0], roots[roots.len() - 1]])).to_array();
        for (root, step) in roots.iter_mut().zip(steps) {
            let polished = if step.re.is_finite() && step.im.is_finite() { *root - step } else { *root };
            // A double root, or two real ones that the chain did not tell apart, comes out with next to no imaginary part.
            *root = Complex::new(polished.re, polished.im.abs());
        }
    }
    found
}

/// Divides by `x − root`, from the end where rounding does not grow.
fn divide_linear<const N: usize>(p: &mut [f64; N], degree: usize, root: f64) {
    if root.abs() <= 1.0 {
        let mut carry = p[degree];
        for c in p[..degree].iter_mut().rev() {
            (*c, carry) = (carry, *c + root * carry);
        }
    } else {
        let (mut carry, inverse) = (0.0, 1.0 / root);
        for c in &mut p[..degree] {
            carry = (carry - *c) * inverse;
            *c = carry;
        }
    }
}

/// Divides by `x² − sum x + product`, forwards.
fn divide_quadratic<const N: usize>(p: &mut [f64; N], degree: usize, sum: f64, product: f64) {
    let (mut last, mut before) = (0.0, 0.0);
    for k in (2..=degree).rev() {
        let quotient = p[k] + sum * last - product * before;
        (last, before) = (quotient, last);
        p[k] = quotient;
    }
    p.copy_within(2..=degree, 0);
}

/// The root of `x² + 2 half x + constant` with the positive imaginary part; a double real root where rounding left a real pair.
#[inline]
fn quadratic_root(half: f64, constant: f64) -> Complex<f64> {
    Complex::new(-half, (constant - half * half).max(0.0).sqrt())
}

/// One of each pair of roots of a quartic without real ones (Descartes): with `y = x + h` to leave no cube,
///
/// ```text
/// y⁴ + p y² + q y + r = (y² + α y + β) (y² − α y + γ),   u = α²
/// u³ + 2 p u² + (p² − 4 r) u − q² = 0,   β + γ = p + u,   β γ = r,   α (γ − β) = q
/// ```
///
/// The cubic has one positive root, and two that are not: the squares of sums of roots that are not conjugate.
fn quartic_roots<const N: usize>(coefficients: &[f64; N]) -> [Complex<f64>; 2] {
    let inverse = 1.0 / coefficients[4];
    let [e, d, c, b] = [0, 1, 2, 3].map(|k| coefficients[k] * inverse);
    let h = 0.25 * b;
    let p = c - 6.0 * h * h;
    let q = d - 2.0 * h * (c - 4.0 * h * h);
    let r = e - h * d + h * h * (c - 3.0 * h * h);
    let (second, first, last) = (2.0 * p, p * p - 4.0 * r, q * q);
    // No root of a cubic with real roots is above this. From there Halley's iteration falls to the largest.
    let mut u = (2.0 * (second * second - 3.0 * first).max(0.0).sqrt() - second) / 3.0;
    for _ in 0..MAX_STEPS {
        let f = ((u + second) * u + first) * u - last;
        let slope = (3.0 * u + 2.0 * second) * u + first;
        let step = f * slope / (slope * slope - f * (3.0 * u + second));
        if step > 0.0 {
            u -= step;
        }
        if step.is_nan() || step <= 1e-4 * u {
            break;
        }
    }
    let sum = p + u;
    let difference = (sum * sum - 4.0 * r).max(0.0).sqrt().copysign(q);
    let half = 0.5 * u.max(0.0).sqrt();
    [quadratic_root(half, 0.5 * (sum - difference)) - h, quadratic_root(-half, 0.5 * (sum + difference)) - h]
}

/// A root of the first coefficients, up to an even `degree` of six or more, of a polynomial that has no real ones.
fn laguerre<const N: usize>(p: &[f64; N], degree: usize) -> Option<Complex<f64>> {
    // As many steps of Horner's rule as the compiler knows of.
    match degree {
        6 => complex_root::<7>(p.first_chunk()?),
        8 => complex_root::<9>(p.first_chunk()?),
        10 => complex_root::<11>(p.first_chunk()?),
        _ => None,
    }
}

/// Two steps of Laguerre's iteration, which finds the way from anywhere, then Halley's, which does without a square root.
fn complex_root<const N: usize>(p: &[f64; N]) -> Option<Complex<f64>> {
    let degree = (N - 1) as f64;
    let mut z = Complex::new(0.0, 1.0);
    for count in 0..40 {
        // The value, the slope, and half of the curvature.
        let (mut f, mut d, mut h) = (Complex::from(p[N - 1]), Complex::from(0.0), Complex::from(0.0));
        for c in p[..N - 1].iter().rev() {
            h = h * z + d;
            d = d * z + f;
            f = f * z + c;
        }
        let (numerator, denominator) = if count < 2 {
            let square = (d * d * (degree - 1.0) - f * h * (2.0 * degree)) * (degree - 1.0);
            let root = square.square_root();
            let is_longer = d.re * root.re + d.im * root.im >= 0.0;
            (f * degree, if is_longer { d + root } else { d - root })
        } else {
            (f * d, d * d - f * h)
        };
        let step = numerator * denominator.conj() * (1.0 / denominator.norm_sqr());
        if !(step.re.is_finite() && step.im.is_finite()) {
            return (f.norm_sqr() == 0.0).then_some(z);
        }
        z -= step;
        // The convergence is cubic, and a step on the whole polynomial follows.
        if step.norm_sqr() <= 1e-8 * z.norm_sqr() {
            return Some(z);
        }
    }
    None
}

/// By how much two roots of `p` are off, to first order.
#[inline]
fn newton_step<const N: usize>(p: &[f64; N], z: TwoComplex) -> TwoComplex {
    let (mut value, mut slope) = (TwoComplex::real(p[N - 1]), TwoComplex::real(0.0));
    for c in p[..N - 1].iter().rev() {
        slope = slope * z + value;
        value = value * z + TwoComplex::real(*c);
    }
    value / slope
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// The polynomial of degree 10 with these roots, the complex ones with their conjugates.
    fn planted(real: &[f64], complex: &[Complex<f64>]) -> [f64; 11] {
        let mut p = [0.0; 11];
        p[0] = 1.0;
        let mut degree = 0;
        let factors = complex.iter().map(|z| [z.norm_sqr(), -2.0 * z.re, 1.0]);
        for factor in real.iter().map(|r| [-r, 1.0, 0.0]).chain(factors) {
            let mut product = [0.0; 11];
            for i in 0..=degree {
                for (j, f) in factor.iter().enumerate().filter(|(j, _)| i + j < 11) {
                    product[i + j] += p[i] * f;
                }
            }
            degree += if factor[2] == 0.0 { 1 } else { 2 };
            p = product;
        }
        assert_eq!(degree, 10);
        p
    }

    #[test]
    fn planted_roots_are_found() {
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        for round in 0..2000 {
            let pairs = round % 6;
            let mut real: Vec<f64> = (0..10 - 2 * pairs)
                .map(|_| rng.random_range(-1.0..1.0_f64) * 10_f64.powf(rng.random_range(-1.0..1.0)))
                .collect();
            real.sort_by(f64::total_cmp);
            let complex: Vec<_> = (0..pairs)
                .map(|_| Complex::new(rng.random_range(-2.0..2.0), rng.random_range(0.05..2.0)))
                .collect();
            let p = planted(&real, &complex);
            // Roots closer than this are lost in the rounding of the coefficients.
            if real.windows(2).any(|w| w[1] - w[0] < 1e-2 * w[1].abs().max(0.1)) {
                continue;
            }
            let found = real_roots(&p);
            assert_eq!(found.as_slice().len(), real.len(), "{real:?} {complex:?}");
            for (x, y) in found.as_slice().iter().zip(&real) {
                assert!((x - y).abs() < 1e-6 * (1.0 + y.abs()), "{x} {y}");
            }
            let mut out = [Complex::from(0.0); 11];
            let n = complex_roots(&p, found.as_slice(), &mut out);
            assert_eq!(n, pairs);
            for z in &complex {
                let nearest = out[..n].iter().map(|w| (w - z).norm()).fold(f64::INFINITY, f64::min);
                assert!(nearest < 1e-4, "{z} is off by {nearest:e}");
            }
        }
    }

    #[test]
    fn a_chain_that_loses_its_digits_says_so() {
        // Of a noisy five-point problem. The leading terms of its first two members nearly cancel, and the chain counts two
        // of the four real roots, near −1.3224, −1.3032, 0.3016 and 0.7417.
        let p = [
            20.410_937_491_442_69,
            -11.526_383_629_997_055,
            -145.592_640_071_085_58,
            -176.159_648_712_850_13,
            30.516_545_741_724_837,
            256.736_337_101_047_35,
            282.053_204_553_523_24,
            164.169_041_260_380_2,
            56.864_489_112_105_495,
            11.241_241_541_789_88,
            1.0,
        ];
        let found = real_roots(&p);
        assert!(found.close && found.as_slice().len() <= 4);
        let apart = planted(
            &[-2.0, -1.0, 0.5, 3.0],
            &[Complex::i(), Complex::new(1.0, 2.0), Complex::new(-1.0, 0.5)],
        );
        assert!(!real_roots(&apart).close);
    }

    #[test]
    fn roots_without_end() {
        // A leading coefficient of zero, an exact double root, NaN: no panic, and not certain.
        let mut p =
            planted(&[-2.0, -1.0, 0.5, 3.0], &[Complex::new(0.0, 1.0), Complex::new(1.0, 2.0), Complex::i()]);
        assert!(real_roots(&p).as_slice().len() >= 4);
        p[10] = 0.0;
        assert!(!real_roots(&p).certain);
        p[3] = f64::NAN;
        assert!(!real_roots(&p).certain);
        assert!(!real_roots(&[0.0; 11]).certain);
    }
}
