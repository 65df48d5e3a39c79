//! Weights and filtered features of the rows of cells, block by block.

use std::ops::Range;

use linpred_core::{
    BLOCK_HEIGHT, BLOCK_WIDTH, BlockPlane, ColourBlock, FeatureGroup, FilteredGroup,
    PREFILTER_HALO, PREPARE_HALO, PreparedBlock,
};
use rayon::prelude::*;

use crate::dispatch::Level;
use crate::geometry::{ImageSize, plane_bytes};
use crate::held_rows::{HeldRows, copy_clamped};
use crate::row::{FEATURES, RowLayout};

/// Rows of input around a row of blocks that it is made of.
pub(crate) const BLOCK_HALO: usize = PREPARE_HALO;
// A missing feature is filled from its neighbours, hence the 1.
const _: () = assert!(
    PREFILTER_HALO < BLOCK_HALO,
    "the prefilter must not read beyond the band"
);

/// Blocks that each thread works out before their results are stored.
const BLOCKS_PER_THREAD: usize = 4;

/// What the cells read of 19 rows beside their colour: planes row after row.
pub(crate) struct PreparedRows {
    size: ImageSize,
    pub(crate) weight: Vec<f32>,
    pub(crate) variance: Vec<f32>,
    pub(crate) tolerance: Vec<f32>,
    /// Features; empty if the image has no such feature.
    pub(crate) features: [Vec<f32>; FEATURES],
    pub(crate) feature_variances: [Vec<f32>; FEATURES],
}

impl PreparedRows {
    pub(crate) fn new(layout: &RowLayout) -> Self {
        let pixels = layout.size.width() * BLOCK_HEIGHT;
        let plane = || vec![0.0; pixels];
        let feature = |k: usize| vec![0.0; if layout.features[k] { pixels } else { 0 }];
        Self {
            size: layout.size,
            weight: plane(),
            variance: plane(),
            tolerance: plane(),
            features: std::array::from_fn(feature),
            feature_variances: std::array::from_fn(feature),
        }
    }

    /// Bytes of 19 rows.
    pub(crate) fn bytes(layout: &RowLayout) -> u64 {
        let features = layout.features.iter().filter(|present| **present).count();
        plane_bytes(layout.size, BLOCK_HEIGHT, 3 + 2 * features)
    }

    /// Bytes that working them out takes, on `threads` threads.
    pub(crate) fn working_bytes(threads: u64) -> u64 {
        threads * (BLOCKS_PER_THREAD * size_of::<Block>() + size_of::<Inputs>()) as u64
    }

    /// Works out the rows from `first_row` on, of which some may lie above the image, and counts blocks of
    /// features.
    pub(crate) fn fill(&mut self, band: &HeldRows, first_row: isize, level: Level) -> Filled {
        let columns: Vec<usize> = (0..self.size.width()).step_by(BLOCK_WIDTH).collect();
        let at_once = BLOCKS_PER_THREAD * rayon::current_num_threads();
        let mut blocks: Vec<Box<Block>> = (0..at_once.min(columns.len()))
            .map(|_| Block::new())
            .collect();
        let mut filled = Filled::default();
        // a group is there if its first feature is
        let groups = GROUPS.map(|group| !self.features[group.start].is_empty());
        for columns in columns.chunks(at_once) {
            (blocks.par_iter_mut().zip(columns)).for_each_init(
                Inputs::new,
                |inputs, (block, &x)| {
                    let source = Source {
                        band,
                        width: self.size.width(),
                        x,
                        y: first_row,
                    };
                    block.work_out(&source, &self.features, level, inputs);
                },
            );
            for (block, &x) in blocks.iter().zip(columns) {
                for (present, filtered) in groups.iter().zip(block.filtered) {
                    filled.feature_blocks += u64::from(*present);
                    filled.skipped += u64::from(*present && !filtered);
                }
                self.store(block, x);
                self.copy_unfiltered(block, band, x, first_row);
            }
        }
        filled
    }

    fn store(&mut self, block: &Block, x: usize) {
        let width = self.size.width();
        let columns = BLOCK_WIDTH.min(width - x);
        let store = |plane: &mut [f32], values: &BlockPlane| {
            for (row, values) in plane.chunks_exact_mut(width).zip(values) {
                row[x..x + columns].copy_from_slice(&values[..columns]);
            }
        };
        store(&mut self.weight, &block.prepared.weight);
        store(&mut self.variance, &block.prepared.variance);
        store(&mut self.tolerance, &block.prepared.tolerance);
        let groups = [
            (&block.normal.value[..], &block.normal.variance[..]),
            (&block.albedo.value[..], &block.albedo.variance[..]),
            (&block.depth.value[..], &block.depth.variance[..]),
        ];
        for ((features, done), (values, variances)) in
            GROUPS.into_iter().zip(block.filtered).zip(groups)
        {
            if done {
                for (k, (value, variance)) in features.zip(values.iter().zip(variances)) {
                    store(&mut self.features[k], value);
                    store(&mut self.feature_variances[k], variance);
                }
            }
        }
    }

