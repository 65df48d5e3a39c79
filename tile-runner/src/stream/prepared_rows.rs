//! Weights and filtered features of the rows of cells, block by block.

use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use linpred_core::{
    BLOCK_HEIGHT, BLOCK_WIDTH, BlockPlane, ColourBlock, FeatureGroup, FilteredGroup, MAX_FEATURES,
    PREFILTER_HALO, WEIGHTS_HALO, WeightBlock,
};
use linpred_dispatch::InstructionSet;
use rayon::prelude::*;

use crate::geometry::plane_bytes;
use crate::row::RowLayout;
use crate::stream::borders::copy_clamped;
use crate::stream::held_rows::HeldRows;

/// Rows of input around a row of blocks that it is made of.
pub(crate) const BLOCK_HALO: usize = WEIGHTS_HALO;
// A missing feature is filled from its neighbours, hence the 1.
const _: () = assert!(
    PREFILTER_HALO < BLOCK_HALO,
    "the prefilter must not read beyond the rows that are held"
);

/// What the cells read of 19 rows beside their colour.
pub(crate) struct PreparedRows {
    width: usize,
    rows: Vec<PreparedRow>,
}

/// A row of them. A feature that the image lacks has empty planes.
pub(crate) struct PreparedRow {
    pub(crate) weight: Vec<f32>,
    pub(crate) variance: Vec<f32>,
    pub(crate) tolerance: Vec<f32>,
    pub(crate) features: [Vec<f32>; MAX_FEATURES],
    pub(crate) feature_variances: [Vec<f32>; MAX_FEATURES],
    /// The features smoothed more; empty if nobody asks for them.
    pub(crate) smoothed: [Vec<f32>; MAX_FEATURES],
    pub(crate) smoothed_variances: [Vec<f32>; MAX_FEATURES],
}

impl PreparedRow {
    fn new(layout: &RowLayout, vary: bool) -> Self {
        let width = layout.size.width();
        let plane = || vec![0.0; width];
        let feature = |k: usize| vec![0.0; if layout.features[k] { width } else { 0 }];
        let smoothed = |k: usize| if vary { feature(k) } else { Vec::new() };
        Self {
            weight: plane(),
            variance: plane(),
            tolerance: plane(),
            features: std::array::from_fn(feature),
            feature_variances: std::array::from_fn(feature),
            smoothed: std::array::from_fn(smoothed),
            smoothed_variances: std::array::from_fn(smoothed),
        }
    }
}

impl PreparedRows {
    /// Rows to be prepared; with smoothed features, too, if models are to `vary` in what they see.
    pub(crate) fn new(layout: &RowLayout, vary: bool) -> Self {
        Self {
            width: layout.size.width(),
            rows: (0..BLOCK_HEIGHT)
                .map(|_| PreparedRow::new(layout, vary))
                .collect(),
        }
    }

    /// Bytes of 19 rows.
    pub(crate) fn bytes(layout: &RowLayout, vary: bool) -> u64 {
        let features = layout.feature_channels();
        let sets = if vary { 2 } else { 1 };
        plane_bytes(layout.size, BLOCK_HEIGHT, 3 + 2 * sets * features)
    }

    /// Row `row` of the 19.
    pub(crate) fn row(&self, row: usize) -> &PreparedRow {
        &self.rows[row]
    }

    /// Works out `pieces`, each from the row that stands before it on, which may lie above the image: each thread at a bench of its own. Counts blocks of features.
    pub(crate) fn fill(
        pieces: Vec<(isize, &mut Self)>,
        held: &HeldRows,
        instruction_set: InstructionSet,
        benches: &mut [Box<BlockBench>],
    ) -> Filled {
        let width = pieces.first().map_or(0, |(_, piece)| piece.width);
        let columns = width.div_ceil(BLOCK_WIDTH);
        // A block is stored row by row, so that threads wait for one another no longer than a row takes.
        let pieces = pieces.into_iter().map(|(first_row, piece)| {
            let rows: Vec<_> = piece.rows.iter_mut().map(Mutex::new).collect();
            (first_row, rows)
        });
        let pieces: Vec<_> = pieces.collect();
        let next = AtomicUsize::new(0);
        let filled = benches.par_iter_mut().map(|bench| {
            let mut filled = Filled::default();
            loop {
                let block = next.fetch_add(1, Ordering::Relaxed);
                let Some((first_row, rows)) = pieces.get(block / columns.max(1)) else {
                    return filled;
                };
                let source = Source {
                    held,
                    width,
                    x: block % columns * BLOCK_WIDTH,
                    y: *first_row,
                };
                bench.work_out(&source, instruction_set);
                filled.count(&bench.features);
                for (row, target) in rows.iter().enumerate() {
                    // A thread that panicked takes the run down with it; the rows are of no use then.
                    let mut target = target.lock().unwrap_or_else(PoisonError::into_inner);
                    bench.store(&source, row, &mut target);
                }
            }
        });
        filled.reduce(Filled::default, Filled::and)
    }
}

