//! What an estimate can be told.

use std::f64::consts::PI;

use nalgebra::{UnitQuaternion, Vector3};

use crate::lanes::SearchScore;
use crate::robust::data::observations::Observations;
use crate::solver::SolverName;
use crate::{Camera, InputError, RelativePose};

/// How an estimate is made. The defaults suit most pairs; the threshold has to be in the unit of the focal lengths.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct Options {
    /// Matches whose Sampson error is below this are inliers, in pixels of [`focal_lengths`](Self::focal_lengths): two to three
    /// standard deviations of the points' noise. Below that the noise, and with it the covariance, is measured too small.
    pub threshold: f64,
    /// `fx, fy` of view 1 and of view 2, in pixels. With all of them 1 the threshold is in units of the plane `z = 1`, or
    /// in radians for bearings.
    pub focal_lengths: [[f64; 2]; 2],
    /// How the search scores a residual: `Marginalised` over all thresholds up to one, or `Truncated` at one (MSAC). Poses of fewer than
    /// ten matches are always scored with `Truncated`.
    pub loss: SearchScore,
    /// How sure the search is to be that it has seen a good sample before it stops, in `(0, 1)`.
    pub confidence: f64,
    /// At least this many samples are drawn.
    pub min_iterations: usize,
    /// At most this many samples are drawn.
    pub max_iterations: usize,
    /// The best pose is returned if at most this many poses as good as it are expected where all matches are false. A smaller
    /// number refuses more poses of chance; infinity returns the best pose whatever chance explains.
    pub max_false_alarms: f64,
    /// The same seed gives the same answer, bit for bit.
    pub seed: u64,
    /// Which of the pairs that share a seed this is: each has random numbers of its own.
    pub index: u64,
    /// The solver of the samples; it decides how many matches a sample has.
    pub solver: SolverName,
}

impl Default for Options {
    /// A threshold of a thousandth of the focal length, a confidence of 0.9999, from 100 to 100,000 iterations, 0.03 false
    /// alarms.
    fn default() -> Self {
        Self {
            threshold: 1e-3,
            focal_lengths: [[1.0; 2]; 2],
            loss: SearchScore::default(),
            confidence: 0.9999,
            // Between 100 and 300 neither the recorded pairs nor the planted tables change by more than chance.
            min_iterations: 100,
            max_iterations: 100_000,
            // A refinement tries motions that are not counted: with 300 false matches and 100,000 samples, 0.1 let sixteen
            // poses in a thousand pass.
            max_false_alarms: 0.03,
            seed: 0,
            index: 0,
            solver: SolverName::default(),
        }
    }
}

impl Options {
    /// The defaults with a threshold in pixels of these cameras.
    #[must_use]
    pub fn in_pixels(threshold: f64, camera1: &Camera, camera2: &Camera) -> Self {
        Self { threshold, ..Self::default() }.with_cameras(camera1, camera2)
    }

    /// These options with the focal lengths of these cameras.
    #[must_use]
    pub fn with_cameras(self, camera1: &Camera, camera2: &Camera) -> Self {
        let focal_lengths = [camera1, camera2].map(|camera| camera.focal_lengths().into());
        Self { focal_lengths, ..self }
    }

    /// Whether an estimate can be made with these options: every estimate asks first.
    ///
    /// # Errors
    /// [`EstimateError::Option`] for the first that is impossible.
    pub fn check(&self) -> Result<(), EstimateError> {
        let refuse = |option, found, expected| Err(EstimateError::Option { option, found, expected });
        if !(self.threshold > 0.0 && self.threshold.is_finite()) {
            return refuse("threshold", self.threshold, "a positive finite number");
        }
        for found in self.focal_lengths.into_iter().flatten() {
            if !(found > 0.0 && found.is_finite()) {
                return refuse("focal length", found, "a positive finite number");
            }
        }
        if !(self.confidence > 0.0 && self.confidence < 1.0) {
            return refuse("confidence", self.confidence, "a number above 0 and below 1");
        }
        if self.max_false_alarms.is_nan() || self.max_false_alarms <= 0.0 {
            return refuse("largest number of false alarms", self.max_false_alarms, "a positive number");
        }
        if self.max_iterations == 0 {
            return refuse("largest number of iterations", 0.0, "at least 1");
        }
        Ok(())
    }
}

/// What is known beside the matches.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Priors<'a> {
    /// One a match, higher is better: more samples are drawn from the best matches, beside those that move as their neighbours
    /// do, and fewer are drawn where that helps.
    pub scores: Option<&'a [f64]>,
    /// A pose to begin with; the length of its translation plays no part.
    pub pose: Option<RelativePose>,
    /// A direction that both cameras know.
    pub direction: Option<KnownDirection>,
}

/// A direction in space that both cameras know: gravity, or the axis about which a robot turns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownDirection {
    /// In the frame of camera 1; of any length.
    pub in_view1: Vector3<f64>,
    /// In the frame of camera 2; the same as in view 1 for the axis of the rotation.
    pub in_view2: Vector3<f64>,
    /// A pose that turns the first direction further than this from the second, in radians from 0 to π, is neither the answer nor the
    /// runner-up.
    pub tolerance: f64,
}

