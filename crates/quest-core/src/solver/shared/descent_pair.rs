//! Two descents to local minima of the Sampson errors side by side: each step of one waits for the step before, those of two do
//! not wait for each other.
//!
//! A motion is held as the two rotations into its [`EpipolarFrame`](crate::epipolar_frame::EpipolarFrame), and a step turns
//! these: no quaternion is needed on the way.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion};

use crate::Correspondence;
use crate::algebra::descent::{FALL, RISE};
use crate::algebra::vectors::two::{Two, TwoVectors, both, dot};
use crate::pose::RIGHT_ANGLE;
use crate::solver::shared::motion::{AT_EPIPOLE, Motion, SCHEDULE, Until, constraint, sampson_row};

/// Levenberg–Marquardt from two motions to local minima of the summed squares of the Sampson errors, by the [`SCHEDULE`] of one:
/// the loop of [`descent`](crate::algebra::descent) with a mask in place of each branch. Returns the sums before the last step.
pub(crate) fn minimise_sampson(
    motions: &mut [Motion; 2],
    matches: &[Correspondence],
    until: &Until,
) -> [f64; 2] {
    let beyond_five = matches.len().saturating_sub(5).max(1) as f64;
    let mut frames = Frames::new(motions);
    let mut current = frames.equations(matches);
    let (mut damping, mut is_over) = (Two::splat(SCHEDULE.first), Two::ZERO);
    for _ in 0..until.steps {
        let (step, is_step) = damped_step(&current, damping);
        let trial = frames.moved(&step);
        // To first order the cost falls by the step's square in units of the noise times its variance.
        let (mut fall, mut square) = (Two::ZERO, Two::ZERO);
        for (x, sums) in step.iter().zip(&current) {
            fall -= *x * sums[5];
            square += *x * *x;
        }
        let is_last = square.simd_lt(Two::splat(until.step * until.step))
            | (fall * beyond_five).simd_lt(current[5][5] * until.within_noise);
        frames = frames.or(&trial, is_last & is_step & !is_over);
        is_over |= is_last | !is_step;
        if is_over.all() {
            break;
        }
        let next = trial.equations(matches);
        let is_better = next[5][5].simd_lt(current[5][5]);
        let accepted = is_better & !is_over;
        frames = frames.or(&trial, accepted);
        for (row, next) in current.iter_mut().zip(&next) {
            for (x, next) in row.iter_mut().zip(next) {
                *x = accepted.select(*next, *x);
            }
        }
        damping = is_better.select(damping * FALL, (damping * RISE).max(Two::splat(SCHEDULE.refused)));
        is_over |= damping.simd_gt(Two::splat(SCHEDULE.most));
    }
    *motions = frames.motions();
    current[5][5].to_array()
}

/// The upper triangle of `Jᵀ J`, the residuals as a sixth column of `J`.
type Equations = [[Two; 6]; 6];

/// The rotations into two epipolar frames, row by row.
#[derive(Clone, Copy)]
struct Frames {
    from_1: [TwoVectors; 3],
    from_2: [TwoVectors; 3],
}

impl Frames {
    fn new(motions: &[Motion; 2]) -> Self {
        let frames = motions.each_ref().map(Motion::frame);
        let side_by_side = |m: [&Matrix3<f64>; 2]| -> [TwoVectors; 3] {
            std::array::from_fn(|i| std::array::from_fn(|j| Two::new(m.map(|m| m[(i, j)]))))
        };
        Self {
            from_1: side_by_side(frames.each_ref().map(|frame| &frame.from_1)),
            from_2: side_by_side(frames.each_ref().map(|frame| &frame.from_2)),
        }
    }

    fn motions(&self) -> [Motion; 2] {
        let [from_1, from_2] = [self.from_1, self.from_2].map(|two| two.map(|row| row.map(Two::to_array)));
        std::array::from_fn(|k| {
            let [from_1, from_2] = [from_1, from_2].map(|two| Matrix3::from_fn(|i, j| two[i][j][k]));
            let r_21 = Rotation3::from_matrix_unchecked(from_2.tr_mul(&from_1));
            let q_21 =
                UnitQuaternion::new_normalize(UnitQuaternion::from_rotation_matrix(&r_21).into_inner());
            Motion { q_21, direction: from_2.row(2).transpose().normalize() }
        })
    }

    /// `other` where the mask is set.
    #[inline]
    fn or(&self, other: &Self, mask: Two) -> Self {
        let select = |x: &[TwoVectors; 3], y: &[TwoVectors; 3]| -> [TwoVectors; 3] {
            std::array::from_fn(|i| std::array::from_fn(|j| mask.select(y[i][j], x[i][j])))
        };
        Self { from_1: select(&self.from_1, &other.from_1), from_2: select(&self.from_2, &other.from_2) }
    }

