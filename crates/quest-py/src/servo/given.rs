//! What both controllers are told, and what they are made of.

use std::fmt::Debug;
use std::sync::{Arc, Mutex};

use nalgebra::{Matrix3, Rotation3, UnitQuaternion};
use pyo3::prelude::*;
use quest_core::RelativePose;
use quest_core::servo::{
    Acceleration, Arrival, Axes, Border, ControlLaw, FilterOptions, Limits, Mount, Plane, PoseEstimator, Rig,
    Safety, Servo, Tracker, Twist, on_plane,
};
use quest_core::solver::SolverName;

use super::command::Command;
use super::controller::AnyLoop;
use crate::errors::{NotFinite, QuestError, ShapeMismatch, TooFewMatches};
use crate::{arrays, camera, coordinates};

/// The arguments of both controllers.
pub(super) struct Given<'a, 'py> {
    pub(super) goal: &'a Bound<'py, PyAny>,
    pub(super) camera: Option<&'a Bound<'py, PyAny>>,
    pub(super) limits: (f64, f64),
    pub(super) acceleration: (Option<f64>, Option<f64>),
    pub(super) noise: f64,
    pub(super) goal_images: u32,
    pub(super) period: f64,
    pub(super) unit: Option<f64>,
    pub(super) depths: Option<&'a Bound<'py, PyAny>>,
    pub(super) depth_precision: Option<&'a Bound<'py, PyAny>>,
    pub(super) solver: Option<&'a str>,
    pub(super) plane: Option<Plane>,
    pub(super) border: f64,
    pub(super) explore: f64,
    pub(super) coasting_images: usize,
    pub(super) largest_gap: f64,
    /// Metres, degrees, seconds.
    pub(super) arrival: (f64, f64, f64),
    pub(super) mount: Mount,
    pub(super) axes: Axes,
}

/// A positive number of the argument `name`.
pub(super) fn positive(name: &str, value: f64) -> PyResult<f64> {
    if value > 0.0 && value.is_finite() {
        return Ok(value);
    }
    Err(QuestError::new_err(format!("{name} is {value}, expected a positive number")))
}

/// A number of the argument `name` that is not negative; infinity counts.
pub(super) fn not_negative(name: &str, value: f64) -> PyResult<f64> {
    if value >= 0.0 {
        return Ok(value);
    }
    Err(QuestError::new_err(format!("{name} is {value}, expected a number that is not negative")))
}

/// The inverse depths' harmonic mean: the unit of `t` where the depths are in metres.
fn unit_of(depths: &[f64]) -> Option<f64> {
    let (sum, count) = depths
        .iter()
        .filter(|z| z.is_finite())
        .fold((0.0, 0.0), |(sum, count), z| (sum + 1.0 / z, count + 1.0));
    (count > 0.0).then_some(count / sum)
}

/// Depths of the argument `depths` with the precision of each: NaN where a feature has none.
pub(super) fn depths(
    given: &Bound<'_, PyAny>,
    precision: Option<&Bound<'_, PyAny>>,
    features: usize,
) -> PyResult<(Vec<f64>, Vec<f64>)> {
    let depths = arrays::vector("depths", given)?;
    let bad = depths.iter().find(|z| !(z.is_nan() || (**z > 0.0 && z.is_finite())));
    if depths.len() != features || bad.is_some() {
        let found = bad.map_or_else(|| format!("{} numbers", depths.len()), |z| format!("the number {z}"));
        return Err(ShapeMismatch::new_err(format!(
            "depths has {found}, expected {features} that are positive, NaN where a depth is not known"
        )));
    }
    let precision = match precision {
        None => vec![0.02; features],
        Some(given) => match given.extract::<f64>() {
            Ok(one) => vec![positive("depth_precision", one)?; features],
            Err(_) => arrays::vector("depth_precision", given)?,
        },
    };
    if precision.len() != features || precision.iter().any(|p| *p <= 0.0) {
        let found = precision.len();
        return Err(ShapeMismatch::new_err(format!(
            "depth_precision has {found} numbers, expected one or {features} that are positive"
        )));
    }
    Ok((depths, precision))
}

