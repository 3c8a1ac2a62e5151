//! `solve --rotation`: translation and depths for a rotation that is known, section 8.

use nalgebra::{Quaternion, UnitQuaternion};
use quest_core::{
    Candidate, CandidateKind, Correspondence,
    structure::{translation_direction, with_depths},
};

/// A direction of translation takes two matches.
pub(super) const MIN_MATCHES: usize = 2;

/// What stands in the place of a solver's name, and of the kind of a candidate.
pub(super) const NAME: &str = "rotation";
pub(super) const KIND: &str = "given_rotation";

/// `w,x,y,z` as a unit quaternion.
pub(super) fn parse(text: &str) -> Result<UnitQuaternion<f64>, String> {
    let numbers = text.split(',').map(|field| field.trim().parse::<f64>()).collect::<Result<Vec<_>, _>>();
    let Ok([w, x, y, z]) = numbers.as_deref() else {
        return Err(format!("found {text:?}, expected the four numbers w,x,y,z of a quaternion"));
    };
    let q = Quaternion::new(*w, *x, *y, *z);
    // Printed quaternions have three digits; another length is a mistake.
    if (q.norm() - 1.0).abs() < 0.01 {
        Ok(UnitQuaternion::new_normalize(q))
    } else {
        Err(format!("found a quaternion of length {}, expected length 1", q.norm()))
    }
}

/// The pose with this rotation.
pub(super) fn candidate(q_21: UnitQuaternion<f64>, matches: &[Correspondence]) -> Candidate {
    let direction = translation_direction(&q_21, matches);
    let completed = with_depths(q_21, &direction, matches);
    Candidate {
        kind: CandidateKind::Exact,
        pose: completed.pose,
        residual: completed.residual,
        in_front: completed.in_front,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use quest_core::simulate::{Scene, SceneOptions};

    #[test]
    fn the_true_rotation_gives_the_true_translation_and_depths() {
        for index in 0..50 {
            let scene = Scene::generate(&SceneOptions::realistic(), 8, index).unwrap();
            let found = candidate(scene.truth.q_21, &scene.matches);
            assert!((found.pose.t_21 - scene.truth.t_21).norm() < 1e-9 && found.in_front == 5);
            for (m, x1) in scene.matches.iter().zip(&scene.points1) {
                let (z1, _) = found.depths(m).unwrap();
                assert!((z1 - x1.z).abs() < 1e-6, "{z1} {}", x1.z);
            }
        }
    }

    #[test]
    fn a_quaternion_is_four_numbers_of_length_one() {
        let q = parse("0.943, -0.110, -0.223,-0.221").unwrap();
        assert!((q.w - 0.943).abs() < 1e-3 && (q.norm() - 1.0).abs() < 1e-15);
        for wrong in ["1,0,0", "a,b,c,d", "0,0,0,0", "2,0,0,0", "NaN,0,0,0", ""] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }
}
