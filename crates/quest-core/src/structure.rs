//! Section 8: the translation and all depths with one common scale, at a given rotation.
//!
//! With unit bearings `a`, `b`, `c = R a` and `n = b × c`, crossing `z1 c + t = z2 b` with `b` and with `c` gives
//!
//! ```text
//! n · t = 0        z1 = −(b × t) · n / |n|²        z2 = −(c × t) · n / |n|²
//! ```
//!
//! the least-squares depths where the two rays do not meet, and at a solution the null vector of the matrix `B` of
//! (58), (59) up to its scale. The common scale is chosen so that the mean absolute depth over both views is 1:
//! `|t|` is then the parallax (63), and goes to zero with it.
#![expect(clippy::inline_always, reason = "a call would leave the instructions of the lanes")]

use std::array::from_fn;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::algebra::symmetric::{smallest_eigenvector_3, smallest_eigenvectors_3};
use crate::algebra::vectors::abreast::{Work, abreast};
use crate::algebra::vectors::columns::{Column, MotionColumns};
use crate::algebra::vectors::geometry;
use crate::algebra::vectors::lane::{F, Float, Lanes, MAX_F64_LANES, Mask};
use crate::algebra::vectors::two::{
    Two, TwoLanes, TwoVectors, both, cross, dot, quaternions, rotation, side_by_side,
};
use crate::pose::{PARALLEL, sampson_squares};
use crate::{Correspondence, RelativePose};

/// The direction of the translation that fits the rotation best: the eigenvector of `Σ n nᵀ` with the smallest
/// eigenvalue, either sign. At an exact solution it is orthogonal to every `n`.
#[must_use]
pub fn translation_direction(q_21: &UnitQuaternion<f64>, matches: &[Correspondence]) -> Vector3<f64> {
    let r_21 = q_21.to_rotation_matrix();
    let mut sum = Matrix3::zeros();
    for m in matches {
        let n = m.bearing2().cross(&(r_21 * m.bearing1()));
        sum += n * n.transpose();
    }
    smallest_eigenvector_3(&sum).unwrap_or_else(Vector3::z)
}

/// The same for two rotation matrices side by side, row by row; not finite where no direction is left.
#[inline]
pub(crate) fn translation_directions(r_21: &[TwoVectors; 3], matches: &[Correspondence]) -> TwoVectors {
    let mut sum = [Two::ZERO; 6];
    for m in matches {
        let (a, b) = (both(m.bearing1()), both(m.bearing2()));
        let [x, y, z] = cross(&b, &from_fn(|i| dot(&r_21[i], &a)));
        for (sum, product) in sum.iter_mut().zip([x * x, y * y, z * z, x * y, x * z, y * z]) {
            *sum += product;
        }
    }
    smallest_eigenvectors_3(&sum)
}

/// A rotation and a direction of translation, completed by the scale, and what the matches say of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Completed {
    /// The pose; the mean absolute depth over both views is 1.
    pub pose: RelativePose,
    /// The matches with positive depth in both views. Those whose rays are parallel to rounding have no depth and
    /// count where the rays point the same way.
    pub in_front: usize,
    /// The residual; see [`RelativePose::residual`].
    pub residual: f64,
}

/// The pose with rotation `q_21` and a translation along `direction` (a unit vector, of either sign): the sign
/// puts more of the points in front of the cameras, the length makes the mean absolute depth 1.
///
/// Where no match has a depth the translation is zero.
#[must_use]
pub fn with_depths(
    q_21: UnitQuaternion<f64>,
    direction: &Vector3<f64>,
    matches: &[Correspondence],
) -> Completed {
    let (q, t) = (quaternions(&q_21, &q_21), both(direction));
    let r_21 = rotation(&q);
    let mut tally = Tally::new(TwoLanes);
    for pair in matches.chunks(2) {
        let second = pair.get(1);
        let a = side_by_side(pair[0].bearing1(), second.map(Correspondence::bearing1));
        let b = side_by_side(pair[0].bearing2(), second.map(Correspondence::bearing2));
        let lengths = [
            Two::new([pair[0].length1(), second.map_or(1.0, Correspondence::length1)]),
            Two::new([pair[0].length2(), second.map_or(1.0, Correspondence::length2)]),
        ];
        tally.add(TwoLanes, &Rays::new(TwoLanes, &a, &b, &r_21, &t), &lengths);
    }
    let mut out = CompletedColumns::new();
    tally.map(|sum| Two::splat(sum.reduce_add())).complete(TwoLanes, &q, &t, matches.len(), 0, &mut out);
    out.get(0, matches)
}