/// The pose of a camera from a matrix of shape (4, 4), or from its first three rows.
pub(super) fn transform(name: &str, given: &Bound<'_, PyAny>) -> PyResult<RelativePose> {
    let rows: Vec<[f64; 4]> = arrays::rows(name, given)?;
    let wrong = |found: &str| {
        QuestError::new_err(format!(
            "{name} {found}, expected a rotation and a translation in metres as a matrix of shape (4, 4)"
        ))
    };
    let [a, b, c, ..] = rows[..] else { return Err(wrong(&format!("has {} rows", rows.len()))) };
    let r = Matrix3::new(a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2]);
    let is_rotation = (r * r.transpose() - Matrix3::identity()).amax() < 1e-6 && r.determinant() > 0.0;
    if !is_rotation || ![a[3], b[3], c[3]].iter().all(|x| x.is_finite()) {
        return Err(wrong("is no rigid transform"));
    }
    let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(r));
    Ok(RelativePose::new(q, [a[3], b[3], c[3]].into()))
}

/// What both controllers are made of.
#[derive(Debug)]
pub(super) struct Loop<L> {
    camera: Option<quest_core::Camera>,
    pub(super) servo: Servo<Tracker<SolverName>, L>,
    /// The last image on the plane z = 1.
    seen: Vec<Option<[f64; 2]>>,
}

impl<L: ControlLaw> Loop<L> {
    /// The loop with the law that is made of the unit in metres.
    pub(super) fn shared(
        given: &Given<'_, '_>,
        law: impl Fn(f64) -> PyResult<L>,
    ) -> PyResult<Arc<Mutex<Self>>> {
        let camera = given.camera.map(|c| camera::from_argument("camera", c)).transpose()?;
        let solver = given.solver.map_or(Ok(SolverName::default()), str::parse);
        let solver = solver.map_err(|error| QuestError::new_err(error.to_string()))?;
        let goal = goal_points(given.goal, camera.as_ref(), solver.info().min_matches)?;
        let known = given.depths.map(|d| depths(d, given.depth_precision, goal.len())).transpose()?;
        let metres = known.as_ref().and_then(|(z, _)| unit_of(z));
        let unit = positive("unit", given.unit.or(metres).unwrap_or(1.0))?;
        let safety = safety(given, camera.as_ref())?;
        let focal = camera.as_ref().map_or(1.0, |c| c.focal_lengths().0);
        let noise = positive("noise", given.noise)? / focal;
        let period = positive("period", given.period)?;
        let images = given.goal_images.max(1) as usize;
        let base = given.mount.pose();
        let options = FilterOptions {
            plane: given.plane,
            base: RelativePose::new(base.q_21, base.t_21 / unit),
            ..FilterOptions::for_images(noise, images, &safety.limits, period, unit)
        };
        let mut tracker = Tracker::new(&goal, solver, options);
        if let Some((z, precision)) = &known {
            tracker.set_depths_each(z, precision);
        }
        let rig = Rig { period, unit, mount: given.mount, axes: given.axes };
        let servo = Servo::new(&goal, tracker, law(unit)?, safety).with_rig(rig);
        Ok(Arc::new(Mutex::new(Self { camera, servo, seen: vec![None; goal.len()] })))
    }
}

impl<L: ControlLaw + Debug + Send> AnyLoop for Loop<L> {
    fn features(&self) -> usize {
        self.seen.len()
    }

    fn step(&mut self, points: &[[f64; 2]], stamp: Option<f64>, now: Option<f64>) -> Command {
        for (seen, point) in self.seen.iter_mut().zip(points) {
            *seen = point_on_plane(self.camera.as_ref(), *point);
        }
        let step = match stamp {
            Some(stamp) => self.servo.step_at(&self.seen, stamp, now.unwrap_or(stamp)),
            None => self.servo.step(&self.seen),
        };
        Command::new(&step, self.servo.estimator().inliers(), self.seen.len())
    }

