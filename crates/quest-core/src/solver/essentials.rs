//! The essential matrices of five matches and nothing else: what a robust estimator needs of a hypothesis that will most
//! likely be thrown away.
//!
//! The steps of [`quest`](super::quest) up to the roots. Nothing is refined, decomposed or completed by depths, and what
//! [`quest`](super::quest) would try again is given up.

use nalgebra::{Matrix3, Vector3};

use super::aligned::Alignment;
use super::cubics::{Resultant, combine};
use crate::Correspondence;
use crate::algebra::polynomial::real_roots;

/// Hands over the real essential matrices of five matches, of any scale; none where they are dependent.
///
/// Matches that a rotation alone explains leave the translation open: they get one direction of it.
pub(crate) fn essentials_of_five(matches: &[Correspondence; 5], mut accept: impl FnMut(Matrix3<f64>)) {
    let alignment = Alignment::new(matches);
    let r0_21 = alignment.q0_21.to_rotation_matrix().into_inner();
    if alignment.is_pure_rotation() {
        return accept(Vector3::<f64>::x().cross_matrix() * r0_21);
    }
    let Ok(basis) = alignment.null_space(matches) else { return };
    let (resultant, _) = Resultant::new(&basis, alignment.parallax);
    for &z in real_roots(&resultant.polynomial()).as_slice() {
        let rows = alignment.essential(&combine(&basis, &resultant.point(z)));
        let e = Matrix3::from_fn(|i, j| rows[i][j]) * r0_21;
        if e.iter().all(|x| x.is_finite()) {
            accept(e);
        }
    }
}
