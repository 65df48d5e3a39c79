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
//! `exp(-d)` as `(1 - d/8)^8`, which ends. Both sides of a pair give it the same weight, so each pair is compared once.
//!
//! On demand the same pairs filter the group a second time, their distances taken at a fifth ([`SMOOTHING`]): models that see such features
//! err in other places than those that see the first.
//!
//! A pixel in whose surroundings there is no variance stays as it is. Its result depends only on the
//! pixels within 7 of it, not on where it lies in a block.

#![expect(
    clippy::needless_range_loop,
    reason = "the loops follow the indices of the formulas"
)]

use crate::block::plane::{
    BLOCK_COLUMNS, BLOCK_HEIGHT, BLOCK_WIDTH, BlockPlane, BlockRow, columns, columns_of,
};
use crate::float::reciprocal;

/// Half-width of the search.
const SEARCH: usize = 3;
/// Half-width of the patches that are compared.
const PATCH: usize = 2;
const PATCH_SPAN: usize = 2 * PATCH + 1;
/// Half-width of the mean that steadies the variances: four samples estimate theirs badly.
const STEADY: usize = 2;
const STEADY_SPAN: usize = 2 * STEADY + 1;
/// Pixels around a block that its prefilter reads.
pub const PREFILTER_HALO: usize = SEARCH + PATCH + STEADY;

/// Part of a feature's square that counts as noise whatever its variance says: rounding of half floats.
const ROUNDING: f32 = 1e-6;
/// Part of the distance between patches at which the second filter takes it (measured: 0.1 to 0.25 alike).
const SMOOTHING: f32 = 0.2;

/// Distances are cut here, so that one pixel's does not rule out its neighbours for good.
const LARGEST_DISTANCE: f32 = 1e3;

const INPUT_HEIGHT: usize = BLOCK_HEIGHT + 2 * PREFILTER_HALO;
/// Columns of the input: those that are read, and more for registers that reach beyond the block.
const INPUT_COLUMNS: usize = BLOCK_COLUMNS + SEARCH + PREFILTER_HALO;
/// Variances are steadied, and patches compared, up to here around a block.
const MARGIN: usize = SEARCH + PATCH;
const STEADY_HEIGHT: usize = BLOCK_HEIGHT + 2 * MARGIN;
const STEADY_COLUMNS: usize = INPUT_COLUMNS - 2 * STEADY;
/// Rows of weights, of pixels that lie above or in the block, and of distances for them.
const WEIGHTS_HEIGHT: usize = BLOCK_HEIGHT + SEARCH;
const DISTANCES_HEIGHT: usize = WEIGHTS_HEIGHT + 2 * PATCH;
/// Columns of their rows: what is compared, zeros for sums and registers that reach beyond, and more to end with a line of the cache.
const PADDED: usize = 64;
const _: () = assert!(BLOCK_COLUMNS + 2 * PATCH <= PADDED);
// A block's pixels, the partners on one side of them, and patches: no more than what the registers hold.
const _: () = assert!(BLOCK_WIDTH + SEARCH + 2 * PATCH <= BLOCK_COLUMNS);

/// A plane of a block with its halo; beyond the image, the nearest pixel of the image.
pub type FeaturePlane = [[f32; INPUT_COLUMNS]; INPUT_HEIGHT];
type SteadyPlane = [[f32; STEADY_COLUMNS]; STEADY_HEIGHT];

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
        value: [[[0.0; INPUT_COLUMNS]; INPUT_HEIGHT]; N],
        variance: [[[0.0; INPUT_COLUMNS]; INPUT_HEIGHT]; N],
    };
    /// Columns of its planes that are read, from the first; the others may hold any finite number.
    pub const WIDTH: usize = BLOCK_WIDTH + 2 * PREFILTER_HALO;
    /// Rows of its planes.
    pub const HEIGHT: usize = INPUT_HEIGHT;
}

/// A filtered group, and the variance that it has kept.
#[derive(Clone, Debug, PartialEq)]
#[repr(align(64))]
pub struct FilteredGroup<const N: usize> {
    /// Features.
    pub value: [BlockPlane; N],
    /// Variance left in them, `sum w^2 var / (sum w)^2`.
    pub variance: [BlockPlane; N],
}

