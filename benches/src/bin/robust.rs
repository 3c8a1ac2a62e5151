//! What an estimate from matches with outliers says, against the planted truth: models, the two poses of a plane, the length of
//! the translation, the covariance, false poses, time. Tables in Markdown.
#![expect(clippy::print_stdout, reason = "a program for people: tables are its output")]

use std::error::Error;
use std::time::Instant;

use clap::{Parser, ValueEnum};
use nalgebra::{SMatrix, SVector, Vector3};
use quest_benches::statistics::{mean, percentile, sorted};
use quest_benches::{SEED, parallel};
use quest_core::robust::{self, Estimate, Model, Options};
use quest_core::simulate::{
    Angle, FOCAL_LENGTH, Layout, Motion, Scene, SceneError, SceneOptions, is_inside_image, pixel_to_plane,
    plane_to_pixel,
};
use quest_core::{Correspondence, RelativePose, disambiguation};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// The 95 % quantiles of χ² with five and six degrees of freedom.
const CHI_SQUARE_5: f64 = 11.070_5;
const CHI_SQUARE_6: f64 = 12.591_6;

/// 95 % of a normal variable is within so many standard deviations.
const NORMAL_95: f64 = 1.96;

/// Estimates against the truth.
#[derive(Debug, Parser)]
struct Arguments {
    /// Scenes of a row
    #[arg(long, default_value_t = 1_000)]
    scenes: u64,
    /// Seed of the scenes
    #[arg(long, default_value_t = SEED)]
    seed: u64,
    /// Only these tables, separated by commas
    #[arg(long, value_delimiter = ',', default_value = "models,third-view,length,covariance,false-poses")]
    tables: Vec<Name>,
    /// Rounds of the table of times; the least counts
    #[arg(long, default_value_t = 50)]
    rounds: u32,
    /// Threads; the numbers do not depend on it
    #[arg(long, default_value_t = parallel::all_cores())]
    threads: usize,
}

/// A table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Name {
    /// Which models are recognised, and how good their poses are
    Models,
    /// Whether a third view decides between the poses of a plane
    ThirdView,
    /// The length of the translation beside the true parallax
    Length,
    /// Errors beside the covariance
    Covariance,
    /// Matches that are all false
    FalsePoses,
    /// Milliseconds, on one thread
    Time,
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments = Arguments::parse();
    println!("{} scenes a row, seed {}", arguments.scenes, arguments.seed);
    for name in &arguments.tables {
        println!();
        match name {
            Name::Models => arguments.models()?,
            Name::ThirdView => arguments.third_view()?,
            Name::Length => arguments.length()?,
            Name::Covariance => arguments.covariance()?,
            Name::FalsePoses => arguments.false_poses()?,
            Name::Time => arguments.time()?,
        }
    }
    Ok(())
}

/// Half a pixel of noise, as in most rows.
fn noisy(points: usize) -> SceneOptions {
    SceneOptions { points, noise_px: 0.5, ..SceneOptions::realistic() }
}

fn options() -> Options {
    Options { threshold: 1.5, focal_lengths: [[FOCAL_LENGTH; 2]; 2], ..Options::default() }
}

/// An estimate beside the truth.
struct Moved {
    model: Model,
    /// The error of the length of the translation as a share of it.
    length: f64,
    /// Whether the translation points to the right side, and that of the runner-up.
    is_right: bool,
    second: Option<bool>,
}

/// The errors of rotation and of the direction of translation, in degrees.
fn errors(pose: &RelativePose, truth: &RelativePose) -> [f64; 2] {
    [pose.rotation_error(truth), pose.translation_error(truth).unwrap_or(0.0)].map(f64::to_degrees)
}

fn larger(pose: &RelativePose, truth: &RelativePose) -> f64 {
    errors(pose, truth).into_iter().fold(0.0, f64::max)
}

/// The pose, and the runner-up where there is one.
fn poses(found: &Estimate) -> Vec<RelativePose> {
    [Some(found.pose), found.runner_up.map(|r| r.pose)].into_iter().flatten().collect()
}

/// The share in per cent of those for which `f` holds.
fn share<T>(all: &[T], f: impl Fn(&T) -> bool) -> f64 {
    100.0 * mean(all.iter().map(|x| f64::from(u8::from(f(x)))))
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    percentile(&sorted(values), 0.5)
}

