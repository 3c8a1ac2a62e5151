#![no_main]
//! Systems of polynomials: refused, or solutions that satisfy every equation, and the same ones again.
use libfuzzer_sys::fuzz_target;
use quest_core::polynomial_system::{Options, System, solve};
use quest_fuzz::Bytes;
use quest_fuzz::hostile::Choices;

fuzz_target!(|bytes: &[u8]| {
    let mut bytes = Bytes(bytes);
    let unknowns = 1 + bytes.below(3);
    let equations = unknowns + bytes.below(2);
    let degree = 1 + bytes.below(3);
    let is_sane = bytes.unit() < 0.8;
    let scale = bytes.pick(&[1.0, 1.0, 1e-12, 1e12, 1e-160, 1e160]);
    let term = |bytes: &mut Bytes| {
        let mut left = degree;
        #[expect(clippy::cast_possible_truncation, reason = "at most 3")]
        let exponents: Vec<u8> = (0..unknowns)
            .map(|_| {
                let exponent = bytes.below(left + 1);
                left -= exponent;
                exponent as u8
            })
            .collect();
        // Whole coefficients make double solutions and contradictions likely.
        let c = match bytes.below(4) {
            0 => bytes.between(-2.0, 2.0),
            _ => bytes.between(-3.0, 3.0).round(),
        };
        (if is_sane { c * scale } else { bytes.anything() }, exponents)
    };
    let equations: Vec<Vec<_>> =
        (0..equations).map(|_| (0..1 + bytes.below(6)).map(|_| term(&mut bytes)).collect()).collect();
    let Ok(system) = System::new(unknowns, equations) else { return };
    let options = Options { max_rounds: 3, max_monomials: 120, ..Options::default() };
    let found = solve(&system, &options);
    if let Ok(found) = &found {
        for solution in &found.all {
            assert!(solution.x.iter().all(|x| x.re.is_finite() && x.im.is_finite()), "{solution:?}");
            assert!(solution.residual.is_finite() && solution.residual >= 0.0, "{solution:?}");
            assert!(solution.multiplicity > 0, "{solution:?}");
        }
    }
    // The words of an answer hold all of it; NaN would not equal itself.
    assert_eq!(format!("{found:?}"), format!("{:?}", solve(&system, &options)));
});
