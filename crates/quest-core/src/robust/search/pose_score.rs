//! The score of a pose, not only of its essential matrix: points behind a camera are outliers.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

use crate::algebra::vectors::widest::{Work, widest};
use crate::lanes::Loss;
use crate::robust::data::columns::{Look, POSES, is_in_front};
use crate::robust::data::observations::Observations;
use crate::robust::refine::loss::CAP;
use crate::robust::search::search_score::{MANY, REACH, cost};
use crate::solver::shared::essential::decompose;
use crate::solver::shared::motion::Motion;

/// The stopping rule counts matches up to this multiple of the threshold: counted at the threshold itself a pose that is
/// not refined to the end looks worse than it is, and the search goes on for nothing.
const SUPPORT: f64 = 1.5;

/// Matches side by side.
const WIDTH: usize = 8;

/// Enough votes to tell four poses apart.
const MAX_VOTES: usize = 256;

/// A motion and its score.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scored {
    /// The direction of the translation has the sign that puts the points in front.
    pub(crate) motion: Motion,
    /// The summed loss over all matches; zero is perfect.
    pub(crate) cost: f64,
    /// How many matches the stopping rule counts as inliers.
    pub(crate) support: usize,
}

/// Scores poses, with the memory to do so.
#[derive(Debug)]
pub(crate) struct PoseScorer<'a> {
    pub(crate) observations: &'a Observations,
    loss: Loss,
    /// The residuals of the pose that was scored last, in pixels, and on which side of the cameras its points are.
    look: Look,
    /// Its matches within the limit asked for that are in front of both cameras, in order.
    pub(crate) inliers: Vec<u32>,
}

impl<'a> PoseScorer<'a> {
    pub(crate) fn new(observations: &'a Observations, loss: Loss) -> Self {
        let loss = if observations.len() < MANY { Loss::Truncated } else { loss };
        Self { observations, loss, look: Look::default(), inliers: Vec::new() }
    }

    /// The best of the four poses of an essential matrix. [`Self::inliers`] are those within `limit` pixels.
    pub(crate) fn best_pose(&mut self, e: &Matrix3<f64>, limit: f64) -> Option<Scored> {
        let rows = std::array::from_fn(|i| std::array::from_fn(|j| e[(i, j)]));
        let ([w, x, y, z], t) = decompose(&rows)?;
        let motion = Motion {
            q_21: UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z)),
            direction: Vector3::from(t).normalize(),
        };
        self.observations.columns.look(e, &motion, &mut self.look);
        let pose = self.vote(limit);
        let motion = if pose < 2 { motion } else { motion.twisted() };
        let direction = if pose.is_multiple_of(2) { motion.direction } else { -motion.direction };
        Some(self.finish(Motion { direction, ..motion }, pose, limit))
    }

    /// The score of one pose.
    pub(crate) fn score(&mut self, motion: Motion, limit: f64) -> Scored {
        self.observations.columns.look(&motion.essential(), &motion, &mut self.look);
        self.finish(motion, 0, limit)
    }

    /// The inlier threshold in pixels.
    pub(crate) fn threshold(&self) -> f64 {
        self.observations.columns.threshold()
    }

    /// The sum of the squares of the residuals of the pose that was scored last, at this noise, none above [`CAP`].
    pub(crate) fn misfit(&self, sigma: f64) -> f64 {
        let square = |(i, r): (usize, &f64)| {
            let square = (r / sigma).powi(2).min(CAP);
            if self.look.is_in_front(i, 0) { square } else { CAP }
        };
        self.residuals().iter().enumerate().map(square).sum()
    }

    /// The residuals of the pose that was scored last, in pixels.
    pub(crate) fn residuals(&self) -> &[f64] {
        &self.look.residuals
    }

    /// The one of the four poses with most matches in front of both cameras.
    fn vote(&self, limit: f64) -> usize {
        let limit = limit.max(REACH * self.threshold());
        let residuals = self.residuals();
        let voters = (0..residuals.len()).filter(|&i| residuals[i].abs() < limit);
        let mut votes = [0_usize; POSES];
        for i in voters.take(MAX_VOTES) {
            for (pose, votes) in votes.iter_mut().enumerate() {
                *votes += usize::from(self.look.is_in_front(i, pose));
            }
        }
        // The first of equals.
        (1..POSES).fold(0, |best, pose| if votes[pose] > votes[best] { pose } else { best })
    }

    /// The score of a pose of the motion that was looked at, `motion` itself.
    fn finish(&mut self, motion: Motion, pose: usize, limit: f64) -> Scored {
        let reach = REACH * self.threshold();
        let judging = Judging {
            look: &self.look,
            pose,
            loss: self.loss,
            inverse_reach: 1.0 / reach,
            judged: limit.max(reach),
            near: SUPPORT * self.threshold(),
        };
        let (cost, support) = widest(judging);
        self.inliers.resize(self.look.residuals.len(), 0);
        let mut found = 0;
        for (i, (index, r)) in (0_u32..).zip(&self.look.residuals).enumerate() {
            // Written in any case, which takes less time than to ask.
            self.inliers[found] = index;
            found += usize::from(self.look.is_in_front(i, pose) & (r.abs() < limit));
        }
        self.inliers.truncate(found);
        Scored { motion, cost, support }
    }
}

/// Sums the loss of a pose, and counts its support.
struct Judging<'a> {
    look: &'a Look,
    pose: usize,
    loss: Loss,
    inverse_reach: f64,
    /// Matches behind a camera that are closer than this cost as much as outliers.
    judged: f64,
    near: f64,
}

impl Work for Judging<'_> {
    type Output = (f64, usize);

    #[inline(always)]
    fn run(self) -> (f64, usize) {
        match self.loss {
            Loss::Truncated => self.sum(|u| cost(Loss::Truncated, u)),
            Loss::Marginalised => self.sum(|u| cost(Loss::Marginalised, u)),
        }
    }
}

impl Judging<'_> {
    #[inline(always)]
    #[expect(clippy::needless_bitwise_bool, reason = "lazy operators branch, which no vector can")]
    fn sum(self, cost: impl Fn(f64) -> f64) -> (f64, usize) {
        let Self { look, pose, inverse_reach, judged, near, .. } = self;
        let (mut sum, mut support) = ([0.0; WIDTH], [0.0; WIDTH]);
        let (residuals, last_residuals) = look.residuals.as_chunks::<WIDTH>();
        let (sides, last_sides) = look.sides.as_chunks::<WIDTH>();
        let mut add = |j: usize, r: f64, sides: u32| {
            let (r, is_in_front) = (r.abs(), is_in_front(sides, pose));
            let loss = cost(r * inverse_reach);
            sum[j] += if (r < judged) & !is_in_front { 1.0 } else { loss };
            support[j] += if is_in_front & (r < near) { 1.0 } else { 0.0 };
        };
        for (residuals, sides) in residuals.iter().zip(sides) {
            for j in 0..WIDTH {
                add(j, residuals[j], sides[j]);
            }
        }
        for (j, (r, sides)) in last_residuals.iter().zip(last_sides).enumerate() {
            add(j, *r, *sides);
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a number of matches")]
        let support = support.iter().sum::<f64>() as usize;
        (sum.iter().sum(), support)
    }
}