    /// The features of the groups that had no noise to be filtered.
    fn copy_unfiltered(&mut self, block: &Block, band: &HeldRows, x: usize, y: isize) {
        let width = self.size.width();
        let columns = x..width.min(x + BLOCK_WIDTH);
        for (features, _) in GROUPS
            .into_iter()
            .zip(block.filtered)
            .filter(|(_, done)| !done)
        {
            for k in features {
                // the plane of a feature that the image lacks has no rows
                let values = self.features[k].chunks_exact_mut(width);
                let variances = self.feature_variances[k].chunks_exact_mut(width);
                for (y, (values, variances)) in (y..).zip(values.zip(variances)) {
                    band.copy_feature(k, x as isize, y, &mut values[columns.clone()]);
                    variances[columns.clone()].fill(0.0);
                }
            }
        }
    }
}

/// Features that are filtered together: normal, albedo, depth.
const GROUPS: [Range<usize>; 3] = [0..3, 3..6, 6..7];

/// What filling rows took, in blocks of features, one for each group.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Filled {
    pub(crate) feature_blocks: u64,
    /// Blocks without noise in reach.
    pub(crate) skipped: u64,
}

/// One block's results.
struct Block {
    prepared: PreparedBlock,
    normal: FilteredGroup<3>,
    albedo: FilteredGroup<3>,
    depth: FilteredGroup<1>,
    /// Which of the groups had noise; the others' results are not there.
    filtered: [bool; 3],
}

impl Block {
    fn new() -> Box<Self> {
        Box::new(Self {
            prepared: PreparedBlock::EMPTY,
            normal: FilteredGroup::ZERO,
            albedo: FilteredGroup::ZERO,
            depth: FilteredGroup::ZERO,
            filtered: [false; 3],
        })
    }

    fn work_out(
        &mut self,
        source: &Source,
        features: &[Vec<f32>; FEATURES],
        level: Level,
        inputs: &mut Inputs,
    ) {
        source.load_colours(&mut inputs.colours);
        level.prepare(&inputs.colours, &mut self.prepared);
        let wanted =
            GROUPS.map(|group| !features[group.start].is_empty() && source.is_noisy(&group));
        self.filtered = [false; 3];
        if wanted[0] {
            source.load_features(&GROUPS[0], &mut inputs.triple);
            self.filtered[0] = level.prefilter(&inputs.triple, &mut self.normal);
        }
        if wanted[1] {
            source.load_features(&GROUPS[1], &mut inputs.triple);
            self.filtered[1] = level.prefilter(&inputs.triple, &mut self.albedo);
        }
        if wanted[2] {
            source.load_features(&GROUPS[2], &mut inputs.single);
            self.filtered[2] = level.prefilter(&inputs.single, &mut self.depth);
        }
    }
}

/// What a block is made of, used for its parts in turn.
struct Inputs {
    colours: ColourBlock,
    triple: FeatureGroup<3>,
    single: FeatureGroup<1>,
}

impl Inputs {
    fn new() -> Box<Self> {
        Box::new(Self {
            colours: ColourBlock::BLACK,
            triple: FeatureGroup::ZERO,
            single: FeatureGroup::ZERO,
        })
    }
}

/// Where a block comes from.
struct Source<'a> {
    band: &'a HeldRows,
    /// Columns of the image.
    width: usize,
    /// The block's first column and row, which may lie above the image.
    x: usize,
    y: isize,
}

impl Source<'_> {
    fn load_colours(&self, block: &mut ColourBlock) {
        const WIDTH: usize = ColourBlock::WIDTH;
        let first = self.x as isize - PREPARE_HALO as isize;
        for row in 0..ColourBlock::HEIGHT {
            let y = self.y + row as isize - PREPARE_HALO as isize;
            let (colours, guides) = (self.band.colours(y), self.band.guides(y));
            copy_clamped(&guides.luminance, first, &mut block.luminance[row][..WIDTH]);
            copy_clamped(&guides.variance, first, &mut block.variance[row][..WIDTH]);
            copy_clamped(&colours.good, first, &mut block.good[row][..WIDTH]);
        }
    }

    /// Whether a feature of the group may have a variance in the block or its halo.
    fn is_noisy(&self, group: &Range<usize>) -> bool {
        let end = self.x + BLOCK_WIDTH + PREFILTER_HALO;
        let columns = self.x.saturating_sub(PREFILTER_HALO)..end.min(self.width);
        self.rows_of_features().any(|y| {
            let row = self.band.guides(y);
            group.clone().any(|k| row.is_noisy(k, &columns))
        })
    }

    fn rows_of_features(&self) -> Range<isize> {
        let first = self.y - PREFILTER_HALO as isize;
        first..first + FeatureGroup::<1>::HEIGHT as isize
    }

    fn load_features<const N: usize>(&self, group: &Range<usize>, block: &mut FeatureGroup<N>) {
        let first = self.x as isize - PREFILTER_HALO as isize;
        for (row, y) in self.rows_of_features().enumerate() {
            let source = self.band.guides(y);
            for (c, k) in group.clone().enumerate() {
                let value = &mut block.value[c][row][..FeatureGroup::<N>::WIDTH];
                self.band.copy_feature(k, first, y, value);
                let variance = &mut block.variance[c][row][..FeatureGroup::<N>::WIDTH];
                copy_clamped(&source.feature_variances[k], first, variance);
            }
        }
    }
}