/// The same for the first `count` of some rotations and directions, and with a second place in `out` for their twisted partners:
/// the other rotations of the same essential matrices.
pub(crate) fn many_with_depths(
    motions: &MotionColumns,
    count: usize,
    matches: &[Correspondence],
    out: &mut [CompletedColumns],
) {
    abreast(ManyWithDepths { motions, count, matches, out });
}

struct ManyWithDepths<'a> {
    motions: &'a MotionColumns,
    count: usize,
    matches: &'a [Correspondence],
    out: &'a mut [CompletedColumns],
}

impl Work for ManyWithDepths<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<f64>>(self, lanes: L) {
        for first in (0..self.count).step_by(L::COUNT) {
            let (q_21, t) = self.motions.load(lanes, first);
            let r_21 = geometry::rotation(lanes, &q_21);
            let (mut tally, mut twisted) = (Tally::new(lanes), Tally::new(lanes));
            for m in self.matches {
                let b = geometry::splat(lanes, m.bearing2());
                let rays = Rays::new(lanes, &geometry::splat(lanes, m.bearing1()), &b, &r_21, &t);
                let lengths = [lanes.splat(m.length1()), lanes.splat(m.length2())];
                tally.add(lanes, &rays, &lengths);
                if self.out.len() > 1 {
                    twisted.add(lanes, &rays.twisted(&b, &t), &lengths);
                }
            }
            let count = self.matches.len();
            tally.complete(lanes, &q_21, &t, count, first, &mut self.out[0]);
            if let Some(out) = self.out.get_mut(1) {
                let twin = geometry::composed::<L>(&[lanes.splat(0.0), t[0], t[1], t[2]], &q_21);
                twisted.complete(lanes, &twin, &t, count, first, out);
            }
        }
    }
}

/// Motions that are [`Completed`].
#[derive(Clone, Copy)]
pub(crate) struct CompletedColumns {
    motions: MotionColumns,
    in_front: Column,
    residual: Column,
    /// The sum of the depths; zero where no match has one.
    absolute: Column,
}

impl CompletedColumns {
    pub(crate) const fn new() -> Self {
        let none = [0.0; MAX_F64_LANES];
        Self { motions: MotionColumns::new(), in_front: none, residual: none, absolute: none }
    }

    /// The motion in place `k`.
    #[inline]
    pub(crate) fn get(&self, k: usize, matches: &[Correspondence]) -> Completed {
        let ((q_21, t_21), in_front) = (self.motions.get(k), whole(self.in_front[k]));
        if self.absolute[k] == 0.0 {
            let pose = RelativePose::new(q_21, Vector3::zeros());
            return Completed { pose, in_front, residual: pose.residual(matches) };
        }
        Completed { pose: RelativePose::new(q_21, t_21), in_front, residual: self.residual[k] }
    }
}

/// The same pose, its points counted and the sign of its translation chosen with the noise in mind: a match whose rays are closer to
/// parallel than its noise, as much as the residual says, has a depth of either sign by chance, and counts as in front where the rays
/// point the same way.
pub(crate) fn with_noise(found: &Completed, matches: &[Correspondence]) -> Completed {
    let r_21 = found.pose.q_21.to_rotation_matrix();
    let parallel = PARALLEL.max(CLEAR * std::f64::consts::SQRT_2 * found.residual);
    let (mut front, mut behind, mut far) = (0, 0, 0);
    for m in matches {
        let (b, c) = (m.bearing2(), r_21 * m.bearing1());
        let normal = b.cross(&c);
        let depths = [c, *b].map(|x| -x.cross(&found.pose.t_21).dot(&normal));
        if b.dot(&c) > 0.0 && normal.norm() <= parallel {
            far += 1;
        } else if depths.iter().all(|z| *z > 0.0) {
            front += 1;
        } else if depths.iter().all(|z| *z < 0.0) {
            behind += 1;
        }
    }
    let pose = if behind > front { RelativePose::new(found.pose.q_21, -found.pose.t_21) } else { found.pose };
    Completed { pose, in_front: far + front.max(behind), ..*found }
}

