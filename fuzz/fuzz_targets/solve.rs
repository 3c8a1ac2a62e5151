#![no_main]
//! Every solver and every kind of candidates on degenerate matches; the same matches give the same bits.
use libfuzzer_sys::fuzz_target;
use quest_core::Candidates;
use quest_core::solver::{Kinds, SolverName};
use quest_fuzz::Bytes;
use quest_fuzz::hostile::{Choices, matches};
use quest_fuzz::invariants;

fuzz_target!(|bytes: &[u8]| {
    let mut bytes = Bytes(bytes);
    let solver = bytes.pick(&SolverName::ALL);
    let kinds = bytes.pick(&Kinds::CHOICES);
    let is_minimal = bytes.unit() < 0.5;
    let all = matches(&mut bytes);
    let minimal = solver.info().min_matches;
    let some = if is_minimal { &all[..minimal.min(all.len())] } else { &all };
    let mut found = Candidates::new();
    solver.solve(kinds, some, &mut found);
    invariants::candidates(&found, some);
    invariants::order(&found);
    assert!(found.len() <= solver.most_candidates(kinds), "{solver:?}: {}", found.len());
    let mut again = Candidates::new();
    solver.solve(kinds, some, &mut again);
    assert_eq!((&*found, found.degeneracy()), (&*again, again.degeneracy()));
});