    fn idle(&mut self, now: f64) -> Twist {
        self.servo.idle(now)
    }

    fn reset(&mut self) {
        self.servo.reset();
    }

    fn depths(&mut self) -> (Vec<f64>, Vec<f64>) {
        let (unit, features) = (self.servo.rig_mut().unit, self.seen.len());
        let all = |numbers: Vec<f64>| if numbers.is_empty() { vec![f64::NAN; features] } else { numbers };
        let filter = self.servo.estimator();
        (all(filter.depths().map(|z| unit * z).collect()), all(filter.depth_precisions().collect()))
    }

    fn set_depths(&mut self, depths: &[f64], precision: &[f64]) {
        self.servo.reset();
        self.servo.estimator_mut().set_depths_each(depths, precision);
    }

    fn safety(&mut self) -> &mut Safety {
        self.servo.safety_mut()
    }

    fn rig(&mut self) -> &mut Rig {
        self.servo.rig_mut()
    }
}

/// The goal's features on the plane z = 1.
fn goal_points(
    given: &Bound<'_, PyAny>,
    camera: Option<&quest_core::Camera>,
    needed: usize,
) -> PyResult<Vec<[f64; 2]>> {
    let points: Vec<[f64; 2]> = arrays::rows("goal", given)?;
    if points.len() < needed {
        let found = points.len();
        return Err(TooFewMatches::new_err(format!("goal has {found} features, expected at least {needed}")));
    }
    match camera {
        Some(camera) => coordinates::in_pixels("goal", &points, camera)?,
        None => coordinates::on_plane("goal", &points)?,
    }
    let on_plane = |(row, &[u, v]): (usize, &[f64; 2])| {
        point_on_plane(camera, [u, v]).ok_or_else(|| {
            NotFinite::new_err(format!(
                "row {row} of goal is ({u}, {v}), which is not finite or has no viewing ray in front; expected every \
                 feature to be seen in the goal image: leave the others out, and their rows of later images"
            ))
        })
    };
    points.iter().enumerate().map(on_plane).collect()
}

/// Limits and guards.
fn safety(given: &Given<'_, '_>, camera: Option<&quest_core::Camera>) -> PyResult<Safety> {
    let limits = Limits {
        speed: positive("max_speed", given.limits.0)?,
        turn_rate: positive("max_turn_rate", given.limits.1)?,
    };
    let usual = Safety::for_robot(limits);
    let acceleration = usual.acceleration.map(|a| Acceleration {
        linear: given.acceleration.0.unwrap_or(a.linear),
        angular: given.acceleration.1.unwrap_or(a.angular),
    });
    if let Some(a) = &acceleration {
        not_negative("max_acceleration", a.linear)?;
        not_negative("max_turn_acceleration", a.angular)?;
    }
    let (distance, degrees, seconds) = given.arrival;
    let border = camera.and_then(|c| Border::of_camera(c, given.border));
    Ok(Safety {
        acceleration,
        border: border.filter(|_| given.plane.is_some()),
        coasting_images: given.coasting_images,
        largest_gap: not_negative("largest_gap", given.largest_gap)?,
        explore: not_negative("explore", given.explore)?,
        arrival: Arrival {
            distance: not_negative("tolerance", distance)?,
            angle: not_negative("angle_tolerance", degrees)?.to_radians(),
            seconds: not_negative("arrival_time", seconds)?,
        },
        ..usual
    })
}

/// A pixel, or a point given so, on the plane z = 1.
fn point_on_plane(camera: Option<&quest_core::Camera>, point: [f64; 2]) -> Option<[f64; 2]> {
    match camera {
        Some(camera) => on_plane(camera, point),
        None => Some(point).filter(|p| p.iter().all(|c| c.is_finite())),
    }
}
