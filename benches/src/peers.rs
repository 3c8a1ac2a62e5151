//! Solvers of other libraries, with the feature `peers`.
#![cfg(feature = "peers")]

use kornia_algebra::Vec2F64;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion};
use quest_core::{Correspondence, RelativePose};

/// Five points on the planes `z = 1`, as kornia-3d takes them.
pub type KorniaProblem = [[Vec2F64; 5]; 2];

/// The same matches for kornia-3d; `None` unless there are five.
#[must_use]
pub fn kornia_problem(matches: &[Correspondence]) -> Option<KorniaProblem> {
    let five: &[Correspondence; 5] = matches.try_into().ok()?;
    Some([
        five.map(|m| Vec2F64::new(m.bearing1().x / m.bearing1().z, m.bearing1().y / m.bearing1().z)),
        five.map(|m| Vec2F64::new(m.bearing2().x / m.bearing2().z, m.bearing2().y / m.bearing2().z)),
    ])
}

/// The essential matrices that kornia-3d's `essential_5pt` (Nistér's method) finds: no poses.
#[must_use]
pub fn kornia(problem: &KorniaProblem) -> Vec<Matrix3<f64>> {
    let found = kornia_3d::pose::essential_5pt(&problem[0], &problem[1]);
    found.iter().map(|e| Matrix3::from_column_slice(&e.to_cols_array())).collect()
}

/// The distance of the nearest of these matrices to the true one, each of norm 1 and of either sign.
#[must_use]
pub fn essential_error(truth: &RelativePose, found: &[Matrix3<f64>]) -> f64 {
    let truth = truth.essential().normalize();
    let distance = |e: &Matrix3<f64>| (e.normalize() - truth).norm().min((e.normalize() + truth).norm());
    found.iter().map(distance).fold(f64::INFINITY, f64::min)
}

/// The four poses of an essential matrix, `U (W or Wᵀ) Vᵀ` with the last column of U as `±t`.
#[must_use]
pub fn poses(e: &Matrix3<f64>) -> Vec<RelativePose> {
    let svd = e.svd(true, true);
    let (Some(mut u), Some(mut v_t)) = (svd.u, svd.v_t) else { return Vec::new() };
    if u.determinant() < 0.0 {
        u.neg_mut();
    }
    if v_t.determinant() < 0.0 {
        v_t.neg_mut();
    }
    let w = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
    let rotations = [w, w.transpose()].map(|w| u * w * v_t);
    let t: nalgebra::Vector3<f64> = u.column(2).into();
    rotations
        .into_iter()
        .map(|r| UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(r)))
        .flat_map(|q_21| [t, -t].map(|t_21| RelativePose::new(q_21, t_21)))
        .collect()
}
