//! The kinds of scenes by which solvers are judged.

use std::f64::consts::PI;

use nalgebra::{Unit, UnitQuaternion, Vector3};
use quest_core::RelativePose;
use quest_core::simulate::{Angle, Layout, Motion, Scene, SceneError, SceneOptions, View};

/// A family of scenes with a name. A kind, a seed and an index are one scene, on every machine.
#[derive(Clone, Debug)]
pub struct SceneKind {
    /// The name in tables, and on the command line.
    pub name: String,
    /// How scenes are drawn.
    pub options: SceneOptions,
    /// Whether the axis of the rotation is made orthogonal to the translation, see [`SceneKind::scene`].
    pub partner_at_zero: bool,
}

impl SceneKind {
    fn new(name: impl Into<String>, options: SceneOptions) -> Self {
        Self { name: name.into(), options, partner_at_zero: false }
    }

    /// The same with this many points in a scene.
    #[must_use]
    pub fn with_points(mut self, points: usize) -> Self {
        self.options.points = points;
        self
    }

    /// The scene of this kind, seed and index.
    ///
    /// Every essential matrix has two rotations, `q` and its twisted partner `t ⊗ q`, whose first component is
    /// `−t · q_v`. With `partner_at_zero` it vanishes; a solver that divides by `q1` loses both.
    ///
    /// # Errors
    /// Those of [`Scene::generate`].
    pub fn scene(&self, seed: u64, index: u64) -> Result<Scene, SceneError> {
        if !self.partner_at_zero {
            return Scene::generate(&self.options, seed, index);
        }
        // The new axis moves the points in view 2. Where one of them no longer has an image, the next scene of
        // the same residue serves: indices below 2^32 keep to themselves.
        let mut draw = index;
        loop {
            let drawn = Scene::generate(&self.options, seed, draw)?;
            let turned = with_partner_at_zero(&drawn)?;
            if turned.points2().all(|x| x.z.abs() > 1e-3 * x.norm()) {
                return Ok(turned);
            }
            draw += 1 << 32;
        }
    }
}

/// The points of a scene seen from a camera 2 that is turned about an axis orthogonal to the translation.
fn with_partner_at_zero(scene: &Scene) -> Result<Scene, SceneError> {
    let RelativePose { q_21, t_21 } = scene.truth;
    let direction = t_21.normalize();
    let axis = q_21.axis().map_or_else(Vector3::x, Unit::into_inner);
    // Twice: what the first projection leaves of a nearly parallel axis is orthogonal to few digits.
    let project = |v: Vector3<f64>| (v - direction * direction.dot(&v)).normalize();
    let axis = Unit::new_normalize(project(project(axis)));
    let q_21 = UnitQuaternion::from_axis_angle(&axis, q_21.angle());
    Scene::from_points(RelativePose::new(q_21, t_21), scene.points1.clone())
}

/// The kinds without noise: general ones, then what breaks solvers.
#[must_use]
pub fn noise_free() -> Vec<SceneKind> {
    let general = SceneOptions::default();
    let mut all = vec![
        SceneKind::new("general", general),
        SceneKind::new("realistic", SceneOptions::realistic()),
        SceneKind::new("coplanar", SceneOptions { layout: Layout::Coplanar, ..general }),
        SceneKind::new(
            "coplanar-realistic",
            SceneOptions { layout: Layout::Coplanar, ..SceneOptions::realistic() },
        ),
        SceneKind::new("half-turn", SceneOptions { angle: Angle::Exactly(PI), ..general }),
        SceneKind::new("translation", SceneOptions { motion: Motion::PureTranslation, ..general }),
        SceneKind { partner_at_zero: true, ..SceneKind::new("partner-q1-0", general) },
        SceneKind::new("rotation", SceneOptions { motion: Motion::PureRotation, ..general }),
    ];
    for parallax in [1e-1, 1e-2, 1e-3, 1e-6, 1e-8] {
        let options = SceneOptions { motion: Motion::Parallax(parallax), ..general };
        all.push(SceneKind::new(format!("parallax-{parallax:.0e}"), options));
    }
    all
}

/// Six parallaxes, for the length of the translation.
#[must_use]
pub fn parallaxes() -> Vec<(f64, SceneKind)> {
    let all = [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6].map(|parallax| {
        let options = SceneOptions { motion: Motion::Parallax(parallax), ..SceneOptions::realistic() };
        (parallax, SceneKind::new(format!("length-{parallax:.0e}"), options))
    });
    all.into()
}

/// The kinds with 0.75 px of noise, as the paper has it, with `points` points: those that a camera sees.
/// One more is seen as in section 9.
#[must_use]
pub fn noisy(points: usize) -> Vec<SceneKind> {
    let base = SceneOptions { noise_px: 0.75, points, ..SceneOptions::realistic() };
    vec![
        SceneKind::new("general", base),
        SceneKind::new("coplanar", SceneOptions { layout: Layout::Coplanar, ..base }),
        SceneKind::new("parallax-1e-2", SceneOptions { motion: Motion::Parallax(0.01), ..base }),
        SceneKind::new("rotation", SceneOptions { motion: Motion::PureRotation, ..base }),
        SceneKind::new(
            "section-9",
            SceneOptions {
                view: View::Everywhere,
                ..SceneOptions { noise_px: 0.75, points, ..SceneOptions::default() }
            },
        ),
    ]
}

#[cfg(test)]
mod tests {
    use nalgebra::Quaternion;

    use super::*;

    #[test]
    fn the_twisted_partner_lies_at_zero() {
        let all = noise_free();
        let kind = all.iter().find(|k| k.partner_at_zero).unwrap();
        for index in 0..200 {
            let RelativePose { q_21, t_21 } = kind.scene(crate::SEED, index).unwrap().truth;
            let partner = Quaternion::from_imag(t_21.normalize()) * q_21.into_inner();
            assert!(partner.w.abs() < 1e-15);
        }
    }

    #[test]
    fn every_kind_has_scenes_and_a_name_of_its_own() {
        let mut names: Vec<_> = noise_free().into_iter().map(|k| k.name).collect();
        names.extend(parallaxes().into_iter().map(|(_, k)| k.name));
        names.sort();
        assert!(names.windows(2).all(|w| w[0] != w[1]));
        let parallaxes = parallaxes().into_iter().map(|(_, k)| k);
        for kind in noise_free().into_iter().chain(noisy(35)).chain(parallaxes) {
            for index in 0..20 {
                assert_eq!(kind.scene(1, index).unwrap().matches.len(), kind.options.points);
            }
        }
    }
}
