//! Hostile input: a thousand runs, each with its own mistakes.

use std::convert::Infallible;

use quest_benches::parallel;
use quest_core::RelativePose;
use quest_core::servo::scenario::{self, Features};
use quest_core::servo::{
    DepthFilter, Disturbances, Estimate, FreeCamera, FreeCameraLaw, HoldReason, Motion, Plant, PoseEstimator,
    Record, Rig, Safety, Servo, State, Sticky, Tracker, World,
};
use quest_core::solver::SolverName;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::scenes::{LIMITS, UNIT};

const IMAGES: usize = 300;

/// What a run is fed.
#[derive(Clone, Copy, Debug)]
struct Mischief {
    /// The share of features that are anywhere, anew in each image.
    fuzz: f64,
    /// The share of images that are lost, or shown again.
    dropped: f64,
    doubled: f64,
    /// The noise that the loop is told, in pixels.
    told_px: f64,
}

/// Whether the camera went further than a tenth beyond its start while tracking, and how many commands were unsafe.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Outcome {
    is_wild: bool,
    arrives: bool,
    unsafe_commands: usize,
}

pub(crate) fn print_table(runs: u64, seed: u64, filter: &str, threads: usize, filtered: bool, lost: usize) {
    if !"hostile input".contains(filter) {
        return;
    }
    let Ok(outcomes) =
        parallel::map(runs, threads, |index| Ok::<_, Infallible>(run(seed, index, filtered, |_| {})));
    let count = |is: &dyn Fn(&Outcome) -> bool| outcomes.iter().filter(|o| is(o)).count();
    println!("\n| hostile input | runs | wild while tracking | arrives all the same | unsafe commands |");
    println!("|---|---:|---:|---:|---:|");
    println!(
        "| fuzz, sticky, twins, dropped, doubled, 5 px | {} | {} | {} | {} |",
        outcomes.len(),
        count(&|o| o.is_wild),
        count(&|o| o.arrives),
        outcomes.iter().map(|o| o.unsafe_commands).sum::<usize>()
    );
    let wild = outcomes.iter().enumerate().filter(|(_, o)| o.is_wild);
    for (index, outcome) in wild.take(lost) {
        println!("  {index}: {outcome:?}");
    }
}

pub(crate) fn run(seed: u64, index: u64, filtered: bool, watch: impl FnMut(&Record)) -> Outcome {
    let rng = &mut scenario::generator(seed ^ 0x4057, index);
    let count = [6, 8, 12, 20, 40][rng.random_range(0..5)];
    // A plane has a twin.
    let features = if rng.random::<f64>() < 0.3 { Features::Coplanar } else { Features::General };
    let noise_px = if rng.random::<f64>() < 0.3 { 5.0 } else { 0.5 };
    let share = if rng.random::<f64>() < 0.5 { rng.random_range(0.0..0.4) } else { 0.0 };
    let images = if rng.random() { 20.0 } else { f64::INFINITY };
    let disturbances =
        Disturbances { noise_px, sticky: Some(Sticky { share, images }), ..Disturbances::default() };
    let half = |rng: &mut ChaCha8Rng, most: f64| if rng.random() { rng.random_range(0.0..most) } else { 0.0 };
    let mischief = Mischief {
        fuzz: half(rng, 0.5),
        dropped: half(rng, 0.5),
        doubled: half(rng, 0.5),
        told_px: if rng.random::<f64>() < 0.8 { noise_px } else { 0.5 },
    };
    let (world, camera) = scenario::random(features, count, &disturbances, rng, scenario::random_camera);
    let goal = world.on_plane(&world.goal_pixels(rng));
    let mut options = world.filter_options(&LIMITS, UNIT);
    let told = mischief.told_px / world.camera.focal_lengths().0;
    (options.noise, options.goal_noise) = (told, told);
    let (law, safety) = (FreeCameraLaw { rate: 0.5, unit: UNIT }, Safety::for_robot(LIMITS));
    let rig = Rig { unit: UNIT, ..Rig::default() };
    let own = scenario::generator(seed ^ 0xbad, index);
    if filtered {
        let filter = DepthFilter::new(&goal, SolverName::Quest, options);
        return drive(
            &world,
            camera,
            Servo::new(&goal, Mangled::new(filter, mischief, own), law, safety).with_rig(rig),
            rng,
            watch,
        );
    }
    let tracker = Tracker::new(&goal, SolverName::Quest, options);
    drive(
        &world,
        camera,
        Servo::new(&goal, Mangled::new(tracker, mischief, own), law, safety).with_rig(rig),
        rng,
        watch,
    )
}

fn drive<E: PoseEstimator>(
    world: &World,
    mut camera: FreeCamera,
    mut servo: Servo<Mangled<E>, FreeCameraLaw>,
    rng: &mut ChaCha8Rng,
    mut watch: impl FnMut(&Record),
) -> Outcome {
    let begin = camera.pose().t_21.norm();
    let mut outcome = Outcome { is_wild: false, arrives: false, unsafe_commands: 0 };
    world.run(&mut camera, &mut servo, IMAGES, rng, |record| {
        watch(record);
        let command = &record.step.command;
        let is_safe = command.is_finite()
            && command.linear.norm() <= LIMITS.speed * (1.0 + 1e-12)
            && command.angular.norm() <= LIMITS.turn_rate * (1.0 + 1e-12);
        outcome.unsafe_commands += usize::from(!is_safe);
        let away = record.truth.t_21.norm() - begin;
        outcome.is_wild |= record.step.state == State::Tracking && away > 0.1 * begin;
        true
    });
    let end = camera.pose();
    outcome.arrives = end.t_21.norm() < 0.02 && end.q_21.angle().to_degrees() < 1.0;
    outcome
}

/// An estimator that is shown something else than the camera saw.
struct Mangled<E> {
    inner: E,
    mischief: Mischief,
    seen: Vec<Option<[f64; 2]>>,
    rng: ChaCha8Rng,
}

impl<E> Mangled<E> {
    fn new(inner: E, mischief: Mischief, rng: ChaCha8Rng) -> Self {
        Self { inner, mischief, seen: Vec::new(), rng }
    }

    fn mangle(&mut self, features: &[Option<[f64; 2]>]) {
        let Self { mischief, seen, rng, .. } = self;
        if rng.random::<f64>() < mischief.doubled && !seen.is_empty() {
            return;
        }
        seen.clear();
        seen.extend_from_slice(features);
        for feature in seen.iter_mut() {
            if rng.random::<f64>() < mischief.fuzz {
                *feature = match rng.random_range(0..20) {
                    0 => Some([f64::NAN, 0.0]),
                    1 => Some([1e300, -1e300]),
                    2 => None,
                    _ => Some([rng.random_range(-0.6..0.6), rng.random_range(-0.5..0.5)]),
                };
            }
        }
        if rng.random::<f64>() < mischief.dropped {
            seen.fill(None);
        }
    }
}

impl<E: PoseEstimator> PoseEstimator for Mangled<E> {
    fn estimate(&mut self, features: &[Option<[f64; 2]>]) -> Result<Estimate, HoldReason> {
        self.mangle(features);
        self.inner.estimate(&self.seen)
    }

    fn moved(&mut self, motion: &Motion) {
        self.inner.moved(motion);
    }

    fn restart(&mut self) {
        self.inner.restart();
    }

    fn begin(&self) -> Option<RelativePose> {
        self.inner.begin()
    }
}
