//! Complex roots of a polynomial whose real ones are known: by Laguerre's method, the last four in closed form.

use nalgebra::Complex;

use super::MAX_STEPS;
use crate::algebra::number::{Number, TwoComplex};

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
