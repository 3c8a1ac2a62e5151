//! The score of a pose, not only of its essential matrix: points behind a camera are outliers.
//!
//! An essential matrix has four poses. They are told apart by the depths of the points, and depths are noise where the
//! rays of a match subtend less than the noise: such a match only has to look the same way in both views. Without
//! this a vote rejects the true rotation of a camera that hardly moves.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

use super::observations::Observations;
use super::score::{REACH, loss};
use crate::solver::essential::decompose;
use crate::solver::motion::Motion;

/// Rays closer than this, in pixels of both views, have no depth.
const DISPARITY: f64 = 2.0;

/// The stopping rule counts matches up to this multiple of the threshold: counted at the threshold itself a pose that is
/// not refined to the end looks worse than it is, and the search goes on for nothing.
const SUPPORT: f64 = 1.5;

/// Enough votes to tell four poses apart.
const MAX_VOTES: usize = 256;

/// A motion and its score.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scored {
    /// The direction of the translation has the sign that puts the points in front.
    pub(super) motion: Motion,
    /// The summed loss over all matches; zero is perfect.
    pub(super) cost: f64,
    /// How many matches the stopping rule counts as inliers.
    pub(super) support: usize,
}

/// Scores poses, with the memory to do so.
#[derive(Debug)]
pub(super) struct PoseScorer<'a> {
    pub(super) observations: &'a Observations,
    /// The inlier threshold in pixels.
    pub(super) threshold: f64,
    /// The residuals of the pose that was scored last, in pixels.
    pub(super) residuals: Vec<f64>,
    /// Its matches within the limit asked for that are in front of both cameras, in order.
    pub(super) inliers: Vec<u32>,
}

impl<'a> PoseScorer<'a> {
    pub(super) fn new(observations: &'a Observations, threshold: f64) -> Self {
        Self { observations, threshold, residuals: Vec::new(), inliers: Vec::new() }
    }

    /// The best of the four poses of an essential matrix. [`Self::inliers`] are those within `limit` pixels.
    pub(super) fn best_pose(&mut self, e: &Matrix3<f64>, limit: f64) -> Option<Scored> {
        let rows = std::array::from_fn(|i| std::array::from_fn(|j| e[(i, j)]));
        let ([w, x, y, z], t) = decompose(&rows)?;
        let motion = Motion {
            q_21: UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z)),
            direction: Vector3::from(t).normalize(),
        };
        self.observations.residuals(e, &mut self.residuals);
        let motion = self.vote(&motion, limit);
        Some(self.finish(motion, limit))
    }

    /// The score of one pose.
    pub(super) fn score(&mut self, motion: Motion, limit: f64) -> Scored {
        self.observations.residuals(&motion.essential(), &mut self.residuals);
        self.finish(motion, limit)
    }

    /// The one of the four poses with most matches in front of both cameras.
    fn vote(&self, motion: &Motion, limit: f64) -> Motion {
        let limit = limit.max(REACH * self.threshold);
        let poses = [*motion, motion.twisted()].map(|motion| {
            let voters = (0..self.residuals.len()).filter(|&i| self.residuals[i].abs() < limit);
            let mut votes = [0_usize; 2];
            let depth = self.depth_test(&motion);
            for i in voters.take(MAX_VOTES) {
                let side = depth(i);
                votes[0] += usize::from(side != Side::Behind && side != Side::Mixed);
                votes[1] += usize::from(side != Side::InFront && side != Side::Mixed);
            }
            (motion, votes)
        });
        let (mut best, mut most) = (poses[0].0, None);
        for (motion, votes) in poses {
            for (count, sign) in votes.into_iter().zip([1.0, -1.0]) {
                if most.is_none_or(|most| count > most) {
                    most = Some(count);
                    best = Motion { direction: motion.direction * sign, ..motion };
                }
            }
        }
        best
    }

    fn finish(&mut self, motion: Motion, limit: f64) -> Scored {
        let reach = REACH * self.threshold;
        let mut inliers = std::mem::take(&mut self.inliers);
        inliers.clear();
        let (mut cost, mut support) = (0.0, 0);
        let depth = self.depth_test(&motion);
        for (i, (index, r)) in (0_u32..).zip(&self.residuals).enumerate() {
            let loss = loss(r / reach, self.residuals.len());
            if r.abs() >= limit.max(reach) {
                cost += loss;
            } else if matches!(depth(i), Side::InFront | Side::Far) {
                cost += loss;
                support += usize::from(r.abs() < SUPPORT * self.threshold);
                if r.abs() < limit {
                    inliers.push(index);
                }
            } else {
                cost += 1.0;
            }
        }
        self.inliers = inliers;
        Scored { motion, cost, support }
    }

    /// On which side of the cameras a match is.
    fn depth_test(&self, motion: &Motion) -> impl Fn(usize) -> Side + use<'a> {
        let observations = self.observations;
        let r_21 = motion.q_21.to_rotation_matrix().into_inner();
        let t = motion.direction;
        let parallel = DISPARITY * DISPARITY * observations.square_angle_of_pixel();
        move |index| {
            let m = &observations.matches[index];
            let (b, c) = (m.bearing2(), r_21 * m.bearing1());
            let bc = b.dot(&c);
            // |b × c|² of unit vectors; the difference has the digits that are needed at two pixels.
            if bc > 0.0 && 1.0 - bc * bc < parallel {
                return Side::Far;
            }
            // −(b × t) · (b × c) and −(c × t) · (b × c): the depths before their division by |b × c|².
            let (tb, tc) = (t.dot(b), t.dot(&c));
            match (bc * tb - tc > 0.0, tb - bc * tc > 0.0) {
                (true, true) => Side::InFront,
                (false, false) => Side::Behind,
                _ => Side::Mixed,
            }
        }
    }
}

/// Where the point of a match is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    /// In front of both cameras.
    InFront,
    /// Behind both: in front of them with the opposite translation.
    Behind,
    /// In front of one, behind the other.
    Mixed,
    /// Too far to tell.
    Far,
}
