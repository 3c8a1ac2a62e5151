//! `F` and `H` of pixels, where a focal length is not known.
//!
//! R. Hartley, *In defence of the eight-point algorithm*, IEEE TPAMI 19(6), 1997; each equation is divided by the length of its
//! gradient, as found in the round before, which makes its residual the Sampson error.

use nalgebra::{Matrix2, Matrix3, SMatrix, Vector2, Vector3};

/// Pixels of a match in both images.
pub(crate) type PixelMatch = [Vector2<f64>; 2];

/// Rounds of fitting and of choosing the inliers again.
const ROUNDS: usize = 6;

/// A homography that is not fitted to the pixels yet may be off by so many thresholds.
const NEAR: f64 = 4.0;

/// A matrix that fits pixels, and which of them are its inliers.
pub(crate) struct Fitted {
    pub(crate) matrix: Matrix3<f64>,
    pub(crate) inliers: Vec<bool>,
}

/// What is fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// `x2ᵀ F x1 = 0`.
    Fundamental,
    /// `x2 ∝ H x1`.
    Homography,
}

/// The inliers that are near where a homography takes them: the inliers of a pose are on their epipolar lines, false ones too, and one of
/// these is far from where a plane is seen.
pub(crate) fn near(
    homography: &Matrix3<f64>,
    matches: &[PixelMatch],
    inliers: &[bool],
    threshold: f64,
) -> Vec<bool> {
    let is_near = |m: &PixelMatch| Kind::Homography.error(homography, m) < NEAR * threshold;
    matches.iter().zip(inliers).map(|(m, is_inlier)| *is_inlier && is_near(m)).collect()
}

/// Fits all matches that are within `threshold` pixels, beginning with those of `start`.
pub(crate) fn fit(kind: Kind, matches: &[PixelMatch], start: &[bool], threshold: f64) -> Option<Fitted> {
    let scale = Scale::new(matches)?;
    let mut inliers = start.to_vec();
    let mut matrix = None;
    for _ in 0..ROUNDS {
        let chosen = matches.iter().zip(&inliers).filter(|(_, is_inlier)| **is_inlier).map(|(m, _)| m);
        let found = kind.linear(&scale, chosen, matrix.as_ref())?;
        inliers = matches.iter().map(|m| kind.error(&found, m) < threshold).collect();
        matrix = Some(found);
    }
    matrix.map(|matrix| Fitted { matrix, inliers })
}

/// A shift and a scale for each image that bring its pixels to the unit square.
struct Scale([Matrix3<f64>; 2]);

impl Scale {
    fn new(matches: &[PixelMatch]) -> Option<Self> {
        let count = matches.len() as f64;
        let one = |view: usize| {
            let mean = matches.iter().map(|m| m[view]).sum::<Vector2<f64>>() / count;
            let spread = matches.iter().map(|m| (m[view] - mean).norm()).sum::<f64>() / count;
            let s = std::f64::consts::SQRT_2 / spread;
            s.is_finite().then(|| Matrix3::new(s, 0.0, -s * mean.x, 0.0, s, -s * mean.y, 0.0, 0.0, 1.0))
        };
        Some(Self([one(0)?, one(1)?]))
    }
}

impl Kind {
    /// The fit of the matches, weighed by the matrix of the round before.
    fn linear<'a>(
        self,
        Scale([s1, s2]): &Scale,
        matches: impl Iterator<Item = &'a PixelMatch>,
        before: Option<&Matrix3<f64>>,
    ) -> Option<Matrix3<f64>> {
        let mut normal = SMatrix::<f64, 9, 9>::zeros();
        let mut count = 0;
        for m in matches {
            let (x1, x2) = (s1 * m[0].push(1.0), s2 * m[1].push(1.0));
            let weight = before.map_or(1.0, |matrix| self.weight(matrix, m));
            for row in self.rows(&x1, &x2) {
                normal += row * row.transpose() * weight;
            }
            count += 1;
        }
        if count < self.fewest() {
            return None;
        }
        let eigen = normal.symmetric_eigen();
        let smallest = eigen.eigenvalues.imin();
        let found = Matrix3::from_row_iterator(eigen.eigenvectors.column(smallest).iter().copied());
        let matrix = match self {
            Self::Fundamental => s2.transpose() * rank_two(&found)? * s1,
            Self::Homography => s2.try_inverse()? * found * s1,
        };
        let matrix = matrix / matrix.norm();
        matrix.iter().all(|x| x.is_finite()).then_some(matrix)
    }

    fn fewest(self) -> usize {
        match self {
            Self::Fundamental => 8,
            Self::Homography => 4,
        }
    }

    /// The equations of a match, linear in the entries of the matrix, row after row.
    fn rows(self, x1: &Vector3<f64>, x2: &Vector3<f64>) -> Vec<SMatrix<f64, 9, 1>> {
        let row = |left: Vector3<f64>| SMatrix::<f64, 9, 1>::from_fn(|k, _| left[k / 3] * x1[k % 3]);
        match self {
            Self::Fundamental => vec![row(*x2)],
            Self::Homography => {
                vec![row(Vector3::new(0.0, -x2.z, x2.y)), row(Vector3::new(x2.z, 0.0, -x2.x))]
            }
        }
    }

    /// What makes the square of an equation's residual a squared distance in pixels, to first order.
    fn weight(self, matrix: &Matrix3<f64>, m: &PixelMatch) -> f64 {
        match self {
            Self::Fundamental => 1.0 / gradient2(matrix, m).max(f64::MIN_POSITIVE),
            Self::Homography => {
                let z = (matrix * m[0].push(1.0)).z;
                2.0 / (z * z * transferred(matrix, m).1.trace()).max(f64::MIN_POSITIVE)
            }
        }
    }

    /// The Sampson error of `F`, or the distance to the point that `H` transfers in units of what noise of one pixel in both images makes of it:
    /// a plane that is seen from aside in image 1 makes the noise of that larger.
    fn error(self, matrix: &Matrix3<f64>, m: &PixelMatch) -> f64 {
        let (x1, x2) = (m[0].push(1.0), m[1].push(1.0));
        match self {
            Self::Fundamental => {
                x2.dot(&(matrix * x1)).abs() / gradient2(matrix, m).max(f64::MIN_POSITIVE).sqrt()
            }
            Self::Homography => {
                let (off, noise) = transferred(matrix, m);
                noise.try_inverse().map_or(f64::INFINITY, |inverse| off.dot(&(inverse * off)).max(0.0).sqrt())
            }
        }
    }
}

