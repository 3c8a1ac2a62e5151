#![no_main]
//! The closed loop on any images: every command is finite and within the limits, and none is given without a pose.
use libfuzzer_sys::fuzz_target;
use quest_core::servo::{DepthFilter, FilterOptions, FreeCameraLaw, Limits, Safety, Servo};
use quest_core::solver::SolverName;
use quest_fuzz::Bytes;
use quest_fuzz::hostile::Choices;
use quest_fuzz::invariants;

const LIMITS: Limits = Limits { speed: 0.2, turn_rate: 0.3 };

fuzz_target!(|bytes: &[u8]| {
    let mut bytes = Bytes(bytes);
    let features = 3 + bytes.below(20);
    let goal: Vec<[f64; 2]> =
        (0..features).map(|_| [bytes.between(-0.5, 0.5), bytes.between(-0.5, 0.5)]).collect();
    let options = FilterOptions { first_images: 1 + bytes.below(4), ..FilterOptions::default() };
    let filter = DepthFilter::new(&goal, SolverName::Quest, options);
    let law = FreeCameraLaw { rate: 0.5, unit: bytes.pick(&[1e-3, 1.0, 1e3]) };
    let mut servo = Servo::new(&goal, filter, law, Safety::new(LIMITS));
    for _ in 0..12 {
        let shift = [bytes.between(-0.2, 0.2), bytes.between(-0.2, 0.2)];
        let zoom = bytes.between(0.5, 2.0);
        let image: Vec<_> = goal
            .iter()
            .map(|[u, v]| match bytes.below(12) {
                0 => None,
                1 => Some([bytes.anything(), bytes.anything()]),
                2 => Some([bytes.between(-1.0, 1.0), bytes.between(-1.0, 1.0)]),
                _ => Some([u * zoom + shift[0], v * zoom + shift[1]]),
            })
            .collect();
        let step = servo.step(&image);
        invariants::command(&step.command, &LIMITS);
    }
});
