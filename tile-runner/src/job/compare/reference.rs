//! What must be known of all of the reference before an image is held against it.

use std::cell::Cell;
use std::sync::atomic::AtomicBool;

use crate::error::Error;
use crate::quantile::{self, quantile, values_at};

use super::flip::Exposures;
use super::images::Images;
use super::window::luminance;

/// Share of the reference's pixels that are no highlights.
const BELOW_HIGHLIGHTS: f64 = 0.99;
/// Bytes of the search for three luminances.
pub(super) const BYTES: u64 = quantile::bytes(3);

/// Figures of a reference.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scale {
    /// Mean of its luminance.
    pub(super) mean: f64,
    /// Luminance from which on a pixel is among the brightest 1 %.
    pub(super) highlight: f64,
    /// What FLIP looks at it with; none if it is black.
    pub(super) exposures: Option<Exposures>,
}

/// What a pass adds up.
#[derive(Clone, Copy, Default)]
struct Sums {
    luminance: f64,
    pixels: u64,
    /// Pixels of no luminance.
    black: u64,
}

/// Reads the reference as often as it takes. Pixels that are not finite are left out; NaN if all are.
pub(super) fn measure(images: &mut Images, stop: &AtomicBool) -> Result<Scale, Error> {
    let sums = Cell::new(Sums::default());
    let highlight = |values| quantile(BELOW_HIGHLIGHTS, values);
    let median = |values| upper_median(values, sums.get().black);
    let brightest = |values| (values - 1) as f64;
    let [highlight, median, brightest] = values_at([&highlight, &median, &brightest], |each| {
        sums.set(Sums::default());
        images.read_reference(stop, |colour| {
            let mut own = sums.get();
            for x in 0..colour[0].len() {
                let luminance = luminance(colour, x);
                if luminance.is_finite() {
                    own.luminance += luminance;
                    own.pixels += 1;
                    own.black += u64::from(luminance <= 0.0);
                    each(luminance);
                }
            }
            sums.set(own);
        })
    })?;
    let sums = sums.get();
    Ok(Scale {
        mean: sums.luminance / sums.pixels as f64,
        highlight,
        exposures: Exposures::of_reference(median, brightest),
    })
}

/// The place of the median of so many values, the upper one of two, as FLIP takes it; of those that are not black, if half of them or more are.
fn upper_median(values: u64, black: u64) -> f64 {
    let all = values / 2;
    let place = match all < black && black < values {
        true => black + (values - black) / 2,
        false => all,
    };
    place as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_not_black_unless_all_is() {
        assert_eq!(upper_median(7, 0), 3.0);
        assert_eq!(upper_median(8, 4), 4.0);
        // 5 black ones, then the 5th, 6th and 7th: the middle one
        assert_eq!(upper_median(8, 5), 6.0);
        assert_eq!(upper_median(8, 8), 4.0);
    }
}