impl KnownDirection {
    /// Whether a rotation takes the direction from view 1 to view 2.
    pub(super) fn allows(&self, q_21: &UnitQuaternion<f64>) -> bool {
        self.off(q_21) <= self.tolerance
    }

    /// How far from its place in view 2 a rotation takes the direction, in radians.
    fn off(&self, q_21: &UnitQuaternion<f64>) -> f64 {
        let turned = q_21 * self.in_view1;
        turned.cross(&self.in_view2).norm().atan2(turned.dot(&self.in_view2))
    }

    /// The error of matches whose best pose it does not allow, if they have one.
    pub(super) fn refuse(&self, q_21: Option<&UnitQuaternion<f64>>) -> EstimateError {
        EstimateError::Direction { off: q_21.map(|q_21| self.off(q_21)), tolerance: self.tolerance }
    }
}

/// Why there is no estimate.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EstimateError {
    /// The matches were refused.
    #[error(transparent)]
    Input(#[from] InputError),
    /// An option or a prior is impossible.
    #[error("the {option} is {found}, expected {expected}")]
    Option {
        /// Its name.
        option: &'static str,
        /// What was found.
        found: f64,
        /// What was expected.
        expected: &'static str,
    },
    /// No pose explains more of the matches than chance would.
    #[error("{}", describe_no_pose(*inliers, *matches, *false_share))]
    NoPose {
        /// Matches that agree with the best pose.
        inliers: usize,
        /// All matches.
        matches: usize,
        /// The share of false matches that agree with it as well; see [`Estimate::false_share`](crate::robust::Estimate).
        false_share: f64,
    },
    /// No pose that the matches agree with turns the [known direction](KnownDirection) to where it was told to be.
    #[error("{}", describe_direction(*off, *tolerance))]
    Direction {
        /// How far from there the best pose turns it, in radians, if there is one.
        off: Option<f64>,
        /// What is allowed, in radians.
        tolerance: f64,
    },
    /// The caller ended the search.
    #[error("the search was ended before it had an answer")]
    Cancelled,
}

/// More false matches within the threshold than this are a sign that it is in another unit.
pub(super) const UNUSUAL: f64 = 0.3;

fn describe_no_pose(inliers: usize, matches: usize, false_share: f64) -> String {
    let text = format!(
        "no pose could be found: the best one agrees with {inliers} of {matches} matches within the threshold, which chance \
         explains"
    );
    if false_share < UNUSUAL {
        return text;
    }
    format!(
        "{text}; the threshold accepts {:.0} % of false matches: is it in the unit of the points? With cameras it is in pixels, \
         without them in units of the plane z = 1",
        100.0 * false_share
    )
}

fn describe_direction(off: Option<f64>, tolerance: f64) -> String {
    let best =
        off.map_or_else(String::new, |off| format!(": the best one misses it by {:.3}", off.to_degrees()));
    format!(
        "no pose could be found that turns the known direction to within {:.3} degrees of where it is in view 2{best}",
        tolerance.to_degrees()
    )
}

impl Priors<'_> {
    pub(super) fn check(&self, matches: usize) -> Result<(), EstimateError> {
        let refuse = |option, found, expected| Err(EstimateError::Option { option, found, expected });
        if let Some(scores) = self.scores {
            if scores.len() != matches {
                let found = scores.len() as f64;
                return refuse("number of scores", found, "one a match");
            }
            if let Some(&found) = scores.iter().find(|s| !s.is_finite()) {
                return refuse("score of a match", found, "a finite number");
            }
        }
        if let Some(pose) = self.pose {
            let all = pose.t_21.iter().chain(pose.q_21.coords.iter());
            if let Some(&found) = all.copied().find(|x| !x.is_finite()).as_ref() {
                return refuse("initial pose", found, "finite numbers");
            }
        }
        if let Some(KnownDirection { in_view1, in_view2, tolerance }) = self.direction {
            for length in [in_view1.norm(), in_view2.norm()] {
                if !(length > 0.0 && length.is_finite()) {
                    return refuse("length of the known direction", length, "a positive finite number");
                }
            }
            if !(0.0..=PI).contains(&tolerance) {
                return refuse("tolerance of the known direction", tolerance, "radians from 0 to π");
            }
        }
        Ok(())
    }

    /// The matches as observations, from the best to the worst.
    pub(super) fn ranked(&self, observations: &Observations) -> Option<Vec<u32>> {
        let scores = self.scores?;
        #[expect(clippy::cast_possible_truncation, reason = "matches are counted by u32")]
        let mut ranked: Vec<u32> = (0..observations.len() as u32).collect();
        let score = |i: u32| scores[observations.order[i as usize] as usize];
        ranked.sort_by(|&i, &j| score(j).total_cmp(&score(i)));
        Some(ranked)
    }
}