/// How far the transferred point is from the match, and the covariance of that where both images have noise of one pixel: `I + A Aᵀ` with
/// the derivative `A` of the transfer.
fn transferred(h: &Matrix3<f64>, m: &PixelMatch) -> (Vector2<f64>, Matrix2<f64>) {
    let y = h * m[0].push(1.0);
    let at = y.xy() / y.z;
    let slope = (h.fixed_view::<2, 2>(0, 0) - at * h.fixed_view::<1, 2>(2, 0)) / y.z;
    (at - m[1], Matrix2::identity() + slope * slope.transpose())
}

fn gradient2(f: &Matrix3<f64>, m: &PixelMatch) -> f64 {
    let (l2, l1) = (f * m[0].push(1.0), f.transpose() * m[1].push(1.0));
    l2.xy().norm_squared() + l1.xy().norm_squared()
}

/// The nearest matrix of rank two.
fn rank_two(m: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let mut svd = m.svd(true, true);
    let smallest = svd.singular_values.imin();
    svd.singular_values[smallest] = 0.0;
    svd.recompose().ok()
}

#[cfg(test)]
mod tests {
    use nalgebra::Rotation3;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    const SEED: u64 = 0xc01_0001;

    fn scene(depth: f64) -> (Vec<PixelMatch>, Vec<bool>) {
        let mut rng = ChaCha8Rng::seed_from_u64(SEED);
        let r = Rotation3::from_euler_angles(0.02, 0.15, -0.03);
        let pixel = |x: &Vector3<f64>| Vector2::new(1000.0 * x.x / x.z + 640.0, 1000.0 * x.y / x.z + 480.0);
        let mut all = Vec::new();
        for i in 0..200 {
            let x1 = Vector3::new(rng.random_range(-2.0..2.0), rng.random_range(-1.5..1.5), 6.0)
                + Vector3::z() * rng.random_range(-depth..=depth);
            let x2 = r * x1 + Vector3::new(-1.0, 0.1, 0.2);
            let noise = Vector2::from_fn(|_, _| rng.random_range(-0.5..0.5));
            let lost = Vector2::from_fn(|_, _| rng.random_range(100.0..300.0));
            all.push([pixel(&x1), pixel(&x2) + if i % 5 == 0 { lost } else { noise }]);
        }
        let start = (0..200).map(|i| i % 5 != 0 && i % 3 != 0).collect();
        (all, start)
    }

    #[test]
    fn both_are_fitted_to_the_true_matches() {
        for (kind, depth) in [(Kind::Fundamental, 1.5), (Kind::Homography, 0.0)] {
            let (matches, start) = scene(depth);
            let found = fit(kind, &matches, &start, 4.0).unwrap();
            let true_found = (0..200).filter(|i| i % 5 != 0 && found.inliers[*i]).count();
            assert_eq!(true_found, 160, "{kind:?}");
            // A false match lies on the epipolar line by chance, hardly ever at the point.
            let false_found = (0..200).filter(|i| i % 5 == 0 && found.inliers[*i]).count();
            assert!(false_found <= 6, "{kind:?} {false_found}");
        }
    }

    /// One match in five is false and counts as an inlier of the pose: together they would draw the fit off the plane.
    #[test]
    fn false_inliers_of_a_pose_are_far_from_its_plane() {
        let (matches, start) = scene(0.0);
        let plane = fit(Kind::Homography, &matches, &start, 4.0).unwrap().matrix;
        let rough = plane * Matrix3::new(1.0, 0.0, 6.0, 0.0, 1.0, -4.0, 0.0, 0.0, 1.0);
        let near = near(&rough, &matches, &[true; 200], 4.0);
        let found = fit(Kind::Homography, &matches, &near, 4.0).unwrap();
        assert_eq!((0..200).filter(|i| i % 5 != 0 && found.inliers[*i]).count(), 160);
        assert_eq!((0..200).filter(|i| i % 5 == 0 && near[*i]).count(), 0);
    }
}
