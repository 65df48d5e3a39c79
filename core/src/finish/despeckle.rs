//! Takes out single pixels that stand out of all their neighbours and that their own radiance does not account for.
//!
//! The blend leaves pinholes and sparks where every prediction was ruled out, or one that should have been was not. With l the mean
//! of the channels, a pixel brighter than 1.15 times the brightest of its eight neighbours is scaled down to that, and one darker than the
//! darkest by as much is scaled up, unless the noisy pixel says so, too: by more than two of its standard deviations.
//!
//! A pixel that is black among lit ones has no colour to scale and takes that of its neighbours; so does a dark one with a negative channel, and a bright one stays. One that is not finite in the input has
//! nothing to say for itself.

#![expect(
    clippy::needless_range_loop,
    reason = "the loops follow the indices of the formulas"
)]

use crate::block::plane::columns;
use crate::finish::{FinishedPlane, RUN, Run, is_zero, mean_of_channels, run, runs, store};
use crate::float::{larger, smaller};

/// Rows above and below that a pixel is compared with.
pub const DESPECKLE_RADIUS: usize = 1;
/// Rows that it is compared with, and its own.
pub const DESPECKLE_SPAN: usize = 2 * DESPECKLE_RADIUS + 1;
const WIDE: usize = RUN + 2 * DESPECKLE_RADIUS;

/// By how much a pixel may stand out of its neighbours.
const OUTSTANDING: f32 = 1.15;
/// Squared standard deviations by which a pixel has to support it.
const SUPPORT: f32 = 2.0 * 2.0;
/// A pixel below this part of its neighbours is black: what colour it has is chance, and would be scaled with it.
const BLACK: f32 = 0.05;

/// A row of smoothed colours and what is around it, for [`despeckle`]; beyond the image, the nearest row of the image.
#[derive(Clone, Copy, Debug)]
pub struct SpeckRow<'a> {
    /// Radiance of the row above, the row and the row below, each red green blue; finite.
    pub colour: [[&'a [f32]; 3]; DESPECKLE_SPAN],
    /// 1, or 0 where a pixel passes through.
    pub noisy: &'a [f32],
    /// 1, or 0 where a pixel's input is not finite.
    pub good: &'a [f32],
    /// Mean of the channels of the noisy radiance.
    pub own: &'a [f32],
    /// Its variance summed over the channels, or that of the 3 x 3 pixels around if larger.
    pub variance: &'a [f32],
}

/// Takes the specks out of a row of every plane, by the same factors; `rows` of a plane are the row above, the row and the row below. All
/// planes have the columns of [`crate::finish_columns`].
#[inline(always)]
pub fn despeckle(input: &SpeckRow<'_>, planes: &mut [FinishedPlane<'_, DESPECKLE_SPAN>]) {
    for first in runs(input.noisy.len()) {
        if is_zero(run(input.noisy, first)) {
            for plane in planes.iter_mut() {
                store(
                    plane.output,
                    first,
                    run(plane.rows[DESPECKLE_RADIUS], first),
                );
            }
            continue;
        }
        let (scales, fills) = scales(input, first);
        for plane in planes.iter_mut() {
            let sums = sums_of_8(&plane.rows, first);
            let row = run(plane.rows[DESPECKLE_RADIUS], first);
            let mut scaled = [0.0; RUN];
            for x in 0..RUN {
                let filled = sums[x] * fills[x];
                scaled[x] = if fills[x] > 0.0 {
                    filled
                } else {
                    row[x] * scales[x]
                };
            }
            store(plane.output, first, &scaled);
        }
    }
}

/// What to scale the pixels of a run by, 1 for most; and the factor of the sum of the eight neighbours, which takes a pixel's place where
/// it is above 0.
#[inline(always)]
fn scales(input: &SpeckRow<'_>, first: usize) -> (Run, Run) {
    let [above, row, below] = input.colour.map(|planes| means(&planes, first));
    let colour = input.colour[DESPECKLE_RADIUS].map(|plane| run(plane, first));
    let [[r0, g0, b0], [r1, g1, b1], [r2, g2, b2]] = input.colour;
    let [reds, greens, blues] =
        [[r0, r1, r2], [g0, g1, g2], [b0, b1, b2]].map(|rows| sums_of_8(&rows, first));
    let [noisy, good] = [input.noisy, input.good].map(|plane| run(plane, first));
    let [own, variance] = [input.own, input.variance].map(|plane| run(plane, first));
    let (mut scales, mut fills) = ([1.0; RUN], [0.0; RUN]);
    for x in 0..RUN {
        let level = mean_of_channels(colour, x);
        let brightest = of_8([&above, &row, &below], x, larger);
        let darkest = of_8([&above, &row, &below], x, smaller);
        let (most, least) = (larger(OUTSTANDING * brightest, 0.0), darkest / OUTSTANDING);
        let margin = SUPPORT / 3.0 * variance[x];
        let supports = |gap: f32| good[x] > 0.0 && gap > 0.0 && gap * gap >= margin;
        // Channels that nearly cancel have no level to scale.
        let whole = colour.iter().all(|plane| plane[x] >= 0.0);
        let noisy = noisy[x] > 0.0;
        let spark = noisy && whole && level > most && !supports(own[x] - most);
        let hole = noisy && level < least && least > 0.0 && !supports(least - own[x]);
        let black = hole && (!whole || level <= BLACK * least);
        let positive = reds[x] >= 0.0 && greens[x] >= 0.0 && blues[x] >= 0.0;
        let sum = reds[x] + greens[x] + blues[x];
        let target = if spark { most } else { least };
        let scaled = (spark || hole) && !black;
        scales[x] = if scaled { target / level } else { 1.0 };
        fills[x] = if black && positive && sum <= f32::MAX {
            3.0 * least / sum
        } else {
            0.0
        };
    }
    (scales, fills)
}

/// Means of the channels of a run and a column on both sides.
#[inline(always)]
fn means(planes: &[&[f32]; 3], first: usize) -> [f32; WIDE] {
    let [red, green, blue] = planes.map(|plane| wide(plane, first));
    let mut means = [0.0; WIDE];
    for x in 0..WIDE {
        means[x] = (red[x] + green[x] + blue[x]) * (1.0 / 3.0);
    }
    means
}

#[inline(always)]
fn wide(plane: &[f32], first: usize) -> &[f32; WIDE] {
    columns(plane, first - DESPECKLE_RADIUS)
}

/// The eight neighbours of column `x` of the middle row, put together.
#[inline(always)]
fn of_8(rows: [&[f32; WIDE]; DESPECKLE_SPAN], x: usize, both: impl Fn(f32, f32) -> f32) -> f32 {
    let [above, row, below] = rows;
    let three = |row: &[f32; WIDE]| both(both(row[x], row[x + 1]), row[x + 2]);
    both(both(three(above), three(below)), both(row[x], row[x + 2]))
}

/// Sums of the eight neighbours of a plane.
#[inline(always)]
fn sums_of_8(rows: &[&[f32]; DESPECKLE_SPAN], first: usize) -> Run {
    let rows = rows.map(|plane| wide(plane, first));
    let mut sums = [0.0; RUN];
    for x in 0..RUN {
        sums[x] = of_8(rows, x, |a, b| a + b);
    }
    sums
}
