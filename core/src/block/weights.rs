//! What a fit needs to know of each pixel: its weight, its smoothed variance, and how far a prediction may be from it.
//!
//! Computed block by block, from the colours and variances in and around it. A pixel's bits depend on what is around it and
//! not on where it lies in a block: sums of floats are those of fixed neighbours in a fixed order, and those over 19 x 19 pixels, which
//! slide, are sums of integers.

#![expect(
    clippy::needless_range_loop,
    reason = "the loops follow the indices of the formulas"
)]

use crate::block::median::medians_3x3;
use crate::block::plane::{
    BLOCK_COLUMNS, BLOCK_HEIGHT, BLOCK_WIDTH, BlockPlane, BlockRow, columns,
};
use crate::float::{exp2_parts, fine_reciprocal_sqrt, larger, log2_parts, round_to_u32, smaller};

/// Pixels around a block that its weights read: the half-width of the log-average, and one more for the mean below it.
pub const WEIGHTS_HALO: usize = LOG_AVERAGE_RADIUS + 1;

/// Half-width of the neighbourhood over which luminance is averaged geometrically: the log-average luminance of tone mapping (Reinhard
/// et al. 2002), here a local one.
const LOG_AVERAGE_RADIUS: usize = 9;
const LOG_AVERAGE_SPAN: usize = 2 * LOG_AVERAGE_RADIUS + 1;
/// A pixel weighs one over this many squared log-averages. No fit depends on it; tolerances do, by way of [`WEIGHT_TOLERANCE`].
const WEIGHT_SCALE: f32 = 4.0;
/// Side of the squares whose mean variances say how noisy the surroundings are at least.
const CORNER_SPAN: usize = 5;
/// Relative error below which a prediction never disagrees with a pixel.
const RELATIVE_TOLERANCE: f32 = 0.1;
/// The same for the pixel's weight, as a part of 1 / weight.
const WEIGHT_TOLERANCE: f32 = 1e-3;

const INPUT_HEIGHT: usize = BLOCK_HEIGHT + 2 * WEIGHTS_HALO;
/// Means over 3 x 3 pixels reach one pixel less far than their input.
const MEAN_HEIGHT: usize = INPUT_HEIGHT - 2;
/// Columns of the means: those that are read, and more to fill registers.
const MEAN_COLUMNS: usize = 64;
const INPUT_COLUMNS: usize = MEAN_COLUMNS + 2;
const _: () = assert!(ColourBlock::WIDTH <= INPUT_COLUMNS);

/// A plane of a block with its halo; beyond the image, the nearest pixel of the image.
pub type ColourPlane = [[f32; INPUT_COLUMNS]; INPUT_HEIGHT];
type MeanRow = [f32; MEAN_COLUMNS];

/// Input of [`weigh_samples`].
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
        luminance: [[0.0; INPUT_COLUMNS]; INPUT_HEIGHT],
        variance: [[0.0; INPUT_COLUMNS]; INPUT_HEIGHT],
        good: [[0.0; INPUT_COLUMNS]; INPUT_HEIGHT],
    };
    /// Columns of its planes that are read, from the first; the others may hold any finite number.
    pub const WIDTH: usize = BLOCK_WIDTH + 2 * WEIGHTS_HALO;
    /// Rows of its planes.
    pub const HEIGHT: usize = INPUT_HEIGHT;
}

/// Weights, variances and tolerances of a block (see [`crate::Pixel`]).
#[derive(Clone, Debug, PartialEq)]
pub struct WeightBlock {
    /// `1 / (4 G^2)`, G the geometric mean over the 19 x 19 pixels around of the mean luminance of the 3 x 3 around each; 0 for a bad
    /// pixel and where all of those are black.
    ///
    /// It hardly changes within a window, and that is its merit: a weight that falls with a pixel's own radiance, or with its
    /// neighbours', believes the pixels that came out dark, and light is lost (a window's mean by 5.6 % where the noise is as large as the
    /// radiance). There is no unit of radiance in it: exposure changes nothing.
    pub weight: BlockPlane,
    /// Mean of the variances of the 3 x 3 pixels around or, if larger, the least of the means over the four 5 x 5 that have the pixel
    /// in a corner; 0 where those of the 3 x 3 are 0 and lit.
    ///
    /// In skewed noise a pixel that came out dark has a small variance, too; the wider means know better, and the least of them is not
    /// taken in by a bright window on one side.
    pub variance: BlockPlane,
    /// Squared distance within which a prediction agrees with the pixel: the largest of its variance, the
    /// median of those of the 3 x 3 around, their mean relative to the radiance and the least of the four wider means, and a tenth of the radiance.
    pub tolerance: BlockPlane,
}

