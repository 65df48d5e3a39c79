//! Smooths what grain the models have left: non-local means without patches, guided by the features.
//!
//! Where models of many windows are mixed, their mean still has a grain of its own, fine and mottled. Its size is known: the estimated
//! squared error e. Pixels whose radiances differ by no more than that, and whose features agree, are averaged:
//!
//! ```text
//! d(i, j) = |o_i - o_j|^2 (c_i + c_j) + sum over the features of |f_i - f_j|^2 (p_i + p_j)
//! o_i <- sum_j w o_j / sum_j w,   w = exp(-d(i, j)),   j = i + step (dx, dy), |dx|, |dy| <= 3
//! ```
//!
//! `exp(-d)` is `(1 - d/8)^8`, as in the prefilter. Two passes, the second with a step of 4 pixels: a wavelet "with holes" (Dammertz et
//! al. 2010, Edge-Avoiding A-Trous Wavelet Transform for fast Global Illumination Filtering), which reaches 15 pixels by 98 neighbours.
//! The precisions are, with `m` the mean radiance over 3 x 3 and a tenth of the level around, and `e` the mean over 5 x 5,
//!
//! ```text
//! c = strength / 4 / (3 m^2 t),   t = e / m^2, at most 0.2^2
//! p = strength / 2 / (2 s + a^2)
//! ```
//!
//! with s the variance left in a feature and a what it may differ by on one surface. As the error goes to 0, so does what smoothing changes.
//!
//! A pixel without noise neither changes nor counts, and nor does one with a negative channel: what is not negative stays so, and
//! layers, smoothed with the weights of their colour, still sum to it.

use crate::block::plane::columns;
use crate::features::{FEATURES, Feature};
use crate::finish::{FinishedPlane, RUN, Run, is_zero, run, runs, store};
use crate::float::{larger, smaller};

/// Half-width of the neighbours, in steps.
pub const SMOOTH_RADIUS: usize = 3;
/// Rows of neighbours.
pub const SMOOTH_SPAN: usize = 2 * SMOOTH_RADIUS + 1;

/// Half-width of the mean radiance.
pub const MEAN_RADIUS: usize = 1;
/// Rows of it.
pub const MEAN_SPAN: usize = 2 * MEAN_RADIUS + 1;
/// Half-width of the mean error.
pub const ERROR_RADIUS: usize = 2;
/// Rows of it.
pub const ERROR_SPAN: usize = 2 * ERROR_RADIUS + 1;

/// A pass over the image.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Smoothing {
    /// Pixels from a neighbour to the next.
    pub step: usize,
    /// Factor of all distances.
    pub strength: f32,
    /// What the passes before have left of the estimated squared error, as a part of it.
    pub error_left: f32,
}

impl Smoothing {
    /// Pixels from one to its farthest neighbour, in a row or a column.
    pub const fn reach(&self) -> usize {
        SMOOTH_RADIUS * self.step
    }
}

/// The passes, in their order.
pub const SMOOTHINGS: [Smoothing; 2] = [
    Smoothing {
        step: 1,
        strength: 1.5,
        error_left: 1.0,
    },
    Smoothing {
        step: 4,
        strength: 1.0,
        error_left: 0.6,
    },
];
/// Their steps.
const FINE_STEP: usize = SMOOTHINGS[0].step;
const WIDE_STEP: usize = SMOOTHINGS[1].step;
/// Columns from a pixel to its farthest neighbour.
pub(crate) const REACH: usize = SMOOTHINGS[1].reach();

/// Share of the level around in the radiance that grain is measured by.
const LEVEL_SHARE: f32 = 0.1;
/// Grain is at most this part of the radiance.
const MOST_GRAIN: f32 = 0.2;

/// What normals may differ by on one surface, beside their noise; they have length 1.
const NORMAL_SLACK: f32 = 0.08;
/// The same of albedos, which are parts of the light.
const ALBEDO_SLACK: f32 = 0.015;
/// The same of depths, in any unit, as a part of the depth.
const DEPTH_SLACK: f32 = 0.05;
/// The depth among the features.
const DEPTH: usize = Feature::Depth.range().start;

