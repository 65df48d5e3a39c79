//! Float functions that `core` lacks, with the same bits on every machine: the only door to `libm`, and approximations by a few
//! multiplications and additions, which a compiler can run in every lane of a register.
//!
//! The crate `micromath` approximates some of these, too. None is used. Largest error, absolute for the logarithm, else relative, and
//! nanoseconds for a value in a loop over 4096 (x86-64 without extensions); `micromath` 2.1.0:
//!
//! | here | error | ns | `micromath` | error | ns | why it stays |
//! |---|---|---|---|---|---|---|
//! | [`reciprocal`] | 1.6e-7 | 0.25 | `inv` | 0.125 | 0.07 | a guess without a Newton step: distances in the prefilter would change with the unit of a feature |
//! | [`reciprocal_sqrt`] | 7.7e-7 | 0.42 | `invsqrt` | 0.034 | 0.09 | the same of estimated noise, and of the confidence in a prediction |
//! | [`fine_reciprocal_sqrt`] | 2e-7 | | `invsqrt` | 0.034 | | its rotations would not be orthonormal |
//! | [`log2_parts`] | 3.3e-7 | 1.6 | `log2` | 8.8e-5 from 1 on, 0.17 below | 5.5 | a factor of 2 is not exact, and it branches, so that no lanes run side by side |
//! | [`exp2_parts`] | 8.2e-8 | 1.7 | `exp` | 7.5e-4 | 15.6 | branches |
//! | [`round_to_u32`], [`saturate`] | exact | | none | | | |
//!
//! The prefilter's `exp(-d)` as `(1 - d/8)^8` is no approximation but a choice, for it ends; by `exp` it would take 2.0 ns for 0.76.

/// Square root, correctly rounded; NaN below 0.
pub(crate) fn sqrt(x: f32) -> f32 {
    libm::sqrtf(x)
}

/// Square root in double precision, correctly rounded; NaN below 0.
pub(crate) fn sqrt_f64(x: f64) -> f64 {
    libm::sqrt(x)
}

/// Natural logarithm in double precision, within 1 unit in the last place; minus infinity at 0.
pub(crate) fn ln_f64(x: f64) -> f64 {
    libm::log(x)
}

/// e to the power of `x` in double precision, within 1 unit in the last place; 0 at minus infinity.
pub(crate) fn exp_f64(x: f64) -> f64 {
    libm::exp(x)
}

/// The larger; not `f32::max`, whose care for NaN costs.
#[inline(always)]
pub(crate) fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The smaller, likewise.
#[inline(always)]
pub(crate) fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The float nearest to `x`, the largest finite one of its sign where it would be infinite.
pub(crate) fn saturate(x: f64) -> f32 {
    x.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32
}

/// Bits of a float's fraction.
const FRACTION_BITS: u32 = 23;
const FRACTION: u32 = (1 << FRACTION_BITS) - 1;
/// From here to twice that, a float's fraction counts ones: adding it to a smaller number rounds that to an integer.
const INTEGERS: f32 = 8_388_608.0;

/// `x` rounded to the nearest integer, for `x` from 0 to 2^23; some other number beyond.
#[inline(always)]
pub(crate) fn round_to_u32(x: f32) -> u32 {
    (x + INTEGERS).to_bits().wrapping_sub(INTEGERS.to_bits())
}

/// The biased exponent of a positive normal number, and the binary logarithm of its fraction, from 0 to 1, within 5e-7.
///
/// A power of two as a factor changes the first alone, and exactly.
#[inline(always)]
pub(crate) fn log2_parts(x: f32) -> (u32, f32) {
    // log2(1 + t) / t, interpolated at Chebyshev's points.
    const TERMS: [f32; 8] = [
        1.442_694_8,
        -0.721_310_73,
        0.480_073_75,
        -0.353_454_65,
        0.256_179_63,
        -0.155_599_86,
        0.063_787_53,
        -0.012_370_624,
    ];
    let bits = x.to_bits();
    let t = f32::from_bits((bits & FRACTION) | 1.0f32.to_bits()) - 1.0;
    (bits >> FRACTION_BITS, t * polynomial(&TERMS, t))
}

