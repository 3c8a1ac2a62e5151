//! The answers of the start on one scale.

use nalgebra::{Matrix3, Vector3};

use super::{FEW, PLANE, POOL, TRANSLATION, Terms, WRONG_WAY};
use crate::RelativePose;
use crate::servo::estimators::tracker::hypothesis::Hypothesis;
use crate::servo::estimators::tracker::map::{KeyImage, PLANE_RELIEF, PLANE_SLOPE};
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

/// A wrong match is anywhere in the image: minus twice the log of its likelihood, relative to that of a right one, is `2 ln(A / 2πσ²)`, 22
/// for half a pixel and an image of a radian, and a few are expected.
const ANYWHERE: f64 = 25.0;

/// What a wrong match costs beside right ones with this share of the variance that was told.
pub(super) fn anywhere(noise: f64) -> f64 {
    ANYWHERE - 2.0 * noise.ln()
}

/// A squared residual as evidence, where a wrong match costs `anywhere`.
pub(super) fn likely(square: f64, anywhere: f64) -> f64 {
    if square < INLIER { bounded(square, KNEE) } else { anywhere }
}

/// What a scene costs more that is partly a plane. A plane with wrong matches that lie on their epipolar lines by chance is to come first;
/// the scene is kept beside it, and the first motion tells them apart.
const MIXED: f64 = 40.0;

/// The relief of a wall, as a share of a poster's.
const EXACT: f64 = 0.1;

/// What the judgement works with.
#[derive(Clone, Debug)]
pub(super) struct Bench {
    /// The share of the variance that was told which the matches show.
    pub(super) noise: f64,
    points: Vec<Point>,
    /// What each feature costs on the plane.
    on_plane: Vec<f64>,
    squares: Vec<f64>,
    scratch: Vec<f64>,
}

impl Bench {
    pub(super) fn new(features: usize) -> Self {
        let empty = Point { place: [0.0; 2], rho: 1.0, variance: 0.0, is_mapped: false, is_wrong: false };
        Self {
            noise: 1.0,
            points: vec![empty; features],
            on_plane: vec![f64::NAN; features],
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
        } else if terms.goal.len() >= FEW {
            let mixed = within.min(self.score_mixed(h, PLANE_RELIEF, image, chosen, terms));
            if self.noise < 1.0 {
                return mixed.min(self.score_mixed(h, EXACT * PLANE_RELIEF, image, chosen, terms));
            }
            mixed
        } else {
            // Of few features several are near any plane.
            within
        }
    }

    /// The score of a scene most of which may be a plane: each feature is on it or anywhere, and the share of those on it is free.
    ///
    /// A box in front of a wall is such a scene. As a scene with relief it pays for the freedom of depths that are all alike, and a
    /// rotation or a wrong plane won.
    fn score_mixed(
        &mut self,
        h: &Hypothesis,
        flat: f64,
        image: &KeyImage,
        chosen: &[bool],
        terms: &Terms<'_>,
    ) -> f64 {
        let plane = plane_through(&h.map.points, h.map.normal, terms.goal, chosen);
        let task = self.task(image, terms);
        let (flat, free) = (flat * flat, h.map.relief * h.map.relief);
        for (i, point) in self.points.iter_mut().enumerate() {
            let place = terms.goal[i];
            let on_plane = plane.dot(&Vector3::new(place[0], place[1], 1.0));
            let off = (h.map.points[i].rho - on_plane).powi(2);
            let is_on = off < (free / flat).ln() * flat;
            let (rho, variance) = terms.known[i]
                .map_or((on_plane, if is_on { flat } else { free }), |known| (known.rho, known.variance));
            *point = Point { place, rho, variance, is_mapped: chosen[i], is_wrong: false };
        }
        let adjusted = h.map.keys[0];
        residuals(&self.points, &image.frame, &adjusted, &task, &mut self.squares);
        let Self { points, squares, scratch, .. } = self;
        let fit = resect(points, &image.frame, &adjusted, &task, squares, scratch);
        let first = self.evidence_mixed(&adjusted, image, &task, [flat, free], terms);
        let other = fit
            .map_or(f64::INFINITY, |fit| self.evidence_mixed(&fit.pose, image, &task, [flat, free], terms));
        first.min(other) + prior(&adjusted, &plane, terms)
    }