impl Arguments {
    /// `f` of every scene of a row, with a share of false matches, and its estimate. The mean depth of the true matches is one.
    fn estimates<T: Send>(
        &self,
        scene: &SceneOptions,
        outliers: f64,
        f: impl Fn(u64, &Scene, Option<Estimate>) -> T + Sync,
    ) -> Result<Vec<T>, SceneError> {
        parallel::map(self.scenes, self.threads, |index| {
            let mut scene = Scene::generate(scene, self.seed, index)?;
            let is_true = scene
                .add_outliers(outliers, self.seed, index)
                .map_err(|source| SceneError::from(quest_core::InputError::Match { index: 0, source }))?;
            scale_by_true(&mut scene, &is_true)?;
            let found = robust::estimate(&scene.matches, &options()).ok();
            Ok(f(index, &scene, found))
        })
    }

    fn models(&self) -> Result<(), SceneError> {
        println!("0.5 px, 30 % outliers, threshold 1.5 px\n");
        println!(
            "| scene | matches | general | planar | rotation | no pose | rotation error, median | one of the poses within 5° | 10° | \
             two poses | length of t < 0.01 |"
        );
        println!("|---|---|---|---|---|---|---|---|---|---|---|");
        let planar = |points| SceneOptions { layout: Layout::Coplanar, ..noisy(points) };
        let turning = |points| SceneOptions { motion: Motion::PureRotation, ..noisy(points) };
        for points in [50, 100, 500] {
            for (name, scene) in [
                ("general", noisy(points)),
                ("planar", planar(points)),
                ("rotation in place", turning(points)),
            ] {
                self.model_row(name, &scene)?;
            }
        }
        Ok(())
    }

    fn model_row(&self, name: &str, scene: &SceneOptions) -> Result<(), SceneError> {
        let all = self.estimates(scene, 0.3, |_, scene, found| {
            found.map(|found| {
                let best = poses(&found).iter().map(|p| larger(p, &scene.truth)).fold(180.0, f64::min);
                let rotation = found.pose.rotation_error(&scene.truth).to_degrees();
                (found.model, rotation, best, found.runner_up.is_some(), found.pose.t_21.norm())
            })
        })?;
        let is = |model| share(&all, |e| e.is_some_and(|e| e.0 == model));
        println!(
            "| {name} | {} | {:.1} % | {:.1} % | {:.1} % | {:.1} % | {:.3}° | {:.1} % | {:.1} % | {:.1} % | {:.1} % |",
            scene.points,
            is(Model::General),
            is(Model::Planar),
            is(Model::PureRotation),
            share(&all, Option::is_none),
            median(all.iter().map(|e| e.map_or(180.0, |e| e.1))),
            share(&all, |e| e.is_some_and(|e| e.2 < 5.0)),
            share(&all, |e| e.is_some_and(|e| e.2 < 10.0)),
            share(&all, |e| e.is_some_and(|e| e.3)),
            share(&all, |e| e.is_some_and(|e| e.4 < 0.01)),
        );
        Ok(())
    }

    /// Planes seen from three places.
    fn third_view(&self) -> Result<(), SceneError> {
        println!("Planes, 100 matches, 0.5 px, no outliers, third view at the same parallax\n");
        println!("| parallax | two poses | the third view takes the better one | without it |");
        println!("|---|---|---|---|");
        for parallax in [0.03, 0.1, 0.3] {
            let planar =
                SceneOptions { layout: Layout::Coplanar, motion: Motion::Parallax(parallax), ..noisy(100) };
            let all = self.estimates(&planar, 0.0, |index, scene, found| {
                let found = found.filter(|found| found.runner_up.is_some())?;
                let third = third_view(scene, &planar, self.seed, self.scenes + index)?;
                let (first, second) = (poses(&found), poses(&robust::estimate(&third, &options()).ok()?));
                let noise = found.noise_px / FOCAL_LENGTH;
                let choice =
                    disambiguation::choose(&scene.matches, &first, &third, &second, noise).ok()??;
                let errors: Vec<_> = first.iter().map(|p| larger(p, &scene.truth)).collect();
                Some((errors[choice.pose_21] <= errors[1 - choice.pose_21], errors[0] <= errors[1]))
            })?;
            let asked: Vec<_> = all.iter().flatten().collect();
            println!(
                "| {parallax} | {} | {:.1} % | {:.1} % |",
                asked.len(),
                share(&asked, |e| e.0),
                share(&asked, |e| e.1)
            );
        }
        Ok(())
    }

