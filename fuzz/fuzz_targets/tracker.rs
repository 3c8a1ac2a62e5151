#![no_main]
//! The closed loop with every estimator, law and guard, on images that come at any time: every command is finite and within the limits.
use libfuzzer_sys::fuzz_target;
use quest_core::servo::per_frame::{Choice, Length};
use quest_core::servo::{
    Border, ControlLaw, DepthFilter, DifferentialDriveLaw, FilterOptions, FreeCameraLaw, Limits, PerFrame, PoseEstimator,
    Safety, Servo, Tracker,
};
use quest_core::solver::SolverName;
use quest_fuzz::Bytes;
use quest_fuzz::hostile::Choices;
use quest_fuzz::invariants;

const LIMITS: Limits = Limits { speed: 0.2, turn_rate: 0.3 };

fuzz_target!(|bytes: &[u8]| {
    let mut bytes = Bytes(bytes);
    let bytes = &mut bytes;
    let features = 1 + bytes.below(24);
    let goal: Vec<[f64; 2]> = match bytes.below(3) {
        0 => (0..features).map(|_| [bytes.between(-0.5, 0.5), bytes.between(-0.5, 0.5)]).collect(),
        1 => (0..features).map(|_| [bytes.between(-0.5, 0.5), 0.1]).collect(),
        _ => vec![[bytes.between(-0.5, 0.5), bytes.between(-0.5, 0.5)]; features],
    };
    let options = FilterOptions {
        noise: bytes.pick(&[1e-3, 1e-6, 1e-1, 1e-300]),
        first_images: 1 + bytes.below(4),
        patience: 1 + bytes.below(5),
        min_features: 5 + bytes.below(4),
        ..FilterOptions::default()
    };
    let choice = bytes.pick(&[Choice::ClosestDepths, Choice::Reprojection, Choice::RotationAxis]);
    let length = bytes.pick(&[Length::GoalDepths, Length::BothViews, Length::Unit]);
    match bytes.below(4) {
        0 | 1 => with_law(bytes, &goal, Tracker::new(&goal, SolverName::Quest, options)),
        2 => with_law(bytes, &goal, DepthFilter::new(&goal, SolverName::Quest, options)),
        _ => with_law(bytes, &goal, PerFrame::new(&goal, SolverName::Quest, choice, length)),
    }
});

fn with_law<E: PoseEstimator>(bytes: &mut Bytes, goal: &[[f64; 2]], estimator: E) {
    match bytes.below(3) {
        0 | 1 => {
            let law = FreeCameraLaw { rate: 0.5, unit: bytes.pick(&[1e-3, 1.0, 1e3]) };
            run(bytes, goal, estimator, law);
        }
        _ => {
            let law = DifferentialDriveLaw::new(0.1, bytes.between(0.05, 0.5));
            run(bytes, goal, estimator, law);
        }
    }
}

fn run<E: PoseEstimator, L: ControlLaw>(bytes: &mut Bytes, goal: &[[f64; 2]], estimator: E, law: L) {
    let mut safety = if bytes.unit() < 0.5 { Safety::for_robot(LIMITS) } else { Safety::new(LIMITS) };
    safety.border = (bytes.unit() < 0.5).then_some(Border { left: -0.5, right: 0.5 });
    safety.explore = bytes.pick(&[0.0, 0.1]);
    safety.coasting_images = bytes.below(3);
    let mut servo = Servo::new(goal, estimator, law, safety);
    let mut time = 0.0;
    for _ in 0..16 {
        // The camera moves a little from image to image, as it does before a tracker.
        let shift = [bytes.between(-0.05, 0.05), bytes.between(-0.05, 0.05)];
        let zoom = bytes.pick(&[1.0, 1.01, 0.9, 2.0]);
        let hostility = bytes.pick(&[0, 0, 1, 12]);
        let image: Vec<_> = goal
            .iter()
            .map(|[u, v]| match bytes.below(12) {
                0 if hostility > 0 => None,
                1 if hostility > 0 => Some([bytes.anything(), bytes.anything()]),
                2..12 if hostility > 1 => Some([bytes.between(-1.0, 1.0), bytes.between(-1.0, 1.0)]),
                _ => Some([u * zoom + shift[0], v * zoom + shift[1]]),
            })
            .collect();
        let stamp = if bytes.unit() < 0.05 { bytes.anything() } else { time };
        let step = if bytes.unit() < 0.5 { servo.step(&image) } else { servo.step_at(&image, stamp, time) };
        invariants::command(&step.command, &LIMITS);
        time += bytes.pick(&[0.033, 0.033, 0.0, 1.0, 1e9]);
        match bytes.below(12) {
            0 => invariants::command(&servo.idle(time), &LIMITS),
            1 if bytes.unit() < 0.1 => servo.reset(),
            _ => {}
        }
    }
}
