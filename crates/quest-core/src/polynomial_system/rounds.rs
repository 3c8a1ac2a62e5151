//! One round of relinearisation: whether its functionals are the moments of all solutions, and these.

use faer::c64;

use super::moments::Functionals;
use super::monomials::Grading;
use super::newton::{Polished, normalize, polish};
use super::rank::RankDecision;
use super::solution::Solution;
use super::spectrum::spectrum;
use super::system::System;
use super::{Options, SolveError};

/// A polished solution solves the equations to rounding, which several that run together magnify little.
const SOLVED: f64 = 1e-9;

/// A solution of which the coordinate that is 1 in the others is below this part of all lies at infinity. Simple ones there
/// leave 1e-13 or less.
const AT_INFINITY: f64 = 1e-7;

/// Solutions closer than this, relative to their size, are one if they also run together ([`SINGULAR`]): a double one is known to
/// the root of the rounding.
const TOGETHER: f64 = 1e-5;

/// Where the derivatives are closer to dependent than this, solutions run together.
const SINGULAR: f64 = 1e-4;

/// What a round has come to.
pub(super) enum Outcome {
    /// Every solution.
    Found {
        /// Each once, not in order.
        all: Vec<Solution>,
        /// How many functionals are left for solutions at infinity.
        at_infinity: usize,
        /// The rank of `W_0`.
        w_0: RankDecision,
    },
    /// The functionals are those of more than points, or of more points than their degree tells apart.
    NotToldApart {
        /// The rank of `W_0`, or how many eigenvectors are solutions.
        told_apart: usize,
        /// Whether `W_0` has the rank of a finite number of points.
        full_rank: bool,
    },
}

/// The solutions that the functionals of a round are the moments of.
///
/// 1. All of them at once, those at infinity included. That there are as many solutions as functionals is what shows that
///    none is missing.
/// 2. Where that fails, the functionals on polynomials of a lower degree that stops to count for more: those at infinity, which may
///    be a whole curve, only show at the highest degrees.
pub(super) fn outcome(
    system: &System,
    functionals: &Functionals,
    options: &Options,
) -> Result<Outcome, SolveError> {
    let whole = candidates(system, functionals, options)?;
    if let Ok(found) = &whole
        && found.points.len() == functionals.count()
        && let Some(all) = verified(&found.points, options)
    {
        return Ok(Outcome::Found { all, at_infinity: 0, w_0: found.w_0 });
    }
    if functionals.grading.step > 0
        && options.solutions.is_none()
        && let Some(finite) = finite_part(system, functionals, options)?
    {
        return Ok(finite);
    }
    Ok(match whole {
        Err(w_0) => Outcome::NotToldApart { told_apart: w_0.rank, full_rank: false },
        Ok(found) => {
            if let Some(all) = verified(&found.points, options) {
                let at_infinity = functionals.count() - found.points.len();
                Outcome::Found { all, at_infinity, w_0: found.w_0 }
            } else {
                let told_apart = found.points.iter().filter(|p| p.residual < SOLVED).count();
                Outcome::NotToldApart { told_apart, full_rank: true }
            }
        }
    })
}

/// The solutions of the lowest degree, not below that of the equations, at which the number of functionals does not grow.
fn finite_part(
    system: &System,
    functionals: &Functionals,
    options: &Options,
) -> Result<Option<Outcome>, SolveError> {
    let rise = functionals.grading.rise();
    let lowest = system.degree().next_multiple_of(rise) - rise;
    let mut before = functionals.restricted(lowest, options.zero)?.1.rank;
    for degree in (lowest + rise..=functionals.degree).step_by(rise) {
        let (restricted, decision) = functionals.restricted(degree, options.zero)?;
        let unchanged = decision.rank == before;
        before = decision.rank;
        if !unchanged {
            continue;
        }
        if let Ok(found) = candidates(system, &restricted, options)?
            && found.points.len() == decision.rank
            && let Some(all) = verified(&found.points, options)
        {
            let at_infinity = functionals.count() - decision.rank;
            return Ok(Some(Outcome::Found { all, at_infinity, w_0: found.w_0 }));
        }
    }
    Ok(None)
}

/// Polished solutions, those at infinity left out.
struct Candidates {
    points: Vec<Polished>,
    w_0: RankDecision,
}

