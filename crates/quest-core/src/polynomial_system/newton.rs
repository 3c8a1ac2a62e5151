//! Newton's iteration on the equations, in the least-squares sense where there are more than unknowns.

use faer::{Mat, c64};

use super::SolveError;
use super::system::System;

/// Steps enough for a multiple solution, which each only halves the error of.
const STEPS: usize = 30;

/// An approximate solution after Newton's iteration.
#[derive(Clone, Debug)]
pub(super) struct Polished {
    pub(super) x: Vec<c64>,
    pub(super) residual: f64,
    /// The smallest singular value of the derivatives over the largest: small where solutions run together.
    pub(super) regularity: f64,
}

/// Improves a solution as long as its residual falls. Of homogeneous equations the step is taken across the solution, whose
/// scale is free.
pub(super) fn polish(system: &System, start: Vec<c64>, homogeneous: bool) -> Result<Polished, SolveError> {
    let mut x = start;
    let mut residual = system.residual(&x);
    let mut regularity = 0.0;
    for _ in 0..STEPS {
        let (step, ratio) = step(system, &x, homogeneous)?;
        regularity = ratio;
        let mut next: Vec<c64> = x.iter().zip(&step).map(|(x, dx)| x - dx).collect();
        if homogeneous {
            normalize(&mut next);
        }
        let improved = system.residual(&next);
        // Not a number is no improvement either.
        if improved.is_nan() || improved >= residual {
            break;
        }
        x = next;
        residual = improved;
    }
    Ok(Polished { x, residual, regularity })
}

/// Scales to norm 1 with the largest component real and positive.
pub(super) fn normalize(x: &mut [c64]) {
    let norm = x.iter().map(c64::norm_sqr).sum::<f64>().sqrt();
    let largest = x.iter().fold(c64::ZERO, |a, b| if b.norm() > a.norm() * (1.0 + 1e-9) { *b } else { a });
    if norm > 0.0 {
        let factor = largest.conj() / largest.norm() / norm;
        for c in x.iter_mut() {
            *c *= factor;
        }
    }
}

/// The step `J⁺ f`, and the ratio of the extreme singular values of `J`. The equations are scaled by the size of their terms
/// and the unknowns by their values, so that both mean something.
fn step(system: &System, x: &[c64], homogeneous: bool) -> Result<(Vec<c64>, f64), SolveError> {
    let equations = system.equations();
    let (n, m) = (x.len(), equations.len() + usize::from(homogeneous));
    let largest = x.iter().map(|c| c.norm()).fold(f64::MIN_POSITIVE, f64::max);
    let unit = |k: usize| x[k].norm().max(1e-3 * largest);
    let mut jacobian = Mat::<c64>::zeros(m.max(n), n);
    let mut values = Mat::<c64>::zeros(m.max(n), 1);
    for (i, f) in equations.iter().enumerate() {
        let gradient = f.gradient(x);
        let size = (0..n).map(|k| gradient[k].norm() * unit(k)).fold(0.0, f64::max);
        let scale = if size > 0.0 { 1.0 / size } else { 1.0 };
        values[(i, 0)] = f.evaluate(x) * scale;
        for k in 0..n {
            jacobian[(i, k)] = gradient[k] * (scale * unit(k));
        }
    }
    if homogeneous {
        for k in 0..n {
            jacobian[(m - 1, k)] = x[k].conj() * (unit(k) / largest);
        }
    }
    let svd = jacobian.thin_svd().map_err(|_| SolveError::NoConvergence)?;
    let s = svd.S().column_vector();
    let mut coordinates = svd.U().adjoint() * &values;
    for k in 0..n {
        let value = s[k].re;
        coordinates[(k, 0)] = if value > 0.0 { coordinates[(k, 0)] / value } else { c64::ZERO };
    }
    let step = svd.V() * coordinates;
    let ratio = if s[0].re > 0.0 { s[n - 1].re / s[0].re } else { 0.0 };
    Ok(((0..n).map(|k| step[(k, 0)] * unit(k)).collect(), ratio))
}