/// What filling rows took, in blocks of features.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Filled {
    pub(crate) feature_blocks: u64,
    /// Blocks without noise in reach.
    pub(crate) skipped: u64,
}

impl Filled {
    fn count(&mut self, features: &[FeatureBench]) {
        for feature in features {
            self.feature_blocks += 1;
            self.skipped += u64::from(!feature.filtered);
        }
    }

    fn and(self, other: Self) -> Self {
        Self {
            feature_blocks: self.feature_blocks + other.feature_blocks,
            skipped: self.skipped + other.skipped,
        }
    }
}

/// Where a thread works out blocks, one after the other.
pub(crate) struct BlockBench {
    colours: ColourBlock,
    prepared: WeightBlock,
    features: Vec<FeatureBench>,
    vary: bool,
}

impl BlockBench {
    /// A bench for the features of an image; with smoothed ones, too, if models are to `vary` in what they see.
    pub(crate) fn new(layout: &RowLayout, vary: bool) -> Box<Self> {
        let present = layout.groups().filter(|range| layout.features[range.start]);
        Box::new(Self {
            colours: ColourBlock::BLACK,
            prepared: WeightBlock::EMPTY,
            features: present.map(FeatureBench::new).collect(),
            vary,
        })
    }

    /// Bytes of a bench.
    pub(crate) fn bytes(layout: &RowLayout) -> u64 {
        let present = layout.groups().filter(|range| layout.features[range.start]);
        let features = present.map(|range| FeatureBench::bytes(range.len()));
        (size_of::<Self>() + features.sum::<usize>()) as u64
    }

    fn work_out(&mut self, source: &Source, instruction_set: InstructionSet) {
        source.load_colours(&mut self.colours);
        instruction_set.weigh_samples(&self.colours, &mut self.prepared);
        for feature in &mut self.features {
            feature.filtered = source.is_noisy(&feature.range)
                && match &mut feature.channels {
                    Channels::One(one) => {
                        one.filter(&feature.range, source, self.vary, instruction_set)
                    }
                    Channels::Two(two) => {
                        two.filter(&feature.range, source, self.vary, instruction_set)
                    }
                    Channels::Three(three) => {
                        three.filter(&feature.range, source, self.vary, instruction_set)
                    }
                };
        }
    }

    /// Stores row `row` of the block that was worked out.
    fn store(&self, source: &Source, row: usize, target: &mut PreparedRow) {
        let columns = source.x..source.width.min(source.x + BLOCK_WIDTH);
        let store = |plane: &mut [f32], values: &BlockPlane| {
            plane[columns.clone()].copy_from_slice(&values[row][..columns.len()]);
        };
        store(&mut target.weight, &self.prepared.weight);
        store(&mut target.variance, &self.prepared.variance);
        store(&mut target.tolerance, &self.prepared.tolerance);
        let y = source.y + row as isize;
        for feature in &self.features {
            let [filtered, smoothed] = feature.results();
            let sets = [
                (
                    filtered,
                    &mut target.features,
                    &mut target.feature_variances,
                ),
                (
                    smoothed,
                    &mut target.smoothed,
                    &mut target.smoothed_variances,
                ),
            ];
            for ((values, variances), own, own_variances) in sets {
                let planes = values.iter().zip(variances);
                for (k, (value, variance)) in feature.range.clone().zip(planes) {
                    let (own, own_variance) = (&mut own[k], &mut own_variances[k]);
                    if own.is_empty() {
                        continue;
                    }
                    if feature.filtered {
                        store(own, value);
                        store(own_variance, variance);
                    } else {
                        let own = &mut own[columns.clone()];
                        source.held.copy_feature(k, source.x as isize, y, own);
                        own_variance[columns.clone()].fill(0.0);
                    }
                }
            }
        }
    }
}

/// Where a feature is filtered.
struct FeatureBench {
    /// Its channels among those of all features.
    range: Range<usize>,
    channels: Channels,
    /// Whether it had noise in the block; the results are not there otherwise.
    filtered: bool,
}

