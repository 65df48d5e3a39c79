//! Takes the noise off the features before anything is regressed on them (NFOR: Bitterli et al. 2016, section 4.1).
//!
//! Regression assumes noise in the response alone: noise in a feature flattens its slope and is printed into the
//! prediction. Each group of features (a normal, an albedo, a depth) is filtered by non-local means with its own
//! variances:
//!
//! ```text
//! d(p, q) = sum_c ((f_c(p) - f_c(q))^2 - var_c(p) - var_c(q)) / (sum_c (var_c(p) + var_c(q)) + eps)
//! w(p, q) = exp(-max(0, mean of d over 5 x 5)),   q within 7 x 7 of p
//! ```
//!
//! with one ratio for the group rather than one per channel (a third of the divisions, the same error) and
//! `exp(-d)` as `(1 - d/8)^8`, which ends.

#![expect(
    clippy::needless_range_loop,
    reason = "the loops follow the indices of the formulas"
)]

use crate::prepare::{BLOCK_HEIGHT, BLOCK_WIDTH, BlockPlane};

/// Half-width of the search.
const SEARCH: usize = 3;
/// Half-width of the patches that are compared.
const PATCH: usize = 2;
/// Half-width of the mean that steadies the variances: four samples estimate theirs badly.
const STEADY: usize = 2;
/// Pixels around a block that its prefilter reads.
pub const PREFILTER_HALO: usize = SEARCH + PATCH + STEADY;

/// Part of a feature's square that counts as noise whatever its variance says: rounding of half floats.
const ROUNDING: f32 = 1e-6;
/// Distances are cut here, so that one pixel's does not rule out its neighbours for good.
const LARGEST_DISTANCE: f32 = 1e3;

const INPUT_WIDTH: usize = BLOCK_WIDTH + 2 * PREFILTER_HALO;
const INPUT_HEIGHT: usize = BLOCK_HEIGHT + 2 * PREFILTER_HALO;
const STEADY_WIDTH: usize = INPUT_WIDTH - 2 * STEADY;
const STEADY_HEIGHT: usize = INPUT_HEIGHT - 2 * STEADY;
const PATCHES_WIDTH: usize = BLOCK_WIDTH + 2 * PATCH;
const PATCHES_HEIGHT: usize = BLOCK_HEIGHT + 2 * PATCH;

/// A plane of a block with its halo; beyond the image, the nearest pixel of the image.
pub type FeaturePlane = [[f32; INPUT_WIDTH]; INPUT_HEIGHT];
type SteadyPlane = [[f32; STEADY_WIDTH]; STEADY_HEIGHT];

/// A group of `N` features that belong together, with their variances.
#[derive(Clone, Debug, PartialEq)]
pub struct FeatureGroup<const N: usize> {
    /// Features; finite.
    pub value: [FeaturePlane; N],
    /// Variances of their means; finite, not negative.
    pub variance: [FeaturePlane; N],
}

impl<const N: usize> FeatureGroup<N> {
    /// A group of zeros.
    pub const ZERO: Self = Self {
        value: [[[0.0; INPUT_WIDTH]; INPUT_HEIGHT]; N],
        variance: [[[0.0; INPUT_WIDTH]; INPUT_HEIGHT]; N],
    };
    /// Columns of its planes.
    pub const WIDTH: usize = INPUT_WIDTH;
    /// Rows of its planes.
    pub const HEIGHT: usize = INPUT_HEIGHT;
}

/// A filtered group, and the variance that it has kept.
#[derive(Clone, Debug, PartialEq)]
pub struct FilteredGroup<const N: usize> {
    /// Features.
    pub value: [BlockPlane; N],
    /// Variance left in them, `sum w^2 var / (sum w)^2`.
    pub variance: [BlockPlane; N],
}

impl<const N: usize> FilteredGroup<N> {
    /// A group of zeros.
    pub const ZERO: Self = Self {
        value: [[[0.0; BLOCK_WIDTH]; BLOCK_HEIGHT]; N],
        variance: [[[0.0; BLOCK_WIDTH]; BLOCK_HEIGHT]; N],
    };
}

/// Filters a block of a group; returns false, and copies, where the group has no variance at all.
///
/// A pixel's result depends on the 7 pixels around it alone. The stack holds some 20 KiB.
#[inline(always)]
pub fn prefilter<const N: usize>(input: &FeatureGroup<N>, output: &mut FilteredGroup<N>) -> bool {
    if !has_variance(input) {
        copy(input, output);
        return false;
    }
    let steady = steady_variance(&input.variance);
    let mut sums = Sums {
        weight: [[0.0; BLOCK_WIDTH]; BLOCK_HEIGHT],
    };
    *output = FilteredGroup::ZERO;
    for dy in 0..=2 * SEARCH {
        for dx in 0..=2 * SEARCH {
            let weights = patch_weights(&input.value, &steady, dx, dy);
            sums.add(&weights, input, output, dx, dy);
        }
    }
    sums.normalise(output);
    true
}

#[inline(always)]
fn has_variance<const N: usize>(input: &FeatureGroup<N>) -> bool {
    let mut largest = 0.0f32;
    for row in input.variance.iter().flatten() {
        for value in row {
            largest = largest.max(*value);
        }
    }
    largest > 0.0
}

#[inline(always)]
fn copy<const N: usize>(input: &FeatureGroup<N>, output: &mut FilteredGroup<N>) {
    for (plane, values) in output.value.iter_mut().zip(&input.value) {
        for y in 0..BLOCK_HEIGHT {
            for x in 0..BLOCK_WIDTH {
                plane[y][x] = values[y + PREFILTER_HALO][x + PREFILTER_HALO];
            }
        }
    }
    output.variance = [[[0.0; BLOCK_WIDTH]; BLOCK_HEIGHT]; N];
}

