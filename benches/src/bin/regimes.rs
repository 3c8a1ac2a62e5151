//! Estimates where the camera hardly moves and where matches are dirty, against the planted truth. Tables in Markdown.
//!
//! Scenes are of a camera of 1280 × 960 pixels and a focal length of 1,000, with points 4 to 9 away, a turn of about two degrees,
//! a translation in any direction and noise of half a pixel, where a table does not say otherwise.
#![expect(clippy::print_stdout, reason = "a program for people: tables are its output")]

use std::convert::Infallible;

use clap::{Parser, ValueEnum};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use quest_benches::statistics::{mean, percentile, sorted};
use quest_benches::{SEED, parallel};
use quest_core::robust::{self, Estimate, EstimateError, Model, Options};
use quest_core::{Correspondence, RelativePose};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

const FOCAL_LENGTH: f64 = 1_000.0;
const SIZE: [f64; 2] = [1280.0, 960.0];
const NOISE: f64 = 0.5;

/// The 95 % quantile of χ² with three degrees of freedom.
const CHI_SQUARE_3: f64 = 7.814_7;

/// Small motions and dirty matches.
#[derive(Debug, Parser)]
struct Arguments {
    /// Scenes of a row
    #[arg(long, default_value_t = 200)]
    scenes: u64,
    /// Seed of the scenes
    #[arg(long, default_value_t = SEED)]
    seed: u64,
    /// Only these tables, separated by commas
    #[arg(long, value_delimiter = ',', default_value = "parallax,mixed,hubs,static,false-poses")]
    tables: Vec<Name>,
    /// Parallaxes of the first table, in pixels
    #[arg(long, value_delimiter = ',', default_value = "0,0.5,1,2,3,4,6,10")]
    parallax: Vec<f64>,
    /// Only the rows of the first table whose name has this
    #[arg(long, default_value = "")]
    rows: String,
    /// Threads; the numbers do not depend on it
    #[arg(long, default_value_t = parallel::all_cores())]
    threads: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Name {
    /// Video rate: a parallax of 0 to 10 pixels
    Parallax,
    /// Many distant points and a few near ones
    Mixed,
    /// Many matches of one keypoint, or of one match
    Hubs,
    /// Matches that do not move at all
    Static,
    /// Matches that are all false
    FalsePoses,
}

fn main() {
    let arguments = Arguments::parse();
    println!("{} scenes a row, seed {}", arguments.scenes, arguments.seed);
    for name in &arguments.tables {
        println!();
        match name {
            Name::Parallax => arguments.of_parallax(),
            Name::Mixed => arguments.of_mixed(),
            Name::Hubs => arguments.of_hubs(),
            Name::Static => arguments.of_static(),
            Name::FalsePoses => arguments.of_false_poses(),
        }
    }
}

/// Matches and the pose that they were made with.
struct Planted {
    rng: ChaCha8Rng,
    truth: RelativePose,
    matches: Vec<Correspondence>,
    true_count: usize,
    /// The depths of the true matches' points, summed over both views.
    depths: f64,
}

fn correspondence(a: [f64; 2], b: [f64; 2]) -> Correspondence {
    let plane = |p: [f64; 2]| [0, 1].map(|k| (p[k] - 0.5 * SIZE[k]) / FOCAL_LENGTH);
    #[expect(clippy::unwrap_used, reason = "finite numbers")]
    Correspondence::from_image_points(plane(a), plane(b)).unwrap()
}

impl Planted {
    /// A camera that moves by `step` and turns by about two degrees.
    fn new(seed: u64, index: u64, step: f64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(index);
        let mut normal = || Distribution::<f64>::sample(&StandardNormal, &mut rng);
        let direction = Vector3::from_fn(|_, _| normal()).normalize();
        let turn = Vector3::from_fn(|_, _| normal()) * 0.02;
        let truth = RelativePose::new(UnitQuaternion::new(turn), direction * step);
        Self { rng, truth, matches: Vec::new(), true_count: 0, depths: 0.0 }
    }

    fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.rng)
    }

    fn pixel(&mut self) -> [f64; 2] {
        SIZE.map(|size| self.rng.random_range(0.0..size))
    }

    /// More true matches, their depths from `depth`.
    fn add_true(&mut self, count: usize, depth: impl Fn(&mut ChaCha8Rng, [f64; 2]) -> f64) {
        let wanted = self.matches.len() + count;
        while self.matches.len() < wanted {
            let a = self.pixel();
            let z = depth(&mut self.rng, a);
            let x1 = Vector3::new(a[0] - 640.0, a[1] - 480.0, FOCAL_LENGTH) * (z / FOCAL_LENGTH);
            let x2 = self.truth.q_21 * x1 + self.truth.t_21;
            let b = [x2.x / x2.z * FOCAL_LENGTH + 640.0, x2.y / x2.z * FOCAL_LENGTH + 480.0];
            if x2.z > 0.0 && (0..2).all(|k| b[k] > 0.0 && b[k] < SIZE[k]) {
                let [a, b] = [a, b].map(|p| p.map(|x| x + NOISE * self.normal()));
                self.matches.push(correspondence(a, b));
                self.true_count += 1;
                self.depths += x1.z + x2.z;
            }
        }
    }

    fn add_false(&mut self, count: usize) {
        for _ in 0..count {
            let (a, b) = (self.pixel(), self.pixel());
            self.matches.push(correspondence(a, b));
        }
    }

    /// False matches of one keypoint.
    fn add_hub(&mut self, count: usize, view: usize) {
        let one = self.pixel();
        for _ in 0..count {
            let other = self.pixel();
            let [a, b] = if view == 2 { [other, one] } else { [one, other] };
            self.matches.push(correspondence(a, b));
        }
    }

    fn estimate(&self, threshold: f64) -> Result<Estimate, EstimateError> {
        let focal_lengths = [[FOCAL_LENGTH; 2]; 2];
        robust::estimate(&self.matches, &Options { threshold, focal_lengths, ..Options::default() })
    }

    /// The errors of the rotation and of the direction of the translation in degrees.
    fn errors(&self, pose: &RelativePose) -> [f64; 2] {
        let direction = pose.t_21.angle(&self.truth.t_21);
        [pose.rotation_error(&self.truth), direction].map(f64::to_degrees)
    }

    /// The normalised squared errors of the rotation and of the translation, in the length that was estimated.
    fn squares(&self, found: &Estimate) -> [f64; 2] {
        let turn = (self.truth.q_21 * found.pose.q_21.inverse()).scaled_axis();
        let of = |at: usize, error: Vector3<f64>| {
            let block: Matrix3<f64> = found.covariance.fixed_view::<3, 3>(at, at).into_owned();
            block.cholesky().map_or(f64::INFINITY, |factor| error.dot(&factor.solve(&error)))
        };
        // A length is in units of the mean depth over both views.
        let unit = self.depths / (2 * self.true_count) as f64;
        [of(0, turn), of(3, self.truth.t_21 / unit - found.pose.t_21)]
    }
}

fn share(count: usize, of: usize) -> f64 {
    100.0 * count as f64 / of.max(1) as f64
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    percentile(&sorted(values), 0.5)
}

/// What one scene of the first table gave.
struct Outcome {
    model: Option<Model>,
    errors: [f64; 2],
    squares: [f64; 2],
}

impl Arguments {
    fn map<T: Send>(&self, f: impl Fn(u64) -> T + Sync) -> Vec<T> {
        let found = parallel::map(self.scenes, self.threads, |index| Ok::<_, Infallible>(f(index)));
        found.unwrap_or_else(|never| match never {})
    }

