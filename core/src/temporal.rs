//! How much the pixels of neighbouring frames may help those of a frame, and their average.
//!
//! A frame's pixel takes with it the pixels of the frames before and after that show the same surface: their noisy radiance, its variance, their features, as
//! they were rendered. Nothing is resampled, for that blurs frame after frame. With e = y_j - y the difference of two such pixels, v their variances, x their
//! features and means `<>` over q x q pixels, n of which are known in both frames,
//!
//! ```text
//! bias^2 = the largest of |<e>_3|^2 - <v + v_j>_3 / n, |<e>_15|^2 - <v + v_j>_15 / n, <|e|^2 - v - v_j>_15 and 0, mean over the channels
//! d      = |N_j - N|^2 + |A_j - A|^2 / (3 (a^2 + 0.01)) + (Z_j / Z - <Z_j / Z>_15)^2,   N normal, A albedo, a its mean over the channels, Z depth
//! s      = product over q in {3, 15} of 4 <v> <v_j> / (<v> + <v_j>)^2
//! w_j    = s V / (V + m (bias^2 + <d>_3 L^2))
//! ```
//!
//! where V and L are the means, over 3 x 3 pixels of every frame, of variance and radiance. V / (V + bias^2) is the weight that makes the mean squared error of the average
//! least if m neighbours have that bias: one where motion is known, for then each errs by itself, and all where it is not. Radiance that is proportional to the albedo, and changes by itself at most as a normal turns by 90 degrees, differs by d L^2. s is for lights that few samples find: where they
//! are in one frame alone, neither tells anything of the other. It is the same seen from either frame, so that what one does not take from the other it does not lose to it, and
//! the light of a sequence stays what it is; weights by each pixel's own variance would darken it.
//!
//! The wide mean sees light that changes by less than the noise of 3 x 3 pixels, the narrow one highlights and shadows that move, the mean square texture that has moved
//! unsaid, the features disoccluded surfaces and edges. As the variances go to 0, so do the weights of pixels that differ.
//!
//! LPR section 6 averages filtered frames over time, with a fixed factor of forgetting; WLR section 7 makes the frame's number a feature of the fit. Neither asks whether the light
//! is still the same.

#![expect(
    clippy::needless_range_loop,
    reason = "the loops follow the indices of the formulas"
)]

use crate::block::plane::columns;
use crate::finish::{RUN, Run, run, runs, store};

/// Rows above and below a pixel that its weights depend on.
pub const TEMPORAL_RADIUS: usize = 7;
/// Those rows, and its own.
pub const TEMPORAL_SPAN: usize = 2 * TEMPORAL_RADIUS + 1;
const WIDE: usize = RUN + 2 * TEMPORAL_RADIUS;

/// By how much a frame's pixel outshines those of all others to be a firefly, as within a frame (`fireflies.rs`): it tells nothing of them, and stays where it is.
const FIREFLY: f32 = 8.0;

/// Half-width of the narrow neighbourhood.
const NEAR: usize = 1;

/// Albedos are relative to this and more: a darker one reflects next to nothing.
const DARK_ALBEDO: f32 = 0.01;