impl<const N: usize> FilteredGroup<N> {
    /// A group of zeros.
    pub const ZERO: Self = Self {
        value: [[[0.0; BLOCK_COLUMNS]; BLOCK_HEIGHT]; N],
        variance: [[[0.0; BLOCK_COLUMNS]; BLOCK_HEIGHT]; N],
    };
}

/// Filters a block of a group, and once more and more strongly into `smoothed` if that is given; where the group has no variance at all,
/// copies it and returns false.
///
/// Takes some 40 KiB of stack.
#[inline(always)]
pub fn prefilter<const N: usize>(
    input: &FeatureGroup<N>,
    output: &mut FilteredGroup<N>,
    mut smoothed: Option<&mut FilteredGroup<N>>,
) -> bool {
    begin(input, output);
    if let Some(smoothed) = smoothed.as_deref_mut() {
        begin(input, smoothed);
    }
    if !has_variance(input) {
        return false;
    }
    let steady = steady_variance(&input.variance);
    let noise = noise(&steady, &input.value);
    let mut sums = [[1.0; BLOCK_COLUMNS]; BLOCK_HEIGHT];
    let mut smoothed_sums = sums;
    let mut pairs = Pairs::ZERO;
    for dy in 0..=SEARCH {
        let leftmost = if dy == 0 { SEARCH + 1 } else { 0 };
        for column in leftmost..=2 * SEARCH {
            let step = Step { column, dy };
            pairs.compare(&input.value, &noise, step);
            pairs.weigh(step, 1.0);
            add_pairs(&pairs.weights, input, step, &mut sums, output);
            if let Some(smoothed) = smoothed.as_deref_mut() {
                pairs.weigh(step, SMOOTHING);
                add_pairs(&pairs.weights, input, step, &mut smoothed_sums, smoothed);
            }
        }
    }
    normalise(&sums, &steady, input, output);
    if let Some(smoothed) = smoothed {
        normalise(&smoothed_sums, &steady, input, smoothed);
    }
    true
}

/// From a pixel to its partner: `column - SEARCH` to the right and `dy` down.
#[derive(Clone, Copy)]
struct Step {
    column: usize,
    dy: usize,
}

impl Step {
    /// Columns that the partner lies to the right, or 0.
    #[inline(always)]
    fn right(self) -> usize {
        self.column.saturating_sub(SEARCH)
    }

    /// Columns that the partner lies to the left, or 0.
    #[inline(always)]
    fn left(self) -> usize {
        SEARCH.saturating_sub(self.column)
    }
}

#[inline(always)]
fn has_variance<const N: usize>(input: &FeatureGroup<N>) -> bool {
    let mut some = false;
    for plane in &input.variance {
        for row in plane {
            for x in 0..FeatureGroup::<N>::WIDTH {
                some |= row[x] > 0.0;
            }
        }
    }
    some
}

/// Starts every pixel with its own value, at weight 1.
#[inline(always)]
fn begin<const N: usize>(input: &FeatureGroup<N>, output: &mut FilteredGroup<N>) {
    for c in 0..N {
        for y in 0..BLOCK_HEIGHT {
            output.value[c][y] = *columns(&input.value[c][y + PREFILTER_HALO], PREFILTER_HALO);
            output.variance[c][y] =
                *columns(&input.variance[c][y + PREFILTER_HALO], PREFILTER_HALO);
        }
    }
}

