//! What must be known of all of the reference before an image is held against it.

use std::sync::atomic::AtomicBool;

use crate::error::Error;

use super::images::Images;
use super::quantile::quantile;
use super::window::luminance;

/// Share of the reference's pixels that are no highlights.
const BELOW_HIGHLIGHTS: f64 = 0.99;

/// Figures of a reference.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scale {
    /// Mean of its luminance.
    pub(super) mean: f64,
    /// Luminance from which on a pixel is among the brightest 1 %.
    pub(super) highlight: f64,
}

/// Reads the reference as often as it takes. Pixels that are not finite are left out; NaN if all are.
pub(super) fn measure(images: &mut Images, stop: &AtomicBool) -> Result<Scale, Error> {
    let mut mean = (0.0, 0_u64);
    let highlight = quantile(BELOW_HIGHLIGHTS, |each| {
        mean = (0.0, 0);
        images.read_reference(stop, |colour| {
            for x in 0..colour[0].len() {
                let luminance = luminance(colour, x);
                if luminance.is_finite() {
                    mean = (mean.0 + luminance, mean.1 + 1);
                    each(luminance);
                }
            }
        })
    })?;
    Ok(Scale {
        mean: mean.0 / mean.1 as f64,
        highlight,
    })
}
