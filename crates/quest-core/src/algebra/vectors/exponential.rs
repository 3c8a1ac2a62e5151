//! The exponential and the logarithm of numbers in lanes: without a branch or a call, so that the compiler makes vectors of a loop
//! over them, and with the same bits on every processor, where the standard library asks the system's.

/// `2⁵² + 2⁵¹`: a number that is added to it loses what follows its point.
const WHOLE: f64 = 6_755_399_441_055_744.0;

/// `ln 2` in two parts, of which the first has so many zeros at its end that its products with exponents are exact.
const LN_2: [f64; 2] = [0.693_147_180_369_123_8, 1.908_214_929_270_587_7e-10];

/// The range of arguments whose exponentials are normal numbers.
const RANGE: [f64; 2] = [-708.0, 709.0];

/// `1/k!` from the highest: Taylor's series on `|x| ≤ ln 2 / 2`, whose rest is below half of the last bit.
const TAYLOR: [f64; 14] = [
    1.0 / 6_227_020_800.0,
    1.0 / 479_001_600.0,
    1.0 / 39_916_800.0,
    1.0 / 3_628_800.0,
    1.0 / 362_880.0,
    1.0 / 40_320.0,
    1.0 / 5_040.0,
    1.0 / 720.0,
    1.0 / 120.0,
    1.0 / 24.0,
    1.0 / 6.0,
    0.5,
    1.0,
    1.0,
];

/// `2/(2k + 1)` from the highest: the series of `ln((1 + s)/(1 − s))/s` in `s²` on `|s| ≤ 0.172`, without its first term.
const LOGARITHM: [f64; 10] = [
    2.0 / 21.0,
    2.0 / 19.0,
    2.0 / 17.0,
    2.0 / 15.0,
    2.0 / 13.0,
    2.0 / 11.0,
    2.0 / 9.0,
    2.0 / 7.0,
    2.0 / 5.0,
    2.0 / 3.0,
];

/// The bits of `√½`, of one, and of `2⁵²`, whose last bits are an integer.
const ROOT_HALF: u64 = 0x3fe6_a09e_667f_3bcd;
const ONE: u64 = 0x3ff0_0000_0000_0000;
const INTEGER: u64 = 0x4330_0000_0000_0000;
const FRACTION: u32 = 52;

/// `eˣ` to a few units of the last place; of arguments beyond its [range](RANGE) that of the nearest end.
#[inline(always)]
pub(crate) fn exp(x: f64) -> f64 {
    let x = x.clamp(RANGE[0], RANGE[1]);
    let shifted = x * std::f64::consts::LOG2_E + WHOLE;
    let power = shifted - WHOLE;
    let rest = (x - power * LN_2[0]) - power * LN_2[1];
    let mut sum = TAYLOR[0];
    for term in &TAYLOR[1..] {
        sum = sum * rest + term;
    }
    f64::from_bits(sum.to_bits().wrapping_add(shifted.to_bits() << FRACTION))
}

/// The natural logarithm of a positive normal number, to a few units of the last place.
#[inline(always)]
pub(crate) fn ln(x: f64) -> f64 {
    // x = 2^power · m with m from √½ to √2.
    let above = x.to_bits().wrapping_sub(ROOT_HALF).wrapping_add(ONE);
    let biased = above >> FRACTION;
    let power = f64::from_bits(INTEGER | biased) - (f64::from_bits(INTEGER) + 1023.0);
    let m = f64::from_bits(x.to_bits().wrapping_sub((biased << FRACTION).wrapping_sub(ONE)));
    let s = (m - 1.0) / (m + 1.0);
    let square = s * s;
    let mut sum = LOGARITHM[0];
    for term in &LOGARITHM[1..] {
        sum = sum * square + term;
    }
    power * LN_2[0] + (2.0 * s + (sum * square * s + power * LN_2[1]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the standard library's: a few roundings of a number near the result.
    #[test]
    fn they_are_those_of_the_standard_library() {
        for k in 0..400_000 {
            let x = f64::from(k) * 0.003_541 - 708.0;
            assert!((exp(x) / x.exp() - 1.0).abs() < 1e-15, "exp {x}: {} {}", exp(x), x.exp());
            let y = 10_f64.powf(f64::from(k) * 0.0015 - 300.0);
            assert!((ln(y) - y.ln()).abs() < 4e-16 * y.ln().abs().max(1.0), "ln {y}: {} {}", ln(y), y.ln());
        }
        for x in
            [1.0, 0.5, 2.0, std::f64::consts::FRAC_1_SQRT_2, 1.0 + f64::EPSILON, f64::MIN_POSITIVE, f64::MAX]
        {
            assert!((ln(x) - x.ln()).abs() <= 4e-16 * x.ln().abs(), "{x}");
        }
        assert!(
            (exp(0.0) - 1.0).abs() < f64::EPSILON
                && exp(f64::NEG_INFINITY) > 0.0
                && exp(f64::INFINITY).is_finite()
        );
    }
}