    fn of_parallax(&self) {
        println!(
            "| matches, inliers, threshold | parallax | rotation, planar | rotation ° | direction ° | mean NEES/3 of R, median | of t | in 95 % of R | of t |"
        );
        println!("|---|---|---|---|---|---|---|---|---|");
        let uniform = |rng: &mut ChaCha8Rng, _: [f64; 2]| rng.random_range(4.0..9.0);
        let corridor = |rng: &mut ChaCha8Rng, [u, _]: [f64; 2]| {
            let side = ((u - 640.0) / 640.0).abs();
            (9.0 - 5.0 * side) * rng.random_range(0.9..1.1)
        };
        for (count, inliers, threshold) in [
            (100, 0.7, 1.5),
            (500, 0.5, 1.25),
            (500, 0.5, 2.5),
            (500, 1.0, 1.25),
            (500, 1.0, 2.5),
            (2000, 0.5, 1.25),
            (2000, 0.5, 2.5),
            (2000, 1.0, 1.25),
            (2000, 1.0, 2.5),
        ] {
            self.row_of_parallax(
                &format!("{count}, {:.0} %, {threshold}", 100.0 * inliers),
                |planted| {
                    let some = (f64::from(count) * inliers).round();
                    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count")]
                    planted.add_true(some as usize, uniform);
                    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count")]
                    planted.add_false((f64::from(count) - some) as usize);
                },
                threshold,
            );
        }
        self.row_of_parallax(
            "corridor, 500, 70 %",
            |planted| {
                planted.add_true(350, corridor);
                planted.add_false(150);
            },
            1.25,
        );
        self.row_of_parallax(
            "corridor, 350, 100 %",
            |planted| {
                planted.add_true(350, corridor);
            },
            1.25,
        );
    }

    fn row_of_parallax(&self, name: &str, fill: impl Fn(&mut Planted) + Sync, threshold: f64) {
        if !name.contains(&self.rows) {
            return;
        }
        for &parallax in &self.parallax {
            let all = self.map(|index| {
                let mut planted = Planted::new(self.seed, index, parallax * 6.5 / FOCAL_LENGTH);
                fill(&mut planted);
                match planted.estimate(threshold) {
                    Ok(found) => Outcome {
                        model: Some(found.model),
                        errors: planted.errors(&found.pose),
                        squares: planted.squares(&found),
                    },
                    Err(_) => Outcome { model: None, errors: [180.0; 2], squares: [f64::INFINITY; 2] },
                }
            });
            let of = |model| share(all.iter().filter(|o| o.model == Some(model)).count(), all.len());
            let [r, t] = [0, 1].map(|k| median(all.iter().map(|o| o.errors[k])));
            let nees = |k: usize| {
                let each = || all.iter().map(|o| o.squares[k] / 3.0);
                (mean(each()), median(each()))
            };
            let inside =
                |k: usize| share(all.iter().filter(|o| o.squares[k] < CHI_SQUARE_3).count(), all.len());
            let ((nr, mr), (nt, mt)) = (nees(0), nees(1));
            println!(
                "| {name} | {parallax} px | {:.1} %, {:.1} % | {r:.4} | {t:.2} | {nr:.2}, {mr:.2} | {nt:.2}, {mt:.2} | {:.1} % | {:.1} % |",
                of(Model::PureRotation),
                of(Model::Planar),
                inside(0),
                inside(1)
            );
        }
    }

    fn of_mixed(&self) {
        println!(
            "| distant, near, false | called rotation | within 5° | rotation ° | direction ° | near matches kept |"
        );
        println!("|---|---|---|---|---|---|");
        for (far, near) in [(45, 15), (150, 50), (160, 40), (190, 10), (54, 6)] {
            for false_share in [0.0, 0.3] {
                let all = self.map(|index| {
                    let mut planted = Planted::new(self.seed + 1, index, 0.2);
                    planted.add_true(far, |rng, _| rng.random_range(100.0..400.0));
                    planted.add_true(near, |rng, _| rng.random_range(1.8..3.6));
                    let count = (far + near) as f64 * false_share / (1.0 - false_share);
                    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count")]
                    planted.add_false(count as usize);
                    planted.estimate(1.25).map_or((None, [180.0; 2], 0.0), |found| {
                        let kept = (far..far + near).filter(|&i| found.inliers[i]).count();
                        (Some(found.model), planted.errors(&found.pose), share(kept, near))
                    })
                });
                let rotation = all.iter().filter(|a| a.0 == Some(Model::PureRotation)).count();
                let right = all.iter().filter(|a| a.1.iter().all(|e| *e < 5.0)).count();
                println!(
                    "| {far}, {near}, {:.0} % | {:.1} % | {:.1} % | {:.3} | {:.2} | {:.0} % |",
                    100.0 * false_share,
                    share(rotation, all.len()),
                    share(right, all.len()),
                    median(all.iter().map(|a| a.1[0])),
                    median(all.iter().map(|a| a.1[1])),
                    mean(all.iter().map(|a| a.2))
                );
            }
        }
    }