/// A row of a frame, as a frame beside it sees it. Planes have the columns of [`crate::finish_columns`]; those of features that the frames lack are empty.
#[derive(Clone, Copy, Debug)]
pub struct FrameRow<'a> {
    /// Radiance, red green blue.
    pub colour: [&'a [f32]; 3],
    /// Variances of the three; empty if none are known.
    pub variance: [&'a [f32]; 3],
    /// Normal.
    pub normal: [&'a [f32]; 3],
    /// Albedo.
    pub albedo: [&'a [f32]; 3],
    /// Depth.
    pub depth: &'a [f32],
}

/// Planes of a row that [`compare_frames`] fills.
pub const COMPARED_PLANES: usize = 12;

// their places
const KNOWN: usize = 0;
const DIFFERENCE: usize = 1;
const NOISE: usize = 4;
const OWN_VARIANCE: usize = 5;
const VARIANCE: usize = 6;
const DEPTH: usize = 7;
const SQUARED_DEPTH: usize = 8;
const MISMATCH: usize = 9;
const LUMINANCE: usize = 10;
const SQUARES: usize = 11;

/// Works out, pixel by pixel, what is to be summed up of a frame's row alone. Where no variances are known, its noise is that of a difference of two such frames.
#[inline(always)]
pub fn compare_own(own: &FrameRow<'_>, known: &[f32], output: [&mut [f32]; COMPARED_PLANES]) {
    let mut output = output;
    for first in runs(known.len()) {
        let mut values = [[0.0; RUN]; COMPARED_PLANES];
        values[KNOWN] = *run(known, first);
        radiance(own, own, first, &mut values);
        if own.variance[0].is_empty() {
            for x in 0..RUN {
                values[NOISE][x] = 2.0 * values[OWN_VARIANCE][x];
            }
        }
        store_known(&mut output, first, &mut values);
    }
}

/// Works out, pixel by pixel, what is to be summed up of a frame's row and of what a neighbour has there. `known` is 1 where both have a pixel, and 0 elsewhere, where
/// their planes may hold anything.
#[inline(always)]
pub fn compare_frames(
    own: &FrameRow<'_>,
    other: &FrameRow<'_>,
    known: &[f32],
    output: [&mut [f32]; COMPARED_PLANES],
) {
    let mut output = output;
    for first in runs(known.len()) {
        let mut values = [[0.0; RUN]; COMPARED_PLANES];
        values[KNOWN] = *run(known, first);
        radiance(own, other, first, &mut values);
        features(own, other, first, &mut values);
        store_known(&mut output, first, &mut values);
    }
}

/// Stores the values of a run where they are known, and zeros elsewhere.
#[inline(always)]
fn store_known(
    output: &mut [&mut [f32]; COMPARED_PLANES],
    first: usize,
    values: &mut [Run; COMPARED_PLANES],
) {
    let known = values[KNOWN];
    for (plane, values) in output.iter_mut().zip(values) {
        for x in 0..RUN {
            let usable = known[x] > 0.0 && values[x].abs() <= f32::MAX;
            values[x] = if usable { values[x] } else { 0.0 };
        }
        store(plane, first, values);
    }
}

/// What there is to compare of the radiances.
#[inline(always)]
fn radiance(
    own: &FrameRow<'_>,
    other: &FrameRow<'_>,
    first: usize,
    values: &mut [Run; COMPARED_PLANES],
) {
    let mut squares = [0.0; RUN];
    for c in 0..3 {
        let (own, other) = (run(own.colour[c], first), run(other.colour[c], first));
        for x in 0..RUN {
            let difference = other[x] - own[x];
            values[DIFFERENCE + c][x] = difference;
            squares[x] += difference * difference;
            values[LUMINANCE][x] += other[x].abs() * (1.0 / 3.0);
        }
    }
    for x in 0..RUN {
        values[SQUARES][x] = squares[x] * (1.0 / 3.0);
    }
    if own.variance[0].is_empty() {
        values[NOISE] = values[SQUARES];
        values[OWN_VARIANCE] = grain(own, first);
        values[VARIANCE] = grain(other, first);
        return;
    }
    for c in 0..3 {
        let (own, other) = (run(own.variance[c], first), run(other.variance[c], first));
        for x in 0..RUN {
            // a variance that is not known is that of the other frame
            let other_variance = if other[x] >= 0.0 { other[x] } else { 0.0 };
            let own = if own[x] >= 0.0 {
                own[x]
            } else {
                other_variance
            };
            values[OWN_VARIANCE][x] += own * (1.0 / 3.0);
            values[VARIANCE][x] += other_variance * (1.0 / 3.0);
        }
    }
    for x in 0..RUN {
        values[NOISE][x] = values[OWN_VARIANCE][x] + values[VARIANCE][x];
    }
}

/// What the noise of pixels looks like, mean over the channels: what one differs by from the mean of those left and right of it has 3/2 of a pixel's variance, and what
/// texture there is.
#[inline(always)]
fn grain(row: &FrameRow<'_>, first: usize) -> Run {
    let mut grain = [0.0; RUN];
    for colour in row.colour {
        let around: &[f32; RUN + 2] = columns(colour, first - 1);
        for x in 0..RUN {
            let difference = around[x + 1] - 0.5 * (around[x] + around[x + 2]);
            grain[x] += difference * difference * (1.0 / 1.5 / 3.0);
        }
    }
    grain
}

/// What there is to compare of the features.
#[inline(always)]
fn features(
    own: &FrameRow<'_>,
    other: &FrameRow<'_>,
    first: usize,
    values: &mut [Run; COMPARED_PLANES],
) {
    if !own.normal[0].is_empty() {
        for c in 0..3 {
            let (own, other) = (run(own.normal[c], first), run(other.normal[c], first));
            for x in 0..RUN {
                let difference = other[x] - own[x];
                values[MISMATCH][x] += difference * difference;
            }
        }
    }
    if !own.albedo[0].is_empty() {
        let (mut squares, mut mean) = ([0.0; RUN], [0.0; RUN]);
        for c in 0..3 {
            let (own, other) = (run(own.albedo[c], first), run(other.albedo[c], first));
            for x in 0..RUN {
                let difference = other[x] - own[x];
                squares[x] += difference * difference;
                mean[x] += own[x] * (1.0 / 3.0);
            }
        }
        for x in 0..RUN {
            values[MISMATCH][x] += squares[x] / (3.0 * (mean[x] * mean[x] + DARK_ALBEDO));
        }
    }
    if !own.depth.is_empty() {
        let (own, other) = (run(own.depth, first), run(other.depth, first));
        for x in 0..RUN {
            let size = own[x].abs() + f32::MIN_POSITIVE;
            let relative = ((other[x] - own[x]) / size).clamp(-1.0, 1.0);
            values[DEPTH][x] = relative;
            values[SQUARED_DEPTH][x] = relative * relative;
        }
    }
}

/// Planes of a row that [`measure_frame`] fills.
pub const MEASURED_PLANES: usize = 14;

// their places; each of the first four is followed by that of the wide neighbourhood
const PIXELS: usize = 0;
const SQUARED_BIAS: usize = 2;
const NOISE_MEAN: usize = 4;
const SIMILAR: usize = 6;
const MISMATCH_MEAN: usize = 7;
const VARIANCE_SUM: usize = 8;
const LUMINANCE_SUM: usize = 9;
const DEPTH_MEAN: usize = 10;
const IS_KNOWN: usize = 11;
const UNEXPLAINED: usize = 12;
const BRIGHTNESS: usize = 13;

/// The place of the mean of Z_j / Z - 1, by which depths of a neighbour differ around a pixel.
pub const DEPTH_CHANGE: usize = DEPTH_MEAN;

/// Sums up over the neighbourhoods of a row's pixels. `planes` are, plane by plane, what [`compare_frames`] makes of the rows around, from above to below; beyond the
/// image, zeros.
#[inline(always)]
pub fn measure_frame(
    planes: &[[&[f32]; TEMPORAL_SPAN]; COMPARED_PLANES],
    output: &mut [&mut [f32]; MEASURED_PLANES],
) {
    let columns = planes[KNOWN][0].len();
    for first in runs(columns) {
        let sums = planes.each_ref().map(|rows| sums(rows, first));
        let mut values = [[0.0; RUN]; MEASURED_PLANES];
        values[SIMILAR] = [1.0; RUN];
        measure_neighbourhood(&sums, 0, &mut values);
        measure_neighbourhood(&sums, 1, &mut values);
        let [near, wide] = [0, 1];
        for x in 0..RUN {
            let (pixels, around) = (sums[KNOWN][near][x], sums[KNOWN][wide][x]);
            let depth = sums[DEPTH][wide][x] / at_least_one(around);
            let pixels_or_one = at_least_one(pixels);
            let square = sums[SQUARED_DEPTH][near][x] - 2.0 * depth * sums[DEPTH][near][x];
            let square = square / pixels_or_one + depth * depth;
            let square = if square > 0.0 { square } else { 0.0 };
            values[MISMATCH_MEAN][x] = sums[MISMATCH][near][x] / pixels_or_one + square;
            values[VARIANCE_SUM][x] = sums[VARIANCE][near][x];
            values[LUMINANCE_SUM][x] = sums[LUMINANCE][near][x];
            values[DEPTH_MEAN][x] = depth;
            let beyond = sums[SQUARES][wide][x] - sums[NOISE][wide][x];
            values[UNEXPLAINED][x] = beyond / at_least_one(around);
        }
        values[IS_KNOWN] = *run(planes[KNOWN][TEMPORAL_RADIUS], first);
        values[BRIGHTNESS] = *run(planes[LUMINANCE][TEMPORAL_RADIUS], first);
        for (plane, values) in output.iter_mut().zip(&values) {
            store(plane, first, values);
        }
    }
}

/// What is alike in the narrow neighbourhood, 0, or the wide one, 1.
#[inline(always)]
fn measure_neighbourhood(
    sums: &[[Run; 2]; COMPARED_PLANES],
    size: usize,
    values: &mut [Run; MEASURED_PLANES],
) {
    let size = size.min(1);
    for x in 0..RUN {
        let pixels = sums[KNOWN][size][x];
        let share = 1.0 / at_least_one(pixels);
        let mut square = 0.0;
        for c in 0..3 {
            let difference = sums[DIFFERENCE + c][size][x] * share;
            square += difference * difference * (1.0 / 3.0);
        }
        values[PIXELS + size][x] = pixels;
        values[SQUARED_BIAS + size][x] = square;
        values[NOISE_MEAN + size][x] = sums[NOISE][size][x] * share;
        let (own, other) = (sums[OWN_VARIANCE][size][x], sums[VARIANCE][size][x]);
        let both = own + other;
        let similar = 4.0 * (own / both) * (other / both);
        values[SIMILAR][x] *= if both > 0.0 { similar } else { 1.0 };
    }
}

#[inline(always)]
fn at_least_one(count: f32) -> f32 {
    if count > 1.0 { count } else { 1.0 }
}

/// Sums over the narrow neighbourhood and the wide one: of their rows, and then of their columns.
#[inline(always)]
fn sums(rows: &[&[f32]; TEMPORAL_SPAN], first: usize) -> [Run; 2] {
    let (mut near, mut wide) = ([0.0; WIDE], [0.0; WIDE]);
    for (k, row) in rows.iter().enumerate() {
        let row: &[f32; WIDE] = columns(row, first - TEMPORAL_RADIUS);
        for x in 0..WIDE {
            wide[x] += row[x];
        }
        if k.abs_diff(TEMPORAL_RADIUS) <= NEAR {
            for x in 0..WIDE {
                near[x] += row[x];
            }
        }
    }
    [
        sum_columns::<NEAR>(&near),
        sum_columns::<TEMPORAL_RADIUS>(&wide),
    ]
}

/// Sums of 2 R + 1 columns.
#[inline(always)]
fn sum_columns<const R: usize>(down: &[f32; WIDE]) -> Run {
    let mut sums = [0.0; RUN];
    for k in TEMPORAL_RADIUS - R..=TEMPORAL_RADIUS + R {
        let shifted: &Run = columns(down, k);
        for x in 0..RUN {
            sums[x] += shifted[x];
        }
    }
    sums
}

/// Works out the weights of the pixels of a row's neighbours, 0 to 1, where the frame's own weigh 1. `own` is what [`measure_frame`] makes of the frame compared with itself, `others` of each neighbour and where its
/// weights go. `alike` is how many of them err in one way, 1 where each was found by its own motion. Where variances are not `known`, they are taken from the frames themselves, over 15 x 15 pixels: from what pixels differ by from those beside them, or from
/// the neighbour that differs least, if that is less.
#[inline(always)]
pub fn weigh_frames(
    own: &[&[f32]; MEASURED_PLANES],
    others: &mut [([&[f32]; MEASURED_PLANES], &mut [f32])],
    alike: f32,
    known: bool,
) {
    for first in runs(own[PIXELS].len()) {
        let level = Level::of(own, others, first, known);
        for (measured, weights) in others.iter_mut() {
            let plane = |k: usize| run(measured[k], first);
            let mut values = [0.0; RUN];
            for x in 0..RUN {
                let beyond = plane(UNEXPLAINED)[x];
                let mut bias = if beyond > 0.0 { beyond } else { 0.0 };
                for size in 0..2 {
                    let noise = match known {
                        true => plane(NOISE_MEAN + size)[x],
                        false => 2.0 * level.variance[x],
                    };
                    let chance = noise / at_least_one(plane(PIXELS + size)[x]);
                    let square = plane(SQUARED_BIAS + size)[x] - chance;
                    bias = if square > bias { square } else { bias };
                }
                let radiance = level.radiance[x];
                let mismatch = plane(MISMATCH_MEAN)[x] * radiance * radiance;
                let variance = level.variance[x];
                let squared = alike * (bias + mismatch);
                let weight = variance / (variance + squared) * plane(SIMILAR)[x];
                let outshines = plane(BRIGHTNESS)[x] > FIREFLY * level.ordinary[x];
                let usable = level.noisy[x] > 0.0 && plane(IS_KNOWN)[x] > 0.0 && !outshines;
                let usable = usable && weight > 0.0;
                values[x] = if usable { weight } else { 0.0 };
            }
            store(weights, first, &values);
        }
    }
}

/// What all frames have in common around the pixels of a run.
struct Level {
    variance: Run,
    radiance: Run,
    /// 0 where the frame has no noise.
    noisy: Run,
    /// The second largest radiance that a frame has at the pixel itself.
    ordinary: Run,
}

impl Level {
    #[inline(always)]
    fn of(
        own: &[&[f32]; MEASURED_PLANES],
        others: &[([&[f32]; MEASURED_PLANES], &mut [f32])],
        first: usize,
        known: bool,
    ) -> Self {
        let plane = |planes: &[&[f32]; MEASURED_PLANES], k: usize| *run(planes[k], first);
        let mut pixels = plane(own, PIXELS);
        let mut variance = plane(own, VARIANCE_SUM);
        let mut radiance = plane(own, LUMINANCE_SUM);
        let mut noisy = variance;
        let mut least = plane(own, NOISE_MEAN + 1);
        let (mut brightest, mut ordinary) = (plane(own, BRIGHTNESS), [0.0; RUN]);
        for (measured, _) in others {
            let [n, v, l] = [PIXELS, VARIANCE_SUM, LUMINANCE_SUM].map(|k| plane(measured, k));
            let [around, square] = [PIXELS + 1, NOISE_MEAN + 1].map(|k| plane(measured, k));
            let brightness = plane(measured, BRIGHTNESS);
            for x in 0..RUN {
                pixels[x] += n[x];
                variance[x] += v[x];
                radiance[x] += l[x];
                let smaller = around[x] > 0.0 && square[x] < least[x];
                least[x] = if smaller { square[x] } else { least[x] };
                let (one, other) = (brightness[x], brightest[x]);
                let (more, less) = if one > other {
                    (one, other)
                } else {
                    (other, one)
                };
                brightest[x] = more;
                ordinary[x] = if less > ordinary[x] {
                    less
                } else {
                    ordinary[x]
                };
            }
        }
        for x in 0..RUN {
            let share = 1.0 / at_least_one(pixels[x]);
            radiance[x] *= share;
            variance[x] *= share;
            if !known {
                variance[x] = 0.5 * least[x];
                noisy[x] = variance[x];
            }
        }
        Self {
            variance,
            radiance,
            noisy,
            ordinary,
        }
    }
}

/// Averages the pixels of a plane: `own`, which weighs 1, and those of the neighbours with their weights. They hold `what`. All
/// planes have the columns of [`crate::finish_columns`].
#[inline(always)]
pub fn average_frames(
    own: &[f32],
    others: &[(&[f32], &[f32])],
    what: Averaged,
    output: &mut [f32],
) {
    for first in runs(own.len()) {
        let (mut sum, mut total) = (*run(own, first), [1.0; RUN]);
        for (weights, values) in others {
            let (weights, values) = (run(weights, first), run(values, first));
            for x in 0..RUN {
                let weight = weights[x];
                total[x] += weight;
                let factor = match what {
                    Averaged::Means => weight,
                    Averaged::Variances => weight * weight,
                };
                sum[x] += if weight > 0.0 {
                    factor * values[x]
                } else {
                    0.0
                };
            }
        }
        for x in 0..RUN {
            let divisor = match what {
                Averaged::Means => total[x],
                Averaged::Variances => total[x] * total[x],
            };
            sum[x] /= divisor;
        }
        store(output, first, &sum);
    }
}

/// What a plane holds that [`average_frames`] averages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Averaged {
    /// Means of samples: weights count once.
    Means,
    /// Their variances: weights count twice.
    Variances,
}