impl WeightBlock {
    /// A block that no fit reads.
    pub const EMPTY: Self = Self {
        weight: [[0.0; BLOCK_COLUMNS]; BLOCK_HEIGHT],
        variance: [[0.0; BLOCK_COLUMNS]; BLOCK_HEIGHT],
        tolerance: [[0.0; BLOCK_COLUMNS]; BLOCK_HEIGHT],
    };
}

/// The level of radiance around a pixel whose [`weight`](WeightBlock::weight) is `weight = 1 / (4 G^2)`: G; 0 where the weight is 0.
#[inline(always)]
pub fn level_of(weight: f32) -> f32 {
    if weight >= f32::MIN_POSITIVE {
        0.5 * fine_reciprocal_sqrt(weight)
    } else {
        0.0
    }
}

/// Computes a block. Takes some 25 KiB of stack.
#[inline(always)]
pub fn weigh_samples(input: &ColourBlock, output: &mut WeightBlock) {
    let mut logs = [LogRow::ZERO; MEAN_HEIGHT];
    // The mean luminance of the block itself, which begins where the first log-average is in the middle of its neighbourhood.
    let mut means = [[0.0; BLOCK_COLUMNS]; BLOCK_HEIGHT];
    for y in 0..MEAN_HEIGHT {
        let shares = shares_3x3(&input.good, y);
        let mean = means_3x3(&input.luminance, y, &shares);
        logs[y] = log_row(&mean);
        if (LOG_AVERAGE_RADIUS..LOG_AVERAGE_RADIUS + BLOCK_HEIGHT).contains(&y) {
            means[y - LOG_AVERAGE_RADIUS] = *columns(&mean, LOG_AVERAGE_RADIUS);
        }
    }
    let mut sums = LogRow::ZERO;
    for y in 0..LOG_AVERAGE_SPAN - 1 {
        sums.add(&logs[y]);
    }
    for y in 0..BLOCK_HEIGHT {
        sums.add(&logs[y + LOG_AVERAGE_SPAN - 1]);
        let log_average = geometric_means(&sums);
        sums.subtract(&logs[y]);
        weigh_row(input, y, &means[y], &log_average, output);
    }
}

/// Row `y` of the block, from its mean luminance and its log-average.
#[inline(always)]
fn weigh_row(
    input: &ColourBlock,
    y: usize,
    means: &BlockRow,
    log_average: &BlockRow,
    output: &mut WeightBlock,
) {
    let shares = shares_3x3(&input.good, y + LOG_AVERAGE_RADIUS);
    let variances = means_3x3(&input.variance, y + LOG_AVERAGE_RADIUS, &shares);
    let variances: &BlockRow = columns(&variances, LOG_AVERAGE_RADIUS);
    let corners = corner_means(input, y);
    let luminance = medians(&input.luminance, y);
    let spreads = medians(&input.variance, y);
    let own: &BlockRow = columns(&input.variance[y + WEIGHTS_HALO], WEIGHTS_HALO);
    let good: &BlockRow = columns(&input.good[y + WEIGHTS_HALO], WEIGHTS_HALO);
    let weights = &mut output.weight[y];
    let tolerances = &mut output.tolerance[y];
    for x in 0..BLOCK_COLUMNS {
        let square = means[x] * means[x];
        let scale = WEIGHT_SCALE * log_average[x] * log_average[x];
        let usable = scale > f32::MIN_POSITIVE && scale <= f32::MAX;
        weights[x] = if usable { good[x] / scale } else { 0.0 };
        // The noise around, relative to the radiance around: beside a bright edge its mean alone would excuse anything.
        let median = luminance[x];
        let noise = variances[x] / larger(square, f32::MIN_POSITIVE) * median * median;
        let spread = larger(larger(spreads[x], own[x]), larger(noise, corners[x]));
        let radiance = RELATIVE_TOLERANCE * median;
        tolerances[x] = spread + 3.0 * (radiance * radiance + WEIGHT_TOLERANCE * scale);
    }
    for x in 0..BLOCK_COLUMNS {
        // All samples alike and not black: a light that is seen, not a light that was missed.
        let exact = variances[x] == 0.0 && means[x] > 0.0;
        let wide = larger(variances[x], corners[x]);
        output.variance[y][x] = if exact { 0.0 } else { wide };
    }
}

