//! What one hypothesis calls the scene: the goal's features with their depths, a plane, and where the key images were taken.

use nalgebra::Vector3;

use crate::RelativePose;
use crate::servo::estimators::tracker::resection::Point;

/// The prior of the plane: how much its inverse depth changes across the image, one standard deviation, and how exactly it is one in the
/// middle, which fixes the unit of length.
pub(crate) const PLANE_SLOPE: f64 = 0.5;
pub(crate) const PLANE_UNIT: f64 = 0.02;
/// How far the inverse depths of a plane are off it: a hundredth, the relief of a poster.
pub(crate) const PLANE_RELIEF: f64 = 0.01;

/// Steps after a change at most.
const STEPS: usize = 8;

/// An image that the map is adjusted to; all hypotheses share it.
#[derive(Clone, Debug)]
pub(crate) struct KeyImage {
    pub(crate) frame: Vec<Option<[f64; 2]>>,
    /// The variance of a coordinate.
    pub(crate) variance: f64,
}

/// A scene and the key images' poses in it.
#[derive(Clone, Debug)]
pub(crate) struct Map {
    pub(crate) points: Vec<Point>,
    /// The plane `ρ = n · (u, v, 1)` about which the inverse depths scatter.
    pub(crate) normal: Vector3<f64>,
    /// The standard deviation of the inverse depths about the plane.
    pub(crate) relief: f64,
    /// One for each key image.
    pub(crate) keys: Vec<RelativePose>,
    /// The damping of the next step.
    pub(crate) damping: f64,
    /// The cost after the last step; NaN where it has to be found.
    pub(crate) cost: f64,
    /// Steps that are still to be taken: none once the map has settled.
    pub(crate) steps_left: usize,
    /// Whether it has settled since its adequacy was found.
    pub(crate) is_to_be_judged: bool,
    /// How wrong the depths may make a translation, relative to its length: see [`adequacy`](super::adequacy).
    pub(crate) adequacy: f64,
    /// The log of the determinant of the information about the key images' poses and the plane.
    pub(crate) log_information: f64,
}

impl Map {
    pub(crate) fn new(goal: &[[f64; 2]], most_keys: usize, relief: f64) -> Self {
        let point = |place: &[f64; 2]| Point {
            place: *place,
            rho: 1.0,
            variance: relief * relief,
            is_mapped: false,
            is_wrong: false,
        };
        Self {
            points: goal.iter().map(point).collect(),
            normal: Vector3::z(),
            relief,
            keys: Vec::with_capacity(most_keys),
            damping: 1e-4,
            cost: f64::NAN,
            steps_left: 0,
            is_to_be_judged: false,
            adequacy: f64::INFINITY,
            log_information: 0.0,
        }
    }

    /// Nothing known but the goal image and the depths that were given.
    pub(crate) fn forget(&mut self, goal: &[[f64; 2]], known: &[Option<Known>], relief: f64) {
        self.relief = relief;
        self.normal = Vector3::z();
        self.keys.clear();
        (self.damping, self.cost, self.steps_left, self.adequacy) = (1e-4, f64::NAN, 0, f64::INFINITY);
        self.is_to_be_judged = false;
        for ((point, place), known) in self.points.iter_mut().zip(goal).zip(known) {
            let (rho, variance) = known.map_or((1.0, relief * relief), |k| (k.rho, k.variance));
            *point = Point { place: *place, rho, variance, is_mapped: known.is_some(), is_wrong: false };
        }
    }

    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.points.copy_from_slice(&other.points);
        self.keys.clear();
        self.keys.extend_from_slice(&other.keys);
        (self.normal, self.relief, self.damping) = (other.normal, other.relief, other.damping);
        (self.cost, self.steps_left, self.adequacy) = (other.cost, other.steps_left, other.adequacy);
        (self.log_information, self.is_to_be_judged) = (other.log_information, other.is_to_be_judged);
    }

    /// Says whether a feature is a wrong match. Either way what was learnt of its depth is forgotten.
    pub(crate) fn set_wrong(&mut self, i: usize, is_wrong: bool, goal: &[[f64; 2]], known: &[Option<Known>]) {
        let unknown = Known { rho: self.on_plane(goal[i]), variance: self.relief * self.relief };
        let Known { rho, variance } = known[i].unwrap_or(unknown);
        self.points[i] = Point { place: goal[i], rho, variance, is_wrong, ..self.points[i] };
    }

    /// Lets it settle anew.
    pub(crate) fn unsettle(&mut self, damping: f64) {
        (self.cost, self.steps_left, self.damping) = (f64::NAN, STEPS, damping);
    }

    pub(crate) fn is_planar(&self) -> bool {
        self.relief <= PLANE_RELIEF
    }

    /// The inverse depth that the plane gives a feature.
    pub(crate) fn on_plane(&self, place: [f64; 2]) -> f64 {
        self.normal.x * place[0] + self.normal.y * place[1] + self.normal.z
    }
}

/// A depth that was given: the inverse depth in the unit of the loop, and its variance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Known {
    pub(crate) rho: f64,
    pub(crate) variance: f64,
}
