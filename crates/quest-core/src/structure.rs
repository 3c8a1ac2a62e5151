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

use std::array::from_fn;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::algebra::symmetric::{smallest_eigenvector_3, smallest_eigenvectors_3};
use crate::algebra::vectors::two::{
    Two, TwoQuaternions, TwoVectors, both, cross, dot, product, quaternions, rotation, scaled, side_by_side,
    unit_quaternions,
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
    let mut tally = Tally::default();
    for pair in matches.chunks(2) {
        let second = pair.get(1);
        let a = side_by_side(pair[0].bearing1(), second.map(Correspondence::bearing1));
        let b = side_by_side(pair[0].bearing2(), second.map(Correspondence::bearing2));
        let lengths = [
            Two::new([pair[0].length1(), second.map_or(1.0, Correspondence::length1)]),
            Two::new([pair[0].length2(), second.map_or(1.0, Correspondence::length2)]),
        ];
        tally.add(&Rays::new(&a, &b, &r_21, &t), &lengths);
    }
    let [completed, _] = tally.map(|sum| Two::splat(sum.reduce_add())).completed(&q, &t, matches);
    completed
}

/// The same for two rotations and directions side by side.
pub(crate) fn two_with_depths(
    q_21: &TwoQuaternions,
    direction: &TwoVectors,
    matches: &[Correspondence],
) -> [Completed; 2] {
    let r_21 = rotation(q_21);
    let mut tally = Tally::default();
    for m in matches {
        let rays = Rays::new(&both(m.bearing1()), &both(m.bearing2()), &r_21, direction);
        tally.add(&rays, &[m.length1(), m.length2()].map(Two::splat));
    }
    tally.completed(q_21, direction, matches)
}

/// The same for two motions and their twisted partners: the two rotations of two essential matrices.
pub(crate) fn two_pairs_with_depths(
    q_21: &TwoQuaternions,
    direction: &TwoVectors,
    matches: &[Correspondence],
) -> [[Completed; 2]; 2] {
    let r_21 = rotation(q_21);
    let (mut tally, mut twisted) = (Tally::default(), Tally::default());
    for m in matches {
        let b = both(m.bearing2());
        let rays = Rays::new(&both(m.bearing1()), &b, &r_21, direction);
        let lengths = [m.length1(), m.length2()].map(Two::splat);
        tally.add(&rays, &lengths);
        twisted.add(&rays.twisted(&b, direction), &lengths);
    }
    let [x, y, z] = *direction;
    let twin = product(&[Two::ZERO, x, y, z], q_21);
    [tally.completed(q_21, direction, matches), twisted.completed(&twin, direction, matches)]
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

/// What is needed of two pairs of rays, `b` of view 2 and `c` of view 1 after the rotation: two matches, or one match after
/// two rotations.
struct Rays {
    /// `b × c`.
    normal: TwoVectors,
    /// `b · c`.
    cosine: Two,
    /// `t · b` and `t · c`.
    along: [Two; 2],
    /// The squared Sampson errors.
    squares: Two,
}

impl Rays {
    #[inline]
    fn new(a: &TwoVectors, b: &TwoVectors, r_21: &[TwoVectors; 3], t: &TwoVectors) -> Self {
        let c = from_fn(|i| dot(&r_21[i], a));
        let (normal, along) = (cross(b, &c), [dot(t, b), dot(t, &c)]);
        let squares = sampson_squares(dot(t, &normal), along[0], along[1]);
        Self { normal, cosine: dot(b, &c), along, squares }
    }

    /// Of `c' = 2 (t · c) t − c`, as after the twisted rotation. The angles to `t` stay, and the constraint but for its sign.
    #[inline]
    fn twisted(&self, b: &TwoVectors, t: &TwoVectors) -> Self {
        let [tb, tc] = self.along;
        let (twice, moment) = (tc + tc, cross(b, t));
        let normal = from_fn(|k| twice * moment[k] - self.normal[k]);
        Self { normal, cosine: twice * tb - self.cosine, ..*self }
    }
}

/// What the matches say of the sign and the length of a translation: sums over those on either side.
#[derive(Clone, Copy, Default)]
struct Tally {
    front: Two,
    behind: Two,
    /// Matches whose rays are not parallel.
    with_depth: Two,
    /// Matches whose rays are parallel and point the same way.
    at_infinity: Two,
    /// The sum of the depths, each before its division, and that of their absolute values.
    signed: Two,
    absolute: Two,
    /// The sum of the squared Sampson errors.
    squares: Two,
}

impl Tally {
    #[inline]
    fn add(&mut self, rays: &Rays, [length1, length2]: &[Two; 2]) {
        let (cosine, [tb, tc]) = (rays.cosine, rays.along);
        let (zero, one) = (Two::ZERO, Two::splat(1.0));
        let mut square = dot(&rays.normal, &rays.normal);
        // −(b × t) · (b × c) and −(c × t) · (b × c): the ranges before their division by |n|².
        let (mut area1, mut area2) = (cosine * tb - tc, tb - cosine * tc);
        let is_parallel = square.simd_le(Two::splat(PARALLEL * PARALLEL));
        if is_parallel.any() {
            (area1, area2) = (!is_parallel & area1, !is_parallel & area2);
            square = is_parallel.select(one, square);
            self.at_infinity += is_parallel & cosine.simd_gt(zero) & one;
        }
        self.with_depth += !is_parallel & one;
        self.front += area1.simd_gt(zero) & area2.simd_gt(zero) & one;
        self.behind += area1.simd_lt(zero) & area2.simd_lt(zero) & one;
        self.signed += area1 + area2;
        self.absolute += (area1.abs() * *length2 + area2.abs() * *length1) / (square * (*length1 * *length2));
        self.squares += rays.squares;
    }

    fn map(self, f: impl Fn(Two) -> Two) -> Self {
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

    #[inline]
    fn completed(
        &self,
        q_21: &TwoQuaternions,
        direction: &TwoVectors,
        matches: &[Correspondence],
    ) -> [Completed; 2] {
        let is_tie = self.behind.simd_eq(self.front) & self.signed.simd_lt(Two::ZERO);
        let flip = self.behind.simd_gt(self.front) | is_tie;
        let length = self.with_depth * 2.0 / self.absolute;
        let t_21 = scaled(direction, flip.select(-length, length)).map(Two::to_array);
        let in_front = (self.at_infinity + flip.select(self.behind, self.front)).to_array();
        let residual = (self.squares / matches.len() as f64).sqrt().to_array();
        let (q_21, absolute) = (unit_quaternions(q_21), self.absolute.to_array());
        from_fn(|k| {
            if absolute[k] == 0.0 {
                let pose = RelativePose::new(q_21[k], Vector3::zeros());
                return Completed { pose, in_front: whole(in_front[k]), residual: pose.residual(matches) };
            }
            let pose = RelativePose::new(q_21[k], Vector3::from(t_21.map(|t| t[k])));
            Completed { pose, in_front: whole(in_front[k]), residual: residual[k] }
        })
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