    /// A row of a table of poses that are right or not: with all of the matches that `fill` adds.
    fn row_of_right(&self, name: &str, step: f64, fill: impl Fn(&mut Planted) + Sync) {
        let all = self.map(|index| {
            let mut planted = Planted::new(self.seed + 2, index, step);
            fill(&mut planted);
            let is_right = |pose: &RelativePose| planted.errors(pose).iter().all(|e| *e < 5.0);
            planted.estimate(1.5).map_or([false, false, true], |found| {
                let second = found.runner_up.is_some_and(|second| is_right(&second.pose));
                [is_right(&found.pose), second, false]
            })
        });
        let of = |k: usize| share(all.iter().filter(|a| a[k]).count(), all.len());
        println!("| {name} | {:.1} % | {:.1} % | {:.1} % |", of(0), of(1), of(2));
    }

    fn of_hubs(&self) {
        println!("| matches | within 5° | the runner-up is | no pose |\n|---|---|---|---|");
        let depth = |rng: &mut ChaCha8Rng, _: [f64; 2]| rng.random_range(4.0..9.0);
        let step = 200.0 * 6.5 / FOCAL_LENGTH;
        for view in [1, 2] {
            for hub in [100, 150, 200] {
                self.row_of_right(
                    &format!("225 of 500 true, {hub} on one pixel of view {view}"),
                    step,
                    |planted| {
                        planted.add_true(225, depth);
                        planted.add_hub(hub, view);
                        planted.add_false(275 - hub);
                    },
                );
            }
        }
        self.row_of_right("40 true, 10 false, 36 on one pixel", step, |planted| {
            planted.add_true(40, depth);
            planted.add_hub(36, 2);
            planted.add_false(10);
        });
        self.row_of_right("225 of 500 true, 5 hubs of 40", step, |planted| {
            planted.add_true(225, depth);
            (0..5).for_each(|_| planted.add_hub(40, 2));
            planted.add_false(75);
        });
        for copies in [80, 150, 300] {
            self.row_of_right(&format!("160 true, one false match {copies} times"), step, |planted| {
                planted.add_true(160, depth);
                planted.add_false(1);
                let one = planted.matches[160];
                planted.matches.extend(std::iter::repeat_n(one, copies - 1));
            });
            self.row_of_right(&format!("160 true, one of them {copies} times"), step, |planted| {
                planted.add_true(160, depth);
                let one = planted.matches[0];
                planted.matches.extend(std::iter::repeat_n(one, copies - 1));
            });
        }
    }

    fn of_static(&self) {
        println!("| matches | within 5° | the runner-up is | no pose |\n|---|---|---|---|");
        let depth = |rng: &mut ChaCha8Rng, _: [f64; 2]| rng.random_range(4.0..9.0);
        for (still, moved, wrong) in [(40, 45, 15), (30, 55, 15), (20, 60, 20)] {
            for parallax in [20.0, 100.0] {
                let name = format!("{still} % static, {moved} % true, {wrong} % false, {parallax} px");
                self.row_of_right(&name, parallax * 6.5 / FOCAL_LENGTH, |planted| {
                    planted.add_true(5 * moved, depth);
                    for _ in 0..5 * still {
                        let a = planted.pixel();
                        planted.matches.push(correspondence(a, a));
                    }
                    planted.add_false(5 * wrong);
                });
            }
        }
    }

    fn of_false_poses(&self) {
        println!("| false matches | threshold | with a pose |\n|---|---|---|");
        for (count, shared) in [(100, 0), (120, 20), (200, 0), (200, 60), (300, 0), (120, 120)] {
            for threshold in [0.3, 1.0, 3.0, 30.0, 300.0, 1_000.0] {
                let all = self.map(|index| {
                    let mut planted = Planted::new(self.seed + 3, index, 1.0);
                    planted.add_false(count - shared);
                    (0..shared / 20).for_each(|k| planted.add_hub(20, 1 + k % 2));
                    planted.estimate(threshold).is_ok()
                });
                let found = all.iter().filter(|a| **a).count();
                println!(
                    "| {count}, {shared} of them on shared pixels | {threshold} px | {:.1} % |",
                    share(found, all.len())
                );
            }
        }
    }
}
