//! Matches in columns, and what a motion makes of all of them: their Sampson errors, and on which side of the cameras their
//! points are.
//!
//! An essential matrix has four poses, and depths are noise where the rays of a match subtend less than the noise: such a
//! match only has to look the same way in both views. Without this a vote rejects the true rotation of a camera that
//! hardly moves.

use nalgebra::{Matrix3, Vector3};

use crate::algebra::vectors::widest::{Simd, Work, widest};
use crate::robust::data::image::Image;
use crate::solver::shared::motion::Motion;

/// Matches that are worked on at once.
const WIDTH: usize = 8;

/// Rays closer than this multiple of the threshold, in pixels of both views, have no depth.
const DISPARITY: f64 = 2.0;

/// A threshold as wide as the image does not make all of it an epipole: the square of a tenth of a radian.
const LARGEST_EPIPOLE: f64 = 0.01;

/// The poses of an essential matrix: of a motion, with the opposite translation, and the same of its twisted partner.
pub(crate) const POSES: usize = 4;

/// `x1` and `x2` of matches in pixels (see [`observations`](crate::robust::data::observations)), six columns. On planes every `z` is one,
/// and its columns are empty.
#[derive(Clone, Debug)]
pub(crate) struct Columns {
    /// The two views, both planes or both spheres.
    images: [Image; 2],
    /// The inlier threshold in pixels.
    threshold: f64,
    all: [Vec<f64>; 6],
}

/// The residuals of matches under a motion, and on which side of the cameras their points are.
#[derive(Clone, Debug, Default)]
pub(crate) struct Residuals {
    /// The signed Sampson error of every match in pixels.
    pub(crate) values: Vec<f64>,
    /// Bit `k` of a match: its point may be in front of both cameras in pose `k` of [`POSES`].
    pub(crate) sides: Vec<u32>,
}

impl Residuals {
    /// Whether the point of a match may be in front of both cameras in a pose.
    pub(crate) fn is_in_front(&self, index: usize, pose: usize) -> bool {
        is_in_front(self.sides[index], pose)
    }
}

/// Whether the bit of a pose is set in those of a match.
#[inline(always)]
pub(crate) fn is_in_front(sides: u32, pose: usize) -> bool {
    sides >> pose & 1 != 0
}

impl Columns {
    /// The points of matches, on the plane `z = 1` or on the unit sphere.
    pub(crate) fn of_points(
        images: [Image; 2],
        threshold: f64,
        points: impl ExactSizeIterator<Item = [Vector3<f64>; 2]>,
    ) -> Self {
        let has_column = |k: usize| k % 3 != 2 || matches!(images[k / 3], Image::Sphere(_));
        let mut all: [Vec<f64>; 6] =
            std::array::from_fn(|k| Vec::with_capacity(if has_column(k) { points.len() } else { 0 }));
        for [x1, x2] in points {
            let (x1, x2) = (images[0].scaled(&x1), images[1].scaled(&x2));
            for (k, x) in x1.iter().chain(x2.iter()).enumerate() {
                if has_column(k) {
                    all[k].push(*x);
                }
            }
        }
        Self { images, threshold, all }
    }

    pub(crate) fn len(&self) -> usize {
        self.all[0].len()
    }

    pub(crate) fn all(&self) -> &[Vec<f64>; 6] {
        &self.all
    }

    /// One coordinate in pixels of one match.
    #[inline]
    pub(crate) fn at(&self, column: usize, index: usize) -> f64 {
        self.all[column].get(index).copied().unwrap_or(1.0)
    }

    /// The two views, both planes or both spheres.
    pub(crate) fn images(&self) -> [Image; 2] {
        self.images
    }

    /// The points of a match on the plane `z = 1`, or on the unit sphere.
    pub(crate) fn vectors(&self, index: usize) -> [Vector3<f64>; 2] {
        let [x1, y1, z1, x2, y2, z2] = std::array::from_fn(|k| self.at(k, index));
        let [d1, d2] = self.inverse_scales().map(Vector3::from);
        [Vector3::new(x1, y1, z1).component_mul(&d1), Vector3::new(x2, y2, z2).component_mul(&d2)]
    }

    /// The inlier threshold in pixels.
    pub(crate) fn threshold(&self) -> f64 {
        self.threshold
    }

    pub(crate) fn is_sphere(&self) -> bool {
        matches!(self.images[0], Image::Sphere(_))
    }

    /// What takes pixels back, `D1` and `D2`.
    pub(crate) fn inverse_scales(&self) -> [[f64; 3]; 2] {
        self.images.map(Image::inverse_scale)
    }