    /// What the mean image says of a pose where each feature's depth has one of two variances.
    fn evidence_mixed(
        &mut self,
        pose: &RelativePose,
        image: &KeyImage,
        task: &Task,
        variances: [f64; 2],
        terms: &Terms<'_>,
    ) -> f64 {
        let (mut sum, most) = (0.0, anywhere(self.noise));
        for (class, variance) in variances.into_iter().enumerate() {
            for (point, known) in self.points.iter_mut().zip(terms.known) {
                point.variance = known.map_or(variance, |known| known.variance);
            }
            residuals(&self.points, &image.frame, pose, task, &mut self.squares);
            let widths = Widths::new(pose, task);
            for ((square, point), cost) in self.squares.iter_mut().zip(&self.points).zip(&mut self.on_plane) {
                let this = (likely(*square, most) + widths.of(point)).min(most);
                if class == 0 {
                    *cost = this;
                } else {
                    *square = if square.is_nan() { f64::NAN } else { this };
                }
            }
        }
        let pairs = || self.on_plane.iter().zip(&self.squares).filter(|(_, free)| !free.is_nan());
        let count = pairs().count() as f64;
        let share = (pairs().filter(|(on, free)| on < free).count() as f64 + 1.0) / (count + 2.0);
        for (on, free) in pairs() {
            let likelihood = share * (-0.5 * on).exp() + (1.0 - share) * (-0.5 * free).exp();
            sum += (-2.0 * likelihood.ln()).min(most);
        }
        // The share is a number more. A scene that may as well be a plane is taken for one, whose depths are known better.
        sum + count.max(1.0).ln() + MIXED
    }

    /// The score of a scene with this relief.
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
            *point = Point { place, rho, variance, is_mapped: chosen[i], is_wrong: false };
        }
        let task = self.task(image, terms);
        let adjusted = h.map.keys[0];
        let first = self.evidence(&adjusted, image, &task);
        let Self { points, squares, scratch, .. } = self;
        let fit = resect(points, &image.frame, &adjusted, &task, squares, scratch);
        let other = fit.map_or(f64::INFINITY, |fit| self.evidence(&fit.pose, image, &task));
        first.min(other) + prior(&adjusted, &h.map.normal, terms)
    }

    /// How the mean image is fitted.
    fn task(&self, image: &KeyImage, terms: &Terms<'_>) -> Task {
        Task {
            variance: self.noise * image.variance,
            place_variance: self.noise * terms.task.place_variance,
            mapped_only: true,
            depth_variance: None,
            iterations: 10,
            ..terms.task
        }
    }

    /// What the mean image says of a pose. Leaves the squared residuals in `squares`.
    fn evidence(&mut self, pose: &RelativePose, image: &KeyImage, task: &Task) -> f64 {
        residuals(&self.points, &image.frame, pose, task, &mut self.squares);
        let cost: f64 =
            self.squares.iter().filter(|s| !s.is_nan()).map(|s| likely(*s, anywhere(self.noise))).sum();
        cost + self.width(pose, image, task)
    }

    /// The log of the determinant: what the freedom of the depths would fit by chance.
    fn width(&self, pose: &RelativePose, image: &KeyImage, task: &Task) -> f64 {
        let widths = Widths::new(pose, task);
        let seen = self.points.iter().zip(&image.frame).filter(|(p, z)| p.is_mapped && z.is_some());
        seen.map(|(point, _)| widths.of(point)).sum()
    }
}

/// What the freedom of a depth would fit by chance, at a pose.
struct Widths {
    r_21: Matrix3<f64>,
    t_21: Vector3<f64>,
    variance: f64,
}

impl Widths {
    fn new(pose: &RelativePose, task: &Task) -> Self {
        Self { r_21: pose.r_21(), t_21: pose.t_21, variance: task.variance + task.place_variance }
    }

    fn of(&self, point: &Point) -> f64 {
        let t_21 = &self.t_21;
        let x2 = self.r_21 * Vector3::new(point.place[0], point.place[1], 1.0) + t_21 * point.rho;
        let z = x2.z.max(0.02);
        let a = [t_21.x - x2.x / z * t_21.z, t_21.y - x2.y / z * t_21.z];
        (point.variance * (a[0] * a[0] + a[1] * a[1]) / (z * z) / self.variance).ln_1p()
    }
}

/// A start is within about the features' depth of its goal, and a radian; planes are not steep.
fn prior(pose: &RelativePose, plane: &Vector3<f64>, terms: &Terms<'_>) -> f64 {
    let (turn, far) = (pose.q_21.angle(), pose.t_21.norm_squared());
    let wrong_way = terms.travel.norm() > 1e-3 && pose.inverse().t_21.dot(&terms.travel) < 0.0;
    let slope = (plane.x.powi(2) + plane.y.powi(2)) / PLANE_SLOPE.powi(2);
    slope + turn * turn + far + if wrong_way { WRONG_WAY } else { 0.0 }
}

