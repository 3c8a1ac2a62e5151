//! The answers of the start on one scale.

use nalgebra::Vector3;

use super::{FEW, PLANE, POOL, TRANSLATION, Terms, WRONG_WAY};
use crate::RelativePose;
use crate::servo::estimators::tracker::hypothesis::Hypothesis;
use crate::servo::estimators::tracker::map::{KeyImage, PLANE_SLOPE};
use crate::servo::estimators::tracker::resection::{INLIER, KNEE, Point, Task, bounded, resect, residuals};

/// Puts the answer at `count` in its place, unless a better one like it is there, or takes the place of a worse one.
pub(super) fn rank(pool: &mut [Hypothesis], count: &mut usize) {
    let (ready, rest) = pool.split_at_mut(*count);
    let new = &mut rest[0];
    if !(new.score.is_finite() && new.pose.t_21.iter().all(|x| x.is_finite())) {
        return;
    }
    let like = ready.iter().position(|h| h.is_like(new) && h.map.is_planar() == new.map.is_planar());
    let mut place = match like {
        Some(k) if ready[k].score <= new.score => return,
        Some(k) => {
            std::mem::swap(&mut ready[k], new);
            k
        }
        None if *count < POOL => {
            *count += 1;
            *count - 1
        }
        None if ready[POOL - 1].score > new.score => {
            std::mem::swap(&mut ready[POOL - 1], new);
            POOL - 1
        }
        None => return,
    };
    while place > 0 && pool[place].score < pool[place - 1].score {
        pool.swap(place, place - 1);
        place -= 1;
    }
}

/// How many features of the mean image an answer explains.
pub(super) fn explained(h: &Hypothesis, image: &KeyImage, chosen: &[bool]) -> usize {
    let pose = &h.map.keys[0];
    let explains = |i: usize, point: &Point| {
        let Some(z) = image.frame[i].filter(|_| chosen[i]) else { return false };
        let x2 = pose.q_21 * Vector3::new(point.place[0], point.place[1], 1.0) + pose.t_21 * point.rho;
        let off = [x2.x / x2.z - z[0], x2.y / x2.z - z[1]];
        x2.z > 0.0 && off[0] * off[0] + off[1] * off[1] < INLIER * image.variance
    };
    h.map.points.iter().enumerate().filter(|(i, point)| explains(*i, point)).count()
}

/// The scores of an answer whose adjustment has settled.
pub(super) fn judge(
    new: &mut Hypothesis,
    bench: &mut Bench,
    image: &KeyImage,
    chosen: &[bool],
    terms: &Terms<'_>,
) {
    let score = bench.score(new, image, chosen, terms);
    new.pose = new.map.keys[0];
    let plane = if new.map.is_planar() { PLANE } else { 0.0 };
    new.against_rotation = score + TRANSLATION + plane;
    // Of few features the widths of the minima differ by more than their depths.
    new.score = if terms.goal.len() < FEW { score + new.map.log_information } else { new.against_rotation };
    new.start_cost = new.map.cost;
}

/// A squared residual as evidence. A wrong match is anywhere in the image: minus twice the log of its likelihood, relative to that of a
/// right one, is `2 ln(A / 2πσ²)`, 22 for half a pixel and an image of a radian, and a few are expected.
pub(super) fn likely(square: f64) -> f64 {
    const ANYWHERE: f64 = 25.0;
    if square < INLIER { bounded(square, KNEE) } else { ANYWHERE }
}

/// The relief of a wall, as a share of a poster's.
const EXACT: f64 = 0.1;

/// What the judgement works with.
#[derive(Clone, Debug)]
pub(super) struct Bench {
    points: Vec<Point>,
    squares: Vec<f64>,
    scratch: Vec<f64>,
}

impl Bench {
    pub(super) fn new(features: usize) -> Self {
        let empty = Point { place: [0.0; 2], rho: 1.0, variance: 0.0, is_mapped: false };
        Self {
            points: vec![empty; features],
            squares: vec![f64::NAN; features],
            scratch: Vec::with_capacity(features),
        }
    }

