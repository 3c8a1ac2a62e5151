//! The plane that most of the points lie near, and the two motions that explain it.
//!
//! Points on a plane have two motions, and the essential cost hardly tells one from the other: a search that has settled on
//! the wrong one does not find its way back. So the plane is fitted to the depths of the pose that was found, its
//! homography `H = R + t gᵀ` is refined on its own, and both of its motions are given back. That also helps where the points
//! only come close to a plane.

use nalgebra::{Matrix3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::robust::conclude::final_refinement::Polished;
use crate::robust::conclude::inverse_depth::InverseDepth;
use crate::robust::data::observations::Observations;
use crate::robust::refine::loss::SCALE;
use crate::robust::refine::loss::{CAP, GemanMcClure};
use crate::robust::refine::point_transfer::refine_homography;
use crate::solver::homography;
use crate::solver::shared::motion::Motion;

/// Samples of three points.
const SAMPLES: usize = 60;

/// Points that a sample is judged by, and that the homography is first refined over.
const JUDGES: usize = 120;

/// Points that the homography of a plane is refined over in the end.
const ENOUGH: usize = 2_000;

/// Steps of the refinement.
const STEPS: usize = 8;

/// A plane seen from both cameras.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plane {
    /// `x2 ∝ H x1`.
    pub(crate) homography: Matrix3<f64>,
    /// Its two motions, with the translation of either sign.
    pub(crate) motions: [Option<Motion>; 2],
}

/// Fits a plane to the inliers of a pose.
pub(crate) fn fit(observations: &Observations, polished: &Polished, rng: &mut ChaCha8Rng) -> Option<Plane> {
    let (motion, inliers, sigma) = (polished.motion(), &polished.pose.inliers, polished.sigma);
    let judges = &inliers[..inliers.len().min(JUDGES)];
    let depths = InverseDepth::all(&observations.columns, motion, judges);
    let g = most_common_plane(&depths, CAP * sigma * sigma, rng)?;
    let mut homography = motion.q_21.to_rotation_matrix().into_inner() + motion.direction * g.transpose();
    Some(refined(observations, judges, &mut homography, sigma))
}

fn refined(observations: &Observations, inliers: &[u32], homography: &mut Matrix3<f64>, sigma: f64) -> Plane {
    let loss = GemanMcClure::new(1.5 * SCALE * sigma);
    refine_homography(&observations.framed(inliers), homography, &loss, STEPS);
    Plane { homography: *homography, motions: homography::motions(homography) }
}

impl Plane {
    /// Refined over more of the inliers, if there are more; `None` if not.
    pub(crate) fn over_all(&self, observations: &Observations, inliers: &[u32], sigma: f64) -> Option<Self> {
        let inliers = &inliers[..inliers.len().min(ENOUGH)];
        let mut homography = self.homography;
        (inliers.len() > JUDGES).then(|| refined(observations, inliers, &mut homography, sigma))
    }
}

/// The `g` with `ρ = g · x1` for most of the points.
fn most_common_plane(depths: &[InverseDepth], cap: f64, rng: &mut ChaCha8Rng) -> Option<Vector3<f64>> {
    if depths.len() < 3 {
        return None;
    }
    let (mut best, mut least) = (None, f64::INFINITY);
    for _ in 0..SAMPLES {
        let [a, b, c] = [0; 3].map(|_| &depths[rng.random_range(0..depths.len())]);
        let columns = [b.x1.cross(&c.x1), c.x1.cross(&a.x1), a.x1.cross(&b.x1)];
        let determinant = a.x1.dot(&columns[0]);
        // The same point twice, or three in a line.
        if determinant.abs() < 1e-9 {
            continue;
        }
        let g = (columns[0] * a.value + columns[1] * b.value + columns[2] * c.value) / determinant;
        let mut cost = 0.0;
        for d in depths {
            cost += ((d.value - g.dot(&d.x1)).powi(2) * d.precision).min(cap);
            if cost > least {
                break;
            }
        }
        if cost < least {
            (best, least) = (Some(g), cost);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Correspondence;
    use crate::robust::search::sampling;
    use nalgebra::UnitQuaternion;
    use rand_distr::{Distribution, StandardNormal};

    const FOCAL: f64 = 500.0;

    #[test]
    fn a_plane_is_refined_over_more_of_its_points() {
        let (q_21, t_21) =
            (UnitQuaternion::new(Vector3::new(0.02, -0.1, 0.05)), Vector3::new(0.3, -0.1, 0.1));
        let truth = q_21.to_rotation_matrix().into_inner() + t_21 * Vector3::new(0.1, -0.2, 0.9).transpose();
        let image = |h: &Matrix3<f64>, x: &Vector3<f64>| {
            let y = h * x;
            y.xy() / y.z
        };
        let rng = &mut sampling::generator(0x91_a4e, 0);
        let mut noise = || 0.5 / FOCAL * Distribution::<f64>::sample(&StandardNormal, rng);
        let places: Vec<Vector3<f64>> = (0..600)
            .map(|k| Vector3::new(0.5 * (2.1 * f64::from(k)).sin(), 0.4 * (3.7 * f64::from(k)).cos(), 1.0))
            .collect();
        let seen = places.iter().map(|x| {
            let y = image(&truth, x);
            Correspondence::from_image_points([x.x + noise(), x.y + noise()], [y.x + noise(), y.y + noise()])
        });
        let matches: Vec<_> = seen.map(Result::unwrap).collect();
        let all: Vec<u32> = (0..600).collect();
        let observations = Observations::new(&matches, all.clone(), [[FOCAL; 2]; 2], 1.5);
        let mut start = truth;
        start[(0, 2)] += 1.0 / FOCAL;
        let first = refined(&observations, &all[..JUDGES], &mut start, 0.5);
        let found = first.over_all(&observations, &all, 0.5).unwrap();
        let off = |plane: &Plane| {
            let square = |x| (image(&plane.homography, x) - image(&truth, x)).norm_squared();
            FOCAL * (places.iter().map(square).sum::<f64>() / 600.0).sqrt()
        };
        // Eight numbers share the noise of both views: √(8/120) and √(8/600) of 0.7 px.
        assert!(off(&first) < 0.4 && off(&found) < 0.16, "{} {}", off(&first), off(&found));
        assert!(off(&found) < off(&first), "{} {}", off(&first), off(&found));
        assert!(first.over_all(&observations, &all[..JUDGES], 0.5).is_none());
    }
}