/// A row and what is around it, for [`weigh_pixels`]; beyond the image, the nearest row of the image.
#[derive(Clone, Copy, Debug)]
pub struct Surroundings<'a> {
    /// Radiance of the row above, the row and the row below, each red green blue; finite.
    pub colour: [[&'a [f32]; 3]; MEAN_SPAN],
    /// Estimated squared error, mean over the channels, of the two rows above, the row and the two rows below; finite, not negative.
    pub error: [&'a [f32]; ERROR_SPAN],
    /// Level of radiance around each pixel (see [`crate::level_of`]).
    pub level: &'a [f32],
    /// 1, or 0 where a pixel passes through.
    pub noisy: &'a [f32],
    /// Features of the row above, the row and the row below; zeros for those that the image lacks.
    pub features: [[&'a [f32]; FEATURES]; MEAN_SPAN],
    /// Variance left in each feature, summed over its channels; zeros for those that the image lacks.
    pub feature_variance: [&'a [f32]; Feature::ALL.len()],
}

/// What [`weigh_pixels`] makes of a row.
#[derive(Debug)]
pub struct Precisions<'a> {
    /// 1 where a pixel is averaged with its neighbours, else 0.
    pub takes_part: &'a mut [f32],
    /// Half the inverse of the squared radiance that pixels may differ by.
    pub colour: &'a mut [f32],
    /// The same of the features.
    pub features: [&'a mut [f32]; Feature::ALL.len()],
}

/// Works out by how much the pixels of a row may differ from others that they are averaged with. All planes have the columns of
/// [`crate::finish_columns`].
#[inline(always)]
pub fn weigh_pixels(pass: &Smoothing, input: &Surroundings<'_>, output: &mut Precisions<'_>) {
    for first in runs(output.takes_part.len()) {
        if is_zero(run(input.noisy, first)) {
            // What has no part is compared with nothing.
            store(output.takes_part, first, &[0.0; RUN]);
            store(output.colour, first, &[0.0; RUN]);
            for feature in &mut output.features {
                store(feature, first, &[0.0; RUN]);
            }
            continue;
        }
        weigh_colours(pass, input, first, output);
        let [normal, albedo, depth] = &mut output.features;
        let [of_normal, of_albedo, of_depth] = input.feature_variance.map(|row| run(row, first));
        let slack = [NORMAL_SLACK, ALBEDO_SLACK].map(|slack| [slack * slack; RUN]);
        store(normal, first, &precisions(pass, of_normal, &slack[0]));
        store(albedo, first, &precisions(pass, of_albedo, &slack[1]));
        let slack = depth_slack(pass, &input.features.map(|row| row[DEPTH]), first);
        store(depth, first, &precisions(pass, of_depth, &slack));
    }
}

/// Precisions of a feature: half the inverse of the squares that pixels may differ by, twice the variance and the slack.
#[inline(always)]
fn precisions(pass: &Smoothing, variance: &Run, slack: &Run) -> Run {
    let mut precisions = [0.0; RUN];
    for x in 0..RUN {
        let spread = 2.0 * variance[x] + slack[x];
        precisions[x] = pass.strength * 0.5 / larger(spread, f32::MIN_POSITIVE);
    }
    precisions
}

/// A run of the precision of the colours, and of which pixels take part.
#[inline(always)]
fn weigh_colours(
    pass: &Smoothing,
    input: &Surroundings<'_>,
    first: usize,
    output: &mut Precisions<'_>,
) {
    let radiance = mean_radiance(&input.colour, first);
    let error = mean_error(&input.error, first);
    let level = run(input.level, first);
    let noisy = run(input.noisy, first);
    let [_, colour, _] = &input.colour;
    let [red, green, blue] = colour.map(|plane| run(plane, first));
    let mut precision = [0.0; RUN];
    let mut takes_part = [0.0; RUN];
    for x in 0..RUN {
        let mean = radiance[x] + LEVEL_SHARE * level[x];
        let square = mean * mean;
        let error = pass.error_left * error[x];
        let grain = 3.0 * smaller(error, MOST_GRAIN * MOST_GRAIN * square);
        let usable = (f32::MIN_POSITIVE..=f32::MAX).contains(&grain);
        let positive = red[x] >= 0.0 && green[x] >= 0.0 && blue[x] >= 0.0;
        precision[x] = if usable {
            pass.strength * 0.25 / grain
        } else {
            0.0
        };
        takes_part[x] = if usable && positive { noisy[x] } else { 0.0 };
    }
    store(output.colour, first, &precision);
    store(output.takes_part, first, &takes_part);
}

/// Means of the channels' magnitudes over 3 x 3 pixels.
#[inline(always)]
fn mean_radiance(colour: &[[&[f32]; 3]; MEAN_SPAN], first: usize) -> Run {
    let mut down = [0.0; RUN + 2 * MEAN_RADIUS];
    for planes in colour {
        let [red, green, blue] = planes.map(|plane| wider_run(plane, first));
        for x in 0..RUN + 2 * MEAN_RADIUS {
            down[x] += red[x].abs() + green[x].abs() + blue[x].abs();
        }
    }
    let mut means = [0.0; RUN];
    for x in 0..RUN {
        means[x] = (down[x] + down[x + 1] + down[x + 2]) * (1.0 / 27.0);
    }
    means
}

/// A run and a column on both sides.
#[inline(always)]
fn wider_run(plane: &[f32], first: usize) -> &[f32; RUN + 2 * MEAN_RADIUS] {
    columns(plane, first - MEAN_RADIUS)
}

/// Means of the errors over 5 x 5 pixels.
#[inline(always)]
fn mean_error(error: &[&[f32]; ERROR_SPAN], first: usize) -> Run {
    const COLUMNS: usize = RUN + 2 * ERROR_RADIUS;
    let mut down = [0.0; COLUMNS];
    for plane in error {
        let row: &[f32; COLUMNS] = columns(plane, first - ERROR_RADIUS);
        for x in 0..COLUMNS {
            down[x] += row[x];
        }
    }
    let mut means = [0.0; RUN];
    for x in 0..RUN {
        let sum = (down[x] + down[x + 1]) + (down[x + 2] + down[x + 3]) + down[x + 4];
        means[x] = sum * (1.0 / (ERROR_SPAN * ERROR_SPAN) as f32);
    }
    means
}

/// Squares that depths may differ by on one surface: a part of the depth, and what it changes by on the way to a neighbour, on a slanted
/// one, by central differences.
#[inline(always)]
fn depth_slack(pass: &Smoothing, rows: &[&[f32]; MEAN_SPAN], first: usize) -> Run {
    let [above, row, below] = rows.map(|row| run(row, first));
    let (left, right) = (
        run(rows[MEAN_RADIUS], first - 1),
        run(rows[MEAN_RADIUS], first + 1),
    );
    let reach = pass.reach() as f32;
    let apart = larger(reach * reach / 2.0, 1.0);
    let mut slack = [0.0; RUN];
    for x in 0..RUN {
        let across = 0.5 * (right[x] - left[x]);
        let down = 0.5 * (below[x] - above[x]);
        let part = DEPTH_SLACK * row[x];
        slack[x] = apart * (across * across + down * down) + part * part;
    }
    slack
}

/// A row of pixels that are compared.
#[derive(Clone, Copy, Debug)]
pub struct ComparedRow<'a> {
    /// [`Precisions::takes_part`]; 0 beyond the image.
    pub takes_part: &'a [f32],
    /// Radiance, red green blue; finite.
    pub colour: [&'a [f32]; 3],
    /// [`Precisions::colour`].
    pub colour_precision: &'a [f32],
    /// Features; zeros for those that the image lacks.
    pub features: [&'a [f32]; FEATURES],
    /// [`Precisions::features`].
    pub feature_precision: [&'a [f32]; Feature::ALL.len()],
}

impl<'a> ComparedRow<'a> {
    /// A row beyond the image, from a plane of zeros.
    pub fn outside(zeros: &'a [f32]) -> Self {
        Self {
            takes_part: zeros,
            colour: [zeros; 3],
            colour_precision: zeros,
            features: [zeros; FEATURES],
            feature_precision: [zeros; Feature::ALL.len()],
        }
    }

    /// The columns from `first` on, and those of their farthest neighbours on both sides.
    #[inline(always)]
    fn around(&self, first: usize) -> Compared<'a, AROUND> {
        let around = |plane: &'a [f32]| columns(plane, first - REACH);
        Compared {
            takes_part: around(self.takes_part),
            colour: self.colour.map(around),
            colour_precision: around(self.colour_precision),
            features: self.features.map(around),
            feature_precision: self.feature_precision.map(around),
        }
    }
}

/// Columns of a run that are compared with all of their neighbours before the next: with AVX-512 they stay in registers (measured: 41 ns a pixel and pass for 54 with whole runs;
/// AVX2 62 for 66, SSE2 131 for 124).
const PART: usize = 16;
const _: () = assert!(RUN.is_multiple_of(PART));
type Part = [f32; PART];

/// Columns of a part and of its neighbours.
const AROUND: usize = PART + 2 * REACH;

/// `N` columns of a row.
struct Compared<'a, const N: usize> {
    takes_part: &'a [f32; N],
    colour: [&'a [f32; N]; 3],
    colour_precision: &'a [f32; N],
    features: [&'a [f32; N]; FEATURES],
    feature_precision: [&'a [f32; N]; Feature::ALL.len()],
}

impl<'a> Compared<'a, AROUND> {
    /// The part that begins in column `first` of these.
    #[inline(always)]
    fn part(&self, first: usize) -> Compared<'a, PART> {
        let part = |plane: &'a [f32; AROUND]| columns(plane, first);
        Compared {
            takes_part: part(self.takes_part),
            colour: self.colour.map(part),
            colour_precision: part(self.colour_precision),
            features: self.features.map(part),
            feature_precision: self.feature_precision.map(part),
        }
    }
}

/// Smooths a row of every plane with the same weights. `rows` are the rows of the neighbours, from above to below, `step` rows from one to
/// the next, the row itself in the middle.
///
/// Takes some 13 KiB of stack.
#[inline(always)]
pub fn smooth(
    pass: &Smoothing,
    rows: &[ComparedRow<'_>; SMOOTH_SPAN],
    planes: &mut [FinishedPlane<'_, SMOOTH_SPAN>],
) {
    let step = smaller_step(pass);
    let mut weights = Weights::ZERO;
    let own = rows[SMOOTH_RADIUS].takes_part;
    for first in runs(own.len()) {
        if is_zero(run(own, first)) {
            for plane in planes.iter_mut() {
                store(plane.output, first, run(plane.rows[SMOOTH_RADIUS], first));
            }
            continue;
        }
        // Where the compiler knows the step, it knows that no neighbour lies beyond what is around.
        match step {
            FINE_STEP => weights.compare(rows, FINE_STEP, first),
            WIDE_STEP => weights.compare(rows, WIDE_STEP, first),
            _ => weights.compare(rows, step, first),
        }
        for plane in planes.iter_mut() {
            let smoothed = weights.average(&plane.rows, step, first);
            store(plane.output, first, &smoothed);
        }
    }
}

/// The pass's step; the longest that there is padding for, if it is longer.
#[inline(always)]
fn smaller_step(pass: &Smoothing) -> usize {
    pass.step.min(REACH / SMOOTH_RADIUS)
}

/// Weights of the neighbours of a run of pixels.
#[repr(align(64))]
struct Weights {
    /// Row by row, 0 throughout where the pixel takes no part.
    neighbours: [[Run; SMOOTH_SPAN]; SMOOTH_SPAN],
    /// One over their sum, or 0 where that is.
    share: Run,
}

impl Weights {
    const ZERO: Self = Self {
        neighbours: [[[0.0; RUN]; SMOOTH_SPAN]; SMOOTH_SPAN],
        share: [0.0; RUN],
    };

    #[inline(always)]
    fn compare(&mut self, rows: &[ComparedRow<'_>; SMOOTH_SPAN], step: usize, first: usize) {
        for part in (0..RUN).step_by(PART) {
            let own = rows[SMOOTH_RADIUS].around(first + part).part(REACH);
            let mut sums = [0.0; PART];
            for (row, weights) in rows.iter().zip(&mut self.neighbours) {
                let row = row.around(first + part);
                for (column, weights) in neighbours(REACH, step).zip(weights) {
                    let found = compare_parts(&own, &row.part(column));
                    for x in 0..PART {
                        sums[x] += found[x];
                    }
                    store(weights, part, &found);
                }
            }
            let mut share = [0.0; PART];
            for x in 0..PART {
                let takes_part = own.takes_part[x] > 0.0;
                share[x] = if takes_part { 1.0 / sums[x] } else { 0.0 };
            }
            store(&mut self.share, part, &share);
        }
    }

    /// A run of a plane's averages.
    #[inline(always)]
    fn average(&self, rows: &[&[f32]; SMOOTH_SPAN], step: usize, first: usize) -> Run {
        let mut sums = [0.0; RUN];
        for (row, weights) in rows.iter().zip(&self.neighbours) {
            for (column, weights) in neighbours(first, step).zip(weights) {
                let values = run(row, column);
                for x in 0..RUN {
                    sums[x] += weights[x] * values[x];
                }
            }
        }
        let own = run(rows[SMOOTH_RADIUS], first);
        for x in 0..RUN {
            let share = self.share[x];
            sums[x] = if share > 0.0 { sums[x] * share } else { own[x] };
        }
        sums
    }
}

/// Where the runs of a run's neighbours in a row begin.
#[inline(always)]
fn neighbours(first: usize, step: usize) -> impl Iterator<Item = usize> {
    (0..SMOOTH_SPAN).map(move |k| first + k * step - SMOOTH_RADIUS * step)
}

/// Weights of a part's neighbours.
#[inline(always)]
fn compare_parts(own: &Compared<'_, PART>, other: &Compared<'_, PART>) -> Part {
    let [nx, ny, nz, red, green, blue, z] = own.features;
    let [mx, my, mz, r, g, b, w] = other.features;
    let [normal, albedo, depth] = own.feature_precision;
    let [other_normal, other_albedo, other_depth] = other.feature_precision;
    let mut weights = [0.0; PART];
    for x in 0..PART {
        let squares = squared_distance(&own.colour, &other.colour, x);
        let mut distance = squares * (own.colour_precision[x] + other.colour_precision[x]);
        let squares = squared_distance(&[nx, ny, nz], &[mx, my, mz], x);
        distance += squares * (normal[x] + other_normal[x]);
        let squares = squared_distance(&[red, green, blue], &[r, g, b], x);
        distance += squares * (albedo[x] + other_albedo[x]);
        let difference = z[x] - w[x];
        distance += difference * difference * (depth[x] + other_depth[x]);
        let base = 1.0 - 0.125 * distance;
        let base = if base > 0.0 { base } else { 0.0 };
        let squared = base * base;
        let fourth = squared * squared;
        weights[x] = fourth * fourth * other.takes_part[x];
    }
    weights
}

#[inline(always)]
fn squared_distance(own: &[&Part; 3], other: &[&Part; 3], x: usize) -> f32 {
    let [a, b, c] = own;
    let [p, q, r] = other;
    let (a, b, c) = (a[x] - p[x], b[x] - q[x], c[x] - r[x]);
    a * a + b * b + c * c
}
