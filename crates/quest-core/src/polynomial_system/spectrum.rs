//! From the null space to the solutions: (19) to (25), `W_l W_0†` and its eigenvectors.

use faer::{Mat, c64};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::moments::Functionals;
use super::rank::{RankDecision, Ranked, Rule};
use super::{Options, SolveError};

/// The homogeneous coordinates of all solutions: the values of the generators, of any common scale.
pub(super) struct Spectrum {
    pub(super) coordinates: Vec<Vec<c64>>,
    pub(super) w_0: RankDecision,
}

/// The solutions that functionals are the moments of; `Err` with the rank of `W_0` where that does not tell them apart.
pub(super) fn spectrum(
    functionals: &Functionals,
    options: &Options,
) -> Result<Result<Spectrum, RankDecision>, SolveError> {
    let count = functionals.count();
    let shifts = functionals.shifts()?;
    let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
    // The paper's W_0 belongs to the constant 1, which is zero at solutions at infinity; that of a generic combination
    // of the generators is zero at none.
    let w_0 = Ranked::new(combination(&shifts, &mut rng).as_ref(), Rule::drop_below(options.zero))?;
    if w_0.decision.rank < count {
        return Ok(Err(w_0.decision));
    }
    let actions: Vec<Mat<f64>> = shifts.iter().map(|w_l| w_0.solve(w_l)).collect();
    // The matrices commute: eigenvectors of a generic combination are eigenvectors of each, also where some of them have
    // one eigenvalue for several solutions.
    let eigen = combination(&actions, &mut rng).eigen().map_err(|_| SolveError::NoConvergence)?;
    let r = eigen.U();
    let coordinates = (0..count).map(|k| {
        let r: Vec<c64> = r.col(k).iter().copied().collect();
        let square: f64 = r.iter().map(c64::norm_sqr).sum();
        actions.iter().map(|a| rayleigh(a, &r) / square).collect()
    });
    Ok(Ok(Spectrum { coordinates: coordinates.collect(), w_0: w_0.decision }))
}

/// A combination of matrices with weights of the normal distribution.
fn combination(matrices: &[Mat<f64>], rng: &mut ChaCha8Rng) -> Mat<f64> {
    let (rows, columns) = matrices.first().map_or((0, 0), Mat::shape);
    let mut sum = Mat::zeros(rows, columns);
    for matrix in matrices {
        let weight: f64 = StandardNormal.sample(rng);
        sum += matrix * faer::Scale(weight);
    }
    sum
}

/// `rᴴ A r`.
fn rayleigh(a: &Mat<f64>, r: &[c64]) -> c64 {
    let mut sum = c64::ZERO;
    for (j, r_j) in r.iter().enumerate() {
        let column = a.col(j);
        let image = r.iter().zip(column.iter()).fold(c64::ZERO, |sum, (r_i, a)| sum + r_i.conj() * *a);
        sum += image * r_j;
    }
    sum
}