    /// Minus twice the log of the marginal likelihood of the mean image, but for a constant: of the scene's class, its plane and its
    /// relief, with the depths integrated out.
    ///
    /// The adjustment's own pose will not do: it fits the depths too, and a translation that is twice too long fits them better, but
    /// costs more by the determinant. In 200 features 1 cm beside the goal the reversed scene then won.
    pub(super) fn score(
        &mut self,
        h: &Hypothesis,
        image: &KeyImage,
        chosen: &[bool],
        terms: &Terms<'_>,
    ) -> f64 {
        // Of a plane it is known that it is one within its relief, but not that it has that much: what the determinant counts of a relief
        // that is not there grows with the parallax, and the twin with the shorter way would win.
        let within = self.score_with(h, h.map.relief, image, chosen, terms);
        if h.map.is_planar() {
            within.min(self.score_with(h, EXACT * h.map.relief, image, chosen, terms))
        } else {
            within
        }
    }

    /// The same, of a scene with this relief.
    fn score_with(
        &mut self,
        h: &Hypothesis,
        relief: f64,
        image: &KeyImage,
        chosen: &[bool],
        terms: &Terms<'_>,
    ) -> f64 {
        let relief = relief * relief;
        for (i, point) in self.points.iter_mut().enumerate() {
            let place = terms.goal[i];
            let (rho, variance) =
                terms.known[i].map_or((h.map.on_plane(place), relief), |known| (known.rho, known.variance));
            *point = Point { place, rho, variance, is_mapped: chosen[i] };
        }
        let task = Task {
            variance: image.variance,
            mapped_only: true,
            depth_variance: None,
            iterations: 10,
            ..terms.task
        };
        let adjusted = h.map.keys[0];
        let first = self.evidence(&adjusted, image, &task);
        let Self { points, squares, scratch } = self;
        let fit = resect(points, &image.frame, &adjusted, &task, squares, scratch);
        let other = fit.map_or(f64::INFINITY, |fit| self.evidence(&fit.pose, image, &task));
        // A start is within about the features' depth of its goal, and a radian.
        let (turn, far) = (adjusted.q_21.angle(), adjusted.t_21.norm_squared());
        let wrong_way = terms.travel.norm() > 1e-3 && adjusted.inverse().t_21.dot(&terms.travel) < 0.0;
        let slope = (h.map.normal.x.powi(2) + h.map.normal.y.powi(2)) / PLANE_SLOPE.powi(2);
        first.min(other) + slope + turn * turn + far + if wrong_way { WRONG_WAY } else { 0.0 }
    }

    /// What the mean image says of a pose. Leaves the squared residuals in `squares`.
    fn evidence(&mut self, pose: &RelativePose, image: &KeyImage, task: &Task) -> f64 {
        residuals(&self.points, &image.frame, pose, task, &mut self.squares);
        let cost: f64 = self.squares.iter().filter(|s| !s.is_nan()).map(|s| likely(*s)).sum();
        cost + self.width(pose, image, task)
    }

    /// The log of the determinant: what the freedom of the depths would fit by chance.
    fn width(&self, pose: &RelativePose, image: &KeyImage, task: &Task) -> f64 {
        let (r_21, t_21) = (pose.r_21(), &pose.t_21);
        let sigma2 = task.variance + task.place_variance;
        let seen = self.points.iter().zip(&image.frame).filter(|(p, z)| p.is_mapped && z.is_some());
        let of = |point: &Point| {
            let x2 = r_21 * Vector3::new(point.place[0], point.place[1], 1.0) + t_21 * point.rho;
            let z = x2.z.max(0.02);
            let a = [t_21.x - x2.x / z * t_21.z, t_21.y - x2.y / z * t_21.z];
            (point.variance * (a[0] * a[0] + a[1] * a[1]) / (z * z) / sigma2).ln_1p()
        };
        seen.map(|(point, _)| of(point)).sum()
    }
}
