//! The score of a pose, not only of its essential matrix: points behind a camera are outliers.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

use crate::algebra::vectors::widest::{Simd, Work, widest};
use crate::lanes::{SearchScore, WithLoss};
use crate::robust::data::columns::{POSES, Residuals, is_in_front};
use crate::robust::data::observations::Observations;
use crate::robust::refine::loss::CAP;
use crate::robust::search::search_score::{MANY, REACH};
use crate::solver::shared::essential::decompose;
use crate::solver::shared::motion::Motion;

/// Matches side by side.
const WIDTH: usize = 8;

/// Enough votes to tell four poses apart.
const MAX_VOTES: usize = 256;

/// Of so many matches no memory is kept: to ask for it takes no time beside that of a score, and ten million need 160 MB.
const LARGE: usize = 1 << 20;

/// A motion and its score.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scored {
    /// The direction of the translation has the sign that puts the points in front.
    pub(crate) motion: Motion,
    /// The summed loss over all matches; zero is perfect.
    pub(crate) cost: f64,
}

/// A pose with its score and with what it makes of every match.
#[derive(Clone, Debug)]
pub(crate) struct ScoredPose {
    pub(crate) scored: Scored,
    /// The matches within the limit asked for that are in front of both cameras, in order.
    pub(crate) inliers: Vec<u32>,
    residuals: Residuals,
    /// Which of the four poses of `residuals` this one is.
    which: usize,
}

impl ScoredPose {
    /// The signed Sampson errors of all matches, in pixels.
    pub(crate) fn residuals(&self) -> &[f64] {
        &self.residuals.values
    }

    /// The signed Sampson errors of the inliers, in pixels.
    pub(crate) fn inlier_residuals(&self) -> impl ExactSizeIterator<Item = f64> {
        self.inliers.iter().map(|&i| self.residuals.values[i as usize])
    }

    /// How many matches are inliers of both poses.
    pub(crate) fn inliers_in_common(&self, other: &Self) -> usize {
        let mut rest = other.inliers.iter().peekable();
        let is_in_rest = |i: &&u32| {
            while rest.next_if(|j| j < i).is_some() {}
            rest.next_if_eq(i).is_some()
        };
        self.inliers.iter().filter(is_in_rest).count()
    }

    /// The sum of the squared residuals in units of the noise `sigma`, none above [`CAP`], which a point behind a camera
    /// counts as well.
    pub(crate) fn misfit(&self, sigma: f64) -> f64 {
        let square = |(i, r): (usize, &f64)| {
            let square = (r / sigma).powi(2).min(CAP);
            if self.residuals.is_in_front(i, self.which) { square } else { CAP }
        };
        self.residuals().iter().enumerate().map(square).sum()
    }
}

/// Scores poses.
#[derive(Debug)]
pub(crate) struct PoseScorer<'a> {
    pub(crate) observations: &'a Observations<'a>,
    loss: SearchScore,
    /// The memory of poses that are not needed any more.
    spare: Vec<(Residuals, Vec<u32>)>,
}

impl<'a> PoseScorer<'a> {
    pub(crate) fn new(observations: &'a Observations<'a>, loss: SearchScore) -> Self {
        let loss = if observations.len() < MANY { SearchScore::Truncated } else { loss };
        Self { observations, loss, spare: Vec::new() }
    }

    /// The same for other matches.
    pub(crate) fn of<'b>(&self, observations: &'b Observations<'b>) -> PoseScorer<'b> {
        PoseScorer::new(observations, self.loss)
    }

    /// Takes the memory of a pose that is not needed any more, unless it is large.
    pub(crate) fn recycle(&mut self, pose: ScoredPose) {
        if pose.residuals.values.len() < LARGE {
            self.spare.push((pose.residuals, pose.inliers));
        }
    }

