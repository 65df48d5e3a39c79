//! Where more samples would help: how many a pixel should get, by the error that is left in it (LPR section 5.2).
//!
//! The mean squared error e of a denoised pixel falls with its samples as `n^-p`. Of all ways to spend a sum of samples, the sum of `e (n / N)^p` over the pixels is
//! least where the totals N are proportional to the **demand**
//!
//! ```text
//! w = (e n^p)^(m / (1 + p))
//! ```
//!
//! with m = 1. LPR gives new samples in proportion to `e n^(-4 / (d + 4))` instead, which forgets what a pixel has: measured with a live renderer (`tests/bench/adaptive`)
//! that is no better than uniform sampling. An m below 1 stays nearer to even totals, because e is itself only estimated.
//!
//! The same bits on every machine; no call allocates or panics.

use crate::float::{exp_f64, ln_f64};
use crate::tile::CHANNELS;

/// How demands become samples; shared by all pixels.
///
/// ```
/// use linpred_core::Sampler;
///
/// let sampler = Sampler::default();
/// // of two grey pixels with the same squared error and 4 samples, the dark one shows it more
/// let dark = sampler.relative_error(0.01, [0.1; 3]);
/// let bright = sampler.relative_error(0.01, [1.0; 3]);
/// let demand = |error: f32| sampler.demand(error.into(), 4.0);
/// let (dark, bright) = (demand(dark), demand(bright));
/// assert!(dark > bright);
/// // totals in proportion to the demands: what is missing is given
/// let level = 40.0;
/// assert_eq!(sampler.missing(level, bright, 4.0), level * bright - 4.0);
/// assert_eq!(sampler.missing(level, bright, 400.0), 0.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Sampler {
    /// Added to a pixel's squared radiance where an error is divided by it, radiance squared: below its root, errors count as they are.
    pub dark: f32,
    /// p: the power of the samples that the squared error of a denoised pixel falls with. That of a mean is 1; models that change with the noise fall slower (measured: .61 to
    /// .81, a mean of .69 over five scenes between 4 and 16 samples).
    pub fall: f64,
    /// m: 1 for the optimum of an error that is known, 0 for equal totals. Above the default the mean error of a picture falls further, and its darkest places look
    /// worse than with uniform sampling (FLIP).
    pub moderation: f64,
    /// The share of a budget that all noisy pixels get alike, so that every estimate keeps improving (Pajot et al., section 4).
    pub even: f64,
}

impl Default for Sampler {
    fn default() -> Self {
        Self {
            dark: 0.003,
            fall: 0.7,
            moderation: 0.63,
            even: 0.25,
        }
    }
}

impl Sampler {
    /// An error relative to what is seen: a squared error, mean over the channels, over the mean square of the denoised `colour` (linear radiance; below 0 counts as 0)
    /// and [`Self::dark`]. The denoised colour is what Pajot et al. ask of a robust measure: a few huge samples in a pixel hide no error. NaN stays NaN.
    pub fn relative_error(&self, squared_error: f32, colour: [f32; CHANNELS]) -> f32 {
        let squares = colour.map(|value| {
            let light = if value > 0.0 { value } else { 0.0 };
            light * light
        });
        squared_error / ((squares[0] + squares[1] + squares[2]) / 3.0 + self.dark)
    }

    /// The demand w for samples in all, up to a factor that is the same for all pixels: of a pixel with this relative error, 0 or more, after `samples` samples. A pixel without
    /// any counts as if it had one. 0 where the error is 0, below it or NaN.
    pub fn demand(&self, relative_error: f64, samples: f64) -> f64 {
        let power = self.moderation / (1.0 + self.fall);
        match relative_error > 0.0 {
            true => exp_f64(
                power * (ln_f64(relative_error) + self.fall * ln_f64(at_least_one(samples))),
            ),
            false => 0.0,
        }
    }

    /// What a pixel with `samples` samples lacks where totals are `level` times the demands: 0 or more.
    pub fn missing(&self, level: f64, demand: f64, samples: f64) -> f64 {
        let missing = level * demand - samples;
        if missing > 0.0 { missing } else { 0.0 }
    }

    /// The error that is expected of a pixel once it has `more` samples: `e (n / (n + more))^p`.
    pub fn expected_error(&self, relative_error: f64, samples: f64, more: f64) -> f64 {
        if more <= 0.0 {
            return relative_error;
        }
        let samples = at_least_one(samples);
        relative_error * exp_f64(self.fall * (ln_f64(samples) - ln_f64(samples + more)))
    }
}