/// 2^`fraction` times the power of two with the biased exponent `exponent`, 0 to 254, within 3e-7 of it; `fraction` from 0 to 2.
#[inline(always)]
pub(crate) fn exp2_parts(exponent: u32, fraction: f32) -> f32 {
    // 2^t for t from 0 to 1, interpolated at Chebyshev's points.
    const TERMS: [f32; 7] = [
        1.0,
        0.693_146_94,
        0.240_230_5,
        0.055_480_428,
        0.009_684_58,
        0.001_238_782_2,
        0.000_218_775_05,
    ];
    let (carry, t) = if fraction < 1.0 {
        (0, fraction)
    } else {
        (1, fraction - 1.0)
    };
    let power = f32::from_bits(exponent.wrapping_add(carry) << FRACTION_BITS);
    power * polynomial(&TERMS, t)
}

/// `1 / x` within 3e-7 of it, for `x` from 2^-126 to 2^125 (Moroz et al., Fast calculation of inverse square root and
/// reciprocal with magic constants, 2018).
///
/// A power of two as a factor of `x` is one of the result, exactly.
#[inline(always)]
pub(crate) fn reciprocal(x: f32) -> f32 {
    let guess = f32::from_bits(0x7eb5_3567_u32.wrapping_sub(x.to_bits()));
    let guess = 1.939_597_4 * guess * (1.436_142 - x * guess);
    guess * (2.0 - x * guess)
}

/// `1 / sqrt(x)` within 1e-6 of it, for positive normal `x` (Moroz et al., as above).
///
/// A power of four as a factor of `x` is one of two of the result, exactly.
#[inline(always)]
pub(crate) fn reciprocal_sqrt(x: f32) -> f32 {
    let guess = f32::from_bits(0x5f1f_fff9_u32.wrapping_sub(x.to_bits() >> 1));
    let guess = 0.703_952_25 * guess * (2.389_244_6 - x * guess * guess);
    guess * (1.5 - 0.5 * x * guess * guess)
}

/// The same within 2e-7: one more of Newton's steps.
#[inline(always)]
pub(crate) fn fine_reciprocal_sqrt(x: f32) -> f32 {
    let guess = reciprocal_sqrt(x);
    guess * (1.5 - 0.5 * x * guess * guess)
}

#[inline(always)]
fn polynomial<const N: usize>(terms: &[f32; N], x: f32) -> f32 {
    terms.iter().rev().fold(0.0, |sum, term| sum * x + term)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: f32, b: f64, tolerance: f64) -> bool {
        (f64::from(a) - b).abs() <= tolerance * b.abs()
    }

    /// Why `micromath` is not used: whoever sees this fail should look again.
    #[test]
    fn micromath_is_further_off() {
        use micromath::F32Ext;
        let relative = |value: f32, exact: f64| (f64::from(value) / exact - 1.0).abs();
        let (mut inv, mut invsqrt, mut log2, mut exp) = (0.0f64, 0.0f64, 0.0f64, 0.0f64);
        let mut inexact_doublings = 0;
        for i in 0..10_000u16 {
            let x = 1.0 + f32::from(i) * 1e-4;
            let exact = f64::from(x);
            inv = inv.max(relative(F32Ext::inv(x), 1.0 / exact));
            invsqrt = invsqrt.max(relative(F32Ext::invsqrt(x), 1.0 / sqrt_f64(exact)));
            let log = F32Ext::log2(x);
            log2 = log2.max((f64::from(log) - libm::log2(exact)).abs());
            inexact_doublings += usize::from(F32Ext::log2(2.0 * x) != 1.0 + log);
            exp = exp.max(relative(F32Ext::exp(x), libm::exp(exact)));
        }
        assert!(inv > 0.1 && invsqrt > 0.03 && log2 > 5e-5 && exp > 1e-4);
        assert!(inexact_doublings > 1000);
    }

    #[test]
    fn approximations_are_as_near_as_they_say() {
        for i in 0..200_000u32 {
            let x = f32::from_bits(0x0080_0000 + i * 10_000);
            assert!(close(reciprocal(x), 1.0 / f64::from(x), 3e-7), "{x}");
            let root = 1.0 / sqrt_f64(f64::from(x));
            assert!(close(reciprocal_sqrt(x), root, 1e-6), "{x}");
            assert!(close(fine_reciprocal_sqrt(x), root, 2e-7), "{x}");
            let (exponent, log) = log2_parts(x);
            let value = libm::log2(f64::from(x)) - (f64::from(exponent) - 127.0);
            assert!((f64::from(log) - value).abs() <= 5e-7, "{x} {log} {value}");
            let fraction = i as f32 * 1e-5;
            let power = libm::exp2(f64::from(fraction) + 3.0);
            assert!(close(exp2_parts(130, fraction), power, 3e-7), "{fraction}");
            assert_eq!(
                round_to_u32(i as f32 + 0.4),
                round_to_u32(i as f32 + 1.4) - 1
            );
        }
    }
}