    /// After steps in the five parameters of the frames.
    #[inline]
    fn moved(&self, [turn1, turn2, turn3, move1, move2]: &[Two; 5]) -> Self {
        let (one, two) = (Two::splat(1.0), Two::splat(2.0));
        // Cayley's rotation by ω = 2 h: of the unit quaternion along (1, h).
        let [x, y, z] = [turn1, turn2, turn3].map(|turn| *turn * 0.5);
        let scale = two / (one + (x * x + y * y + z * z));
        let rotation = [
            [one - scale * (y * y + z * z), scale * (x * y - z), scale * (x * z + y)],
            [scale * (x * y + z), one - scale * (x * x + z * z), scale * (y * z - x)],
            [scale * (x * z - y), scale * (y * z + x), one - scale * (x * x + y * y)],
        ];
        // The shortest rotation that takes the moved translation (a, b, c) to the third axis.
        let c = one / (one + (*move1 * *move1 + *move2 * *move2)).sqrt();
        let (a, b) = (*move1 * c, *move2 * c);
        let over = -one / (one + c);
        let back =
            [[one + a * a * over, a * b * over, -a], [a * b * over, one + b * b * over, -b], [a, b, c]];
        Self {
            from_1: product(&back, &product(&rotation, &self.from_1)),
            from_2: product(&back, &self.from_2),
        }
    }

    fn equations(&self, matches: &[Correspondence]) -> Equations {
        let limit = Two::splat(RIGHT_ANGLE.powi(2));
        let mut sums = [[Two::ZERO; 6]; 6];
        for m in matches {
            let (a, b) = (both(m.bearing1()), both(m.bearing2()));
            let (b, c) = (self.from_2.map(|row| dot(&row, &b)), self.from_1.map(|row| dot(&row, &a)));
            let (e, along) = constraint(&b, &c);
            let g = Two::splat(2.0) - b[2] * b[2] - c[2] * c[2] - e * e * 2.0;
            let counts = g.simd_gt(Two::splat(AT_EPIPOLE));
            let over_g = (Two::splat(1.0) / g) & counts;
            let square = e * e * over_g;
            let row = sampson_row(&b, &c, e, &along, square, over_g);
            for i in 0..5 {
                let weighted = over_g * row[i];
                for j in i..6 {
                    sums[i][j] += weighted * row[j];
                }
            }
            sums[5][5] += counts.select(square, limit);
        }
        sums
    }
}

#[inline]
fn product(x: &[TwoVectors; 3], y: &[TwoVectors; 3]) -> [TwoVectors; 3] {
    x.map(|row| std::array::from_fn(|j| row[0] * y[0][j] + row[1] * y[1][j] + row[2] * y[2][j]))
}

/// The steps `−(H + damping · diag H)⁻¹ g`, and where they exist.
#[inline]
fn damped_step(equations: &Equations, damping: Two) -> ([Two; 5], Two) {
    let mut m = *equations;
    let (mut inverse, mut exists) = ([Two::ZERO; 5], Two::ZERO.simd_eq(Two::ZERO));
    for k in 0..5 {
        m[k][k] += damping * equations[k][k];
    }
    for k in 0..5 {
        exists &= m[k][k].simd_gt(Two::ZERO);
        inverse[k] = Two::splat(1.0) / m[k][k];
        for i in k + 1..5 {
            let factor = m[k][i] * inverse[k];
            for j in i..6 {
                let part = factor * m[k][j];
                m[i][j] -= part;
            }
        }
    }
    let mut step = [Two::ZERO; 5];
    for k in (0..5).rev() {
        let mut sum = m[k][5];
        for j in k + 1..5 {
            sum += m[k][j] * step[j];
        }
        step[k] = -sum * inverse[k];
    }
    let square = step.iter().fold(Two::ZERO, |sum, x| sum + *x * *x);
    (step, exists & square.simd_lt(Two::splat(f64::INFINITY)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Scene, SceneOptions};
    use crate::solver::shared::motion::FINE;
    use nalgebra::Vector3;

    #[test]
    fn two_descents_are_those_of_one() {
        for (points, index) in [(6, 0), (7, 1), (20, 2), (50, 3)] {
            let options = SceneOptions { points, noise_px: 0.75, ..SceneOptions::realistic() };
            let scene = Scene::generate(&options, 111, index).unwrap();
            let truth = Motion { q_21: scene.truth.q_21, direction: scene.truth.t_21.normalize() };
            let near = |x: f64, y: f64| Motion {
                q_21: UnitQuaternion::new(Vector3::new(x, y, -x)) * truth.q_21,
                direction: (truth.direction + Vector3::new(y, x, -y)).normalize(),
            };
            let mut two = [near(1e-3, -2e-3), near(-2e-3, 5e-4)];
            let mut one = two;
            let costs = minimise_sampson(&mut two, &scene.matches, &FINE);
            for ((one, two), cost) in one.iter_mut().zip(&two).zip(costs) {
                let expected = one.minimise_sampson(&scene.matches, f64::INFINITY, &FINE);
                // Rounding, and the curvature of a last step that is well within the noise.
                assert!(one.is_close(two, 1e-5), "{points} points");
                assert!((cost - expected).abs() < 1e-3 * expected);
            }
        }
    }

    #[test]
    fn motions_survive_the_frames() {
        let motion = |x: f64| Motion {
            q_21: UnitQuaternion::new(Vector3::new(x, 0.4, -1.0)),
            direction: Vector3::new(0.3, -x, x).normalize(),
        };
        let motions = [motion(0.2), motion(-2.5)];
        for (found, planted) in Frames::new(&motions).motions().iter().zip(&motions) {
            assert!(found.is_close(planted, 1e-7));
        }
    }
}
