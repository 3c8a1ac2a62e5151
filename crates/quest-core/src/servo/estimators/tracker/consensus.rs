//! Poses that many of the matches of one image agree on.
//!
//! A camera that stands still makes the same wrong matches in all of its images, and their mean keeps them. So samples of five are
//! solved, and each candidate is scored by all matches with a bounded loss: a wrong match costs its share and no more.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::servo::estimators::source::PoseSource;
use crate::solver::{Kinds, SolverName};
use crate::{Candidates, Correspondence, RelativePose, feasibility};

/// Below so many features all candidates are tried, not those of the consensus alone.
pub(crate) const FEW: usize = 25;
/// So many different poses are kept: the first number of few matches, of which many poses explain six of twelve by chance, the
/// second of many.
pub(crate) const KEPT: usize = 12;
const KEPT_OF_MANY: usize = 4;
/// Samples at least, and at most: with six right matches of twelve one sample of 132 is right, so that 1,024 miss in one of 2,000 starts.
const FEWEST_SAMPLES: usize = 64;
const MOST_SAMPLES: usize = 1_024;
/// How much the inverse depths of right matches differ, as a share of their mean.
const SPREAD: f64 = 0.3;
/// How often a right sample may be missed.
const MISSED: f64 = 1e-3;
/// A squared Sampson error above this, in units of the noise, counts as wrong: three standard deviations.
const AGREES: f64 = 9.0;

/// A pose with what the matches say of it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scored {
    pub(crate) pose: RelativePose,
    score: f64,
    /// How many matches agree with it.
    agree: usize,
}

/// The best poses so far.
#[derive(Clone, Debug)]
pub(crate) struct Consensus {
    pub(crate) matches: Vec<Correspondence>,
    /// Which feature each match is.
    pub(crate) features: Vec<usize>,
    pub(crate) best: [Option<Scored>; KEPT],
    sample: Vec<Correspondence>,
    pub(crate) candidates: Candidates,
    /// Samples drawn.
    pub(crate) drawn: usize,
    /// The inverse depths of the pose that is scored.
    inverse_depths: Vec<f64>,
}

impl Consensus {
    pub(crate) fn new(features: usize) -> Self {
        Self {
            matches: Vec::with_capacity(features),
            features: Vec::with_capacity(features),
            best: [None; KEPT],
            sample: Vec::with_capacity(features.max(16)),
            candidates: Candidates::new(),
            drawn: 0,
            inverse_depths: Vec::with_capacity(features.min(FEW)),
        }
    }

    /// The matches of an image, of the features that `takes` chooses.
    pub(crate) fn begin(
        &mut self,
        goal: &[[f64; 2]],
        frame: &[Option<[f64; 2]>],
        takes: impl Fn(usize) -> bool,
    ) {
        self.matches.clear();
        self.features.clear();
        (self.best, self.drawn) = ([None; KEPT], 0);
        for (i, (goal, image)) in goal.iter().zip(frame).enumerate() {
            let Some(image) = image.filter(|_| takes(i)) else { continue };
            if let Ok(m) = Correspondence::from_image_points(*goal, image) {
                self.matches.push(m);
                self.features.push(i);
            }
        }
    }

    /// Draws so many samples more. `sigma` is the noise of a difference between the images.
    pub(crate) fn draw(
        &mut self,
        source: &mut impl PoseSource,
        samples: usize,
        sigma: f64,
        rng: &mut ChaCha8Rng,
    ) {
        let size = source.min_matches().max(5).min(self.matches.len());
        for _ in 0..samples {
            self.drawn += 1;
            self.sample.clear();
            while self.sample.len() < size {
                let m = self.matches[rng.random_range(0..self.matches.len())];
                if !self.sample.contains(&m) {
                    self.sample.push(m);
                }
                // Doubled matches: there may be fewer different ones than a sample has.
                if self.sample.len() < size && rng.random_range(0..64) == 0 {
                    break;
                }
            }
            if self.sample.len() < size {
                continue;
            }
            let mut candidates = std::mem::take(&mut self.candidates);
            source.candidates(&self.sample, &mut candidates);
            for candidate in candidates.iter() {
                self.offer(candidate.pose, sigma);
            }
            self.candidates = candidates;
        }
    }