fn at_least_one(samples: f64) -> f64 {
    if samples > 1.0 { samples } else { 1.0 }
}

/// A number from 0 to below 1 that is uniform and independent over pixels and `salt`s, and the same on every machine: what rounds a number of samples, and a toss of a coin.
///
/// A finaliser of 64 bits with full avalanche (David Stafford's mix 13, of SplitMix64) over the pixel and the salt, twice.
pub fn pixel_hash(x: u32, y: u32, salt: u64) -> f64 {
    let pixel = u64::from(y) << 32 | u64::from(x);
    let bits = mix(mix(pixel.wrapping_add(GOLDEN)).wrapping_add(salt.wrapping_mul(GOLDEN)));
    (bits >> 11) as f64 / (1_u64 << 53) as f64
}

/// 2^64 over the golden ratio, odd: SplitMix64's increment.
const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;

fn mix(mut bits: u64) -> u64 {
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    bits ^ (bits >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn totals_in_proportion_to_the_demands_leave_the_least_error() {
        let sampler = Sampler {
            moderation: 1.0,
            ..Sampler::default()
        };
        let pixels = [(0.5, 4.0), (0.01, 4.0), (0.02, 16.0)];
        let demands = pixels.map(|(error, samples)| sampler.demand(error, samples));
        let all: f64 = demands.iter().sum();
        let totals = demands.map(|demand| 300.0 * demand / all);
        let left = |totals: [f64; 3]| -> f64 {
            let pixels = pixels.iter().zip(totals);
            pixels
                .map(|(&(error, samples), total)| {
                    sampler.expected_error(error, samples, total - samples)
                })
                .sum()
        };
        let best = left(totals);
        for (from, to) in [(0, 1), (1, 2), (2, 0), (1, 0), (2, 1), (0, 2)] {
            let mut moved = totals;
            moved[from] -= 1.0;
            moved[to] += 1.0;
            assert!(left(moved) > best, "{from} to {to}: {} {best}", left(moved));
        }
    }

    #[test]
    fn what_is_no_error_demands_nothing() {
        let sampler = Sampler::default();
        for error in [0.0, -1.0, f64::NAN, f64::NEG_INFINITY] {
            assert_eq!(sampler.demand(error, 4.0), 0.0, "{error}");
        }
        assert!(sampler.relative_error(f32::NAN, [1.0; 3]).is_nan());
        assert_eq!(sampler.relative_error(0.003, [-5.0; 3]), 1.0);
    }

    #[test]
    fn no_sample_counts_as_one() {
        let sampler = Sampler::default();
        assert_eq!(sampler.demand(0.3, 0.0), sampler.demand(0.3, 1.0));
        let after = sampler.expected_error(0.3, 0.0, 3.0);
        assert!(after < 0.3 && after > 0.0, "{after}");
        assert_eq!(sampler.expected_error(0.3, 7.0, 0.0), 0.3);
    }

    #[test]
    fn hashes_of_neighbours_and_of_salts_are_uniform_and_independent() {
        let side = 256;
        let mean = |of: &dyn Fn(u32, u32) -> f64| -> f64 {
            let all = (0..side).flat_map(|y| (0..side).map(move |x| (x, y)));
            all.map(|(x, y)| of(x, y)).sum::<f64>() / f64::from(side * side)
        };
        let centred = |x, y, salt| pixel_hash(x, y, salt) - 0.5;
        // 6 standard errors of the mean of 65,536 of them; of products, whose variance is 1 / 144
        let (error, products) = (6.0 / 12.0_f64.sqrt() / 256.0, 6.0 / 12.0 / 256.0);
        assert!(mean(&|x, y| centred(x, y, 1)).abs() < error);
        for (dx, dy, salt) in [(1, 0, 1), (0, 1, 1), (1, 1, 1), (0, 0, 2), (0, 0, 1 << 40)] {
            let product = mean(&|x, y| centred(x, y, 1) * centred(x + dx, y + dy, salt));
            assert!(product.abs() < products, "{dx} {dy} {salt}: {product}");
        }
        assert!((0..side).all(|x| (0.0..1.0).contains(&pixel_hash(x, x, 0))));
    }
}