    /// The curvature of both images together: `1/f²` of a sphere, zero of a plane.
    pub(crate) fn curvature(&self) -> f64 {
        let [k1, k2] = self.images.map(|image| match image {
            Image::Plane(_) => 0.0,
            Image::Sphere(f) => 1.0 / (f * f),
        });
        k1 + k2
    }

    /// The geometric mean of the focal lengths, in pixels.
    pub(crate) fn focal_length(&self) -> f64 {
        self.images.iter().map(|image| image.square_focal_length().sqrt()).product::<f64>().sqrt()
    }

    /// The squared angle, in radians, that a pixel in both views stands for.
    pub(crate) fn square_angle_of_pixel(&self) -> f64 {
        self.images.iter().map(|image| 1.0 / image.square_focal_length()).sum()
    }

    /// At least `count` matches that are false, or all that can be had: the points of view 1 with those of view 2 shifted
    /// against them.
    pub(crate) fn shifted(&self, count: usize) -> Self {
        let n = self.len();
        let shifts = count.div_ceil(n).min(n - 1);
        let each = n.min(count);
        let mut all: [Vec<f64>; 6] = std::array::from_fn(|_| Vec::with_capacity(shifts * each));
        for k in 1..=shifts {
            let shift = k * (n - 1) / shifts;
            let before = each.min(n - shift);
            for (column, (out, from)) in all.iter_mut().zip(&self.all).enumerate() {
                if from.is_empty() {
                    continue;
                }
                if column < 3 {
                    out.extend_from_slice(&from[..each]);
                } else {
                    out.extend_from_slice(&from[shift..shift + before]);
                    out.extend_from_slice(&from[..each - before]);
                }
            }
        }
        Self { images: self.images, threshold: self.threshold, all }
    }

    /// The matches within `limit` pixels of a motion that are in front of both cameras.
    pub(crate) fn agreeing(&self, motion: &Motion, limit: f64) -> Vec<u32> {
        let mut all = Residuals::default();
        self.residuals(&motion.essential(), motion, &mut all);
        let agrees = |&i: &u32| {
            let i = i as usize;
            all.values[i].abs() < limit && all.is_in_front(i, 0)
        };
        (0_u32..).take(self.len()).filter(agrees).collect()
    }

    /// Fills `out` for an essential matrix of any scale and a motion with that matrix.
    pub(crate) fn residuals(&self, e: &Matrix3<f64>, motion: &Motion, out: &mut Residuals) {
        let view = View::new(self, e, motion);
        out.values.resize(self.len(), 0.0);
        out.sides.resize(self.len(), 0);
        widest(Filling { view: &view, columns: self, out });
    }
}

/// The residuals of all columns.
struct Filling<'a> {
    view: &'a View,
    columns: &'a Columns,
    out: &'a mut Residuals,
}

impl Work for Filling<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        if self.columns.is_sphere() {
            self.view.fill::<true>(self.columns, self.out);
        } else {
            self.view.fill::<false>(self.columns, self.out);
        }
    }
}

/// The coefficients of the residuals under a motion.
struct View {
    /// `F`, `D2 R D1`, row by row.
    f: [f64; 9],
    r: [f64; 9],
    /// `D2 t` and `D1 Rᵀ t`.
    t: [[f64; 3]; 2],
    /// The squares of `D1` and `D2`.
    squares: [[f64; 3]; 2],
    curvature: f64,
    /// The squared sine below which rays have no depth.
    parallel: f64,
    /// The squared sine of a ray and the translation below which it is at the epipole.
    at_epipole: f64,
}

impl View {
    fn new(columns: &Columns, e: &Matrix3<f64>, motion: &Motion) -> Self {
        let [d1, d2] = columns.inverse_scales();
        let r_21 = motion.q_21.to_rotation_matrix().into_inner();
        let t_1 = r_21.tr_mul(&motion.direction);
        let scaled = |m: &Matrix3<f64>| -> [f64; 9] {
            std::array::from_fn(|k| d2[k / 3] * m[(k / 3, k % 3)] * d1[k % 3])
        };
        Self {
            f: scaled(e),
            r: scaled(&r_21),
            t: [
                std::array::from_fn(|k| d2[k] * motion.direction[k]),
                std::array::from_fn(|k| d1[k] * t_1[k]),
            ],
            squares: [d1, d2].map(|d| d.map(|d| d * d)),
            curvature: columns.curvature(),
            parallel: (DISPARITY * columns.threshold).powi(2) * columns.square_angle_of_pixel(),
            at_epipole: (0.5 * columns.threshold.powi(2) * columns.square_angle_of_pixel())
                .min(LARGEST_EPIPOLE),
        }
    }

