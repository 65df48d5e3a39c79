//! Variances for renders that come without, estimated from the pixels themselves.
//!
//! An edge, a stripe or a shading gradient has one direction along which its second difference is 0; noise that is white from
//! pixel to pixel has none. So the variance of a plane is estimated as
//!
//! ```text
//! min over the directions d of -, |, /, \ of the mean over a neighbourhood of (a(p + d) - 2 a(p) + a(p - d))^2 / 6
//! ```
//!
//! (for white noise the expectation of the term is the variance; compare Immerkaer, Fast noise variance estimation, 1996).
//! Two things look like noise to it, and are told from noise by other means:
//!
//! - Texture in radiance: the estimate is also made of the radiance over the albedo, and the smaller one counts.
//! - Texture in albedo: a texture that is sampled with jitter (lens or motion blur, antialiasing) comes with a
//!   depth that jitters as well, while a clean texture lies on a smooth depth. The jitter seen in depth, in pixels, times the
//!   albedo's gradient bounds the albedo's noise.
//!
//! Noise of radiance is estimated relative to the radiance around, to which it is roughly proportional: otherwise a
//! window would lend its noise to the dark wall around it.

#![expect(
    clippy::needless_range_loop,
    reason = "the loops follow the indices of the formulas"
)]

use crate::block::median::medians_3x3;
use crate::block::plane::{
    BLOCK_COLUMNS, BLOCK_HEIGHT, BLOCK_WIDTH, BlockPlane, columns, columns_of,
};
use crate::features::{FEATURES, Feature};
use crate::float::reciprocal_sqrt;

/// Pixels around a block that its estimates read: mean radiance, difference, and neighbourhood.
pub const NOISE_HALO: usize = 1 + 1 + RADIANCE_RADIUS;

/// Half-width of the neighbourhood over which the noise of radiance is averaged (measured: 1 to 3 alike).
const RADIANCE_RADIUS: usize = 2;
/// Half-width of the neighbourhood over which the noise of a feature is averaged.
const FEATURE_RADIUS: usize = 1;
/// The least of four noisy directions is less than their mean, and heavy tails hide (measured: 1 to 1.3).
const RADIANCE_FACTOR: f32 = 1.25;
/// Variance of a jittered texture over squared jitter times squared gradient (measured: 3; 1 leaves noise).
const JITTER_FACTOR: f32 = 3.0;
/// Part of an albedo's estimate that counts whatever depth says.
const ALBEDO_FLOOR: f32 = 0.3;
/// Albedo below which radiance is not divided by it.
const BLACK_ALBEDO: f32 = 0.01;
/// Neighbours of exactly the same radiance from which on a pixel has no noise.
const EQUAL_NEIGHBOURS: u32 = 2;

const INPUT_COLUMNS: usize = BLOCK_COLUMNS + 2 * NOISE_HALO;
const INPUT_HEIGHT: usize = BLOCK_HEIGHT + 2 * NOISE_HALO;

/// Where the next pixel of each of the four directions lies in the 3 x 3 around one; the last one lies opposite.
const DIRECTIONS: [(usize, usize); 4] = [(2, 1), (1, 2), (2, 2), (2, 0)];

/// A plane of a block with its halo; beyond the image, its mirror image.
pub type NoisePlane = [[f32; INPUT_COLUMNS]; INPUT_HEIGHT];

/// What the variances of a block are estimated from; all values finite.
#[derive(Clone, Debug, PartialEq)]
pub struct NoisyBlock {
    /// Radiance, red green blue.
    pub colour: [NoisePlane; 3],
    /// Normal, albedo and depth; 0 where the image has none.
    pub features: [NoisePlane; FEATURES],
}

impl NoisyBlock {
    /// A black block.
    pub const BLACK: Self = Self {
        colour: [[[0.0; INPUT_COLUMNS]; INPUT_HEIGHT]; 3],
        features: [[[0.0; INPUT_COLUMNS]; INPUT_HEIGHT]; FEATURES],
    };
    /// Columns of its planes that are read, from the first; the others may hold any finite number.
    pub const WIDTH: usize = BLOCK_WIDTH + 2 * NOISE_HALO;
    /// Rows of its planes.
    pub const HEIGHT: usize = INPUT_HEIGHT;
}

/// Estimated variances of the means of a block.
#[derive(Clone, Debug, PartialEq)]
pub struct NoiseBlock {
    /// Variance of the radiance, summed over the channels; exactly 0 where a pixel equals its neighbours.
    pub colour: BlockPlane,
    /// Variances of the features.
    pub features: [BlockPlane; FEATURES],
}

impl NoiseBlock {
    /// No noise.
    pub const NONE: Self = Self {
        colour: [[0.0; BLOCK_COLUMNS]; BLOCK_HEIGHT],
        features: [[[0.0; BLOCK_COLUMNS]; BLOCK_HEIGHT]; FEATURES],
    };
}