    /// The best of the four poses of an essential matrix, its inliers within `limit` pixels.
    pub(crate) fn best_pose(&mut self, e: &Matrix3<f64>, limit: f64) -> Option<ScoredPose> {
        let rows = std::array::from_fn(|i| std::array::from_fn(|j| e[(i, j)]));
        let ([w, x, y, z], t) = decompose(&rows)?;
        let motion = Motion {
            q_21: UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z)),
            direction: Vector3::from(t).normalize(),
        };
        let (mut residuals, inliers) = self.spare.pop().unwrap_or_default();
        self.observations.columns.residuals(e, &motion, &mut residuals);
        let which = self.vote(&residuals, limit);
        let motion = if which < 2 { motion } else { motion.twisted() };
        let direction = if which.is_multiple_of(2) { motion.direction } else { -motion.direction };
        Some(self.finish(Motion { direction, ..motion }, residuals, which, inliers, limit))
    }

    /// The score of one pose, its inliers within `limit` pixels.
    pub(crate) fn score(&mut self, motion: Motion, limit: f64) -> ScoredPose {
        let (mut residuals, inliers) = self.spare.pop().unwrap_or_default();
        self.observations.columns.residuals(&motion.essential(), &motion, &mut residuals);
        self.finish(motion, residuals, 0, inliers, limit)
    }

    /// The inlier threshold in pixels.
    pub(crate) fn threshold(&self) -> f64 {
        self.observations.columns.threshold()
    }

    /// The one of the four poses with most matches in front of both cameras.
    fn vote(&self, of: &Residuals, limit: f64) -> usize {
        let limit = limit.max(REACH * self.threshold());
        let residuals = &of.values;
        let voters = (0..residuals.len()).filter(|&i| residuals[i].abs() < limit);
        let mut votes = [0_usize; POSES];
        for i in voters.take(MAX_VOTES) {
            for (pose, votes) in votes.iter_mut().enumerate() {
                *votes += usize::from(of.is_in_front(i, pose));
            }
        }
        // The first of equals.
        (1..POSES).fold(0, |best, pose| if votes[pose] > votes[best] { pose } else { best })
    }

    /// The score of pose `which` of the residuals, `motion` itself; `inliers` is memory to write to.
    fn finish(
        &self,
        motion: Motion,
        residuals: Residuals,
        which: usize,
        mut inliers: Vec<u32>,
        limit: f64,
    ) -> ScoredPose {
        let reach = REACH * self.threshold();
        let judging = Judging {
            residuals: &residuals,
            pose: which,
            loss: self.loss,
            inverse_reach: 1.0 / reach,
            judged: limit.max(reach),
        };
        let cost = widest(judging);
        inliers.resize(residuals.values.len(), 0);
        let mut found = 0;
        for (i, (index, r)) in (0_u32..).zip(&residuals.values).enumerate() {
            // Written in any case, which takes less time than to ask.
            inliers[found] = index;
            found += usize::from(residuals.is_in_front(i, which) & (r.abs() < limit));
        }
        inliers.truncate(found);
        ScoredPose { scored: Scored { motion, cost }, inliers, residuals, which }
    }
}

/// Sums the loss of a pose.
struct Judging<'a> {
    residuals: &'a Residuals,
    pose: usize,
    loss: SearchScore,
    inverse_reach: f64,
    /// Matches behind a camera that are closer than this cost as much as outliers.
    judged: f64,
}

impl Work for Judging<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> f64 {
        self.loss.run(self)
    }
}

impl WithLoss for Judging<'_> {
    type Output = f64;

    #[inline(always)]
    #[expect(clippy::needless_bitwise_bool, reason = "lazy operators branch, which no vector can")]
    fn run(self, cost: impl Fn(f64) -> f64) -> f64 {
        let Self { residuals: of, pose, inverse_reach, judged, .. } = self;
        let mut sum = [0.0; WIDTH];
        let (residuals, last_residuals) = of.values.as_chunks::<WIDTH>();
        let (sides, last_sides) = of.sides.as_chunks::<WIDTH>();
        let mut add = |j: usize, r: f64, sides: u32| {
            let (r, is_in_front) = (r.abs(), is_in_front(sides, pose));
            let loss = cost(r * inverse_reach);
            sum[j] += if (r < judged) & !is_in_front { 1.0 } else { loss };
        };
        for (residuals, sides) in residuals.iter().zip(sides) {
            for j in 0..WIDTH {
                add(j, residuals[j], sides[j]);
            }
        }
        for (j, (r, sides)) in last_residuals.iter().zip(last_sides).enumerate() {
            add(j, *r, *sides);
        }
        sum.iter().sum()
    }
}
