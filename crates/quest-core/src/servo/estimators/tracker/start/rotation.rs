//! The start's rotation: a camera that was only turned.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use rand::RngExt;

use super::judgement::{anywhere, likely};
use super::{POOL, Start, Terms};
use crate::servo::estimators::tracker::resection::{Fit, INLIER, KNEE, Task, resect, residuals};
use crate::{Correspondence, RelativePose};

impl Start {
    /// The rotation that most pairs of matches agree on, fitted.
    pub(super) fn best_rotation(&mut self, sigma: f64, terms: &Terms<'_>) -> Option<Fit> {
        // Where half of the matches are wrong one pair in four is right. All 64 are wrong once in 10⁸ searches.
        const PAIRS: usize = 64;
        let matches = &self.consensus.matches;
        let mut best = (f64::INFINITY, RelativePose::identity());
        for _ in 0..PAIRS {
            let [a, b] = [0; 2].map(|_| self.rng.random_range(0..matches.len()));
            let Some(q_21) = rotation_of_pair(&matches[a], &matches[b]) else { continue };
            let cost = matches
                .iter()
                .map(|m| ((q_21 * m.bearing1() - m.bearing2()).norm_squared() / (sigma * sigma)).min(KNEE))
                .sum::<f64>();
            if cost < best.0 {
                best = (cost, RelativePose::new(q_21, Vector3::zeros()));
            }
        }
        self.fit_rotation(&best.1, terms)
    }

    /// The rotation of the mean image, from one that is about right.
    pub(super) fn fit_rotation(&mut self, about: &RelativePose, terms: &Terms<'_>) -> Option<Fit> {
        let task = Task {
            variance: self.bench.noise * self.mean.variance,
            place_variance: self.bench.noise * terms.task.place_variance,
            depth_variance: Some(0.0),
            is_translation_fixed: true,
            mapped_only: false,
            iterations: 8,
            ..terms.task
        };
        self.pool[POOL].map.forget(terms.goal, terms.known, terms.relief);
        let points = &self.pool[POOL].map.points;
        residuals(points, &self.mean.frame, about, &task, &mut self.squares);
        let mut fit = resect(points, &self.mean.frame, about, &task, &mut self.squares, &mut self.scratch)?;
        residuals(points, &self.mean.frame, &fit.pose, &task, &mut self.squares);
        // The start's features alone, so that all scores are of the same matches.
        let chosen = || self.squares.iter().zip(&self.chosen).filter(|(_, chosen)| **chosen).map(|(s, _)| *s);
        let anywhere = anywhere(self.bench.noise);
        fit.cost = chosen().map(|s| likely(s, anywhere)).sum();
        fit.inliers = chosen().filter(|s| *s < INLIER).count();
        fit.seen = chosen().count();
        Some(fit)
    }
}

/// The rotation that takes two bearings of view 1 to those of view 2; `None` where they are parallel.
fn rotation_of_pair(a: &Correspondence, b: &Correspondence) -> Option<UnitQuaternion<f64>> {
    let frame = |p: &Vector3<f64>, q: &Vector3<f64>| {
        let (along, across) = ((p + q).try_normalize(1e-6)?, p.cross(q).try_normalize(1e-4)?);
        Some(Matrix3::from_columns(&[along, across.cross(&along), across]))
    };
    let (f1, f2) = (frame(a.bearing1(), b.bearing1())?, frame(a.bearing2(), b.bearing2())?);
    let r = nalgebra::Rotation3::from_matrix_unchecked(f2 * f1.transpose());
    Some(UnitQuaternion::from_rotation_matrix(&r))
}