const ALBEDO: usize = Feature::Albedo.range().start;
const DEPTH: usize = Feature::Depth.range().start;

/// Estimates the variances of a block of the means of a further feature's channel, of which nothing is known but its values; they are finite.
#[inline(always)]
pub fn estimate_further_noise(input: &NoisePlane, output: &mut BlockPlane) {
    *output = least_direction::<FEATURE_RADIUS, false>(input, &UNIT);
}

/// Estimates the variances of a block of the features' means.
#[inline(always)]
pub fn estimate_feature_noise(input: &NoisyBlock, output: &mut NoiseBlock) {
    for (plane, variance) in input.features.iter().zip(&mut output.features) {
        estimate_further_noise(plane, variance);
    }
    let depth = &input.features[DEPTH];
    let slope = gradient(depth);
    let depth_noise = output.features[DEPTH];
    for k in Feature::Albedo.range() {
        let texture = gradient(&input.features[k]);
        for y in 0..BLOCK_HEIGHT {
            for x in 0..BLOCK_COLUMNS {
                let z = depth[y + NOISE_HALO][x + NOISE_HALO];
                let jitter = depth_noise[y][x] / (slope[y][x] + 1e-9 * z * z + f32::MIN_POSITIVE);
                let bound = JITTER_FACTOR * jitter * texture[y][x];
                let value = &mut output.features[k][y][x];
                *value = value.min((ALBEDO_FLOOR * *value).max(bound));
            }
        }
    }
}

/// Estimates the variances of a block of the mean radiance.
#[inline(always)]
pub fn estimate_colour_noise(input: &NoisyBlock, output: &mut NoiseBlock) {
    output.colour = [[0.0; BLOCK_COLUMNS]; BLOCK_HEIGHT];
    for c in 0..3 {
        let colour = &input.colour[c];
        let albedo = &input.features[ALBEDO + c];
        let mut magnitude = *colour;
        let mut irradiance = *colour;
        for y in 0..INPUT_HEIGHT {
            for x in 0..INPUT_COLUMNS {
                magnitude[y][x] = colour[y][x].abs();
                irradiance[y][x] = colour[y][x] / (albedo[y][x].abs() + BLACK_ALBEDO);
            }
        }
        let relative = relative_noise(colour);
        let untextured = relative_noise(&irradiance);
        for y in 0..BLOCK_HEIGHT {
            let row = |dy: usize| columns(&magnitude[y + NOISE_HALO - 1 + dy], NOISE_HALO - 1);
            let medians: [f32; BLOCK_COLUMNS] =
                medians_3x3::<{ BLOCK_COLUMNS + 2 }, BLOCK_COLUMNS>([row(0), row(1), row(2)]);
            for x in 0..BLOCK_COLUMNS {
                // The pixel's own radiance or the median of those around, not their mean: bright neighbours stay out.
                let radiance = medians[x].max(magnitude[y + NOISE_HALO][x + NOISE_HALO]);
                let noise = RADIANCE_FACTOR * relative[y][x].min(untextured[y][x]);
                output.colour[y][x] += (noise + 1e-12) * radiance * radiance;
            }
        }
    }
    for y in 0..BLOCK_HEIGHT {
        let equal = equal_neighbours(&input.colour, y);
        for x in 0..BLOCK_COLUMNS {
            if equal[x] >= EQUAL_NEIGHBOURS {
                output.colour[y][x] = 0.0;
            }
        }
    }
}

static UNIT: NoisePlane = [[1.0; INPUT_COLUMNS]; INPUT_HEIGHT];

/// Squared noise over squared radiance.
#[inline(always)]
fn relative_noise(plane: &NoisePlane) -> BlockPlane {
    let mut scale = [[0.0; INPUT_COLUMNS]; INPUT_HEIGHT];
    for y in 1..INPUT_HEIGHT - 1 {
        let mut down = [0.0; INPUT_COLUMNS];
        for x in 0..INPUT_COLUMNS {
            down[x] = plane[y - 1][x].abs() + plane[y][x].abs() + plane[y + 1][x].abs();
        }
        for x in 1..INPUT_COLUMNS - 1 {
            scale[y][x] = (down[x - 1] + down[x] + down[x + 1]) / 9.0;
        }
    }
    least_direction::<RADIANCE_RADIUS, true>(plane, &scale)
}

