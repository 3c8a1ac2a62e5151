//! The solutions of five matches: from the null space of their constraints to motions.

use nalgebra::Complex;

use crate::algebra::number::TwoComplex;
use crate::algebra::polynomial::{RealRoots, complex_roots, real_roots};
use crate::algebra::vectors::abreast::{abreast, is_wide};
use crate::algebra::vectors::lane::MAX_F64_LANES;
use crate::algebra::vectors::two::{Two, TwoQuaternions};
use crate::solver::Kinds;
use crate::solver::quest::cubics::{combine, ten_cubics};
use crate::solver::shared::essential::{decomposed, real_part, twisted};
use crate::solver::shared::newton_pair::{TwoMotions, after, normalized};
use crate::solver::shared::parallax_frame::{Alignment, Coordinates};
use crate::solver::shared::resultant::Resultant;
use crate::solver::shared::roots_abreast::{SolveRoots, Solved};
use crate::solver::shared::shortlist::Shortlist;
use crate::{CandidateKind, Correspondence, Degeneracy};

/// Adds the solutions of five matches.
pub(crate) fn from_five(
    kinds: Kinds,
    alignment: &Alignment,
    matches: &[Correspondence; 5],
    shortlist: &mut Shortlist,
) -> Result<(), Degeneracy> {
    let mut basis = alignment.null_space(matches)?;
    for mixing in MIXINGS {
        shortlist.retain(CandidateKind::Exact);
        let roots = Roots::new(&basis, alignment);
        let complete = roots.push_real(matches, shortlist);
        // Where the roots are in doubt, two real ones may have become complex.
        if kinds == Kinds::All || !complete {
            roots.complex(|q_21, nearly_real| {
                let two = TwoMotions::of_rotations(q_21, matches);
                if nearly_real {
                    shortlist.push_solutions(&two, 2, alignment, matches);
                } else if kinds == Kinds::All {
                    for motion in two.apart().into_iter().flatten() {
                        shortlist.push(CandidateKind::FromComplex, motion);
                    }
                }
            });
        }
        // Every real root is an essential matrix of its own.
        if complete && shortlist.count(CandidateKind::Exact) >= 2 * roots.real.as_slice().len() {
            break;
        }
        basis = mixed(&basis, &mixing);
    }
    Ok(())
}

/// The exact motions of five matches on their own.
pub(crate) fn motions_of_five(matches: &[Correspondence; 5]) -> Option<Shortlist> {
    let alignment = Alignment::new(matches);
    if alignment.is_pure_rotation() {
        return None;
    }
    let mut shortlist = Shortlist::of_five(&alignment);
    from_five(Kinds::Exact, &alignment, matches, &mut shortlist).ok().map(|()| shortlist)
}

/// A double root is known to the square root of rounding; times what the elimination loses. With little parallax rounding is that
/// of the direction of the translation.
const NEARLY_REAL: f64 = 1e-4;

/// With less parallax than this the rounding of the bearings leaves the direction of the translation open to 1e-7, and decides
/// more often what is real.
const SMALL_PARALLAX: f64 = 1e-6;

/// An elimination that comes this close to singular has lost five digits; clusters of roots lose the others. One noisy problem in
/// five hundred is.
const SMALL_PIVOT: f64 = 2e-5;

/// Orthogonal changes of the null space's basis, for another attempt where the first did badly: the last
/// basis vector may be absent from a solution, which puts its root at infinity.
pub(crate) const MIXINGS: [[[f64; 4]; 4]; 2] = [
    [[0.5, 0.5, 0.5, 0.5], [0.5, -0.5, 0.5, -0.5], [0.5, 0.5, -0.5, -0.5], [0.5, -0.5, -0.5, 0.5]],
    [[0.8, 0.0, 0.6, 0.0], [0.0, 0.28, 0.0, 0.96], [-0.6, 0.0, 0.8, 0.0], [0.0, -0.96, 0.0, 0.28]],
];

pub(crate) fn mixed(basis: &[Coordinates; 4], mixing: &[[f64; 4]; 4]) -> [Coordinates; 4] {
    mixing.map(|row| combine(basis, &row))
}

/// The essential matrices of a null space, as roots of its polynomial.
pub(crate) struct Roots<'a> {
    basis: &'a [Coordinates; 4],
    alignment: &'a Alignment,
    resultant: Resultant,
    polynomial: [f64; 11],
    real: RealRoots<11>,
}

impl<'a> Roots<'a> {
    pub(crate) fn new(basis: &'a [Coordinates; 4], alignment: &'a Alignment) -> Self {
        let (resultant, pivot) = Resultant::new(&mut ten_cubics(basis, alignment.parallax));
        let polynomial = resultant.polynomial();
        let mut real = real_roots(&polynomial);
        real.certain &= pivot > SMALL_PIVOT && !real.close && alignment.parallax > SMALL_PARALLAX;
        Self { basis, alignment, resultant, polynomial, real }
    }

