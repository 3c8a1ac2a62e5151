//! How well a motion explains all matches: one number, zero for perfect and one a match at worst.
//!
//! The loss of a residual `r` is the truncated square averaged over all thresholds up to `T`,
//!
//! ```text
//! ρ(u) = 2u − u²,   u = min(|r| / T, 1)
//! ```
//!
//! which does not hang on one threshold (the idea of MAGSAC: D. Barath, J. Matas, J. Noskova, CVPR 2019, in one dimension).

use nalgebra::Matrix3;

use super::observations::{LANES, Observations};

/// The loss reaches one at this multiple of the inlier threshold.
pub(super) const REACH: f64 = 2.5;

/// A model is dropped when its sum over the first points is this many standard deviations above what the best model has
/// on average.
const DOUBT: f32 = 3.0;

/// Lanes between two looks at the sum.
const CHUNKS: usize = 64 / LANES;

/// The loss of a residual in units of the reach.
pub(super) fn loss(u: f64) -> f64 {
    let u = u.abs().min(1.0);
    u * (2.0 - u)
}

/// The search's score of essential matrices.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scorer<'a> {
    observations: &'a Observations,
    /// `1 / T²`.
    inverse_square: f32,
}

impl<'a> Scorer<'a> {
    /// `threshold` in pixels.
    pub(super) fn new(observations: &'a Observations, threshold: f64) -> Self {
        let reach = REACH * threshold;
        #[expect(clippy::cast_possible_truncation, reason = "single precision is what is asked for")]
        let inverse_square = (1.0 / (reach * reach)) as f32;
        Self { observations, inverse_square }
    }

    /// The summed loss of an essential matrix, `None` as soon as it cannot fall below `best`, or most likely will not.
    pub(super) fn score(&self, e: &Matrix3<f64>, best: f32) -> Option<f32> {
        let f = self.observations.fundamental(e);
        #[expect(clippy::cast_possible_truncation, reason = "single precision is what is asked for")]
        let f: [f32; 9] = std::array::from_fn(|k| f[(k / 3, k % 3)] as f32);
        if self.observations.is_sphere() { self.sum::<true>(&f, best) } else { self.sum::<false>(&f, best) }
    }

    fn sum<const SPHERE: bool>(&self, f: &[f32; 9], best: f32) -> Option<f32> {
        let [x1, y1, z1, x2, y2, z2] = self.observations.single().each_ref().map(|c| c.as_chunks().0);
        #[expect(clippy::cast_possible_truncation, reason = "single precision is what is asked for")]
        let [k1, k2] = self.observations.curvature().map(|k| k as f32);
        let count = x1.len();
        // The padding fits nothing.
        let padding = (count * LANES - self.observations.len()) as f32;
        let mean = (best / self.observations.len() as f32).min(0.97);
        let mut lanes = [0.0_f32; LANES];
        let mut start = 0;
        let mut total = 0.0;
        while start < count {
            let end = (start + CHUNKS).min(count);
            for i in start..end {
                add_losses::<SPHERE>(
                    &mut lanes,
                    f,
                    [&x1[i], &y1[i], &z1[i], &x2[i], &y2[i], &z2[i]],
                    k1 + k2,
                    self.inverse_square,
                );
            }
            start = end;
            total = lanes.iter().sum();
            let visited = (end * LANES) as f32;
            let expected = visited * mean + DOUBT * (visited * mean * (1.0 - mean)).sqrt();
            if end < count && (total >= best + padding || total > expected) {
                return None;
            }
        }
        let total = total - padding;
        (total < best).then_some(total)
    }
}

#[inline(always)]
#[expect(clippy::inline_always, reason = "the loop around it is vectorised only as one")]
fn add_losses<const SPHERE: bool>(
    sum: &mut [f32; LANES],
    f: &[f32; 9],
    [x1, y1, z1, x2, y2, z2]: [&[f32; LANES]; 6],
    curvature: f32,
    inverse_square: f32,
) {
    for j in 0..LANES {
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
            square += l2 * l2 + m2 * m2 - e * e * curvature;
        }
        let q = e * e * inverse_square / square;
        // Written so that what is not a number counts as one.
        let q = if q < 1.0 { q } else { 1.0 };
        sum[j] += 2.0 * q.sqrt() - q;
    }
}
