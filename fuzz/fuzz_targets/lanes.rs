#![no_main]
//! Samples in the lanes: the answers of every set of instructions are those of the scalar solver, and of any batch.
use libfuzzer_sys::fuzz_target;
use quest_core::lanes::{BatchSolver, Essentials, Tolerance};
use quest_fuzz::Bytes;
use quest_fuzz::hostile::{Choices, matches};

fuzz_target!(|bytes: &[u8]| {
    let mut bytes = Bytes(bytes);
    let tolerance = bytes.pick(&[Tolerance::Loop, Tolerance::Tight]);
    let all = matches(&mut bytes);
    if all.len() < 5 {
        return;
    }
    let count = 1 + bytes.below(20);
    #[expect(clippy::cast_possible_truncation, reason = "at most 60 matches")]
    let samples: Vec<[u32; 5]> =
        (0..count).map(|_| std::array::from_fn(|_| bytes.below(all.len()) as u32)).collect();
    let solver = BatchSolver::new(tolerance);
    let mut together = Essentials::new();
    solver.solve(&all, &samples, &mut together).expect("every index is one of a match");
    assert!(together.matrices().iter().flatten().all(|x| x.is_finite()));
    let mut alone = Essentials::new();
    for (k, sample) in samples.iter().enumerate() {
        solver.solve(&all, &[*sample], &mut alone).expect("every index is one of a match");
        assert_eq!(&together.matrices()[together.of(k)], alone.matrices());
    }
});