/// A feature in one channel to three.
enum Channels {
    One(Box<Filter<1>>),
    Two(Box<Filter<2>>),
    Three(Box<Filter<3>>),
}

impl FeatureBench {
    fn new(range: Range<usize>) -> Self {
        Self {
            channels: match range.len() {
                1 => Channels::One(Filter::new()),
                2 => Channels::Two(Filter::new()),
                _ => Channels::Three(Filter::new()),
            },
            range,
            filtered: false,
        }
    }

    /// Bytes of one for so many channels.
    fn bytes(channels: usize) -> usize {
        let filter = match channels {
            1 => size_of::<Filter<1>>(),
            2 => size_of::<Filter<2>>(),
            _ => size_of::<Filter<3>>(),
        };
        size_of::<Self>() + filter
    }

    /// Values and variances of its channels, filtered and smoothed.
    fn results(&self) -> [(&[BlockPlane], &[BlockPlane]); 2] {
        match &self.channels {
            Channels::One(one) => one.results(),
            Channels::Two(two) => two.results(),
            Channels::Three(three) => three.results(),
        }
    }
}

/// A block of a feature and what becomes of it.
struct Filter<const N: usize> {
    input: FeatureGroup<N>,
    result: FilteredGroup<N>,
    smoothed: FilteredGroup<N>,
}

impl<const N: usize> Filter<N> {
    fn new() -> Box<Self> {
        Box::new(Self {
            input: FeatureGroup::ZERO,
            result: FilteredGroup::ZERO,
            smoothed: FilteredGroup::ZERO,
        })
    }

    /// Filters a block; whether it has noise.
    fn filter(
        &mut self,
        channels: &Range<usize>,
        source: &Source,
        vary: bool,
        instruction_set: InstructionSet,
    ) -> bool {
        source.load_features(channels, &mut self.input);
        let smoothed = vary.then_some(&mut self.smoothed);
        instruction_set.prefilter(&self.input, &mut self.result, smoothed)
    }

    fn results(&self) -> [(&[BlockPlane], &[BlockPlane]); 2] {
        [&self.result, &self.smoothed].map(|group| (&group.value[..], &group.variance[..]))
    }
}

/// Where a block comes from.
struct Source<'a> {
    held: &'a HeldRows,
    /// Columns of the image.
    width: usize,
    /// The block's first column and row, which may lie above the image.
    x: usize,
    y: isize,
}

impl Source<'_> {
    fn load_colours(&self, block: &mut ColourBlock) {
        const WIDTH: usize = ColourBlock::WIDTH;
        let first = self.x as isize - WEIGHTS_HALO as isize;
        for row in 0..ColourBlock::HEIGHT {
            let y = self.y + row as isize - WEIGHTS_HALO as isize;
            let (colours, guides) = (self.held.colours(y), self.held.guides(y));
            copy_clamped(&guides.luminance, first, &mut block.luminance[row][..WIDTH]);
            copy_clamped(&colours.variance, first, &mut block.variance[row][..WIDTH]);
            copy_clamped(&colours.good, first, &mut block.good[row][..WIDTH]);
        }
    }

    /// Whether one of these channels may have a variance in the block or its halo.
    fn is_noisy(&self, channels: &Range<usize>) -> bool {
        let end = self.x + BLOCK_WIDTH + PREFILTER_HALO;
        let columns = self.x.saturating_sub(PREFILTER_HALO)..end.min(self.width);
        self.rows_of_features().any(|y| {
            let row = self.held.guides(y);
            channels.clone().any(|k| row.is_noisy(k, &columns))
        })
    }

    fn rows_of_features(&self) -> Range<isize> {
        let first = self.y - PREFILTER_HALO as isize;
        first..first + FeatureGroup::<1>::HEIGHT as isize
    }

    fn load_features<const N: usize>(&self, channels: &Range<usize>, block: &mut FeatureGroup<N>) {
        let first = self.x as isize - PREFILTER_HALO as isize;
        for (row, y) in self.rows_of_features().enumerate() {
            let source = self.held.guides(y);
            for (c, k) in channels.clone().enumerate() {
                let value = &mut block.value[c][row][..FeatureGroup::<N>::WIDTH];
                self.held.copy_feature(k, first, y, value);
                let variance = &mut block.variance[c][row][..FeatureGroup::<N>::WIDTH];
                copy_clamped(&source.feature_variances[k], first, variance);
            }
        }
    }
}
