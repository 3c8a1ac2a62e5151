//! `Servo`: a camera that moves to where a goal image was taken, one image in, one command out.

use quest_core::Camera;
use quest_core::servo::{
    Acceleration, Arrival, FilterOptions, FreeCameraLaw, Limits, Rig, Safety, Servo as CoreServo, Step,
    Tracker, on_plane,
};
use quest_core::solver::SolverName;
use serde::{Deserialize, Serialize};
use wasm_bindgen::prelude::*;

use crate::input::{self, not_negative, positive};
use crate::output::{self, PoseObject};

const NAMES: [&str; 14] = [
    "camera",
    "maxSpeed",
    "maxTurnRate",
    "maxAcceleration",
    "maxTurnAcceleration",
    "noise",
    "goalImages",
    "period",
    "unit",
    "rate",
    "explore",
    "tolerance",
    "angleTolerance",
    "solver",
];

#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct Given {
    camera: Option<Camera>,
    max_speed: Option<f64>,
    max_turn_rate: Option<f64>,
    max_acceleration: Option<f64>,
    max_turn_acceleration: Option<f64>,
    noise: Option<f64>,
    goal_images: Option<usize>,
    period: Option<f64>,
    unit: Option<f64>,
    rate: Option<f64>,
    explore: Option<f64>,
    tolerance: Option<f64>,
    angle_tolerance: Option<f64>,
    solver: Option<String>,
}

#[derive(Serialize)]
struct CommandObject {
    linear: [f64; 3],
    angular: [f64; 3],
    state: &'static str,
    advice: String,
    arrived: bool,
    /// Null while the loop holds.
    pose: Option<PoseObject>,
    inliers: usize,
    seen: usize,
}

/// The controller of a free camera. It stands still and says why where the pose cannot be trusted.
#[wasm_bindgen]
pub struct Servo {
    camera: Option<Camera>,
    features: usize,
    servo: CoreServo<Tracker<SolverName>, FreeCameraLaw>,
}

#[wasm_bindgen]
impl Servo {
    /// A controller for this goal image: rows `u, v` of at least five features, pixels where a camera is given, otherwise points on the
    /// plane `z = 1`.
    ///
    /// # Errors
    /// Too few features, a feature without a viewing ray, an impossible option.
    #[wasm_bindgen(constructor)]
    pub fn new(
        goal: &[f64],
        #[wasm_bindgen(unchecked_param_type = "ServoOptions")] options: JsValue,
    ) -> Result<Self, JsError> {
        let given: Given = input::options(options, &NAMES)?;
        let solver = input::solver(given.solver.as_deref())?;
        let goal = goal_points(given.camera.as_ref(), &input::rows("goal", goal)?, solver)?;
        let safety = safety(&given)?;
        let period = positive("period", given.period.or(Some(0.1)))?;
        let unit = positive("unit", given.unit.or(Some(1.0)))?;
        let rate = positive("rate", given.rate.or(Some(0.5)))?;
        let focal_length = given.camera.as_ref().map_or(1.0, |camera| camera.focal_lengths().0);
        let noise = positive("noise", given.noise)? / focal_length;
        let images = given.goal_images.unwrap_or(1).max(1);
        let options = FilterOptions::for_images(noise, images, &safety.limits, period, unit);
        let tracker = Tracker::new(&goal, solver, options);
        let rig = Rig { period, unit, ..Rig::default() };
        let servo = CoreServo::new(&goal, tracker, FreeCameraLaw { rate, unit }, safety).with_rig(rig);
        Ok(Self { camera: given.camera, features: goal.len(), servo })
    }

    /// The command for one image: rows `u, v` of the same features in the same order, NaN for those that are not seen.
    ///
    /// # Errors
    /// Another number of rows than the goal has.
    #[wasm_bindgen(unchecked_return_type = "Command")]
    pub fn step(&mut self, points: &[f64]) -> Result<JsValue, JsError> {
        let points: Vec<[f64; 2]> = input::rows("points", points)?;
        if points.len() != self.features {
            let (found, expected) = (points.len(), self.features);
            return Err(JsError::new(&format!(
                "points has {found} rows, expected {expected} as goal, NaN for features that are not seen"
            )));
        }
        let features: Vec<_> = points.iter().map(|&p| point_on_plane(self.camera.as_ref(), p)).collect();
        output::object(&CommandObject::from(&self.servo.step(&features)))
    }

    /// Forgets everything but the goal.
    pub fn reset(&mut self) {
        self.servo.reset();
    }
}

/// The limits and guards that suit a robot, but for what is given.
fn safety(given: &Given) -> Result<Safety, JsError> {
    let limits = Limits {
        speed: positive("maxSpeed", given.max_speed)?,
        turn_rate: positive("maxTurnRate", given.max_turn_rate)?,
    };
    let usual = Safety::for_robot(limits);
    let acceleration =
        usual.acceleration.unwrap_or(Acceleration { linear: f64::INFINITY, angular: f64::INFINITY });
    let Arrival { distance, angle, seconds } = usual.arrival;
    let degrees = not_negative("angleTolerance", given.angle_tolerance, angle.to_degrees())?;
    Ok(Safety {
        acceleration: Some(Acceleration {
            linear: not_negative("maxAcceleration", given.max_acceleration, acceleration.linear)?,
            angular: not_negative("maxTurnAcceleration", given.max_turn_acceleration, acceleration.angular)?,
        }),
        explore: not_negative("explore", given.explore, usual.explore)?,
        arrival: Arrival {
            distance: not_negative("tolerance", given.tolerance, distance)?,
            angle: degrees.to_radians(),
            seconds,
        },
        ..usual
    })
}

impl From<&Step> for CommandObject {
    fn from(step: &Step) -> Self {
        Self {
            linear: step.command.linear.into(),
            angular: step.command.angular.into(),
            state: step.state.name(),
            advice: step.advice().to_string(),
            arrived: step.status.arrived,
            pose: step.estimate.as_ref().ok().map(|estimate| (&estimate.pose).into()),
            inliers: step.status.inliers,
            seen: step.status.seen,
        }
    }
}

fn goal_points(
    camera: Option<&Camera>,
    points: &[[f64; 2]],
    solver: SolverName,
) -> Result<Vec<[f64; 2]>, JsError> {
    let (found, needed) = (points.len(), solver.info().min_matches);
    if found < needed {
        return Err(JsError::new(&format!("goal has {found} features, expected at least {needed}")));
    }
    let on_plane = points.iter().enumerate().map(|(row, &p)| {
        point_on_plane(camera, p).ok_or_else(|| {
            let [u, v] = p;
            JsError::new(&format!(
                "row {row} of goal is ({u}, {v}), which is not finite or has no viewing ray in front; expected every feature to have one"
            ))
        })
    });
    on_plane.collect()
}

/// A pixel, or a point given so, on the plane z = 1.
fn point_on_plane(camera: Option<&Camera>, point: [f64; 2]) -> Option<[f64; 2]> {
    match camera {
        Some(camera) => on_plane(camera, point),
        None => Some(point).filter(|p| p.iter().all(|c| c.is_finite())),
    }
}