/// Sum over the group of the variances' means over 5 x 5.
#[inline(always)]
fn steady_variance<const N: usize>(variance: &[FeaturePlane; N]) -> SteadyPlane {
    let mut across = [[0.0; STEADY_COLUMNS]; INPUT_HEIGHT];
    for y in 0..INPUT_HEIGHT {
        let mut sum = [0.0; INPUT_COLUMNS];
        for plane in variance {
            for x in 0..INPUT_COLUMNS {
                sum[x] += plane[y][x];
            }
        }
        for x in 0..STEADY_COLUMNS {
            across[y][x] = (sum[x] + sum[x + 1]) + (sum[x + 2] + sum[x + 3]) + sum[x + 4];
        }
    }
    let mut steady = [[0.0; STEADY_COLUMNS]; STEADY_HEIGHT];
    for y in 0..STEADY_HEIGHT {
        for x in 0..STEADY_COLUMNS {
            let [a, b, c, d, e] = [0, 1, 2, 3, 4].map(|k| across[y + k][x]);
            steady[y][x] = ((a + b) + (c + d) + e) * (1.0 / (STEADY_SPAN * STEADY_SPAN) as f32);
        }
    }
    steady
}

/// A pixel's share of the unit in which its distances are measured; never 0.
#[inline(always)]
fn noise<const N: usize>(steady: &SteadyPlane, value: &[FeaturePlane; N]) -> SteadyPlane {
    let mut noise = *steady;
    for y in 0..STEADY_HEIGHT {
        let mut square = [0.0; STEADY_COLUMNS];
        for plane in value {
            for x in 0..STEADY_COLUMNS {
                let own = plane[y + STEADY][x + STEADY];
                square[x] += own * own;
            }
        }
        for x in 0..STEADY_COLUMNS {
            noise[y][x] += 0.5 * ROUNDING * square[x] + f32::MIN_POSITIVE;
        }
    }
    noise
}

/// The pairs of pixels that are a step apart. Aligned, and so are its rows: half of what is read then lies in one line of the cache.
#[repr(align(64))]
struct Pairs {
    distances: [[f32; PADDED]; DISTANCES_HEIGHT],
    /// Sums of five distances side by side.
    across: [BlockRow; DISTANCES_HEIGHT],
    /// The first row is of the pixels `dy` above the block, the first column of those `right()` to the left of it.
    weights: [[f32; PADDED]; WEIGHTS_HEIGHT],
}

impl Pairs {
    const ZERO: Self = Self {
        distances: [[0.0; PADDED]; DISTANCES_HEIGHT],
        across: [[0.0; BLOCK_COLUMNS]; DISTANCES_HEIGHT],
        weights: [[0.0; PADDED]; WEIGHTS_HEIGHT],
    };

    #[inline(always)]
    fn compare<const N: usize>(
        &mut self,
        value: &[FeaturePlane; N],
        noise: &SteadyPlane,
        step: Step,
    ) {
        let rows = BLOCK_HEIGHT + step.dy;
        let read = rows + 2 * PATCH;
        for (y, row) in self.distances.iter_mut().enumerate().take(read) {
            distance_row(value, noise, y, step, row);
        }
        // A pass of its own: sums that read what was just written, at other columns, wait for it (measured: a quarter of all time).
        for (sums, d) in self.across.iter_mut().zip(&self.distances).take(read) {
            for x in 0..BLOCK_COLUMNS {
                sums[x] = (d[x] + d[x + 1]) + (d[x + 2] + d[x + 3]) + d[x + 4];
            }
        }
    }

    /// Weights of the pairs that were compared, their distances times `strength`.
    #[inline(always)]
    fn weigh(&mut self, step: Step, strength: f32) {
        let patches = self.across.windows(PATCH_SPAN);
        let rows = BLOCK_HEIGHT + step.dy;
        for (row, sums) in self.weights.iter_mut().zip(patches).take(rows) {
            let [a, b, c, d, e] = sums else { continue };
            for x in 0..BLOCK_COLUMNS {
                row[x] = falloff((a[x] + b[x]) + (c[x] + d[x]) + e[x], strength);
            }
        }
    }
}