    /// The candidates of the matches that the best pose explains, by `source` and as a plane's.
    pub(crate) fn candidates_of_inliers(
        &mut self,
        source: &mut impl PoseSource,
        planar: bool,
        sigma: f64,
    ) -> &Candidates {
        self.sample.clear();
        let best = self.best[0].map(|best| best.pose);
        let explains =
            |m: &Correspondence| best.is_none_or(|pose| (pose.sampson_error(m) / sigma).powi(2) < AGREES);
        self.sample.extend(self.matches.iter().filter(|m| explains(m)));
        if !planar && self.sample.len() > FEW {
            // A solver's matrix grows with the pairs of matches: with a hundred it takes milliseconds. These are spread over the goal.
            let stride = self.sample.len().div_ceil(FEW);
            let mut k = 0;
            self.sample.retain(|_| {
                k += 1;
                (k - 1) % stride == 0
            });
        }
        self.candidates.clear();
        if planar {
            if self.sample.len() >= SolverName::Homography.info().min_matches {
                SolverName::Homography.solve(Kinds::All, &self.sample, &mut self.candidates);
            }
        } else if self.sample.len() >= source.min_matches() {
            source.candidates(&self.sample, &mut self.candidates);
        }
        &self.candidates
    }

    /// How many samples it takes until one of them has right matches alone, if those are the matches that the best pose explains.
    pub(crate) fn wanted(&self, size: usize) -> usize {
        let n = self.matches.len();
        let subsets = (0..size.min(n)).fold(1, |count, i| count * (n - i) / (i + 1));
        // Drawn with replacement: three times as many leave out one of twenty.
        let most = (3 * subsets).min(MOST_SAMPLES);
        let Some(Scored { agree, .. }) = self.best[0] else { return most };
        let share = |i: usize| agree.saturating_sub(i) as f64 / n.saturating_sub(i).max(1) as f64;
        let wrong = 1.0 - (0..size).map(share).product::<f64>();
        let (mut missed, mut wanted) = (1.0, 0);
        while missed > MISSED && wanted < most {
            (missed, wanted) = (missed * wrong, wanted + 1);
        }
        wanted.max(FEWEST_SAMPLES).min(most)
    }

    /// Takes a pose in among the best, unless it is one of them.
    pub(crate) fn offer(&mut self, pose: RelativePose, sigma: f64) {
        let last = if self.matches.len() < FEW { KEPT } else { KEPT_OF_MANY } - 1;
        let worst = self.best[last].map_or(f64::INFINITY, |scored| scored.score);
        let (mut score, mut agree) = (0.0, 0);
        for m in &self.matches {
            let square = (pose.sampson_error(m) / sigma).powi(2);
            score += square.min(AGREES);
            agree += usize::from(square < AGREES);
            if score >= worst {
                return;
            }
        }
        let mut new = Scored { pose, score, agree };
        if self.matches.len() < FEW {
            new = self.with_depths(&pose, sigma);
            if new.score >= worst || new.score.is_nan() {
                return;
            }
        } else if !self.is_in_front(&pose, sigma) {
            return;
        }
        let same = |p: &RelativePose| {
            p.rotation_error(&pose) < 2e-2 && p.translation_error(&pose).is_none_or(|angle| angle < 0.1)
        };
        if let Some(known) = self.best.iter_mut().flatten().find(|scored| same(&scored.pose)) {
            if new.score < known.score {
                *known = new;
            }
        } else {
            self.best[last] = Some(new);
        }
        let score = |x: &Option<Scored>| x.map_or(f64::INFINITY, |scored| scored.score);
        self.best.sort_by(|a, b| score(a).total_cmp(&score(b)));
    }