/// A depth stands clear of its noise where the angle between the rays is more than this many times the noise of both.
const CLEAR: f64 = 4.0;

/// What is needed of pairs of rays, `b` of view 2 and `c` of view 1 after the rotation: some matches, or one match after some
/// rotations.
struct Rays<L: Lanes<f64>> {
    /// `b × c`.
    normal: geometry::Vector3<L>,
    /// `b · c`.
    cosine: F<L>,
    /// `t · b` and `t · c`.
    along: [F<L>; 2],
    /// The squared Sampson errors.
    squares: F<L>,
}

impl<L: Lanes<f64>> Rays<L> {
    #[inline(always)]
    fn new(
        lanes: L,
        a: &geometry::Vector3<L>,
        b: &geometry::Vector3<L>,
        r_21: &geometry::Matrix3<L>,
        t: &geometry::Vector3<L>,
    ) -> Self {
        let c = geometry::product::<L>(r_21, a);
        let normal = geometry::cross::<L>(b, &c);
        let along = [geometry::dot::<L, 3>(t, b), geometry::dot::<L, 3>(t, &c)];
        let squares = sampson_squares(lanes, geometry::dot::<L, 3>(t, &normal), along[0], along[1]);
        Self { normal, cosine: geometry::dot::<L, 3>(b, &c), along, squares }
    }

    /// Of `c' = 2 (t · c) t − c`, as after the twisted rotation. The angles to `t` stay, and the constraint but for its sign.
    #[inline(always)]
    fn twisted(&self, b: &geometry::Vector3<L>, t: &geometry::Vector3<L>) -> Self {
        let [tb, tc] = self.along;
        let (twice, moment) = (tc + tc, geometry::cross::<L>(b, t));
        let mut normal = moment;
        for k in 0..3 {
            normal[k] = twice.mul_add(moment[k], -self.normal[k]);
        }
        Self { normal, cosine: twice.mul_add(tb, -self.cosine), ..*self }
    }
}

/// What the matches say of the sign and the length of a translation: sums over those on either side.
#[derive(Clone, Copy)]
struct Tally<V> {
    front: V,
    behind: V,
    /// Matches whose rays are not parallel.
    with_depth: V,
    /// Matches whose rays are parallel and point the same way.
    at_infinity: V,
    /// The sum of the depths, each before its division, and that of their absolute values.
    signed: V,
    absolute: V,
    /// The sum of the squared Sampson errors.
    squares: V,
}

impl<V: Float<f64>> Tally<V> {
    #[inline(always)]
    fn new<L: Lanes<f64, Float = V>>(lanes: L) -> Self {
        let zero = lanes.splat(0.0);
        let (front, behind, with_depth, at_infinity) = (zero, zero, zero, zero);
        Self { front, behind, with_depth, at_infinity, signed: zero, absolute: zero, squares: zero }
    }

    #[inline(always)]
    fn add<L: Lanes<f64, Float = V>>(&mut self, lanes: L, rays: &Rays<L>, [length1, length2]: &[V; 2]) {
        let (cosine, [tb, tc]) = (rays.cosine, rays.along);
        let (zero, one) = (lanes.splat(0.0), lanes.splat(1.0));
        let mut square = geometry::dot::<L, 3>(&rays.normal, &rays.normal);
        // −(b × t) · (b × c) and −(c × t) · (b × c): the ranges before their division by |n|².
        let (mut area1, mut area2) = (cosine.mul_add(tb, -tc), cosine.neg_mul_add(tc, tb));
        let is_parallel = square.less(lanes.splat(PARALLEL * PARALLEL));
        if is_parallel.any() {
            (area1, area2) = (zero.select(is_parallel, area1), zero.select(is_parallel, area2));
            square = one.select(is_parallel, square);
            self.at_infinity = self.at_infinity + one.select(is_parallel.and(zero.less(cosine)), zero);
        }
        self.with_depth = self.with_depth + zero.select(is_parallel, one);
        self.front = self.front + one.select(zero.less(area1).and(zero.less(area2)), zero);
        self.behind = self.behind + one.select(area1.less(zero).and(area2.less(zero)), zero);
        self.signed = self.signed + (area1 + area2);
        let depths = area1.abs().mul_add(*length2, area2.abs() * *length1);
        self.absolute = self.absolute + depths / (square * (*length1 * *length2));
        self.squares = self.squares + rays.squares;
    }

