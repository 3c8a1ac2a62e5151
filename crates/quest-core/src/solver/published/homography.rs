//! `homography`: the motions of a plane, by
//!
//! Y. Ma, S. Soatto, J. Košecká, S. Sastry, *An invitation to 3-D vision*, Springer 2004, section 5.3 (algorithm 5.2),
//!
//! the same four as those of E. Malis, M. Vargas, *Deeper understanding of the homography decomposition for vision-based
//! control*, INRIA research report 6303, 2007, with the normalised linear estimate of
//! R. I. Hartley, A. Zisserman, *Multiple view geometry in computer vision*, second edition 2004, algorithm 4.2.
//!
//! **Problem.** Rotation and translation from four or more matches of points on one plane.
//!
//! **Steps**:
//! 1. The homography `x2 ∝ H x1` of four matches in closed form. Each view has a matrix that takes the coordinate axes to
//!    three of the bearings and `(1, 1, 1)` to the fourth; `H` is that of view 2 times the inverse of that of view 1.
//! 2. For more: normalise each view (`normalisation.rs`: for bearings, on a plane `z = 1` or not); each match gives the two rows of
//!    `x2 × H x1 = 0` across `x2`; the direction with the smallest sum of squares, by their Gram matrix; undo the normalisation.
//! 3. Divide by the middle singular value: `H = R + t nᵀ` up to sign, `n` the normal over the distance of the plane.
//! 4. With `Hᵀ H = V diag(σ1², 1, σ3²) Vᵀ`, two directions `u` next to `v2` keep their length under `H`, so that the frame
//!    `v2, u, v2 × u` goes to `H v2, H u, H v2 × H u` by a rotation, with `v2 × u` the normal.
//! 5. The translation `t = (H − R)(v2 × u)` of each. The sign of `H` is open where points may lie behind a camera:
//!    `−H = R' + t n'ᵀ` with `R'` the rotation turned by 180° about `t`, as for every essential matrix.
//!
//! These are four motions up to the sign of `t`, which the depths decide; those with most points in front come first, usually
//! two. A third view, or a point off the plane, decides between them. The normals are not returned: a candidate is a
//! pose, and the plane follows from its depths.
//!
//! No candidate is refined. All are [`Exact`](crate::CandidateKind::Exact), the residual says how well they fit: for
//! points that are not coplanar, badly.
//!
//! **Degenerate**: fewer than four points with no three on a line; an exact pure rotation, for which `H = R` and there is
//! no plane. Where the translation is along the normal the two motions are one, with half of its digits.
//!
//! **Solutions**: two essential matrices, four motions.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use crate::algebra::symmetric::eigen_3;
use crate::degeneracy::diagnose_fewer_than;
use crate::epipolar_frame::tangent_basis;
use crate::solver::published::least_squares::{null_vector, outer};
use crate::solver::published::normalisation::Normalisation;
use crate::solver::shared::motion::Motion;
use crate::solver::shared::parallax_frame::DEPENDENT;
use crate::solver::shared::shortlist::{Shortlist, is_answered};
use crate::solver::{Kinds, PoseSolver};
use crate::{CandidateKind, Candidates, Correspondence};

/// The motions of a plane; the steps stand at the head of the module.
#[derive(Clone, Copy, Debug, Default)]
pub struct Homography;

impl PoseSolver for Homography {
    const NAME: &'static str = "homography";
    const MIN_MATCHES: usize = 4;

    fn solve(&self, matches: &[Correspondence], out: &mut Candidates) {
        if is_answered(Self::MIN_MATCHES, matches, out) {
            return;
        }
        let Some(homography) = homography(matches) else {
            return out.set_degeneracy(diagnose_fewer_than(Self::MIN_MATCHES, matches));
        };
        let mut shortlist = Shortlist::new();
        for motion in motions(&homography).into_iter().flatten() {
            shortlist.push_pair(CandidateKind::Exact, motion);
        }
        shortlist.write(Kinds::Exact, matches, out);
    }
}

/// The matrix `H` with `x2 ∝ H x1`, of any scale; `None` where the matches leave more than one.
fn homography(matches: &[Correspondence]) -> Option<Matrix3<f64>> {
    if let Ok(four) = matches.try_into() {
        return of_four(four);
    }
    let view1 = Normalisation::new(matches.iter().map(Correspondence::bearing1));
    let view2 = Normalisation::new(matches.iter().map(Correspondence::bearing2));
    let rows = matches.iter().flat_map(|m| {
        let x1 = view1.transform * m.bearing1();
        let across = tangent_basis(&(view2.transform * m.bearing2()).normalize());
        across.map(|direction| outer(&direction, &x1))
    });
    let normalised = null_vector(2 * matches.len(), rows)?;
    Some(view2.inverse * Matrix3::from_row_slice(&normalised) * view1.transform)
}

/// The homography of four matches: with `a`, `b` the bearings,
/// `Σ b_i (a_j × a_k)ᵀ det[b_4 b_j b_k] / det[a_4 a_j a_k]` over the cyclic orders of the first three.
fn of_four(matches: &[Correspondence; 4]) -> Option<Matrix3<f64>> {
    let (view1, view2) =
        (Frame::new(matches.map(|m| *m.bearing1()))?, Frame::new(matches.map(|m| *m.bearing2()))?);
    let term = |i: usize| view2.axes[i] * view1.across[i].transpose() * (view2.shares[i] / view1.shares[i]);
    Some(term(0) + term(1) + term(2))
}

/// Four bearings as a projective frame.
struct Frame {
    axes: [Vector3<f64>; 3],
    /// `a_j × a_k`.
    across: [Vector3<f64>; 3],
    /// `det[a_4 a_j a_k]`: the fourth bearing in the basis of the others, times their determinant.
    shares: [f64; 3],
}

