//! Rotations and translations in columns, for registers of any width to load.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::algebra::vectors::geometry;
use crate::algebra::vectors::lane::{F, Float, Lanes, MAX_F64_LANES};

/// As many as the widest register holds.
pub(crate) type Column = [f64; MAX_F64_LANES];

/// Unit quaternions, scalar first, each with a vector.
#[derive(Clone, Copy)]
pub(crate) struct MotionColumns {
    q_21: [Column; 4],
    t_21: [Column; 3],
}

impl MotionColumns {
    pub(crate) const fn new() -> Self {
        Self { q_21: [[0.0; MAX_F64_LANES]; 4], t_21: [[0.0; MAX_F64_LANES]; 3] }
    }

    /// The motion in place `k`.
    #[inline]
    pub(crate) fn get(&self, k: usize) -> (UnitQuaternion<f64>, Vector3<f64>) {
        let [w, x, y, z] = self.q_21.each_ref().map(|column| column[k]);
        let q_21 = UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z));
        (q_21, Vector3::from(self.t_21.each_ref().map(|column| column[k])))
    }

    /// Puts a motion into place `k`.
    #[inline]
    pub(crate) fn set(&mut self, k: usize, q_21: &UnitQuaternion<f64>, t_21: &Vector3<f64>) {
        for (column, x) in self.q_21.iter_mut().zip([q_21.w, q_21.i, q_21.j, q_21.k]) {
            column[k] = x;
        }
        for (column, x) in self.t_21.iter_mut().zip(t_21.iter()) {
            column[k] = *x;
        }
    }

    /// The motions from place `first` on.
    #[inline(always)]
    pub(crate) fn load<L: Lanes<f64>>(
        &self,
        lanes: L,
        first: usize,
    ) -> (geometry::Quaternion<L>, geometry::Vector3<L>) {
        let (mut q_21, mut t_21) = ([lanes.splat(0.0); 4], [lanes.splat(0.0); 3]);
        for i in 0..4 {
            q_21[i] = lanes.load(&self.q_21[i][first..]);
        }
        for i in 0..3 {
            t_21[i] = lanes.load(&self.t_21[i][first..]);
        }
        (q_21, t_21)
    }

    /// Writes motions from place `first` on.
    #[inline(always)]
    pub(crate) fn store<L: Lanes<f64>>(&mut self, first: usize, q_21: &[F<L>; 4], t_21: &[F<L>; 3]) {
        for i in 0..4 {
            q_21[i].store(&mut self.q_21[i][first..]);
        }
        for i in 0..3 {
            t_21[i].store(&mut self.t_21[i][first..]);
        }
    }
}
