//! Five matches whose points lie on a line in one of the views, and on none in the other.
//!
//! Among the solutions of the cubics is then a whole curve of complex matrices of rank one, and their elimination breaks down.
//! The essential matrices are found without it. With the bearings `a = α u + β v` of the one view in the plane of `u` and `v`,
//! of unit normal `n`, and those of the other view `b`,
//!
//! ```text
//! bᵀ E a = bᵀ F (α, β)ᵀ = 0,   F = [E u, E v]                     five equations, six unknowns
//! E = f1 uᵀ + f2 vᵀ + w nᵀ,    f1 ⟂ f2 for the right u and v, |f1| ≥ |f2|
//! ```
//!
//! `det E = 0` puts `w` into the plane of `f1` and `f2`, and the two singular values of `E` are the same for
//! `w = ± f2 √(|f1|² / |f2|² − 1)` alone: two essential matrices.

use nalgebra::{Matrix3, Vector3};

use crate::Correspondence;
use crate::algebra::null_space::null_space;
use crate::algebra::symmetric::eigen_3;

/// Rounding of a product of three unit vectors, and some more.
const IN_A_PLANE: f64 = 1e-14;

/// Equations closer to dependent than this, and `f2` shorter than this beside `f1`, determine nothing.
const DEPENDENT: f64 = 1e-11;

/// The two essential matrices of such matches; `None` for all others.
pub(crate) fn essential_matrices(matches: &[Correspondence; 5]) -> Option<[Matrix3<f64>; 2]> {
    let [x1, x2] = [Correspondence::bearing1, Correspondence::bearing2].map(|of| matches.each_ref().map(of));
    match (plane(&x1), plane(&x2)) {
        (Some(frame), None) => of_plane(&frame, &x1, &x2),
        (None, Some(frame)) => of_plane(&frame, &x2, &x1).map(|pair| pair.map(|e| e.transpose())),
        _ => None,
    }
}

/// A frame `u, v, n` with all bearings in the plane of `u` and `v`.
fn plane(bearings: &[&Vector3<f64>; 5]) -> Option<[Vector3<f64>; 3]> {
    let [first, second, others @ ..] = bearings;
    let normal = first.cross(second);
    // Rules out ordinary bearings at little cost.
    if others.iter().any(|x| normal.dot(x).abs() > IN_A_PLANE) {
        return None;
    }
    let moments: Matrix3<f64> = bearings.iter().map(|x| *x * x.transpose()).sum();
    let (_, frame) = eigen_3(&moments);
    let [_, _, n] = frame;
    bearings.iter().all(|x| n.dot(x).abs() <= IN_A_PLANE).then_some(frame)
}

/// The essential matrices with `bᵀ E a = 0`, `a` in the plane of a frame.
fn of_plane(
    [u, v, n]: &[Vector3<f64>; 3],
    a: &[&Vector3<f64>; 5],
    b: &[&Vector3<f64>; 5],
) -> Option<[Matrix3<f64>; 2]> {
    let rows = std::array::from_fn::<_, 5, _>(|i| {
        let (alpha, beta) = (u.dot(a[i]), v.dot(a[i]));
        std::array::from_fn(|k| b[i][k % 3] * if k < 3 { alpha } else { beta })
    });
    let ([[x, y, z, xx, yy, zz]], pivot) = null_space::<5, 6, 1>(&rows);
    if pivot < DEPENDENT {
        return None;
    }
    let f = Vector3::new(x, y, z) * u.transpose() + Vector3::new(xx, yy, zz) * v.transpose();
    // The right u and v are the principal directions of Fᵀ F, and n the last one.
    let (_, [u, v, _]) = eigen_3(&(f.transpose() * f));
    let (f1, f2) = (f * u, f * v);
    let ratio = f1.norm_squared() / f2.norm_squared();
    let w = f2 * (ratio - 1.0).max(0.0).sqrt() * n.transpose();
    (f2.norm() > DEPENDENT * f1.norm()).then(|| [f + w, f - w])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn essential_matrices_of_a_line_have_equal_singular_values() {
        let line =
            [[-0.4, -0.1, 1.0], [-0.1, 0.05, 1.0], [0.0, 0.1, 1.0], [0.3, 0.25, 1.0], [0.5, 0.35, 1.0]];
        let other =
            [[0.3, 0.1, 1.0], [-0.2, 0.25, 1.0], [0.1, -0.4, 1.0], [-0.35, -0.1, 1.0], [0.45, 0.3, 1.0]];
        let matches = |x1: [[f64; 3]; 5], x2: [[f64; 3]; 5]| {
            std::array::from_fn(|k| Correspondence::from_bearings(x1[k], x2[k]).unwrap())
        };
        for matches in [matches(line, other), matches(other, line)] {
            for e in essential_matrices(&matches).unwrap() {
                let singular = e.singular_values();
                assert!((singular[0] - singular[1]).abs() + singular[2] < 1e-14 * singular[0].max(1.0));
                assert!(matches.iter().all(|m| m.bearing2().dot(&(e * m.bearing1())).abs() < 1e-14));
            }
        }
        // The same match twice leaves a constraint less.
        let twice = |[a, b, c, d, _]: [[f64; 3]; 5]| [a, b, c, d, a];
        for matches in [matches(twice(line), twice(other)), matches(twice(other), twice(line))] {
            assert_eq!(essential_matrices(&matches), None);
        }
        assert_eq!(essential_matrices(&matches(line, line)), None);
        assert_eq!(essential_matrices(&matches(other, other)), None);
    }
}