/// Sum over the group of the variances' means over 5 x 5.
#[inline(always)]
fn steady_variance<const N: usize>(variance: &[FeaturePlane; N]) -> SteadyPlane {
    const SPAN: usize = 2 * STEADY + 1;
    let mut across = [[0.0; STEADY_WIDTH]; INPUT_HEIGHT];
    for y in 0..INPUT_HEIGHT {
        for plane in variance {
            for dx in 0..SPAN {
                for x in 0..STEADY_WIDTH {
                    across[y][x] += plane[y][x + dx];
                }
            }
        }
    }
    let mut steady = [[0.0; STEADY_WIDTH]; STEADY_HEIGHT];
    for y in 0..STEADY_HEIGHT {
        for dy in 0..SPAN {
            for x in 0..STEADY_WIDTH {
                steady[y][x] += across[y + dy][x];
            }
        }
        for value in &mut steady[y] {
            *value *= 1.0 / (SPAN * SPAN) as f32;
        }
    }
    steady
}

/// Weight of the pixel (dx - SEARCH, dy - SEARCH) away, for each pixel of the block.
#[inline(always)]
fn patch_weights<const N: usize>(
    value: &[FeaturePlane; N],
    steady: &SteadyPlane,
    dx: usize,
    dy: usize,
) -> BlockPlane {
    const SPAN: usize = 2 * PATCH + 1;
    let mut across = [[0.0; BLOCK_WIDTH]; PATCHES_HEIGHT];
    for (y, sums) in across.iter_mut().enumerate() {
        let distances = distance_row(value, steady, y, dx, dy);
        for k in 0..SPAN {
            for x in 0..BLOCK_WIDTH {
                sums[x] += distances[x + k];
            }
        }
    }
    let mut weights = [[0.0; BLOCK_WIDTH]; BLOCK_HEIGHT];
    for (y, row) in weights.iter_mut().enumerate() {
        for k in 0..SPAN {
            for x in 0..BLOCK_WIDTH {
                row[x] += across[y + k][x];
            }
        }
        for weight in row {
            *weight = falloff(*weight * (1.0 / (SPAN * SPAN) as f32));
        }
    }
    weights
}

/// d of one row of pixels to those (dx - SEARCH, dy - SEARCH) away.
#[inline(always)]
fn distance_row<const N: usize>(
    value: &[FeaturePlane; N],
    steady: &SteadyPlane,
    y: usize,
    dx: usize,
    dy: usize,
) -> [f32; PATCHES_WIDTH] {
    let mut squared = [0.0; PATCHES_WIDTH];
    let mut square = [0.0; PATCHES_WIDTH];
    for plane in value {
        let (here, there) = (&plane[y + SEARCH + STEADY], &plane[y + dy + STEADY]);
        for x in 0..PATCHES_WIDTH {
            let own = here[x + SEARCH + STEADY];
            let difference = own - there[x + dx + STEADY];
            squared[x] += difference * difference;
            square[x] += own * own;
        }
    }
    let (here, there) = (&steady[y + SEARCH], &steady[y + dy]);
    let mut distance = [0.0; PATCHES_WIDTH];
    for x in 0..PATCHES_WIDTH {
        let noise = here[x + SEARCH] + there[x + dx] + ROUNDING * square[x] + f32::MIN_POSITIVE;
        let ratio = (squared[x] - noise) / noise;
        distance[x] = if ratio < LARGEST_DISTANCE {
            ratio
        } else {
            LARGEST_DISTANCE
        };
    }
    distance
}

/// `exp(-d)` for d above 0, as `(1 - d/8)^8`.
#[inline(always)]
fn falloff(distance: f32) -> f32 {
    let beyond = if distance > 0.0 { distance } else { 0.0 };
    let base = 1.0 - 0.125 * beyond;
    let base = if base > 0.0 { base } else { 0.0 };
    let squared = base * base;
    let fourth = squared * squared;
    fourth * fourth
}

struct Sums {
    weight: BlockPlane,
}

impl Sums {
    #[inline(always)]
    fn add<const N: usize>(
        &mut self,
        weights: &BlockPlane,
        input: &FeatureGroup<N>,
        output: &mut FilteredGroup<N>,
        dx: usize,
        dy: usize,
    ) {
        const MARGIN: usize = PATCH + STEADY;
        for y in 0..BLOCK_HEIGHT {
            for x in 0..BLOCK_WIDTH {
                self.weight[y][x] += weights[y][x];
            }
            for c in 0..N {
                let (values, variances) = (
                    &input.value[c][y + dy + MARGIN],
                    &input.variance[c][y + dy + MARGIN],
                );
                for x in 0..BLOCK_WIDTH {
                    let weight = weights[y][x];
                    output.value[c][y][x] += weight * values[x + dx + MARGIN];
                    output.variance[c][y][x] += weight * weight * variances[x + dx + MARGIN];
                }
            }
        }
    }

    /// The pixel itself has weight 1 or nearly, so no sum is 0.
    #[inline(always)]
    fn normalise<const N: usize>(&self, output: &mut FilteredGroup<N>) {
        for c in 0..N {
            for y in 0..BLOCK_HEIGHT {
                for x in 0..BLOCK_WIDTH {
                    let weight = self.weight[y][x];
                    output.value[c][y][x] /= weight;
                    output.variance[c][y][x] /= weight * weight;
                }
            }
        }
    }
}
