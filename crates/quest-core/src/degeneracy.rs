//! Why matches do not determine a pose, in the words of a user.

use nalgebra::{Matrix3, SymmetricEigen, Vector3};

use crate::{Correspondence, Degeneracy};

/// Bearings closer than this are taken for the same one. Matches this close leave less than six digits
/// of a constraint in double precision.
const SAME: f64 = 1e-10;

/// Whether the bearings of camera 1 are parallel, in the same direction or the opposite one: a whole circle of rotations
/// aligns them with those of camera 2.
pub(crate) fn all_parallel(matches: &[Correspondence]) -> bool {
    matches.iter().all(|m| m.bearing1().cross(matches[0].bearing1()).norm() < SAME)
}

/// Names the reason why matches give fewer than five independent constraints. Quadratic in their number; called only
/// when the constraints have been found short.
pub(crate) fn diagnose(matches: &[Correspondence]) -> Degeneracy {
    diagnose_fewer_than(5, matches)
}

/// The same for a solver that needs another number of distinct matches.
pub(crate) fn diagnose_fewer_than(needed: usize, matches: &[Correspondence]) -> Degeneracy {
    let same = |x: &Vector3<f64>, y: &Vector3<f64>| (x - y).norm() < SAME;
    let coincident = |bearing: fn(&Correspondence) -> &Vector3<f64>| {
        matches.iter().all(|m| same(bearing(m), bearing(&matches[0])))
    };
    if coincident(Correspondence::bearing1) || coincident(Correspondence::bearing2) {
        return Degeneracy::Coincident;
    }
    let repeated = |i: usize| {
        let twin = |m: &Correspondence| {
            same(m.bearing1(), matches[i].bearing1()) && same(m.bearing2(), matches[i].bearing2())
        };
        matches[..i].iter().any(twin)
    };
    let distinct = (0..matches.len()).filter(|&i| !repeated(i)).count();
    if distinct < needed {
        return Degeneracy::Duplicate;
    }
    let leave_out = |skip: usize| matches.iter().enumerate().filter(move |(i, _)| *i != skip).map(|(_, m)| m);
    if (0..=matches.len()).any(|skip| on_a_line(leave_out(skip))) {
        return Degeneracy::Collinear;
    }
    Degeneracy::RankDeficient
}

/// Whether the points lie on a line in both images: their bearings in a plane through the camera.
fn on_a_line<'a>(matches: impl Iterator<Item = &'a Correspondence>) -> bool {
    let (mut moments1, mut moments2) = (Matrix3::zeros(), Matrix3::zeros());
    for m in matches {
        moments1 += m.bearing1() * m.bearing1().transpose();
        moments2 += m.bearing2() * m.bearing2().transpose();
    }
    [moments1, moments2].iter().all(|m| {
        let values = SymmetricEigen::new(*m).eigenvalues;
        // Squares of distances from the plane: rounding of the moments, far above SAME².
        values.min() < 1e-14 * values.max()
    })
}
