//! At which exposures HDR-FLIP looks at an image, and through which tone mapper.

/// ACES as Narkowicz (2015) fits it, the exposure of 0.6 that is part of it taken in: (n2 x^2 + n1 x) / (d2 x^2 + d1 x + d0).
const NUMERATOR: [f32; 2] = [0.6 * 0.6 * 2.51, 0.6 * 0.03];
const DENOMINATOR: [f32; 3] = [0.6 * 0.6 * 2.43, 0.6 * 0.59, 0.14];
/// What the brightest pixel is mapped to at the first exposure, and the median one at the last ("HDR-FLIP", section 3).
const TARGET: f32 = 0.85;
/// From here on all is white: the curve reaches 1 at about 8. Beyond, squares could be infinite.
const WHITE: f32 = 1e4;
/// Exposures there are at least.
const LEAST: f32 = 2.0;

/// Evenly spaced exposures, in stops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::job::compare) struct Exposures {
    first: f32,
    step: f32,
    count: usize,
}

impl Exposures {
    /// From the one at which the brightest pixel is nearly white to the one at which the median one is, a stop or less apart. None for a black reference.
    ///
    /// `median`, `brightest`: luminances of the reference, above 0. In single precision, as the authors' program rounds them, for the number of stops is
    /// rounded up.
    pub(in crate::job::compare) fn of_reference(median: f64, brightest: f64) -> Option<Self> {
        let (median, brightest) = (median as f32, brightest as f32);
        if !(median > 0.0 && brightest > 0.0) {
            return None;
        }
        let bright = bright();
        let (first, last) = ((bright / brightest).log2(), (bright / median).log2());
        let count = (last - first).ceil().max(LEAST);
        Some(Self {
            first,
            step: (last - first) / (count - 1.0),
            count: count as usize,
        })
    }

    /// What radiance is multiplied by, exposure by exposure.
    pub(super) fn factors(self) -> impl Iterator<Item = f32> {
        (0..self.count).map(move |i| (self.first + i as f32 * self.step).exp2())
    }
}

/// The radiance that becomes [`TARGET`]: the larger root of a x^2 + b x + c.
fn bright() -> f32 {
    let a = NUMERATOR[0] - TARGET * DENOMINATOR[0];
    let b = NUMERATOR[1] - TARGET * DENOMINATOR[1];
    let c = -TARGET * DENOMINATOR[2];
    let middle = -0.5 * (b / a);
    middle + (middle * middle - c / a).sqrt()
}

/// A radiance tone mapped and clamped to 0..1; 0 of a negative one.
#[inline(always)]
pub(super) fn tone_mapped(radiance: f32) -> f32 {
    let x = radiance.clamp(0.0, WHITE);
    let numerator = x * x * NUMERATOR[0] + x * NUMERATOR[1];
    let denominator = x * x * DENOMINATOR[0] + x * DENOMINATOR[1] + DENOMINATOR[2];
    (numerator / denominator).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_brightest_pixel_is_nearly_white_at_the_first_exposure_and_the_median_one_at_the_last() {
        let exposures = Exposures::of_reference(0.02, 7.0).unwrap();
        let factors: Vec<f32> = exposures.factors().collect();
        // log2(7 / 0.02) is 8.45
        assert_eq!(factors.len(), 9);
        assert!((tone_mapped(7.0 * factors[0]) - TARGET).abs() < 1e-5);
        assert!((tone_mapped(0.02 * factors[8]) - TARGET).abs() < 1e-5);
    }

    #[test]
    fn a_grey_image_is_seen_twice_and_a_black_one_never() {
        let grey = Exposures::of_reference(0.3, 0.3).unwrap();
        assert_eq!(grey.factors().count(), 2);
        for black in [0.0, f64::NAN] {
            assert_eq!(Exposures::of_reference(black, black), None);
        }
    }

    #[test]
    fn no_radiance_is_mapped_beyond_black_or_white() {
        assert_eq!(tone_mapped(-3.0), 0.0);
        assert_eq!(tone_mapped(f32::MAX), 1.0);
    }
}
