//! Weights and filtered features of the rows of cells, block by block.

use linpred_core::{
    BLOCK_HEIGHT, BLOCK_WIDTH, BlockPlane, ColourBlock, FeatureGroup, FilteredGroup,
    PREFILTER_HALO, PREPARE_HALO, PreparedBlock,
};
use rayon::prelude::*;

use crate::dispatch::Level;
use crate::geometry::{ImageSize, plane_bytes};
use crate::held_rows::{HeldRows, clamped};
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
        let inputs = size_of::<ColourBlock>().max(size_of::<FeatureGroup<3>>());
        threads * (BLOCKS_PER_THREAD * size_of::<Block>() + inputs) as u64
    }

    /// Works out the rows from `first_row` on, of which some may lie above the image, and returns how many feature groups had
    /// to be filtered, per group and block.
    pub(crate) fn fill(&mut self, band: &HeldRows, first_row: isize, level: Level) -> u64 {
        let columns: Vec<usize> = (0..self.size.width()).step_by(BLOCK_WIDTH).collect();
        let mut filtered = 0;
        for columns in columns.chunks(BLOCKS_PER_THREAD * rayon::current_num_threads()) {
            let blocks: Vec<Box<Block>> = columns
                .par_iter()
                .map(|&x| self.work_out(band, x, first_row, level))
                .collect();
            for (block, &x) in blocks.iter().zip(columns) {
                filtered += block.filtered;
                self.store(block, x);
            }
        }
        filtered
    }

    fn work_out(&self, band: &HeldRows, x: usize, y: isize, level: Level) -> Box<Block> {
        let mut block = Box::new(Block {
            prepared: PreparedBlock::EMPTY,
            normal: FilteredGroup::ZERO,
            albedo: FilteredGroup::ZERO,
            depth: FilteredGroup::ZERO,
            filtered: 0,
        });
        level.prepare(&colours(band, self.size, x, y), &mut block.prepared);
        if !self.features[0].is_empty() {
            let normal = features::<3>(band, self.size, 0, x, y);
            block.filtered += u64::from(level.prefilter(&normal, &mut block.normal));
        }
        if !self.features[3].is_empty() {
            let albedo = features::<3>(band, self.size, 3, x, y);
            block.filtered += u64::from(level.prefilter(&albedo, &mut block.albedo));
        }
        if !self.features[6].is_empty() {
            let depth = features::<1>(band, self.size, 6, x, y);
            block.filtered += u64::from(level.prefilter(&depth, &mut block.depth));
        }
        block
    }

    fn store(&mut self, block: &Block, x: usize) {
        let width = self.size.width();
        let columns = BLOCK_WIDTH.min(width - x);
        // the plane of a feature that the image lacks has no rows
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
        let values = groups.iter().flat_map(|group| group.0);
        let variances = groups.iter().flat_map(|group| group.1);
        for (plane, values) in self.features.iter_mut().zip(values) {
            store(plane, values);
        }
        for (plane, values) in self.feature_variances.iter_mut().zip(variances) {
            store(plane, values);
        }
    }
}

/// One block's results.
struct Block {
    prepared: PreparedBlock,
    normal: FilteredGroup<3>,
    albedo: FilteredGroup<3>,
    depth: FilteredGroup<1>,
    filtered: u64,
}

fn colours(band: &HeldRows, size: ImageSize, x: usize, y: isize) -> Box<ColourBlock> {
    let mut block = Box::new(ColourBlock::BLACK);
    for row in 0..ColourBlock::HEIGHT {
        let from_row = y + row as isize - PREPARE_HALO as isize;
        let (colours, guides) = (band.colours(from_row), band.guides(from_row));
        for column in 0..ColourBlock::WIDTH {
            let from = clamped((x + column) as isize - PREPARE_HALO as isize, size.width());
            block.luminance[row][column] = colours.luminance(from);
            block.variance[row][column] = guides.variance[from];
            block.good[row][column] = colours.good[from];
        }
    }
    block
}

fn features<const N: usize>(
    band: &HeldRows,
    size: ImageSize,
    first: usize,
    x: usize,
    y: isize,
) -> Box<FeatureGroup<N>> {
    let mut group = Box::new(FeatureGroup::<N>::ZERO);
    for row in 0..FeatureGroup::<N>::HEIGHT {
        let from_row = y + row as isize - PREFILTER_HALO as isize;
        let source = band.guides(from_row);
        for column in 0..FeatureGroup::<N>::WIDTH {
            let from = clamped(
                (x + column) as isize - PREFILTER_HALO as isize,
                size.width(),
            );
            for c in 0..N {
                group.value[c][row][column] = band.feature(first + c, from as isize, from_row);
                group.variance[c][row][column] = source.feature_variances[first + c][from];
            }
        }
    }
    group
}