    /// Adds the solutions of the real roots. Whether every root was found and led to one.
    fn push_real(&self, matches: &[Correspondence; 5], shortlist: &mut Shortlist) -> bool {
        if !is_wide() {
            return self.real(|two, count| shortlist.push_solutions(two, count, self.alignment, matches));
        }
        let (mut complete, mut out) = (self.real.certain, Solved::new());
        for z in self.real.as_slice().chunks(MAX_F64_LANES) {
            abreast(self.solving(z, matches, &mut out));
            for k in 0..z.len() {
                complete &= shortlist.push_solved(|| out.start(k), out.solution(k));
            }
        }
        complete
    }

    /// The work that leads from some of the real roots to solutions.
    fn solving<'b>(
        &'b self,
        z: &'b [f64],
        matches: &'b [Correspondence; 5],
        out: &'b mut Solved,
    ) -> SolveRoots<'b> {
        let Self { basis, alignment, resultant: equations, .. } = self;
        SolveRoots { basis, alignment, equations, z, matches, out }
    }

    /// Hands over the motions of the real roots, with one of the two rotations of each: two at a time, and how many of them
    /// count. Whether every root was found and `accept` took all its motions.
    pub(crate) fn real(&self, mut accept: impl FnMut(&TwoMotions, usize) -> bool) -> bool {
        let mut complete = self.real.certain;
        for roots in self.real.as_slice().chunks(2) {
            let z = Two::new([roots[0], roots[roots.len() - 1]]);
            let coordinates = combine(self.basis, &self.resultant.point(z));
            let motions = TwoMotions::of_essential(&self.alignment.essential(&coordinates));
            complete &= accept(&motions.after(&self.alignment.q0_21), roots.len());
        }
        complete
    }

    /// Hands over the real parts of both rotations of each complex pair of roots, and whether the pair may be two real
    /// ones that rounding has joined.
    pub(crate) fn complex(&self, mut accept: impl FnMut(&TwoQuaternions, bool)) {
        let nearly_real = NEARLY_REAL.max((10.0 * self.alignment.direction_resolution()).sqrt());
        let mut roots = [Complex::from(0.0); 11];
        let count = complex_roots(&self.polynomial, self.real.as_slice(), &mut roots);
        for roots in roots[..count].chunks(2) {
            let z = TwoComplex::new([roots[0], roots[roots.len() - 1]]);
            let coordinates = combine(self.basis, &self.resultant.point(z));
            let (q, t) = decomposed(&self.alignment.essential(&coordinates));
            let twins = [real_part(q), real_part(twisted(&q, &t))].map(|q| q.map(Two::to_array));
            for (k, z) in roots.iter().enumerate() {
                let q = std::array::from_fn(|i| Two::new([twins[0][i][k], twins[1][i][k]]));
                let q_21 = after(&normalized(&q), &self.alignment.q0_21);
                accept(&q_21, z.im < nearly_real * (1.0 + z.re.abs()));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::algebra::vectors::abreast::{Wide, Work};
    use crate::algebra::vectors::instructions::{Instructions, Token};
    use crate::algebra::vectors::two::TwoLanes;
    use crate::simulate::{Scene, SceneOptions};
    use crate::solver::shared::motion::Motion;

    #[test]
    fn solutions_are_those_of_two_motions_side_by_side() {
        let tokens = [Instructions::Avx2, Instructions::Avx512].map(Token::new);
        let mut count = 0;
        for index in 0..1_000 {
            let noise_px = if index % 2 == 0 { 0.75 } else { 0.0 };
            let options = SceneOptions { points: 5, noise_px, ..SceneOptions::realistic() };
            let matches = Scene::generate(&options, 21, index).unwrap().matches;
            let matches: [Correspondence; 5] = matches.try_into().unwrap();
            let alignment = Alignment::new(&matches);
            let basis = alignment.null_space(&matches).unwrap();
            let roots = Roots::new(&basis, &alignment);
            let mut expected = Vec::new();
            roots.real(|two, count| {
                expected.extend(two.solutions(&alignment, &matches).into_iter().take(count));
                true
            });
            for z in roots.real.as_slice().chunks(MAX_F64_LANES) {
                let rest = expected.split_off(z.len());
                for token in tokens.into_iter().flatten().map(Some).chain([None]) {
                    let mut out = Solved::new();
                    let work = roots.solving(z, &matches, &mut out);
                    match token {
                        Some(token) => token.run(Wide(work)),
                        None => work.run(TwoLanes),
                    }
                    for (k, expected) in expected.iter().enumerate() {
                        let found = out.solution(k);
                        assert_eq!(found.is_some(), expected.is_some(), "{token:?}, scene {index}");
                        let (Some(found), Some(expected)) = (found, expected) else { continue };
                        let is_near = |m: Motion| {
                            let (p, q) = (m.q_21.coords, expected.q_21.coords);
                            (p - q).norm().min((p + q).norm()) < 1e-10
                        };
                        assert!(is_near(found) || is_near(found.twisted()), "{token:?}, scene {index}");
                        assert!(found.direction.cross(&expected.direction).norm() < 1e-10);
                        count += 1;
                    }
                }
                expected = rest;
            }
        }
        assert!(count > 4_000, "{count}");
    }
}
