//! What a fit wants to know of each pixel: its weight, its smoothed variance, and how far a prediction may be from it.
//!
//! Worked out in blocks, each from the colours and variances around it, so that any block gives the same bits.

#![expect(
    clippy::needless_range_loop,
    reason = "the loops follow the indices of the formulas"
)]

use crate::float::{exp, ln};
use crate::median::median_3x3;

/// Columns of a block.
pub const BLOCK_WIDTH: usize = 28;
/// Rows of a block.
pub const BLOCK_HEIGHT: usize = 19;
/// Pixels around a block that its weights read: the level's half-width, and one more for the mean below it.
pub const PREPARE_HALO: usize = LEVEL_RADIUS + 1;

/// Half-width of the neighbourhood whose geometric mean is the local level.
const LEVEL_RADIUS: usize = 9;
/// Weight of the squared local level beside a pixel's own squared radiance (measured: 1 to 10 alike).
const LEVEL_SHARE: f32 = 3.0;
/// Relative error below which a prediction never disagrees with a pixel.
const RELATIVE_TOLERANCE: f32 = 0.1;
/// The same for the pixel's weight, as a part of 1 / weight.
const LEVEL_TOLERANCE: f32 = 1e-3;

const INPUT_WIDTH: usize = BLOCK_WIDTH + 2 * PREPARE_HALO;
const INPUT_HEIGHT: usize = BLOCK_HEIGHT + 2 * PREPARE_HALO;
/// Means over 3 x 3 pixels reach one pixel less far than their input.
const MEAN_WIDTH: usize = INPUT_WIDTH - 2;
const MEAN_HEIGHT: usize = INPUT_HEIGHT - 2;

/// A plane of a block with its halo; beyond the image, the nearest pixel of the image.
pub type ColourPlane = [[f32; INPUT_WIDTH]; INPUT_HEIGHT];
/// A plane of a block.
pub type BlockPlane = [[f32; BLOCK_WIDTH]; BLOCK_HEIGHT];
type MeanPlane = [[f32; MEAN_WIDTH]; MEAN_HEIGHT];

/// What a block's weights are made of.
#[derive(Clone, Debug, PartialEq)]
pub struct ColourBlock {
    /// Mean of the magnitudes of the three channels; 0 where the pixel is bad.
    pub luminance: ColourPlane,
    /// Variance of the mean radiance, summed over the channels; 0 where the pixel is bad.
    pub variance: ColourPlane,
    /// 1, or 0 where the pixel is bad.
    pub good: ColourPlane,
}

impl ColourBlock {
    /// A black block.
    pub const BLACK: Self = Self {
        luminance: [[0.0; INPUT_WIDTH]; INPUT_HEIGHT],
        variance: [[0.0; INPUT_WIDTH]; INPUT_HEIGHT],
        good: [[0.0; INPUT_WIDTH]; INPUT_HEIGHT],
    };
    /// Columns of its planes.
    pub const WIDTH: usize = INPUT_WIDTH;
    /// Rows of its planes.
    pub const HEIGHT: usize = INPUT_HEIGHT;
}

/// Weights, variances and tolerances of a block (see [`crate::Pixel`]).
#[derive(Clone, Debug, PartialEq)]
pub struct PreparedBlock {
    /// `1 / (L^2 + 3 G^2)`, L the mean luminance of the 3 x 3 pixels around, G the geometric mean of L over the 19 x 19 around;
    /// 0 for a bad pixel and where all of those are black.
    ///
    /// Noise is roughly proportional to radiance, and so is what the eye forgives; G keeps a dark pixel from
    /// deciding a fit alone. There is no unit of radiance in it: exposure changes nothing.
    pub weight: BlockPlane,
    /// Mean of the variances of the 3 x 3 pixels around.
    pub variance: BlockPlane,
    /// Squared distance within which a prediction agrees with the pixel: its variance or, if larger, the
    /// median of those of the 3 x 3 around, and a tenth of the radiance.
    pub tolerance: BlockPlane,
}