/// The least of the mean variances over the four 5 x 5 good pixels that have a pixel of row `y` of the block in a corner.
#[inline(always)]
fn corner_means(input: &ColourBlock, y: usize) -> BlockRow {
    const REACH: usize = CORNER_SPAN - 1;
    let mut least = [f32::MAX; BLOCK_COLUMNS];
    for first in [y + WEIGHTS_HALO - REACH, y + WEIGHTS_HALO] {
        let (sums, counts) = (
            sums_5x5(&input.variance, first),
            sums_5x5(&input.good, first),
        );
        let mut means = [0.0; BLOCK_COLUMNS + REACH];
        for x in 0..BLOCK_COLUMNS + REACH {
            means[x] = sums[x] / larger(counts[x], 1.0);
        }
        for x in 0..BLOCK_COLUMNS {
            least[x] = smaller(least[x], smaller(means[x], means[x + REACH]));
        }
    }
    least
}

/// Sums over the 5 x 5 pixels whose first row is `y`; the last column of the first of them is the block's first.
#[inline(always)]
fn sums_5x5(plane: &ColourPlane, y: usize) -> [f32; BLOCK_COLUMNS + CORNER_SPAN - 1] {
    const FIRST: usize = WEIGHTS_HALO - (CORNER_SPAN - 1);
    let mut sums = [0.0; BLOCK_COLUMNS + CORNER_SPAN - 1];
    let rows = plane.get(y..).and_then(<[_]>::first_chunk::<CORNER_SPAN>);
    let Some([a, b, c, d, e]) = rows else {
        debug_assert!(false, "no five rows from {y} on");
        return sums;
    };
    let mut down = [0.0; INPUT_COLUMNS];
    for x in 0..INPUT_COLUMNS {
        down[x] = (a[x] + b[x]) + (c[x] + d[x]) + e[x];
    }
    for x in 0..sums.len() {
        let [a, b, c, d, e] = [0, 1, 2, 3, 4].map(|k| down[x + FIRST + k]);
        sums[x] = (a + b) + (c + d) + e;
    }
    sums
}

/// Medians of the 3 x 3 pixels around those of row `y` of the block.
#[inline(always)]
fn medians(plane: &ColourPlane, y: usize) -> BlockRow {
    let row = |dy: usize| columns(&plane[y + WEIGHTS_HALO - 1 + dy], WEIGHTS_HALO - 1);
    medians_3x3::<{ BLOCK_COLUMNS + 2 }, BLOCK_COLUMNS>([row(0), row(1), row(2)])
}

/// Sums over the 3 x 3 pixels whose first row is `y`.
#[inline(always)]
fn sums_3x3(plane: &ColourPlane, y: usize) -> MeanRow {
    let mut down = [0.0; INPUT_COLUMNS];
    for x in 0..INPUT_COLUMNS {
        down[x] = plane[y][x] + plane[y + 1][x] + plane[y + 2][x];
    }
    let mut sums = [0.0; MEAN_COLUMNS];
    for x in 0..MEAN_COLUMNS {
        sums[x] = down[x] + down[x + 1] + down[x + 2];
    }
    sums
}

/// One over the number of good pixels of 3 x 3.
#[inline(always)]
fn shares_3x3(good: &ColourPlane, y: usize) -> MeanRow {
    sums_3x3(good, y).map(|count| 1.0 / larger(count, 1.0))
}

/// Means over the good pixels of 3 x 3, 0 where there is none.
#[inline(always)]
fn means_3x3(plane: &ColourPlane, y: usize, shares: &MeanRow) -> MeanRow {
    let mut means = sums_3x3(plane, y);
    for x in 0..MEAN_COLUMNS {
        means[x] *= shares[x];
    }
    means
}

/// Binary logarithms of the lit pixels of a row, summed over the neighbourhood of each column: as integers, so that sums may slide.
#[derive(Clone, Copy)]
struct LogRow {
    /// Pixels, in units of [`ONE_PIXEL`], and their biased exponents.
    exponent: [u32; BLOCK_COLUMNS],
    /// Logarithms of their fractions, in units of 1 / [`LOG_UNITS`].
    fraction: [u32; BLOCK_COLUMNS],
}

