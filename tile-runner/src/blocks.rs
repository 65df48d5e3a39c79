//! Weights and filtered features of the rows of cells, block by block.

use linpred_core::{
    BLOCK_HEIGHT, BLOCK_WIDTH, BlockPlane, ColourBlock, FeatureGroup, FilteredGroup,
    PREFILTER_HALO, PREPARE_HALO, PreparedBlock,
};
use rayon::prelude::*;

use crate::dispatch::Level;
use crate::geometry::ImageSize;
use crate::held_rows::{HeldRows, clamped};
use crate::row::FEATURES;

/// Rows of input around a row of blocks that it is made of.
pub(crate) const BLOCK_HALO: usize = PREPARE_HALO;
// A missing feature is filled from its neighbours, hence the 1.
const _: () = assert!(
    PREFILTER_HALO < BLOCK_HALO,
    "the prefilter must not read beyond the band"
);

/// What the cells read of 19 rows beside their colour: planes row after row.
pub(crate) struct PreparedRows {
    width: usize,
    pub(crate) weight: Vec<f32>,
    pub(crate) variance: Vec<f32>,
    pub(crate) tolerance: Vec<f32>,
    pub(crate) features: [Vec<f32>; FEATURES],
    pub(crate) feature_variances: [Vec<f32>; FEATURES],
}

impl PreparedRows {
    pub(crate) fn new(size: ImageSize) -> Self {
        let plane = || vec![0.0; size.width() * BLOCK_HEIGHT];
        Self {
            width: size.width(),
            weight: plane(),
            variance: plane(),
            tolerance: plane(),
            features: std::array::from_fn(|_| plane()),
            feature_variances: std::array::from_fn(|_| plane()),
        }
    }

    /// Works out the rows from `first_row` on, and returns how many feature groups had to be filtered, per group and block.
    pub(crate) fn fill(
        &mut self,
        band: &HeldRows,
        size: ImageSize,
        first_row: usize,
        level: Level,
    ) -> u64 {
        let columns: Vec<usize> = (0..self.width).step_by(BLOCK_WIDTH).collect();
        let mut filtered = 0;
        for columns in columns.chunks(4 * rayon::current_num_threads()) {
            let blocks: Vec<Box<Block>> = columns
                .par_iter()
                .map(|&x| Block::work_out(band, size, x, first_row, level))
                .collect();
            for (block, &x) in blocks.iter().zip(columns) {
                filtered += block.filtered;
                self.store(block, x);
            }
        }
        filtered
    }

    fn store(&mut self, block: &Block, x: usize) {
        let width = self.width;
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

impl Block {
    fn work_out(band: &HeldRows, size: ImageSize, x: usize, y: usize, level: Level) -> Box<Self> {
        let mut block = Box::new(Self {
            prepared: PreparedBlock::EMPTY,
            normal: FilteredGroup::ZERO,
            albedo: FilteredGroup::ZERO,
            depth: FilteredGroup::ZERO,
            filtered: 0,
        });
        level.prepare(&colours(band, size, x, y), &mut block.prepared);
        let mut filtered =
            u64::from(level.prefilter(&features::<3>(band, size, 0, x, y), &mut block.normal));
        filtered +=
            u64::from(level.prefilter(&features::<3>(band, size, 3, x, y), &mut block.albedo));
        filtered +=
            u64::from(level.prefilter(&features::<1>(band, size, 6, x, y), &mut block.depth));
        block.filtered = filtered;
        block
    }
}

fn colours(band: &HeldRows, size: ImageSize, x: usize, y: usize) -> Box<ColourBlock> {
    let mut block = Box::new(ColourBlock::BLACK);
    for row in 0..ColourBlock::HEIGHT {
        let source = band.row((y + row) as isize - PREPARE_HALO as isize);
        for column in 0..ColourBlock::WIDTH {
            let from = clamped((x + column) as isize - PREPARE_HALO as isize, size.width());
            block.luminance[row][column] = source.luminance[from];
            block.variance[row][column] = source.variance[from];
            block.good[row][column] = source.good[from];
        }
    }
    block
}

fn features<const N: usize>(
    band: &HeldRows,
    size: ImageSize,
    first: usize,
    x: usize,
    y: usize,
) -> Box<FeatureGroup<N>> {
    let mut group = Box::new(FeatureGroup::<N>::ZERO);
    for row in 0..FeatureGroup::<N>::HEIGHT {
        let from_row = (y + row) as isize - PREFILTER_HALO as isize;
        let source = band.row(from_row);
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
