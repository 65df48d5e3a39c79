//! How much noise is left in the features of each window of a cell.

use crate::cell::rings::{Centre, Centres};
use crate::lanes::Vector;
use crate::tile::{CELL, RADIUS, SETS, Seen, TILE};

/// Pixels along a window.
const SPAN: usize = 2 * RADIUS + 1;
const _: () = assert!(SPAN == 16 + 2 + 1, "the sums go by doubling");

/// Sums of the features' variances over the valid pixels of the window around each pixel of a cell.
///
/// Once per cell rather than once per model: windows overlap.
pub(crate) struct FeatureNoise<const D: usize> {
    sums: [[[f32; D]; CELL]; CELL],
}

impl<const D: usize> FeatureNoise<D> {
    pub(crate) const NONE: Self = Self {
        sums: [[[0.0; D]; CELL]; CELL],
    };

    /// The sums of the window around `centre`.
    #[inline(always)]
    fn around(&self, centre: Centre) -> &[f32; D] {
        let row = self.sums.get(usize::from(centre.y));
        let sums = row.and_then(|row| row.get(usize::from(centre.x)));
        debug_assert!(sums.is_some(), "{centre:?} is not in a cell");
        sums.unwrap_or(&[0.0; D])
    }

    /// Computes the sums of a tile's cell, over its set `set` of features.
    #[inline(always)]
    fn fill(&mut self, seen: &Seen<D>, set: usize) {
        *self = Self::NONE;
        let rows = seen.tile.pixels.chunks_exact(TILE);
        let variances = seen.variance_of(set).chunks_exact(TILE);
        for (y, (pixels, own)) in rows.zip(variances).enumerate() {
            let Some(own) = own.first_chunk::<TILE>() else {
                debug_assert!(false, "a row is {TILE} pixels");
                return;
            };
            let mut variances = *own;
            for (variance, pixel) in variances.iter_mut().zip(pixels) {
                let valid = pixel.weight > 0.0;
                if !valid {
                    *variance = [0.0; D];
                }
            }
            // No branch, so that the compiler makes vectors of it.
            let noisy = |some, variance: &f32| some | (*variance > 0.0);
            if variances.as_flattened().iter().fold(false, noisy) {
                self.add_row(y, &along(&variances));
            }
        }
    }

    /// Adds row `y` of the tile to the windows that hold it.
    #[inline(always)]
    fn add_row(&mut self, y: usize, along: &[[f32; D]; CELL]) {
        for row in self
            .sums
            .iter_mut()
            .take(y + 1)
            .skip((y + 1).saturating_sub(SPAN))
        {
            for (sum, value) in row.as_flattened_mut().iter_mut().zip(along.as_flattened()) {
                *sum += value;
            }
        }
    }
}

/// Computes the sums of a tile's cell over each of its sets of features.
#[inline(always)]
pub(crate) fn fill<const D: usize>(noise: &mut [FeatureNoise<D>; SETS], seen: &Seen<D>) {
    let sets = if seen.otherwise.is_some() { SETS } else { 1 };
    for (set, noise) in noise.iter_mut().enumerate().take(sets) {
        noise.fill(seen, set);
    }
}

/// The sums of the windows around the centres of several cells; 0 where there is none.
#[inline(always)]
pub(crate) fn around<const D: usize, const L: usize>(
    cells: &[[FeatureNoise<D>; SETS]; L],
    centres: &Centres<L>,
) -> Vector<D, L> {
    let mut sums = [[0.0; L]; D];
    for (lane, (noise, centre)) in cells.iter().zip(centres).enumerate() {
        let Some(centre) = *centre else { continue };
        let Some(noise) = noise.get(usize::from(centre.set)) else {
            debug_assert!(false, "there is no such set: {centre:?}");
            continue;
        };
        for (all, own) in sums.iter_mut().zip(noise.around(centre)) {
            if let Some(place) = all.get_mut(lane) {
                *place = *own;
            }
        }
    }
    sums
}

/// Sums of 19 along a row.
#[inline(always)]
fn along<const D: usize>(values: &[[f32; D]; TILE]) -> [[f32; D]; CELL] {
    let pairs = doubled(values, 1);
    let sixteens = doubled(&doubled(&doubled(&pairs, 2), 4), 8);
    let mut sums = [[0.0; D]; CELL];
    let sixteen = sixteens.as_flattened().iter();
    let two = pairs.as_flattened().iter().skip(16 * D);
    let one = values.as_flattened().iter().skip(18 * D);
    let parts = sixteen.zip(two).zip(one);
    for (sum, ((sixteen, two), one)) in sums.as_flattened_mut().iter_mut().zip(parts) {
        *sum = sixteen + two + one;
    }
    sums
}

/// Each value and the one `step` after it.
#[inline(always)]
fn doubled<const D: usize>(values: &[[f32; D]; TILE], step: usize) -> [[f32; D]; TILE] {
    let mut sums = *values;
    let after = values.as_flattened().iter().skip(step * D);
    for (sum, after) in sums.as_flattened_mut().iter_mut().zip(after) {
        *sum += after;
    }
    sums
}