    fn map(self, f: impl Fn(V) -> V) -> Self {
        Self {
            front: f(self.front),
            behind: f(self.behind),
            with_depth: f(self.with_depth),
            at_infinity: f(self.at_infinity),
            signed: f(self.signed),
            absolute: f(self.absolute),
            squares: f(self.squares),
        }
    }

    /// Writes the motions that are completed from place `first` on.
    #[inline(always)]
    fn complete<L: Lanes<f64, Float = V>>(
        &self,
        lanes: L,
        q_21: &geometry::Quaternion<L>,
        direction: &geometry::Vector3<L>,
        matches: usize,
        first: usize,
        out: &mut CompletedColumns,
    ) {
        // More are behind; or as many, and the sum of the depths is negative.
        let balance = self.front - self.behind;
        let lean = self.signed.select(balance.abs().less(lanes.splat(0.5)), balance);
        let flip = lean.less(lanes.splat(0.0));
        let length = self.with_depth * lanes.splat(2.0) / self.absolute;
        let t_21 = geometry::scaled::<L, 3>(*direction, (-length).select(flip, length));
        out.motions.store::<L>(first, q_21, &t_21);
        (self.at_infinity + self.behind.select(flip, self.front)).store(&mut out.in_front[first..]);
        (self.squares / lanes.splat(matches as f64)).sqrt().store(&mut out.residual[first..]);
        self.absolute.store(&mut out.absolute[first..]);
    }
}