impl PreparedBlock {
    /// A block that no fit reads.
    pub const EMPTY: Self = Self {
        weight: [[0.0; BLOCK_WIDTH]; BLOCK_HEIGHT],
        variance: [[0.0; BLOCK_WIDTH]; BLOCK_HEIGHT],
        tolerance: [[0.0; BLOCK_WIDTH]; BLOCK_HEIGHT],
    };
}

/// Works out a block. The stack holds some 30 KiB.
#[inline(always)]
pub fn prepare(input: &ColourBlock, output: &mut PreparedBlock) {
    let luminance = mean_3x3(&input.luminance, &input.good);
    let variance = mean_3x3(&input.variance, &input.good);
    let level = geometric_mean(&luminance);
    for y in 0..BLOCK_HEIGHT {
        for x in 0..BLOCK_WIDTH {
            let (row, column) = (y + PREPARE_HALO, x + PREPARE_HALO);
            let mean = luminance[row - 1][column - 1];
            let scale = mean * mean + LEVEL_SHARE * level[y][x] * level[y][x];
            let usable = scale > f32::MIN_POSITIVE && scale.is_finite();
            output.weight[y][x] = if usable {
                input.good[row][column] / scale
            } else {
                0.0
            };
            output.variance[y][x] = variance[row - 1][column - 1];
            let median = median_3x3(&input.luminance, column, row);
            // The noise around, relative to the radiance around: beside a bright edge its mean alone would excuse anything.
            let noise = variance[row - 1][column - 1] / (mean * mean).max(f32::MIN_POSITIVE)
                * median
                * median;
            let spread = median_3x3(&input.variance, column, row)
                .max(input.variance[row][column])
                .max(noise);
            let radiance = RELATIVE_TOLERANCE * median;
            output.tolerance[y][x] = spread + 3.0 * (radiance * radiance + LEVEL_TOLERANCE * scale);
        }
    }
}

/// Mean over the good pixels of 3 x 3, 0 where there is none.
#[inline(always)]
fn mean_3x3(values: &ColourPlane, good: &ColourPlane) -> MeanPlane {
    let mut means = [[0.0; MEAN_WIDTH]; MEAN_HEIGHT];
    for (y, row) in means.iter_mut().enumerate() {
        for (x, mean) in row.iter_mut().enumerate() {
            let (mut sum, mut count) = (0.0, 0.0);
            for dy in 0..3 {
                for dx in 0..3 {
                    sum += values[y + dy][x + dx];
                    count += good[y + dy][x + dx];
                }
            }
            *mean = if count > 0.0 { sum / count } else { 0.0 };
        }
    }
    means
}

/// Geometric mean over 19 x 19 of what is above 0, 0 where nothing is.
#[inline(always)]
fn geometric_mean(luminance: &MeanPlane) -> BlockPlane {
    const SPAN: usize = 2 * LEVEL_RADIUS + 1;
    let mut sums = [[0.0f32; BLOCK_WIDTH]; MEAN_HEIGHT];
    let mut counts = [[0.0f32; BLOCK_WIDTH]; MEAN_HEIGHT];
    for (y, row) in luminance.iter().enumerate() {
        let lit = row.map(|v| if v > 0.0 { 1.0 } else { 0.0 });
        let logs = row.map(|v| if v > 0.0 { ln(v) } else { 0.0 });
        for dx in 0..SPAN {
            for x in 0..BLOCK_WIDTH {
                sums[y][x] += logs[x + dx];
                counts[y][x] += lit[x + dx];
            }
        }
    }
    let mut means = [[0.0; BLOCK_WIDTH]; BLOCK_HEIGHT];
    for (y, row) in means.iter_mut().enumerate() {
        let mut sum = [0.0; BLOCK_WIDTH];
        let mut count = [0.0; BLOCK_WIDTH];
        for dy in 0..SPAN {
            for x in 0..BLOCK_WIDTH {
                sum[x] += sums[y + dy][x];
                count[x] += counts[y + dy][x];
            }
        }
        for x in 0..BLOCK_WIDTH {
            row[x] = if count[x] > 0.0 {
                exp(sum[x] / count[x])
            } else {
                0.0
            };
        }
    }
    means
}
