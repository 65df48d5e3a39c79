//! An image with more noise of its own kind.

use linpred_core::pixel_hash;

use crate::error::Error;
use crate::row::{InputRow, RowLayout, RowSource};

/// What tells the toss of a pixel's sign from other hashes of it.
const TOSS: u64 = 1;

/// A source whose rows have as much noise added as they have: to each pixel a standard error of its mean, in all channels with the sign that is tossed for the pixel, and the variance
/// that is stated is twice what it was.
///
/// Where the stated variance is that of the noise, what is added and what was there do not correlate: mean and added noise together are like the mean of half the samples, without the
/// samples being at hand (a thinning of the data, with signs in place of normal numbers). Where it is that of two half buffers, it is one of them or the other, pixel by
/// pixel.
///
/// Pixels with a variance that is not known stay as they are.
pub(super) struct Noisier<S>(pub(super) S);

impl<S: RowSource> RowSource for Noisier<S> {
    fn layout(&self) -> RowLayout {
        self.0.layout()
    }

    fn read_row(&mut self, y: usize, row: &mut InputRow) -> Result<(), Error> {
        self.0.read_row(y, row)?;
        let width = row.colour[0].len();
        let signs: Vec<f32> = (0..width)
            .map(|x| match pixel_hash(x as u32, y as u32, TOSS) < 0.5 {
                true => -1.0,
                false => 1.0,
            })
            .collect();
        let colour = row.colour.iter_mut().zip(&mut row.variance);
        let features = row.features.iter_mut().zip(&mut row.feature_variances);
        for (means, variances) in colour.chain(features) {
            let values = means.iter_mut().zip(variances).zip(&signs);
            for ((mean, variance), sign) in values {
                // NaN is not, either
                if *variance > 0.0 && variance.is_finite() {
                    *mean += sign * variance.sqrt();
                    *variance *= 2.0;
                }
            }
        }
        Ok(())
    }
}