/// A count of matches.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "counts of matches")]
fn whole(count: f64) -> usize {
    count as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Quaternion, SMatrix, Vector4};

    fn planted(t_21: Vector3<f64>) -> (RelativePose, Vec<Correspondence>) {
        let truth = RelativePose::new(UnitQuaternion::new(Vector3::new(0.2, -0.4, 0.1)), t_21);
        let points =
            [[0.3, 0.1, 2.0], [-0.5, 0.4, 3.0], [0.2, -0.6, 2.5], [-0.4, -0.3, 4.0], [0.7, 0.5, 3.5]];
        let matches = points.map(|x1| {
            let x2 = truth.q_21 * Vector3::from(x1) + truth.t_21;
            Correspondence::from_image_points([x1[0] / x1[2], x1[1] / x1[2]], [x2.x / x2.z, x2.y / x2.z])
                .unwrap()
        });
        (truth, matches.into())
    }

    /// The null vector of (58), (59) by SVD, from the quaternion equations (32) as printed.
    fn null_vector_of_59(q_21: &UnitQuaternion<f64>, matches: &[Correspondence]) -> [f64; 13] {
        let mut b = SMatrix::<f64, 20, 13>::zeros();
        let column = |q: Quaternion<f64>| Vector4::new(q.w, q.i, q.j, q.k);
        let q = q_21.quaternion();
        for (i, m) in matches.iter().enumerate() {
            let m1 = Quaternion::from_imag(m.bearing1() * m.length1());
            let m2 = Quaternion::from_imag(m.bearing2() * m.length2());
            for k in 0..3 {
                let e = Quaternion::from_imag(Vector3::ith(k, 1.0));
                b.fixed_view_mut::<4, 1>(4 * i, k).copy_from(&column(e * q));
            }
            b.fixed_view_mut::<4, 1>(4 * i, 3 + 2 * i).copy_from(&column(q * m1));
            b.fixed_view_mut::<4, 1>(4 * i, 4 + 2 * i).copy_from(&column(-(m2 * q)));
        }
        let svd = b.svd(false, true);
        let row = svd.v_t.unwrap().row(svd.singular_values.imin()).clone_owned();
        from_fn(|k| row[k])
    }

    #[test]
    fn closed_form_is_the_null_vector_of_equation_59() {
        for parallax in [1.0, 1e-2, 1e-4] {
            let (truth, matches) = planted(Vector3::new(0.5, -0.2, 0.3) * parallax);
            let direction = translation_direction(&truth.q_21, &matches);
            let Completed { pose, in_front, .. } = with_depths(truth.q_21, &direction, &matches);
            assert_eq!(in_front, 5);
            let null = null_vector_of_59(&truth.q_21, &matches);
            let scale = null[3..].iter().map(|z| z.abs()).sum::<f64>() / 10.0 * null[3].signum();
            // Rounding of the bearings over the parallax.
            let tolerance = 1e-14 / parallax;
            let mut depths = 0.0;
            for (i, m) in matches.iter().enumerate() {
                let (z1, z2) = pose.depths(m).unwrap();
                assert!((z1 - null[3 + 2 * i] / scale).abs() < tolerance);
                assert!((z2 - null[4 + 2 * i] / scale).abs() < tolerance);
                depths += z1 + z2;
            }
            assert!((depths / 10.0 - 1.0).abs() < tolerance);
            for k in 0..3 {
                assert!((pose.t_21[k] - null[k] / scale).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn translation_is_proportional_to_the_parallax() {
        let baseline = Vector3::new(0.5, -0.2, 0.3);
        let (truth, matches) = planted(baseline * 1e-2);
        let length = |truth: &RelativePose, matches: &[Correspondence]| {
            with_depths(truth.q_21, &baseline.normalize(), matches).pose.t_21.norm()
        };
        let reference = length(&truth, &matches) / 1e-2;
        for parallax in [1e-4, 1e-6, 1e-8] {
            let (truth, matches) = planted(baseline * parallax);
            let ratio = length(&truth, &matches) / parallax / reference;
            // Second order in the parallax, and rounding over the parallax.
            assert!((ratio - 1.0).abs() < 1e-2 + 1e-15 / parallax, "{parallax:e}: {ratio}");
        }
    }

    #[test]
    fn points_at_infinity_have_no_depth() {
        let (truth, mut matches) = planted(Vector3::new(0.5, -0.2, 0.3));
        let a = Vector3::new(0.1, 0.2, 1.0);
        matches.push(Correspondence::from_bearings(a.into(), (truth.q_21 * a).into()).unwrap());
        let Completed { pose, in_front, .. } = with_depths(truth.q_21, &truth.t_21.normalize(), &matches);
        assert_eq!((in_front, pose.depths(&matches[5])), (6, None));
        assert!(pose.t_21.norm() > 0.1);
        let Completed { pose, in_front, .. } =
            with_depths(truth.q_21, &truth.t_21.normalize(), &matches[5..]);
        assert_eq!((in_front, pose.t_21), (1, Vector3::zeros()));
    }

    #[test]
    fn distant_points_are_in_front_whatever_noise_makes_of_their_depths() {
        use crate::solver::{Kinds, SolverName};
        use rand::{RngExt, SeedableRng};
        let mut right = 0;
        for index in 0..30 {
            let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(8);
            rng.set_stream(index);
            let mut number = |from: f64, to: f64| rng.random_range(from..to);
            let mut vector = |size: f64| Vector3::from_fn(|_, _| number(-size, size));
            let truth = RelativePose::new(UnitQuaternion::new(vector(0.03)), vector(1.0).normalize() * 0.2);
            // A quarter of the points is near; half a pixel of a focal length of 1,000.
            let matches: Vec<_> = (0..60)
                .map(|i| {
                    let z = if i % 4 == 0 { number(1.8, 3.6) } else { number(100.0, 400.0) };
                    let x1 = Vector3::new(number(-0.4, 0.4), number(-0.3, 0.3), 1.0) * z;
                    let x2 = truth.q_21 * x1 + truth.t_21;
                    let mut seen = |x: &Vector3<f64>| [0, 1].map(|k| x[k] / x.z + number(-9e-4, 9e-4));
                    Correspondence::from_image_points(seen(&x1), seen(&x2)).unwrap()
                })
                .collect();
            let mut found = crate::Candidates::new();
            SolverName::Quest.solve(Kinds::All, &matches, &mut found);
            let best = found.iter().next().unwrap();
            let direction = best.pose.translation_error(&truth).unwrap_or(std::f64::consts::PI);
            right += usize::from(
                best.in_front == 60 && best.pose.rotation_error(&truth) < 0.01 && direction < 0.1,
            );
        }
        assert!(right >= 28, "{right}");
    }
}