/// Squared differences over the noise, d + 1, of the `y`-th row of pixels that the patches of a step's pairs hold.
#[inline(always)]
fn distance_row<const N: usize>(
    value: &[FeaturePlane; N],
    noise: &SteadyPlane,
    y: usize,
    step: Step,
    distances: &mut [f32; PADDED],
) {
    // In planes whose halo is MARGIN: the block's first patches begin SEARCH in, those of the pixels on the other side before it.
    let (row, column) = (y + SEARCH - step.dy, SEARCH - step.right());
    let partner = SEARCH - step.left();
    let pairs = value.each_ref().map(|plane| {
        let here = run(plane, row + STEADY, column + STEADY);
        (here, run(plane, row + step.dy + STEADY, partner + STEADY))
    });
    let noises = (run(noise, row, column), run(noise, row + step.dy, partner));
    for x in 0..BLOCK_COLUMNS {
        let mut squared = 0.0;
        for (here, there) in pairs {
            let difference = here[x] - there[x];
            squared += difference * difference;
        }
        let ratio = squared * reciprocal(noises.0[x] + noises.1[x]);
        distances[x] = if ratio < LARGEST_DISTANCE {
            ratio
        } else {
            LARGEST_DISTANCE
        };
    }
}

/// A block's columns from `first` on, of row `y`.
#[inline(always)]
fn run<const W: usize>(plane: &[[f32; W]], y: usize, first: usize) -> &BlockRow {
    columns_of(plane, y, first)
}

/// `exp(-s d)` for d above 0 and the strength s, as `(1 - s d/8)^8`, from the sum of d + 1 over the patch.
#[inline(always)]
fn falloff(sum: f32, strength: f32) -> f32 {
    const SHARE: f32 = 0.125 / (PATCH_SPAN * PATCH_SPAN) as f32;
    let base = 1.0 + 0.125 * strength - SHARE * strength * sum;
    let base = if base > 0.0 { base } else { 0.0 };
    let base = if base < 1.0 { base } else { 1.0 };
    let squared = base * base;
    let fourth = squared * squared;
    fourth * fourth
}

/// Adds every pixel's partners, one step ahead and one step back.
#[inline(always)]
fn add_pairs<const N: usize>(
    weights: &[[f32; PADDED]; WEIGHTS_HEIGHT],
    input: &FeatureGroup<N>,
    step: Step,
    sums: &mut BlockPlane,
    output: &mut FilteredGroup<N>,
) {
    let (below, above) = (PREFILTER_HALO + step.dy, PREFILTER_HALO - step.dy);
    let ahead = PREFILTER_HALO + step.right() - step.left();
    let back = PREFILTER_HALO + step.left() - step.right();
    for y in 0..BLOCK_HEIGHT {
        let forward = run(weights, y + step.dy, step.right());
        let backward = run(weights, y, step.left());
        for x in 0..BLOCK_COLUMNS {
            sums[y][x] += forward[x] + backward[x];
        }
        for c in 0..N {
            let values = (
                run(&input.value[c], y + below, ahead),
                run(&input.value[c], y + above, back),
            );
            let variances = (
                run(&input.variance[c], y + below, ahead),
                run(&input.variance[c], y + above, back),
            );
            let (value, variance) = (&mut output.value[c][y], &mut output.variance[c][y]);
            for x in 0..BLOCK_COLUMNS {
                let (f, b) = (forward[x], backward[x]);
                value[x] += f * values.0[x] + b * values.1[x];
                variance[x] += f * f * variances.0[x] + b * b * variances.1[x];
            }
        }
    }
}

/// Divides by the sums of the weights, and restores the pixels that have no noise.
#[inline(always)]
fn normalise<const N: usize>(
    sums: &BlockPlane,
    steady: &SteadyPlane,
    input: &FeatureGroup<N>,
    output: &mut FilteredGroup<N>,
) {
    for y in 0..BLOCK_HEIGHT {
        let steady: &BlockRow = columns(&steady[y + MARGIN], MARGIN);
        for c in 0..N {
            let own: &BlockRow = columns(&input.value[c][y + PREFILTER_HALO], PREFILTER_HALO);
            for x in 0..BLOCK_COLUMNS {
                let share = 1.0 / sums[y][x];
                let noisy = steady[x] > 0.0;
                let value = &mut output.value[c][y][x];
                *value = if noisy { *value * share } else { own[x] };
                let variance = &mut output.variance[c][y][x];
                *variance = if noisy {
                    *variance * share * share
                } else {
                    0.0
                };
            }
        }
    }
}