    #[inline(always)]
    fn fill<const SPHERE: bool>(&self, columns: &Columns, out: &mut Residuals) {
        const ONES: &[f64; WIDTH] = &[1.0; WIDTH];
        let chunks = columns.all.each_ref().map(|c| c.as_chunks::<WIDTH>());
        let [x1, y1, z1, x2, y2, z2] = chunks.map(|c| c.0);
        let (residuals, last_residuals) = out.values.as_chunks_mut::<WIDTH>();
        let (sides, last_sides) = out.sides.as_chunks_mut::<WIDTH>();
        for (i, (residuals, sides)) in residuals.iter_mut().zip(sides).enumerate() {
            let (z1, z2) = if SPHERE { (&z1[i], &z2[i]) } else { (ONES, ONES) };
            self.few::<SPHERE>([&x1[i], &y1[i], z1, &x2[i], &y2[i], z2], residuals, sides);
        }
        let left = last_residuals.len();
        if left > 0 {
            let padded = chunks.map(|(_, rest)| {
                let mut padded = [1.0; WIDTH];
                padded[..rest.len()].copy_from_slice(rest);
                padded
            });
            let (mut residuals, mut sides) = ([0.0; WIDTH], [0; WIDTH]);
            self.few::<SPHERE>(padded.each_ref(), &mut residuals, &mut sides);
            last_residuals.copy_from_slice(&residuals[..left]);
            last_sides.copy_from_slice(&sides[..left]);
        }
    }

    /// The Sampson errors and the sides of a few matches.
    ///
    /// With `b = D2 x2` and `c = R D1 x1`, `−(b × t) · (b × c)` and `−(c × t) · (b × c)` have the signs of the depths. In the
    /// twisted partner `c` is turned about `t` by 180°.
    #[inline(always)]
    #[expect(clippy::needless_bitwise_bool, reason = "lazy operators branch, which no vector can")]
    fn few<const SPHERE: bool>(
        &self,
        [x1, y1, z1, x2, y2, z2]: [&[f64; WIDTH]; 6],
        residuals: &mut [f64; WIDTH],
        sides: &mut [u32; WIDTH],
    ) {
        let Self { f, r, t: [t2, t1], squares: [d1, d2], .. } = self;
        for j in 0..WIDTH {
            let (z1, z2) = if SPHERE { (z1[j], z2[j]) } else { (1.0, 1.0) };
            let (x1, y1, x2, y2) = (x1[j], y1[j], x2[j], y2[j]);
            let l0 = f[0] * x1 + f[1] * y1 + f[2] * z1;
            let l1 = f[3] * x1 + f[4] * y1 + f[5] * z1;
            let l2 = f[6] * x1 + f[7] * y1 + f[8] * z1;
            let m0 = f[0] * x2 + f[3] * y2 + f[6] * z2;
            let m1 = f[1] * x2 + f[4] * y2 + f[7] * z2;
            let e = x2 * l0 + y2 * l1 + z2 * l2;
            let mut square = l0 * l0 + l1 * l1 + m0 * m0 + m1 * m1;
            if SPHERE {
                let m2 = f[2] * x2 + f[5] * y2 + f[8] * z2;
                square += l2 * l2 + m2 * m2 - e * e * self.curvature;
            }
            // At an epipole both vanish: no point there contradicts the motion.
            residuals[j] = e / square.max(f64::MIN_POSITIVE).sqrt();
            let c0 = r[0] * x1 + r[1] * y1 + r[2] * z1;
            let c1 = r[3] * x1 + r[4] * y1 + r[5] * z1;
            let c2 = r[6] * x1 + r[7] * y1 + r[8] * z1;
            let bc = x2 * c0 + y2 * c1 + z2 * c2;
            let tb = t2[0] * x2 + t2[1] * y2 + t2[2] * z2;
            let tc = t1[0] * x1 + t1[1] * y1 + t1[2] * z1;
            let bb = d2[0] * x2 * x2 + d2[1] * y2 * y2 + d2[2] * z2 * z2;
            let cc = d1[0] * x1 * x1 + d1[1] * y1 * y1 + d1[2] * z1 * z1;
            let both = self.sides(bc, tb, tc, bb, cc) | self.sides(2.0 * tb * tc - bc, tb, tc, bb, cc) << 2;
            // Within the threshold of an epipole any partner agrees: such a match supports no pose.
            let says_something =
                (bb - tb * tb > self.at_epipole * bb) & (cc - tc * tc > self.at_epipole * cc);
            sides[j] = if says_something { both } else { 0 };
        }
    }