impl Frame {
    /// `None` where three of the bearings lie in a plane.
    fn new([a, b, c, d]: [Vector3<f64>; 4]) -> Option<Self> {
        let across = [b.cross(&c), c.cross(&a), a.cross(&b)];
        let shares = across.map(|n| n.dot(&d));
        let smallest = shares.iter().fold(across[0].dot(&a).abs(), |least, share| least.min(share.abs()));
        // Areas against the square of the extent.
        let extent = [b - a, c - a, d - a].iter().fold(0.0_f64, |most, x| most.max(x.norm_squared()));
        (smallest > DEPENDENT * extent).then_some(Self { axes: [a, b, c], across, shares })
    }
}

/// The motions of the plane that explains all matches to `tolerance` (radians), if there is one.
pub(crate) fn motions_of_plane(matches: &[Correspondence], tolerance: f64) -> [Option<Motion>; 2] {
    let Some(h) = homography(matches) else { return [None; 2] };
    let explains = |m: &Correspondence| {
        let x2 = h * m.bearing1();
        x2.cross(m.bearing2()).norm() < tolerance * x2.norm()
    };
    if matches.iter().all(explains) { motions(&h) } else { [None; 2] }
}

/// A middle singular value this small against the largest one leaves no digit of its direction: the squares are decomposed.
const RANK_ONE: f64 = 1e-7;

/// One motion of each of the two essential matrices of a plane; none for a rotation alone.
pub(crate) fn motions(h: &Matrix3<f64>) -> [Option<Motion>; 2] {
    let ([largest, middle, smallest], [v1, v2, v3]) = eigen_3(&h.tr_mul(h));
    // Of rank one, as far as can be told: it takes all points to the same one.
    if middle <= RANK_ONE * RANK_ONE * largest {
        return [None; 2];
    }
    let h = h / middle.sqrt();
    // Rounding may put them on the wrong side of one.
    let (a, c) = ((1.0 - smallest / middle).max(0.0).sqrt(), (largest / middle - 1.0).max(0.0).sqrt());
    [c, -c].map(|c| {
        let u = (v1 * a + v3 * c).try_normalize(0.0)?;
        let normal = v2.cross(&u);
        let (image2, image_u) = (h * v2, h * u);
        let before = Matrix3::from_columns(&[v2, u, normal]);
        let after = Matrix3::from_columns(&[image2, image_u, image2.cross(&image_u)]);
        let r_21 = after * before.transpose();
        let direction = ((h - r_21) * normal).try_normalize(0.0)?;
        let q_21 = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(r_21));
        Some(Motion { q_21: UnitQuaternion::new_normalize(q_21.into_inner()), direction })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planted_motion_is_one_of_them() {
        let planted = Motion {
            q_21: UnitQuaternion::new(Vector3::new(0.3, -0.2, 0.9)),
            direction: Vector3::new(0.6, 0.0, -0.8),
        };
        for normal in [Vector3::new(0.1, 0.3, 0.5), Vector3::new(-0.4, 0.2, 0.1)] {
            for sign in [1.0, -1.0] {
                let r_21 = planted.q_21.to_rotation_matrix().into_inner();
                let h = (r_21 + planted.direction * 0.7 * normal.transpose()) * (2.5 * sign);
                let found = motions(&h).map(Option::unwrap);
                let same = |m: &Motion| m.is_close(&planted, 1e-7) || m.twisted().is_close(&planted, 1e-7);
                assert!(found.iter().any(same));
                // Both explain the matrix: E x1 is orthogonal to H x1 for every x1.
                for motion in found {
                    let product = motion.essential().transpose() * h;
                    assert!((product + product.transpose()).norm() < 1e-14 * h.norm());
                }
            }
        }
    }

    #[test]
    fn rotations_and_matrices_of_rank_one_have_no_motion() {
        assert!(motions(&Matrix3::identity()).iter().all(Option::is_none));
        assert!(motions(&Matrix3::from_element(1.0)).iter().all(Option::is_none));
        assert!(motions(&Matrix3::zeros()).iter().all(Option::is_none));
    }

    #[test]
    fn the_plane_that_explains_all_matches_has_its_motions_and_any_other_none() {
        let truth = Motion {
            q_21: UnitQuaternion::new(Vector3::new(0.1, -0.2, 0.3)),
            direction: Vector3::new(0.6, 0.0, 0.8),
        };
        let places = [[0.1, 0.2], [-0.3, 0.1], [0.2, -0.4], [-0.1, -0.2], [0.4, 0.3], [0.0, 0.35]];
        let seen = |[u, v]: [f64; 2], off: f64| {
            // On the plane z = 2 + x / 4.
            let x1 = Vector3::new(u, v, 1.0) * (2.0 / (1.0 - 0.25 * u) + off);
            let x2 = truth.q_21 * x1 + truth.direction * 0.5;
            Correspondence::from_bearings(x1.into(), x2.into()).unwrap()
        };
        let flat = places.map(|place| seen(place, 0.0));
        let found = motions_of_plane(&flat, 1e-9).map(Option::unwrap);
        assert!(found.iter().any(|m| m.is_close(&truth, 1e-7) || m.twisted().is_close(&truth, 1e-7)));
        // One point beside the plane.
        let mut relief = flat;
        relief[3] = seen(places[3], 0.5);
        assert!(motions_of_plane(&relief, 1e-3).iter().all(Option::is_none));
        // Points on a line, of which many planes are.
        let line: Vec<_> = (0..6).map(|k| seen([0.1 * f64::from(k), 0.05 * f64::from(k)], 0.0)).collect();
        assert!(motions_of_plane(&line, 1e-9).iter().all(Option::is_none));
    }
}
