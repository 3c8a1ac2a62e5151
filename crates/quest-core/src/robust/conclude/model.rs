//! Which model the matches support: a rotation alone, a plane, or points in space.
//!
//! Every model explains less than the next and more than nothing; the question is whether what it leaves is more than
//! noise. Over the inliers of the essential matrix
//!
//! ```text
//! F_M = (1/n) Σ [min(d_M²/σ², 9.21) − min(r_E²/σ², 9.21)]
//! ```
//!
//! with `d_M` the whitened transfer error of the model (two numbers a match) and `r_E` the Sampson error (one number). Where
//! the model holds, `F` is one: the second number is noise as the first (the idea of K. Kanatani's geometric information
//! criterion, with a cap against false matches). Where it does not, `F` goes to the cap.
//!
//! A rotation takes up the mean of the displacements, so that `F` stays low as long as their spread is not well above the noise,
//! however many matches there are. Where `F` is low the likelihood of all matches decides (see
//! [`small_motion`](crate::robust::conclude::small_motion)); with few matches `F` alone.

use nalgebra::UnitQuaternion;

use crate::robust::conclude::final_refinement::Polished;
use crate::robust::conclude::plane::Plane;
use crate::robust::conclude::rotation_alone::{NOT_A_ROTATION, excess, median_root, rotation_alone};
use crate::robust::conclude::small_motion::SmallMotion;
use crate::robust::data::observations::Observations;
use crate::robust::estimate::{Evidence, Model};
use crate::robust::refine::loss::CAP;
use crate::robust::search::search_score::MANY;

/// With fewer than [`MANY`] matches a rotation alone is enough where it leaves less than this: one, and its scatter.
const ROTATION: f64 = 3.0;

/// A rotation alone is enough while the evidence against it is below this, in nats. Measured with rotations in place of 100 and 500
/// matches: 12 names 98.3 % of 600, 13 names 98.7 to 100 %.
const EVIDENT: f64 = 13.0;

/// A plane has to explain all but this share of what a rotation leaves. Where a rotation leaves little, every plane leaves little,
/// and the rule for larger motions would call volumes planes.
const UNEXPLAINED: f64 = 0.1;

/// Points are no plane if their inverse depths differ from those of a plane by more than this share of their mean.
const FLAT: f64 = 0.1;

/// A plane is enough where it leaves less than this: one, and room for a real wall. With `n` matches it may leave `20/n` more.
const PLANE: f64 = 1.7;
const PLANE_OF_FEW: f64 = 20.0;

/// A plane is exact where it leaves less than this at the noise that the matches show: one, and its scatter with a hundred matches.
/// With more matches it must be within so many standard deviations of the scatter above one.
const EXACT_PLANE: f64 = 1.3;
const EXACT_DEVIATIONS: f64 = 2.5;

/// Models are compared at a noise of at least this share of the threshold. With less noise the calibration error of every
/// real camera would decide.
const LEAST_NOISE: f64 = 0.3;

/// So many matches decide. This bounds the time: the scatter of `F` is 8 % then.
const ENOUGH: usize = 300;

/// Which model, and why.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Verdict {
    pub(crate) model: Model,
    pub(crate) evidence: Evidence,
    /// The best rotation without translation.
    pub(crate) q_21: UnitQuaternion<f64>,
    /// Whether the plane leaves nothing but noise: its own motions are then better than those of the essential matrix.
    pub(crate) is_exact_plane: bool,
}

/// Compares the models over the inliers of a pose; `small` where a rotation alone leaves little.
pub(crate) fn choose(
    observations: &Observations,
    polished: &Polished,
    plane: Option<&Plane>,
    small: Option<&SmallMotion>,
) -> Verdict {
    let pose = &polished.pose;
    let inliers = &pose.inliers[..pose.inliers.len().min(ENOUGH)];
    let noise = polished.sigma;
    let sigma = noise.max(LEAST_NOISE * observations.columns.threshold());
    let framed = observations.framed(inliers);
    let q_21 = small.map_or_else(
        || rotation_alone(observations, inliers, &framed, &polished.motion().q_21, sigma),
        |small| small.q_21,
    );
    let general: Vec<f64> = inliers.iter().map(|&i| pose.residuals()[i as usize].powi(2)).collect();
    let rotation = framed.square_errors(&q_21.to_rotation_matrix().into_inner());
    let planar = plane.map(|plane| framed.square_errors(&plane.homography));
    let few = (PLANE_OF_FEW / inliers.len().max(1) as f64).min(1.0);
    let of_plane = |sigma| planar.as_ref().map_or(CAP, |planar| excess(planar, &general, sigma));
    let is_plane = |sigma| of_plane(sigma) < PLANE + few;
    let is_rotation = match small {
        Some(small) => small.nats < EVIDENT && small.excess < NOT_A_ROTATION,
        None => observations.len() < MANY && excess(&rotation, &general, sigma) < ROTATION,
    };
    let is_plane = match small {
        Some(small) => {
            let SmallMotion { excess, sigma, .. } = *small;
            let explains = || of_plane(sigma) - 1.0 < UNEXPLAINED * (excess - 1.0);
            // Of the two motions of a plane one may be so short that the field bends.
            let is_flat = small.modes.is_empty() || small.likely().any(|mode| mode.at.off_plane() < FLAT);
            is_plane(sigma) && is_flat && (excess > NOT_A_ROTATION || explains())
        }
        None => is_plane(sigma),
    };
    let model = match (is_rotation, is_plane) {
        (true, _) => Model::PureRotation,
        (false, true) => Model::Planar,
        (false, false) => Model::General,
    };
    let scatter = (2.0 / inliers.len().max(1) as f64).sqrt();
    // Of a motion that hardly stands clear of its noise any plane explains much.
    let is_clear = small.is_none_or(|small| model == Model::Planar && small.is_clear());
    let is_exact_plane = is_clear && of_plane(noise) < EXACT_PLANE.min(1.0 + EXACT_DEVIATIONS * scatter);
    let evidence = Evidence {
        rotation_px: median_root(rotation),
        planar_px: planar.map_or(f64::INFINITY, median_root),
        general_px: median_root(general),
    };
    Verdict { model, evidence, q_21, is_exact_plane }
}