    /// One bit for a translation, one for the opposite one.
    #[inline(always)]
    #[expect(clippy::needless_bitwise_bool, reason = "lazy operators branch, which no vector can")]
    fn sides(&self, bc: f64, tb: f64, tc: f64, bb: f64, cc: f64) -> u32 {
        // |b × c|² / (|b|² |c|²); the difference has the digits that are needed at a pixel.
        let is_far = (bc > 0.0) & (bb * cc - bc * bc < self.parallel * (bb * cc));
        let (first, second) = (bc * tb - tc * bb > 0.0, tb * cc - bc * tc > 0.0);
        u32::from(is_far | (first & second)) | u32::from(is_far | (!first & !second)) << 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robust::data::observations::Observations;
    use crate::simulate::{FOCAL_LENGTH, Scene, SceneOptions};
    use crate::{Correspondence, RelativePose};

    /// One block and a part of one; on the sphere where the bearings do not have `z = 1`.
    fn matches(is_sphere: bool) -> (Vec<Correspondence>, RelativePose) {
        let options = SceneOptions { points: 13, noise_px: 2.0, ..SceneOptions::realistic() };
        let scene = Scene::generate(&options, 43, 1).unwrap();
        let unit = |m: &Correspondence| {
            Correspondence::from_bearings((*m.bearing1()).into(), (*m.bearing2()).into()).unwrap()
        };
        let matches = if is_sphere { scene.matches.iter().map(unit).collect() } else { scene.matches };
        (matches, scene.truth)
    }

    fn observations(matches: &[Correspondence]) -> Observations<'_> {
        Observations::new(matches, (0..13).collect(), [[FOCAL_LENGTH; 2]; 2], 1.0)
    }

    fn residuals(all: &Observations, motion: &Motion) -> Residuals {
        let mut residuals = Residuals::default();
        all.columns.residuals(&motion.essential(), motion, &mut residuals);
        residuals
    }

    #[test]
    fn residuals_are_sampson_errors() {
        for is_sphere in [false, true] {
            let (matches, truth) = matches(is_sphere);
            let all = observations(&matches);
            assert_eq!(all.columns.is_sphere(), is_sphere);
            let motion = Motion { q_21: truth.q_21, direction: truth.t_21.normalize() };
            let e = motion.essential();
            for (m, r) in matches.iter().zip(residuals(&all, &motion).values) {
                let [a, b] = [m.bearing1() / m.bearing1().z, m.bearing2() / m.bearing2().z];
                let (line2, line1) = (e * a, e.tr_mul(&b));
                let on_plane = b.dot(&line2) / (line2.xy().norm_squared() + line1.xy().norm_squared()).sqrt();
                let expected = if is_sphere { truth.sampson_error(m) } else { on_plane.abs() };
                // Rounding of products of order one, times the focal length.
                assert!((r.abs() - FOCAL_LENGTH * expected).abs() < 1e-9, "{r} {expected}");
            }
        }
    }

    #[test]
    fn points_are_in_front_of_the_true_pose_alone() {
        for is_sphere in [false, true] {
            let (matches, truth) = matches(is_sphere);
            let all = observations(&matches);
            let motion = Motion { q_21: truth.q_21, direction: truth.t_21.normalize() };
            let opposite = |m: Motion| Motion { direction: -m.direction, ..m };
            let starts = [motion, opposite(motion), motion.twisted(), opposite(motion.twisted())];
            for (k, start) in starts.iter().enumerate() {
                let seen = residuals(&all, start);
                // Twice twisted is the rotation again.
                let found: Vec<_> =
                    (0..POSES).filter(|&pose| (0..13).all(|i| seen.is_in_front(i, pose))).collect();
                assert_eq!(found, [k]);
            }
        }
    }

    #[test]
    fn shifted_matches_are_false() {
        let (matches, _) = matches(false);
        let all = observations(&matches);
        let [x1, _, _, x2, _, _] = all.columns.all();
        for (count, expected) in [(5, 5), (13, 13), (14, 26), (1_000, 13 * 12)] {
            let shifted = all.columns.shifted(count);
            assert_eq!(shifted.len(), expected);
            let [y1, _, _, y2, _, _] = shifted.all();
            let is_true = |k: usize| x1.iter().zip(x2).any(|(x1, x2)| (*x1, *x2) == (y1[k], y2[k]));
            assert!(!(0..expected).any(is_true));
        }
    }
}