    /// Whether more of the matches that agree are in front of both cameras than not.
    ///
    /// A pose and its twisted pair have the same Sampson errors: rounding decided which of them was the best.
    fn is_in_front(&self, pose: &RelativePose, sigma: f64) -> bool {
        let agree = self.matches.iter().filter(|m| (pose.sampson_error(m) / sigma).powi(2) < AGREES);
        let (mut in_front, mut all) = (0, 0);
        for m in agree {
            in_front += feasibility::in_front(pose, std::slice::from_ref(m));
            all += 1;
        }
        2 * in_front > all
    }

    /// The score of a pose with what the depths say: those of a match that agrees are positive and near their mean.
    ///
    /// Five of twelve matches have tens of candidates, and two more lie on the epipolar lines of every hundredth by chance: of 142
    /// samples tens explain seven of twelve, as many as the truth does where five are wrong. Their depths are anything.
    fn with_depths(&mut self, pose: &RelativePose, sigma: f64) -> Scored {
        let inverse = &mut self.inverse_depths;
        inverse.clear();
        let (mut sum, mut count) = (0.0, 0.0);
        for m in &self.matches {
            let square = (pose.sampson_error(m) / sigma).powi(2);
            let depths = pose.depths(m).filter(|(z1, z2)| square < AGREES && *z1 > 0.0 && *z2 > 0.0);
            let rho = depths.map_or(f64::NAN, |(z1, _)| 1.0 / z1);
            if rho.is_finite() {
                (sum, count) = (sum + rho, count + 1.0);
            }
            inverse.push(rho);
        }
        let mean = sum / count;
        // A start is within about the features' depth of its goal, and a radian.
        let mut score = pose.q_21.angle().powi(2) + (pose.t_21 * mean).norm_squared();
        let mut agree = 0;
        for (m, rho) in self.matches.iter().zip(&*inverse) {
            let square = (pose.sampson_error(m) / sigma).powi(2) + ((rho / mean - 1.0) / SPREAD).powi(2);
            // Not a number counts as wrong.
            let agrees = square < AGREES;
            score += if agrees { square } else { AGREES };
            agree += usize::from(agrees);
        }
        Scored { pose: *pose, score, agree }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Unit, UnitQuaternion, Vector3};
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn a_twisted_pair_is_not_among_the_poses_of_many_matches() {
        let rng = &mut ChaCha8Rng::seed_from_u64(7);
        let truth =
            RelativePose::new(UnitQuaternion::new(Vector3::new(0.1, -0.2, 0.1)), Vector3::new(0.3, 0.1, 0.1));
        let points: Vec<Vector3<f64>> = (0..40)
            .map(|_| {
                Vector3::new(
                    rng.random_range(-1.0..1.0),
                    rng.random_range(-1.0..1.0),
                    rng.random_range(3.0..5.0),
                )
            })
            .collect();
        let goal: Vec<[f64; 2]> = points.iter().map(|x| [x.x / x.z, x.y / x.z]).collect();
        let seen = points.iter().map(|x| truth.q_21 * x + truth.t_21).map(|x| Some([x.x / x.z, x.y / x.z]));
        let seen: Vec<_> = seen.collect();
        // Turned by 180° about the baseline, in either direction of it.
        let half_turn =
            UnitQuaternion::from_axis_angle(&Unit::new_normalize(truth.t_21), std::f64::consts::PI);
        let turned = half_turn * truth.q_21;
        for (pose, is_true) in [
            (RelativePose::new(turned, truth.t_21), false),
            (RelativePose::new(turned, -truth.t_21), false),
            (RelativePose::new(truth.q_21, -truth.t_21), false),
            (truth, true),
        ] {
            let mut consensus = Consensus::new(40);
            consensus.begin(&goal, &seen, |_| true);
            consensus.offer(pose, 1e-3);
            assert_eq!(consensus.best[0].is_some(), is_true, "{pose:?}");
        }
    }
}
