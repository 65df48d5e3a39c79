//! Local feature space of a window by truncated singular value decomposition (WLR section 4; LPR section 7).
//!
//! Each feature is mapped from its range in the window to [-1, 1] (WLR section 7). With Z the window's mapped features
//! minus their mean and E their standard deviations, Weyl's inequality bounds what noise can do to a singular value:
//! `|s_m(true) - s_m(Z)| <= ||E||`. Directions below `tau = C ||E||` are noise and dropped; the others, `V_k`,
//! turn a pixel's features into its local ones, `z = V_k^T (x - x_c)`.

#![expect(
    clippy::needless_range_loop,
    reason = "the loops follow the indices of the formulas"
)]

use crate::eigen::SymmetricEigen;
use crate::tile::{Pixel, RINGS, Tile, WINDOW_AREA, offset};

/// A feature that moves less than this part of its magnitude in the window is constant.
const CONSTANT: f32 = 1e-5;

/// Singular values below this part of the largest are rounding of the features, not features.
const ROUNDING: f32 = 1e-4;

/// Terms of the largest model: an intercept and 15 local features.
pub const MAX_TERMS: usize = 16;

/// Terms of one pixel: 1, then its local features; what is beyond the rank is 0.
pub(crate) type Terms = [f32; MAX_TERMS];

/// Writes the terms of the window around (x, y), ring after ring, and returns how many there are, 1 to D + 1.
///
/// `norm_factor` is C. A window without a valid pixel has one term.
#[inline(always)]
pub(crate) fn local_features<const D: usize>(
    tile: &Tile<D>,
    (x, y): (usize, usize),
    norm_factor: f32,
    terms: &mut [Terms; WINDOW_AREA],
) -> usize {
    const {
        assert!(
            D < MAX_TERMS,
            "a term for each feature, and one for the intercept"
        )
    };
    let range = Range::of_window(tile, x, y);
    let basis = range.basis(tile, x, y, norm_factor);
    let centre = tile.pixel(x, y);
    for (terms, &by) in terms.iter_mut().zip(&RINGS) {
        let (px, py) = offset(x, y, by);
        *terms = basis.project(tile.pixel(px, py), centre);
    }
    basis.rank + 1
}

/// Where a window's features lie, over its valid pixels.
struct Range<const D: usize> {
    pixels: f32,
    /// 2 / (max - min), 0 for a constant feature.
    scale: [f32; D],
    mean: [f32; D],
    /// Sum of the features' variances.
    noise: [f32; D],
}

impl<const D: usize> Range<D> {
    #[inline(always)]
    fn of_window(tile: &Tile<D>, x: usize, y: usize) -> Self {
        let origin = tile.pixel(x, y).features;
        let mut low = [f32::MAX; D];
        let mut high = [f32::MIN; D];
        let mut range = Self {
            pixels: 0.0,
            scale: [0.0; D],
            mean: [0.0; D],
            noise: [0.0; D],
        };
        for &by in &RINGS {
            let (px, py) = offset(x, y, by);
            let pixel = tile.pixel(px, py);
            if pixel.weight > 0.0 {
                range.pixels += 1.0;
                for j in 0..D {
                    let value = pixel.features[j];
                    low[j] = if value < low[j] { value } else { low[j] };
                    high[j] = if value > high[j] { value } else { high[j] };
                    // Relative to the centre, so that a large offset does not drown small differences.
                    range.mean[j] += value - origin[j];
                    range.noise[j] += pixel.feature_variance[j];
                }
            }
        }
        let share = 1.0 / range.pixels.max(1.0);
        for j in 0..D {
            range.mean[j] = origin[j] + range.mean[j] * share;
            let extent = high[j] - low[j];
            let floor = CONSTANT * (high[j].abs() + low[j].abs());
            if extent > floor && extent > f32::MIN_POSITIVE && extent.is_finite() {
                range.scale[j] = 2.0 / extent;
            }
        }
        range
    }

    #[inline(always)]
    fn basis(&self, tile: &Tile<D>, x: usize, y: usize, norm_factor: f32) -> Basis<D> {
        let mut basis = Basis {
            axes: [[0.0; MAX_TERMS]; D],
            rank: 0,
        };
        let Some(eigen) = SymmetricEigen::new(&self.gramian(tile, x, y)) else {
            return basis;
        };
        let mut noise = 0.0;
        for j in 0..D {
            noise += self.noise[j] * self.scale[j] * self.scale[j];
        }
        let largest = eigen.values.first().copied().unwrap_or(0.0);
        let threshold = (norm_factor * norm_factor * noise).max(ROUNDING * ROUNDING * largest);
        for (value, vector) in eigen.values.iter().zip(&eigen.vectors) {
            if *value > threshold && *value > 0.0 {
                for j in 0..D {
                    // Term 0 is the intercept.
                    if let Some(axis) = basis.axes[j].get_mut(basis.rank + 1) {
                        *axis = vector[j] * self.scale[j];
                    }
                }
                basis.rank += 1;
            }
        }
        basis
    }

    /// Z^T Z: its eigenvalues are the squared singular values, its eigenvectors are V.
    #[inline(always)]
    fn gramian(&self, tile: &Tile<D>, x: usize, y: usize) -> [[f32; D]; D] {
        let mut gramian = [[0.0; D]; D];
        for &by in &RINGS {
            let (px, py) = offset(x, y, by);
            let pixel = tile.pixel(px, py);
            if pixel.weight > 0.0 {
                let mut row = [0.0; D];
                for j in 0..D {
                    row[j] = (pixel.features[j] - self.mean[j]) * self.scale[j];
                }
                for i in 0..D {
                    for j in 0..D {
                        gramian[i][j] += row[i] * row[j];
                    }
                }
            }
        }
        gramian
    }
}

/// V_k with the mapping to [-1, 1] folded in: one row per feature, one column per term.
struct Basis<const D: usize> {
    axes: [Terms; D],
    rank: usize,
}

impl<const D: usize> Basis<D> {
    #[inline(always)]
    fn project(&self, pixel: &Pixel<D>, centre: &Pixel<D>) -> Terms {
        let mut terms = [0.0; MAX_TERMS];
        for j in 0..D {
            let distance = pixel.features[j] - centre.features[j];
            for (term, axis) in terms.iter_mut().zip(&self.axes[j]) {
                *term += distance * axis;
            }
        }
        terms[0] = 1.0;
        terms
    }
}
