//! A solver of one's own: the rotation is known from a gyroscope, so two matches determine the translation.
#![expect(clippy::print_stdout, reason = "an example shows what it finds")]

use nalgebra::UnitQuaternion;
use quest_core::simulate::{Scene, SceneOptions};
use quest_core::solver::PoseSolver;
use quest_core::structure::{translation_direction, with_depths};
use quest_core::{Candidate, CandidateKind, Candidates, Correspondence, Degeneracy};

struct KnownRotation {
    q_21: UnitQuaternion<f64>,
}

impl PoseSolver for KnownRotation {
    const NAME: &'static str = "known-rotation";
    const MIN_MATCHES: usize = 2;

    fn solve(&self, matches: &[Correspondence], out: &mut Candidates) {
        out.clear();
        if matches.len() < Self::MIN_MATCHES {
            return out.set_degeneracy(Degeneracy::TooFewMatches);
        }
        // The direction is the one orthogonal to every `x2 × R x1`; its sign and length come with the depths.
        let direction = translation_direction(&self.q_21, matches);
        let found = with_depths(self.q_21, &direction, matches);
        out.push(Candidate {
            kind: CandidateKind::Exact,
            pose: found.pose,
            residual: found.residual,
            in_front: found.in_front,
        });
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scene = Scene::generate(&SceneOptions { points: 12, ..SceneOptions::realistic() }, 3, 0)?;
    let mut candidates = Candidates::new();
    KnownRotation { q_21: scene.truth.q_21 }.solve(&scene.matches, &mut candidates);
    let error = candidates[0].pose.translation_error(&scene.truth).unwrap_or(f64::NAN);
    println!("translation {:.4?}, off by {:.1e}°", candidates[0].pose.t_21.as_slice(), error.to_degrees());
    Ok(())
}