/// Least over the directions of the mean of the squared second difference over 6 and over the squared scale.
///
/// `ROBUST` averages magnitudes instead of squares, which a firefly moves less; for normal noise the two agree.
#[inline(always)]
fn least_direction<const RADIUS: usize, const ROBUST: bool>(
    plane: &NoisePlane,
    scale: &NoisePlane,
) -> BlockPlane {
    let mut least = [[f32::MAX; BLOCK_COLUMNS]; BLOCK_HEIGHT];
    for direction in DIRECTIONS {
        let terms = second_differences::<ROBUST>(plane, scale, direction);
        let means = neighbourhood_means::<RADIUS>(&terms);
        for y in 0..BLOCK_HEIGHT {
            for x in 0..BLOCK_COLUMNS {
                let mean = means[y][x];
                // E|N| = sqrt(2 / pi).
                let value = if ROBUST {
                    mean * mean * core::f32::consts::FRAC_PI_2
                } else {
                    mean
                };
                least[y][x] = if value < least[y][x] {
                    value
                } else {
                    least[y][x]
                };
            }
        }
    }
    least
}

/// Squared second differences over the squared scale, or their roots; 0 along the border.
#[inline(always)]
fn second_differences<const ROBUST: bool>(
    plane: &NoisePlane,
    scale: &NoisePlane,
    (x, y): (usize, usize),
) -> NoisePlane {
    const INSIDE: usize = INPUT_COLUMNS - 2;
    let mut terms = [[0.0; INPUT_COLUMNS]; INPUT_HEIGHT];
    for row in 0..INPUT_HEIGHT - 2 {
        let trio = |plane| -> [&[f32; INSIDE]; 3] {
            [
                columns_of(plane, row + 2 - y, 2 - x),
                columns_of(plane, row + 1, 1),
                columns_of(plane, row + y, x),
            ]
        };
        let ([last, own, next], [last_scale, own_scale, next_scale]) = (trio(plane), trio(scale));
        for i in 0..INSIDE {
            let difference = next[i] - 2.0 * own[i] + last[i];
            let (own, next, last) = (own_scale[i], next_scale[i], last_scale[i]);
            let square = 4.0 * own * own + next * next + last * last;
            let term = if ROBUST {
                difference.abs() * reciprocal_sqrt(square)
            } else {
                difference * difference / square
            };
            let lit = square >= f32::MIN_POSITIVE;
            terms[row + 1][i + 1] = if lit { term } else { 0.0 };
        }
    }
    terms
}

#[inline(always)]
fn neighbourhood_means<const RADIUS: usize>(terms: &NoisePlane) -> BlockPlane {
    let span = 2 * RADIUS + 1;
    let share = 1.0 / (span * span) as f32;
    let mut down = [[0.0; INPUT_COLUMNS]; BLOCK_HEIGHT];
    for y in 0..BLOCK_HEIGHT {
        for dy in 0..span {
            for x in 0..INPUT_COLUMNS {
                down[y][x] += terms[y + NOISE_HALO - RADIUS + dy][x];
            }
        }
    }
    let mut means = [[0.0; BLOCK_COLUMNS]; BLOCK_HEIGHT];
    for y in 0..BLOCK_HEIGHT {
        for dx in 0..span {
            for x in 0..BLOCK_COLUMNS {
                means[y][x] += down[y][x + NOISE_HALO - RADIUS + dx];
            }
        }
        for mean in &mut means[y] {
            *mean *= share;
        }
    }
    means
}

/// Mean over 3 x 3 of the squared gradient, per pixel squared.
#[inline(always)]
fn gradient(plane: &NoisePlane) -> BlockPlane {
    let mut squares = [[0.0; INPUT_COLUMNS]; INPUT_HEIGHT];
    for y in 1..INPUT_HEIGHT - 1 {
        for x in 1..INPUT_COLUMNS - 1 {
            let across = plane[y][x + 1] - plane[y][x - 1];
            let down = plane[y + 1][x] - plane[y - 1][x];
            squares[y][x] = 0.25 * (across * across + down * down);
        }
    }
    neighbourhood_means::<1>(&squares)
}

/// How many of the eight pixels around those of row `y` of the block have exactly their radiance.
#[inline(always)]
fn equal_neighbours(colour: &[NoisePlane; 3], y: usize) -> [u32; BLOCK_COLUMNS] {
    let own = colour
        .each_ref()
        .map(|plane| columns::<BLOCK_COLUMNS>(&plane[y + NOISE_HALO], NOISE_HALO));
    // the pixel equals itself
    let mut counts = [0u32.wrapping_sub(1); BLOCK_COLUMNS];
    for dy in 0..3 {
        for dx in 0..3 {
            let other = colour.each_ref().map(|plane| {
                columns::<BLOCK_COLUMNS>(&plane[y + NOISE_HALO - 1 + dy], NOISE_HALO - 1 + dx)
            });
            for x in 0..BLOCK_COLUMNS {
                let mut equal = true;
                for c in 0..3 {
                    equal &= other[c][x] == own[c][x];
                }
                counts[x] = counts[x].wrapping_add(u32::from(equal));
            }
        }
    }
    counts
}
