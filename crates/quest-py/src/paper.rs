//! What `quest_pose.paper` names: the pieces of the paper that have no place in another function.

use nalgebra::Vector3;
use numpy::PyArray2;
use pyo3::prelude::*;
use quest_core::simulate::{self, Angle, Boxes, Layout, Motion, Scene, SceneError, SceneOptions, View};
use quest_core::{InputError, quaternion, structure};

use crate::arrays;
use crate::errors::{self, QuestError};
use crate::estimate::{rotation, vector3};
use crate::solve::Views;
use crate::supervisor::apart;

/// `t`, the depths in view 1 and in view 2, the residual, the matches in front.
type Completed = ([f64; 3], Vec<f64>, Vec<f64>, f64, usize);

/// A direction takes two matches.
const MIN_MATCHES: usize = 2;

#[pyfunction]
pub(crate) fn _translation_and_depths(
    py: Python<'_>,
    r: &Bound<'_, PyAny>,
    x1: &Bound<'_, PyAny>,
    x2: &Bound<'_, PyAny>,
    camera1: Option<&Bound<'_, PyAny>>,
    camera2: Option<&Bound<'_, PyAny>>,
) -> PyResult<Completed> {
    let q_21 = rotation("R", r)?;
    let views = Views::new(x1, x2, camera1, camera2)?;
    py.detach(|| {
        let matches = views.matches().map_err(|error| errors::input(&error))?;
        if matches.len() < MIN_MATCHES {
            return Err(errors::input(&InputError::TooFewMatches {
                found: matches.len(),
                needed: MIN_MATCHES,
            }));
        }
        let direction = structure::translation_direction(&q_21, &matches);
        let found = structure::with_depths(q_21, &direction, &matches);
        let finite = |z: f64| if z.is_finite() { z } else { f64::INFINITY };
        let depths = |m| {
            found.pose.depths(m).map_or((f64::INFINITY, f64::INFINITY), |(z1, z2)| (finite(z1), finite(z2)))
        };
        let (depths1, depths2) = matches.iter().map(depths).unzip();
        Ok((found.pose.t_21.into(), depths1, depths2, found.residual, found.in_front))
    })
}

#[pyfunction]
pub(crate) fn _rotation_metric(r: &Bound<'_, PyAny>, r_est: &Bound<'_, PyAny>) -> PyResult<f64> {
    Ok(simulate::rotation_metric(&rotation("R", r)?, &rotation("R_est", r_est)?))
}

#[pyfunction]
pub(crate) fn _translation_metric(t: &Bound<'_, PyAny>, t_est: &Bound<'_, PyAny>) -> PyResult<f64> {
    let usual = |t: Vector3<f64>| if t.amax() > 0.0 { t.unscale(t.amax()) } else { t };
    let (t, t_est) = (usual(vector3("t", t)?), usual(vector3("t_est", t_est)?));
    Ok(simulate::translation_metric(&t, &t_est))
}

#[pyfunction]
pub(crate) fn _parallax(
    t: &Bound<'_, PyAny>,
    depths1: &Bound<'_, PyAny>,
    depths2: &Bound<'_, PyAny>,
) -> PyResult<f64> {
    let (t, depths1, depths2) =
        (vector3("t", t)?, arrays::vector("depths1", depths1)?, arrays::vector("depths2", depths2)?);
    simulate::parallax(&t, &depths1, &depths2).ok_or_else(|| {
        QuestError::new_err(
            "the depths have no mean, expected finite depths in depths1 or depths2, not all zero",
        )
    })
}

/// The names of the columns of the constraint matrix, and its row (40).
#[pyfunction]
pub(crate) fn _columns() -> (Vec<String>, Vec<f64>) {
    (quaternion::monomial_names().to_vec(), quaternion::NORM_ROW.to_vec())
}

/// `x1`, `x2`, `R`, `t` and the points in the frame of camera 1.
type Drawn<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    [f64; 3],
    Bound<'py, PyArray2<f64>>,
);

#[pyfunction]
#[pyo3(signature = (points, layout, motion, parallax, max_angle, view, noise_px, rounded, boxes, seed, index))]
#[expect(clippy::too_many_arguments, reason = "the keywords of its wrapper")]
pub(crate) fn _scene<'py>(
    py: Python<'py>,
    points: i128,
    layout: &str,
    motion: &str,
    parallax: Option<f64>,
    max_angle: Option<f64>,
    view: &str,
    noise_px: f64,
    rounded: bool,
    boxes: ([[f64; 2]; 3], [f64; 3]),
    seed: i128,
    index: i128,
) -> PyResult<Drawn<'py>> {
    let base = match view {
        "everywhere" => SceneOptions::default(),
        "in-both-images" => SceneOptions::realistic(),
        _ => return Err(unknown("view", view, "everywhere, in-both-images")),
    };
    let (seed, index) = (arrays::whole("seed", seed)?, arrays::whole("index", index)?);
    let options = SceneOptions {
        points: arrays::whole("points", points)?,
        layout: match layout {
            "general" => Layout::General,
            "coplanar" => Layout::Coplanar,
            _ => return Err(unknown("layout", layout, "general, coplanar")),
        },
        motion: match (motion, parallax) {
            ("general", None) => Motion::General,
            ("general", Some(parallax)) => Motion::Parallax(parallax),
            ("rotation", None) => Motion::PureRotation,
            ("translation", None) => Motion::PureTranslation,
            ("rotation" | "translation", Some(_)) => {
                return Err(QuestError::new_err(format!(
                    "parallax is given with motion={motion:?}, expected motion=\"general\" with it"
                )));
            }
            _ => return Err(unknown("motion", motion, "general, rotation, translation")),
        },
        angle: max_angle.map_or(base.angle, Angle::UpTo),
        boxes: Boxes { points: boxes.0, translation: boxes.1 },
        noise_px,
        rounded,
        view: if view == "everywhere" { View::Everywhere } else { View::InBothImages },
    };
    let drawn = py.detach(|| apart(move || Scene::generate(&options, seed, index)));
    let scene = drawn?.map_err(|error: SceneError| QuestError::new_err(error.to_string()))?;
    let on_plane = |b: &Vector3<f64>| [b.x / b.z, b.y / b.z];
    let image1 = scene.matches.iter().map(|m| on_plane(m.bearing1())).collect();
    let image2 = scene.matches.iter().map(|m| on_plane(m.bearing2())).collect();
    let rows: [[f64; 3]; 3] = scene.truth.r_21().transpose().into();
    Ok((
        arrays::to_numpy(py, image1),
        arrays::to_numpy(py, image2),
        arrays::to_numpy(py, rows.to_vec()),
        scene.truth.t_21.into(),
        arrays::to_numpy(py, scene.points1.iter().map(|x| (*x).into()).collect()),
    ))
}

fn unknown(name: &str, found: &str, expected: &str) -> PyErr {
    QuestError::new_err(format!("{name} is {found:?}, expected one of {expected}"))
}