    fn length(&self) -> Result<(), SceneError> {
        println!(
            "0.5 px, 100 matches, threshold 1.5 px: |t| against the true parallax, and its direction, of scenes that are not \
             called a rotation\n"
        );
        println!(
            "| turned by up to | parallax | outliers | scenes | called rotation | error of the length, median | its bias, \
             median | off by more than 45° | of those, with the right runner-up | a runner-up |"
        );
        println!("|---|---|---|---|---|---|---|---|---|---|");
        // The more a camera turns, the smaller is the part of the image that both see.
        for (degrees, outliers) in [30.0_f64, 20.0, 10.0].into_iter().flat_map(|d| [(d, 0.0), (d, 0.3)]) {
            let angle = Angle::UpTo(degrees.to_radians());
            for parallax in [0.003, 0.01, 0.03, 0.1, 0.3] {
                let scene = SceneOptions { motion: Motion::Parallax(parallax), angle, ..noisy(100) };
                let all = self.estimates(&scene, outliers, |_, scene, found| {
                    let is_right = |pose: &RelativePose| errors(pose, &scene.truth)[1] < 45.0;
                    found.map(|found| Moved {
                        model: found.model,
                        length: found.pose.t_21.norm() / scene.truth.t_21.norm() - 1.0,
                        is_right: is_right(&found.pose),
                        second: found.runner_up.map(|second| is_right(&second.pose)),
                    })
                })?;
                let is_rotation = |e: &Moved| e.model == Model::PureRotation;
                let moved: Vec<_> = all.iter().flatten().filter(|e| !is_rotation(e)).collect();
                let wrong: Vec<_> = moved.iter().filter(|e| !e.is_right).collect();
                let lengths = || moved.iter().map(|e| e.length);
                println!(
                    "| {degrees}° | {parallax} | {:.0} % | {} | {:.1} % | {:.1} % | {:+.1} % | {:.1} % | {} of {} | {:.1} % |",
                    100.0 * outliers,
                    moved.len(),
                    share(&all, |e| e.as_ref().is_some_and(is_rotation)),
                    100.0 * median(lengths().map(f64::abs)),
                    100.0 * median(lengths()),
                    share(&moved, |e| !e.is_right),
                    wrong.iter().filter(|e| e.second == Some(true)).count(),
                    wrong.len(),
                    share(&moved, |e| e.second.is_some()),
                );
            }
        }
        Ok(())
    }

    fn covariance(&self) -> Result<(), SceneError> {
        println!(
            "0.5 px: rotation and direction of translation, five degrees of freedom, and the length of translation\n"
        );
        println!(
            "| motion | matches | outliers | mean NEES/5 | median NEES | in the 95 % region | in that of all six | \
             length within 1.96 σ | σ of the length, median |"
        );
        println!("|---|---|---|---|---|---|---|---|---|");
        for outliers in [0.0, 0.3, 0.5] {
            for points in [50, 100, 200, 500, 1_000] {
                self.covariance_row("general", &noisy(points), outliers)?;
            }
            for parallax in [0.01, 0.03, 0.1] {
                let scene = SceneOptions { motion: Motion::Parallax(parallax), ..noisy(100) };
                self.covariance_row(&format!("parallax {parallax}"), &scene, outliers)?;
            }
        }
        Ok(())
    }

    fn covariance_row(&self, name: &str, scene: &SceneOptions, outliers: f64) -> Result<(), SceneError> {
        let all = self.estimates(scene, outliers, |_, scene, found| {
            let found = found.filter(|found| found.model == Model::General)?;
            let deviation = deviation_of_length(&found);
            let error = found.pose.t_21.norm() - scene.truth.t_21.norm();
            let [of_five, of_six] = nees(scene, &found)?;
            Some((of_five, of_six, error / deviation, deviation / scene.truth.t_21.norm()))
        })?;
        let found: Vec<_> = all.into_iter().flatten().collect();
        println!(
            "| {name} | {} | {:.0} % | {:.3} | {:.2} | {:.1} % | {:.1} % | {:.1} % | {:.1} % |",
            scene.points,
            100.0 * outliers,
            mean(found.iter().map(|e| e.0)) / 5.0,
            median(found.iter().map(|e| e.0)),
            share(&found, |e| e.0 < CHI_SQUARE_5),
            share(&found, |e| e.1 < CHI_SQUARE_6),
            share(&found, |e| e.2.abs() < NORMAL_95),
            100.0 * median(found.iter().map(|e| e.3)),
        );
        Ok(())
    }

    fn false_poses(&self) -> Result<(), SceneError> {
        println!("All matches false, threshold 1.5 px\n");
        println!("| matches | files | with a pose |");
        println!("|---|---|---|");
        for points in [10, 15, 20, 50, 100, 300] {
            let all = self.estimates(&noisy(points), 1.0, |_, _, found| found.is_some())?;
            println!("| {points} | {} | {:.2} % |", all.len(), share(&all, |found| *found));
        }
        Ok(())
    }