fn candidates(
    system: &System,
    functionals: &Functionals,
    options: &Options,
) -> Result<Result<Candidates, RankDecision>, SolveError> {
    let grading = functionals.grading;
    let spectrum = match spectrum(functionals, options)? {
        Ok(spectrum) => spectrum,
        Err(w_0) => return Ok(Err(w_0)),
    };
    let points = spectrum.coordinates.iter().filter_map(|coordinates| point(grading, coordinates));
    let polished = points.map(|x| polish(system, x, grading.step == 0)).collect::<Result<_, _>>()?;
    Ok(Ok(Candidates { points: polished, w_0: spectrum.w_0 }))
}

/// The unknowns from the values of the generators; `None` at infinity.
fn point(grading: Grading, coordinates: &[c64]) -> Option<Vec<c64>> {
    let norm = coordinates.iter().map(c64::norm_sqr).sum::<f64>().sqrt();
    if grading.step == 0 {
        let mut x = coordinates.to_vec();
        normalize(&mut x);
        return Some(x);
    }
    let (one, values) = coordinates.split_last()?;
    if one.norm() <= AT_INFINITY * norm {
        return None;
    }
    let values: Vec<c64> = values.iter().map(|value| value / one).collect();
    if grading.step == 1 {
        return Some(values);
    }
    Some(root(grading, &values))
}

/// The unknowns from the values of all monomials of degree `g`: the largest from its power, the others from the values of its
/// `(g−1)`-th power times each.
fn root(grading: Grading, values: &[c64]) -> Vec<c64> {
    let (n, g) = (grading.unknowns, grading.step);
    let monomials = super::monomials::of_degree(n, g);
    let value = |k: usize, j: usize| {
        let is_it = |m: &Vec<u8>| {
            (0..n).all(|i| usize::from(m[i]) == (if i == k { g - 1 } else { 0 }) + usize::from(i == j))
        };
        monomials.iter().position(is_it).map_or(c64::ZERO, |place| values[place])
    };
    let largest =
        (1..n).fold(0, |best, k| if value(k, k).norm() > value(best, best).norm() { k } else { best });
    let power = value(largest, largest);
    if power == c64::ZERO {
        return vec![c64::ZERO; n];
    }
    // An odd root of a negative number is real too.
    let is_negative = power.re < 0.0 && power.im.abs() < 1e-9 * power.re.abs() && g % 2 == 1;
    let sign = if is_negative { -1.0 } else { 1.0 };
    let unknown = (power * sign).powf(1.0 / g as f64) * sign;
    (0..n).map(|j| value(largest, j) / power * unknown).collect()
}

/// The solutions, those that run together once; `None` where one does not solve the system, or is there twice without being
/// a multiple one: then another is missing.
fn verified(points: &[Polished], options: &Options) -> Option<Vec<Solution>> {
    // Where the number of solutions is given they are those of least squares.
    let solved =
        |p: &Polished| p.residual < SOLVED || (options.solutions.is_some() && p.residual.is_finite());
    if !points.iter().all(solved) {
        return None;
    }
    let mut all: Vec<(Solution, bool)> = Vec::new();
    for point in points {
        let singular = point.regularity < SINGULAR;
        let known = all.iter_mut().find(|(other, _)| distance(&other.x, &point.x) < TOGETHER);
        match known {
            None => {
                let solution = Solution { x: point.x.clone(), residual: point.residual, multiplicity: 1 };
                all.push((solution, singular));
            }
            Some((other, is_singular)) if singular && *is_singular => other.multiplicity += 1,
            // Simple ones that are near each other and yet apart.
            Some((other, _)) if distance(&other.x, &point.x) > 1e3 * f64::EPSILON / point.regularity => {
                let solution = Solution { x: point.x.clone(), residual: point.residual, multiplicity: 1 };
                all.push((solution, singular));
            }
            Some(_) => return None,
        }
    }
    Some(all.into_iter().map(|(solution, _)| solution).collect())
}

/// The largest difference of an unknown, relative to the largest unknown.
fn distance(a: &[c64], b: &[c64]) -> f64 {
    let size = a.iter().map(|x| x.norm()).fold(1.0, f64::max);
    a.iter().zip(b).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max) / size
}
