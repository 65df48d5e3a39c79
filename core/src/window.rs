//! The windows of `L` models, one in each lane, as the fits read them.

#![expect(
    clippy::needless_range_loop,
    reason = "the loops follow the indices of the formulas"
)]

use crate::float::sqrt;
use crate::lanes::lanes_stay_innermost;
use crate::tile::{Pixel, RADIUS, RINGS, TILE, Tile, WINDOW_AREA};

/// A pixel of each window. Once [`Windows::in_own_unit`] has been called, radiance is in each window's own unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sample<const L: usize> {
    pub(crate) colour: [[f32; L]; 3],
    /// 0 to 1; 0 keeps it out of the fit.
    pub(crate) weight: [f32; L],
    /// Variance of the mean, summed over the channels.
    pub(crate) variance: [f32; L],
    /// Squared distance at which a prediction disagrees.
    pub(crate) tolerance: [f32; L],
}

impl<const L: usize> Sample<L> {
    const ZERO: Self = Self {
        colour: [[0.0; L]; 3],
        weight: [0.0; L],
        variance: [0.0; L],
        tolerance: [0.0; L],
    };
}

/// `L` windows of `D` features, ring after ring.
#[repr(C, align(64))]
pub(crate) struct Windows<const D: usize, const L: usize> {
    /// Features as they came; then those of the range; in the end the local ones (see [`crate::feature_space`]).
    pub(crate) features: [[[f32; L]; D]; WINDOW_AREA],
    pub(crate) samples: [Sample<L>; WINDOW_AREA],
    /// Radiance of 1 in each window's unit.
    pub(crate) per_radiance: [f32; L],
    /// Windows that have a model: those with a centre and a valid pixel.
    pub(crate) live: [bool; L],
}

/// Where each window's features lie, over its valid pixels.
pub(crate) struct Extent<const D: usize, const L: usize> {
    pub(crate) pixels: [f32; L],
    pub(crate) low: [[f32; L]; D],
    pub(crate) high: [[f32; L]; D],
    /// The largest weight.
    pub(crate) weight: [f32; L],
}

impl<const D: usize, const L: usize> Windows<D, L> {
    pub(crate) const ZERO: Self = Self {
        features: [[[0.0; L]; D]; WINDOW_AREA],
        samples: [Sample::ZERO; WINDOW_AREA],
        per_radiance: [1.0; L],
        live: [false; L],
    };

    /// Reads the window around each centre (its position in the tile); a lane without one has no valid pixel.
    #[inline(always)]
    pub(crate) fn read(
        &mut self,
        tiles: &[&Tile<D>; L],
        centres: &[Option<usize>; L],
    ) -> Extent<D, L> {
        let mut extent = Extent {
            pixels: [0.0; L],
            low: [[f32::MAX; L]; D],
            high: [[f32::MIN; L]; D],
            weight: [0.0; L],
        };
        for (row, places) in RASTER_TO_RING.iter().enumerate() {
            for (column, &place) in places.iter().enumerate() {
                let step = (row * TILE + column) as isize - (RADIUS * (TILE + 1)) as isize;
                let (Some(features), Some(sample)) = (
                    self.features.get_mut(usize::from(place)),
                    self.samples.get_mut(usize::from(place)),
                ) else {
                    break;
                };
                for l in 0..L {
                    let pixel = match centres[l] {
                        Some(centre) => tiles[l].pixel_at(centre.wrapping_add_signed(step)),
                        None => &Pixel::OUTSIDE,
                    };
                    for j in 0..D {
                        features[j][l] = pixel.features[j];
                    }
                    for c in 0..3 {
                        sample.colour[c][l] = pixel.colour[c];
                    }
                    sample.weight[l] = pixel.weight;
                    sample.variance[l] = pixel.variance;
                    sample.tolerance[l] = pixel.tolerance;
                }
                lanes_stay_innermost();
            }
        }
        // Not while they are read: what was just stored lane by lane cannot be loaded as a vector yet.
        let features = self.features.chunks_exact(SPAN);
        for (features, samples) in features.zip(self.samples.chunks_exact(SPAN)) {
            if let (Some(features), Some(samples)) = (
                features.first_chunk::<SPAN>(),
                samples.first_chunk::<SPAN>(),
            ) {
                extent.take_in(features, samples);
            }
        }
        extent
    }

    /// Brings radiance to the unit in which the largest weight is 1, so that no exposure overflows.
    #[inline(always)]
    pub(crate) fn in_own_unit(&mut self, largest_weight: &[f32; L]) {
        let mut per_radiance = [1.0; L];
        let mut largest = [1.0; L];
        for l in 0..L {
            self.live[l] = largest_weight[l] > 0.0 && largest_weight[l].is_finite();
            if self.live[l] {
                largest[l] = largest_weight[l];
            }
            per_radiance[l] = sqrt(largest[l]);
        }
        self.per_radiance = per_radiance;
        for sample in &mut self.samples {
            for l in 0..L {
                for c in 0..3 {
                    sample.colour[c][l] *= per_radiance[l];
                }
                sample.weight[l] /= largest[l];
                sample.variance[l] *= largest[l];
                sample.tolerance[l] *= largest[l];
            }
            lanes_stay_innermost();
        }
    }
}

impl<const D: usize, const L: usize> Extent<D, L> {
    /// Takes in some pixels of the windows.
    #[inline(always)]
    fn take_in(&mut self, values: &[[[f32; L]; D]; SPAN], samples: &[Sample<L>; SPAN]) {
        // Moves what does not count out of the way; a condition here would be a branch, and no vector instruction.
        let mut aways = [[0.0; L]; SPAN];
        for (sample, away) in samples.iter().zip(&mut aways) {
            let weight = &sample.weight;
            for l in 0..L {
                away[l] = if weight[l] > 0.0 { 0.0 } else { f32::INFINITY };
                self.pixels[l] += if weight[l] > 0.0 { 1.0 } else { 0.0 };
                let largest = self.weight[l];
                self.weight[l] = if weight[l] > largest {
                    weight[l]
                } else {
                    largest
                };
            }
            lanes_stay_innermost();
        }
        for j in 0..D {
            let (mut low, mut high) = (self.low[j], self.high[j]);
            for (values, away) in values.iter().zip(&aways) {
                for l in 0..L {
                    let below = values[j][l] + away[l];
                    let above = values[j][l] - away[l];
                    low[l] = if below < low[l] { below } else { low[l] };
                    high[l] = if above > high[l] { above } else { high[l] };
                }
                lanes_stay_innermost();
            }
            (self.low[j], self.high[j]) = (low, high);
        }
    }
}

/// Pixels along a window.
const SPAN: usize = 2 * RADIUS + 1;

/// Where the pixels of a window's rows stand ring after ring: a tile is read row by row, as it lies in memory.
const RASTER_TO_RING: [[u16; SPAN]; SPAN] = {
    let mut places = [[0; SPAN]; SPAN];
    let mut i = 0;
    while i < WINDOW_AREA {
        let row = (RADIUS as isize + RINGS[i].1 as isize) as usize;
        let column = (RADIUS as isize + RINGS[i].0 as isize) as usize;
        places[row][column] = i as u16;
        i += 1;
    }
    places
};