    fn time(&self) -> Result<(), Box<dyn Error>> {
        println!("| matches | outliers | samples | ms, least of {} |", self.rounds);
        println!("|---|---|---|---|");
        let thousand = Options { min_iterations: 1_000, max_iterations: 1_000, ..options() };
        for (points, outliers, options) in [
            (512, 0.5, &thousand),
            (100, 0.3, &options()),
            (500, 0.3, &options()),
            (2_000, 0.3, &options()),
            (100_000, 0.3, &options()),
        ] {
            let mut scene = Scene::generate(&noisy(points), self.seed, 0)?;
            scene.add_outliers(outliers, self.seed, 0)?;
            let (mut least, mut samples) = (f64::INFINITY, 0);
            for _ in 0..self.rounds {
                let start = Instant::now();
                let found = robust::estimate(&scene.matches, options)?;
                least = least.min(start.elapsed().as_secs_f64() * 1e3);
                samples = found.iterations;
            }
            println!("| {points} | {:.0} % | {samples} | {least:.2} |", 100.0 * outliers);
        }
        Ok(())
    }
}

/// Makes the mean depth of the true matches one: a false match has no depth.
fn scale_by_true(scene: &mut Scene, is_true: &[bool]) -> Result<(), SceneError> {
    let true_points: Vec<_> =
        scene.points1.iter().zip(is_true).filter(|(_, is_true)| **is_true).map(|(x1, _)| *x1).collect();
    if let Some(first) = true_points.first().copied() {
        let scaled = Scene::from_points(scene.truth, true_points)?;
        let scale = scaled.points1[0].z / first.z;
        scene.truth = scaled.truth;
        scene.points1.iter_mut().for_each(|x1| *x1 *= scale);
    }
    Ok(())
}

/// The points of a scene as a third camera sees them, matched with their images in view 1.
fn third_view(scene: &Scene, options: &SceneOptions, seed: u64, index: u64) -> Option<Vec<Correspondence>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(index);
    // Motions of other scenes of the kind, until one sees all of the points.
    (0..100).find_map(|attempt| {
        let pose = Scene::generate(options, seed ^ (attempt + 1), index).ok()?.truth;
        let see = |(x, m): (&Vector3<f64>, &Correspondence)| {
            let x3 = pose.q_21 * x + pose.t_21;
            let exact = plane_to_pixel([x3.x / x3.z, x3.y / x3.z]);
            if x3.z <= 0.0 || !is_inside_image(exact) {
                return None;
            }
            let pixel =
                exact.map(|u| u + options.noise_px * Distribution::<f64>::sample(&StandardNormal, &mut rng));
            let x1 = [m.bearing1().x / m.bearing1().z, m.bearing1().y / m.bearing1().z];
            Correspondence::from_image_points(x1, pixel_to_plane(pixel)).ok()
        };
        scene.points1.iter().zip(&scene.matches).map(see).collect()
    })
}

/// The squared errors of rotation and direction of translation, and of rotation and translation, in the metric of the covariance.
fn nees(scene: &Scene, found: &Estimate) -> Option<[f64; 2]> {
    let t = found.pose.t_21;
    let direction = t.try_normalize(0.0)?;
    let across =
        direction.cross(&if direction.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() }).normalize();
    let tangent = [across, direction.cross(&across)];
    // The truth is exp([ω]×) R.
    let rotation = (scene.truth.q_21 * found.pose.q_21.inverse()).scaled_axis();
    let turned = scene.truth.t_21.normalize() - direction;
    let of_five =
        SVector::<f64, 5>::from_fn(|k, _| if k < 3 { rotation[k] } else { turned.dot(&tangent[k - 3]) });
    let moved = scene.truth.t_21 - t;
    let of_six = SVector::<f64, 6>::from_fn(|k, _| if k < 3 { rotation[k] } else { moved[k - 3] });
    let mut project = SMatrix::<f64, 5, 6>::zeros();
    project.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
    for (k, tangent) in tangent.iter().enumerate() {
        project.fixed_view_mut::<1, 3>(3 + k, 3).copy_from(&(tangent.transpose() / t.norm()));
    }
    let five = project * found.covariance * project.transpose();
    let six = found.covariance;
    Some([of_five.dot(&five.cholesky()?.solve(&of_five)), of_six.dot(&six.cholesky()?.solve(&of_six))])
}

/// The standard deviation of the length of the translation.
fn deviation_of_length(found: &Estimate) -> f64 {
    let direction = found.pose.t_21.normalize();
    (direction.transpose() * found.covariance.fixed_view::<3, 3>(3, 3) * direction).x.sqrt()
}
