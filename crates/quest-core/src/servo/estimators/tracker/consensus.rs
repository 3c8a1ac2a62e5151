//! Poses that many of the matches of one image agree on.
//!
//! A camera that stands still makes the same wrong matches in all of its images: their mean keeps them. Samples of five are solved, and each
//! candidate is scored by all matches with a bounded loss; a wrong match then costs its share and no more.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::servo::estimators::source::PoseSource;
use crate::solver::{Kinds, SolverName};
use crate::{Candidates, Correspondence, RelativePose};

/// So many different poses are kept.
pub(crate) const KEPT: usize = 4;
/// Samples: with eight right matches of twelve a sample is right in 7 %, so that 128 miss in one of ten thousand starts.
pub(crate) const SAMPLES: usize = 128;

/// The best poses so far.
#[derive(Clone, Debug)]
pub(crate) struct Consensus {
    pub(crate) matches: Vec<Correspondence>,
    /// Which feature each match is.
    pub(crate) features: Vec<usize>,
    pub(crate) best: [Option<(f64, RelativePose)>; KEPT],
    sample: Vec<Correspondence>,
    pub(crate) candidates: Candidates,
    /// Samples drawn.
    pub(crate) drawn: usize,
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
        let best = self.best[0].map(|(_, pose)| pose);
        let explains =
            |m: &Correspondence| best.is_none_or(|pose| (pose.sampson_error(m) / sigma).powi(2) < 9.0);
        self.sample.extend(self.matches.iter().filter(|m| explains(m)));
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

    /// Takes a pose in among the best, unless it is one of them.
    pub(crate) fn offer(&mut self, pose: RelativePose, sigma: f64) {
        let worst = self.best[KEPT - 1].map_or(f64::INFINITY, |(score, _)| score);
        let mut score = 0.0;
        for m in &self.matches {
            score += (pose.sampson_error(m) / sigma).powi(2).min(9.0);
            if score >= worst {
                return;
            }
        }
        let same = |p: &RelativePose| {
            p.rotation_error(&pose) < 2e-2 && p.translation_error(&pose).is_none_or(|angle| angle < 0.1)
        };
        if let Some(known) = self.best.iter_mut().flatten().find(|(_, p)| same(p)) {
            if score < known.0 {
                *known = (score, pose);
            }
        } else {
            self.best[KEPT - 1] = Some((score, pose));
        }
        self.best.sort_by(|a, b| {
            let score = |x: &Option<(f64, RelativePose)>| x.map_or(f64::INFINITY, |(s, _)| s);
            score(a).total_cmp(&score(b))
        });
    }
}