/// The plane that most of the inverse depths are near, from one that is known.
fn plane_through(points: &[Point], first: Vector3<f64>, goal: &[[f64; 2]], chosen: &[bool]) -> Vector3<f64> {
    /// Those off by three reliefs of a plane count less and less.
    const SCALE: f64 = 3.0 * PLANE_RELIEF;
    let mut plane = first;
    for _ in 0..10 {
        let (mut a, mut b) = (Matrix3::identity() * 1e-9, Vector3::zeros());
        for ((point, goal), _) in points.iter().zip(goal).zip(chosen).filter(|(_, chosen)| **chosen) {
            let m = Vector3::new(goal[0], goal[1], 1.0);
            let weight = 1.0 / (1.0 + ((point.rho - plane.dot(&m)) / SCALE).powi(2));
            a += m * m.transpose() * weight;
            b += m * (weight * point.rho);
        }
        let Some(factor) = a.cholesky() else { return first };
        plane = factor.solve(&b);
    }
    if plane.iter().all(|x| x.is_finite()) { plane } else { first }
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;
    use crate::servo::estimators::tracker::map::Map;

    const GOAL: [[f64; 2]; 9] = [
        [0.0, 0.0],
        [0.3, 0.1],
        [-0.2, 0.3],
        [0.1, -0.4],
        [-0.3, -0.1],
        [0.4, 0.4],
        [-0.4, 0.2],
        [0.2, -0.2],
        [-0.1, 0.4],
    ];

    /// An answer that is told apart from others by its way.
    fn answer(x: f64, score: f64, relief: f64) -> Hypothesis {
        let mut h = Hypothesis::new(Map::new(&GOAL, 4, relief));
        h.pose = RelativePose::new(UnitQuaternion::identity(), Vector3::x() * x);
        h.score = score;
        h
    }

    /// The ways and scores of the pool after these answers.
    fn ranked(answers: impl IntoIterator<Item = Hypothesis>) -> Vec<(f64, f64)> {
        let mut pool = vec![answer(0.0, 0.0, 0.3); POOL + 1];
        let mut count = 0;
        for new in answers {
            pool[count] = new;
            rank(&mut pool, &mut count);
        }
        pool[..count].iter().map(|h| (h.pose.t_21.x, h.score)).collect()
    }

    #[test]
    fn the_best_answers_come_first_each_of_them_once() {
        let of = |x, score| answer(x, score, 0.3);
        assert_eq!(ranked([of(1.0, 5.0), of(2.0, 3.0), of(3.0, 4.0)]), [(2.0, 3.0), (3.0, 4.0), (1.0, 5.0)]);
        // The same answer again counts where it is better.
        assert_eq!(ranked([of(1.0, 5.0), of(2.0, 3.0), of(1.001, 6.0)]), [(2.0, 3.0), (1.0, 5.0)]);
        assert_eq!(ranked([of(1.0, 5.0), of(2.0, 3.0), of(1.001, 2.0)]), [(1.001, 2.0), (2.0, 3.0)]);
        // As a plane it is another one.
        assert_eq!(ranked([of(1.0, 5.0), answer(1.0, 6.0, PLANE_RELIEF)]), [(1.0, 5.0), (1.0, 6.0)]);
        // What is not finite is no answer.
        for bad in [of(1.0, f64::NAN), of(1.0, f64::INFINITY), of(f64::NAN, 1.0), of(f64::INFINITY, 1.0)] {
            assert_eq!(ranked([bad.clone()]), []);
            assert_eq!(ranked([of(2.0, 3.0), bad, of(3.0, 2.0)]), [(3.0, 2.0), (2.0, 3.0)]);
        }
        // A full pool keeps the best.
        let many = |order: fn(usize) -> usize| {
            ranked((0..20).map(order).map(|k| of(k as f64, k as f64))).into_iter().map(|(_, score)| score)
        };
        assert!(many(|k| k).eq((0..POOL).map(|k| k as f64)));
        assert!(many(|k| 19 - k).eq((0..POOL).map(|k| k as f64)));
    }

    #[test]
    fn the_plane_of_most_of_the_points_is_found() {
        let plane = Vector3::new(0.2, -0.1, 0.9);
        let mut points: Vec<Point> = GOAL
            .iter()
            .map(|place| {
                let rho = plane.dot(&Vector3::new(place[0], place[1], 1.0));
                Point { place: *place, rho, variance: 0.0, is_mapped: true, is_wrong: false }
            })
            .collect();
        let first = Vector3::new(0.19, -0.09, 0.91);
        let found = plane_through(&points, first, &GOAL, &[true; 9]);
        assert!((found - plane).norm() < 1e-6, "{found}");
        // Two points are off it; one that is anything was not chosen.
        (points[2].rho, points[6].rho, points[8].rho) = (2.0, 0.1, f64::NAN);
        let chosen: [bool; 9] = std::array::from_fn(|i| i != 8);
        let found = plane_through(&points, first, &GOAL, &chosen);
        assert!((found - plane).norm() < 1e-2, "{found}");
        // Depths that are no numbers leave the plane that was known.
        assert_eq!(plane_through(&points, first, &GOAL, &[true; 9]), first);
    }
}
