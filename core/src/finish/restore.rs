//! Gives back, over wide neighbourhoods, the light that was lost on the way.
//!
//! The mean of the noisy pixels over 33 x 33, weighed down to the sides, is unbiased and, next to one pixel, without noise. With r the mean of what the result lacks
//! of it, d the mean of the result and q the variance of the former,
//!
//! ```text
//! o <- o (1 + r^2 / (r^2 + q) r / d), the factor from 0.5 to 2
//! ```
//!
//! which gives nothing where r may be chance. The weights are products of 1, 2, .., 17, .., 2, 1 down and across: an even mean ends in a step 16 pixels from anything
//! bright, and a square veil shows. By a factor rather than a sum: light that is added where there was little shows as a veil
//! around bright windows. Pixels without noise have lost nothing: they stay as they are and do not count. Those that are not finite in the
//! input cannot be compared, but were predicted by the same models: they take the factor of those around.

use crate::block::plane::columns;
use crate::finish::{RUN, Run, is_zero, mean_of_channels, run, runs, store};

/// Half-width of the neighbourhood.
pub const RESTORE_RADIUS: usize = 16;
/// Rows of the neighbourhood.
pub const RESTORE_SPAN: usize = 2 * RESTORE_RADIUS + 1;
const WIDE: usize = RUN + 2 * RESTORE_RADIUS;

/// Bounds of the factor.
const LEAST: f32 = 0.5;
const MOST: f32 = 2.0;

/// A row of pixels and what they came as, for [`compare_light`].
#[derive(Clone, Copy, Debug)]
pub struct LitRow<'a> {
    /// Radiance, red green blue; finite.
    pub colour: [&'a [f32]; 3],
    /// 1, or 0 where a pixel passes through.
    pub noisy: &'a [f32],
    /// 1, or 0 where a pixel's input is not finite.
    pub good: &'a [f32],
    /// Mean of the channels of the noisy radiance.
    pub own: &'a [f32],
    /// Its variance, summed over the channels.
    pub variance: &'a [f32],
}

/// A row of what is summed up over the neighbourhood: what is lost, what is there, and the variance of the former.
pub const LIGHT_PLANES: usize = 3;

/// Works out, pixel by pixel, what is to be summed up. All planes have the columns of [`crate::finish_columns`].
#[inline(always)]
pub fn compare_light(input: &LitRow<'_>, output: [&mut [f32]; LIGHT_PLANES]) {
    let [lost, light, variance] = output;
    for first in runs(lost.len()) {
        let colour = input.colour.map(|plane| run(plane, first));
        let [noisy, good] = [input.noisy, input.good].map(|plane| run(plane, first));
        let [own, own_variance] = [input.own, input.variance].map(|plane| run(plane, first));
        let mut values = [[0.0; RUN]; LIGHT_PLANES];
        for x in 0..RUN {
            let mean = mean_of_channels(colour, x);
            let counts = noisy[x] * good[x];
            values[0][x] = counts * (own[x] - mean);
            values[1][x] = counts * mean;
            values[2][x] = counts * own_variance[x] * (1.0 / 3.0);
        }
        store(lost, first, &values[0]);
        store(light, first, &values[1]);
        store(variance, first, &values[2]);
    }
}

/// Works out what to multiply the pixels of a row by, 1 where a pixel passes through. `planes` are, plane by plane, what [`compare_light`] makes of the rows of
/// the neighbourhood, from above to below; beyond the image, the nearest row of the image.
#[inline(always)]
pub fn find_factors(
    planes: &[[&[f32]; RESTORE_SPAN]; LIGHT_PLANES],
    noisy: &[f32],
    output: &mut [f32],
) {
    for first in runs(output.len()) {
        let noisy = run(noisy, first);
        if is_zero(noisy) {
            store(output, first, &[1.0; RUN]);
            continue;
        }
        let [lost, light, variance] = planes;
        let lost = sums_33x33(lost, first, &WEIGHTS);
        let light = sums_33x33(light, first, &WEIGHTS);
        let variance = sums_33x33(variance, first, &SQUARED_WEIGHTS);
        let mut factors = [1.0; RUN];
        for x in 0..RUN {
            // Of sums in place of means: the square of the weights' sum divides both r^2 and q.
            let square = lost[x] * lost[x];
            let total = square + variance[x];
            let usable = (f32::MIN_POSITIVE..=f32::MAX).contains(&total) && light[x] > 0.0;
            let factor = 1.0 + square / total * (lost[x] / light[x]);
            let factor = if factor > LEAST { factor } else { LEAST };
            let factor = if factor < MOST { factor } else { MOST };
            factors[x] = if usable && noisy[x] > 0.0 {
                factor
            } else {
                1.0
            };
        }
        store(output, first, &factors);
    }
}

/// Weights of the rows of the neighbourhood, and of its columns.
const WEIGHTS: [f32; RESTORE_SPAN] = weights(1);
/// Their squares, which the variances are summed with.
const SQUARED_WEIGHTS: [f32; RESTORE_SPAN] = weights(2);

const fn weights(power: u32) -> [f32; RESTORE_SPAN] {
    let mut weights = [0.0; RESTORE_SPAN];
    let mut k = 0;
    while k < RESTORE_SPAN {
        let distance = k.abs_diff(RESTORE_RADIUS);
        weights[k] = (RESTORE_RADIUS + 1 - distance).pow(power) as f32;
        k += 1;
    }
    weights
}

/// Weighted sums over the neighbourhood: of its rows, and then of their columns.
#[inline(always)]
fn sums_33x33(rows: &[&[f32]; RESTORE_SPAN], first: usize, weights: &[f32; RESTORE_SPAN]) -> Run {
    let mut down = [0.0; WIDE];
    for (row, weight) in rows.iter().zip(weights) {
        let row = wide(row, first);
        for x in 0..WIDE {
            down[x] += weight * row[x];
        }
    }
    let mut sums = [0.0; RUN];
    for (k, weight) in weights.iter().enumerate() {
        let shifted: &Run = columns(&down, k);
        for x in 0..RUN {
            sums[x] += weight * shifted[x];
        }
    }
    sums
}

#[inline(always)]
fn wide(plane: &[f32], first: usize) -> &[f32; WIDE] {
    columns(plane, first - RESTORE_RADIUS)
}