/// More than the exponents of 361 floats add up to.
const ONE_PIXEL: u32 = 1 << 20;
/// A neighbourhood's 361 stay below 2^30.
const LOG_UNITS: f32 = (1 << 21) as f32;

impl LogRow {
    const ZERO: Self = Self {
        exponent: [0; BLOCK_COLUMNS],
        fraction: [0; BLOCK_COLUMNS],
    };

    #[inline(always)]
    fn add(&mut self, other: &Self) {
        for x in 0..BLOCK_COLUMNS {
            self.exponent[x] = self.exponent[x].wrapping_add(other.exponent[x]);
            self.fraction[x] = self.fraction[x].wrapping_add(other.fraction[x]);
        }
    }

    #[inline(always)]
    fn subtract(&mut self, other: &Self) {
        for x in 0..BLOCK_COLUMNS {
            self.exponent[x] = self.exponent[x].wrapping_sub(other.exponent[x]);
            self.fraction[x] = self.fraction[x].wrapping_sub(other.fraction[x]);
        }
    }
}

#[inline(always)]
fn log_row(luminance: &MeanRow) -> LogRow {
    let mut exponents = [0; LOG_COLUMNS];
    let mut fractions = [0; LOG_COLUMNS];
    for x in 0..MEAN_COLUMNS {
        let (exponent, fraction) = log2_parts(luminance[x]);
        let lit = luminance[x] >= f32::MIN_POSITIVE;
        exponents[x] = if lit { ONE_PIXEL | exponent } else { 0 };
        fractions[x] = if lit {
            round_to_u32(LOG_UNITS * fraction)
        } else {
            0
        };
    }
    LogRow {
        exponent: sums_of_19(&exponents),
        fraction: sums_of_19(&fractions),
    }
}

/// [`MEAN_COLUMNS`], and zeros for the sums of columns beyond the block.
const LOG_COLUMNS: usize = BLOCK_COLUMNS + 2 * LOG_AVERAGE_RADIUS;

/// Sums of columns x to x + 18, by way of those of 3 and 9.
#[inline(always)]
fn sums_of_19(values: &[u32; LOG_COLUMNS]) -> [u32; BLOCK_COLUMNS] {
    const _: () = assert!(LOG_AVERAGE_SPAN == 3 * 3 * 2 + 1);
    let mut threes = [0u32; BLOCK_COLUMNS + 15];
    for x in 0..BLOCK_COLUMNS + 15 {
        threes[x] = values[x]
            .wrapping_add(values[x + 1])
            .wrapping_add(values[x + 2]);
    }
    let mut nines = [0u32; BLOCK_COLUMNS + 9];
    for x in 0..BLOCK_COLUMNS + 9 {
        nines[x] = threes[x]
            .wrapping_add(threes[x + 3])
            .wrapping_add(threes[x + 6]);
    }
    let mut sums = [0u32; BLOCK_COLUMNS];
    for x in 0..BLOCK_COLUMNS {
        sums[x] = nines[x]
            .wrapping_add(nines[x + 9])
            .wrapping_add(values[x + 18]);
    }
    sums
}

/// Geometric means over the lit pixels whose logarithms were added up, 0 where there is none.
///
/// The whole part of the mean exponent is taken out exactly, so a power of two as a factor of all pixels is one of their mean, exactly.
#[inline(always)]
fn geometric_means(sums: &LogRow) -> BlockRow {
    let mut means = [0.0; BLOCK_COLUMNS];
    for x in 0..BLOCK_COLUMNS {
        let pixels = (sums.exponent[x] / ONE_PIXEL) as i32 as f32;
        let exponents = (sums.exponent[x] % ONE_PIXEL) as i32 as f32;
        let fractions = sums.fraction[x] as i32 as f32;
        let share = 1.0 / larger(pixels, 1.0);
        // Half a pixel more keeps rounding away from whole numbers; half a unit less turns rounding into rounding down.
        let whole = round_to_u32((exponents + 0.5) * share - 0.5);
        let rest = exponents - whole as i32 as f32 * pixels;
        let mean = exp2_parts(whole, (rest + fractions * (1.0 / LOG_UNITS)) * share);
        means[x] = if pixels > 0.0 { mean } else { 0.0 };
    }
    means
}
