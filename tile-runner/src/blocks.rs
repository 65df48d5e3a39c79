//! Weights and filtered features of the rows of cells, block by block.

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

    /// Works out the rows from `first_row` on, of which some may lie above the image, and returns how many feature groups had
    /// to be filtered, per group and block.
    pub(crate) fn fill(&mut self, band: &HeldRows, first_row: isize, level: Level) -> u64 {
        let columns: Vec<usize> = (0..self.size.width()).step_by(BLOCK_WIDTH).collect();
        let mut filtered = 0;
        for columns in columns.chunks(BLOCKS_PER_THREAD * rayon::current_num_threads()) {
            let blocks: Vec<Box<Block>> = columns
                .par_iter()
                .map_init(Inputs::new, |inputs, &x| {
                    self.work_out(band, x, first_row, level, inputs)
                })
                .collect();
            for (block, &x) in blocks.iter().zip(columns) {
                filtered += block.filtered;
                self.store(block, x);
            }
        }
        filtered
    }

    fn work_out(
        &self,
        band: &HeldRows,
        x: usize,
        y: isize,
        level: Level,
        inputs: &mut Inputs,
    ) -> Box<Block> {
        let mut block = Box::new(Block::EMPTY);
        load_colours(band, x, y, &mut inputs.colours);
        level.prepare(&inputs.colours, &mut block.prepared);
        if !self.features[0].is_empty() {
            load_features(band, 0, x, y, &mut inputs.triple);
            block.filtered += u64::from(level.prefilter(&inputs.triple, &mut block.normal));
        }
        if !self.features[3].is_empty() {
            load_features(band, 3, x, y, &mut inputs.triple);
            block.filtered += u64::from(level.prefilter(&inputs.triple, &mut block.albedo));
        }
        if !self.features[6].is_empty() {
            load_features(band, 6, x, y, &mut inputs.single);
            block.filtered += u64::from(level.prefilter(&inputs.single, &mut block.depth));
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

impl Block {
    const EMPTY: Self = Self {
        prepared: PreparedBlock::EMPTY,
        normal: FilteredGroup::ZERO,
        albedo: FilteredGroup::ZERO,
        depth: FilteredGroup::ZERO,
        filtered: 0,
    };
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

fn load_colours(band: &HeldRows, x: usize, y: isize, block: &mut ColourBlock) {
    const WIDTH: usize = ColourBlock::WIDTH;
    let first = x as isize - PREPARE_HALO as isize;
    for row in 0..ColourBlock::HEIGHT {
        let from_row = y + row as isize - PREPARE_HALO as isize;
        let (colours, guides) = (band.colours(from_row), band.guides(from_row));
        copy_clamped(&guides.luminance, first, &mut block.luminance[row][..WIDTH]);
        copy_clamped(&guides.variance, first, &mut block.variance[row][..WIDTH]);
        copy_clamped(&colours.good, first, &mut block.good[row][..WIDTH]);
    }
}

fn load_features<const N: usize>(
    band: &HeldRows,
    first_feature: usize,
    x: usize,
    y: isize,
    group: &mut FeatureGroup<N>,
) {
    let first = x as isize - PREFILTER_HALO as isize;
    for row in 0..FeatureGroup::<N>::HEIGHT {
        let from_row = y + row as isize - PREFILTER_HALO as isize;
        let source = band.guides(from_row);
        for c in 0..N {
            let k = first_feature + c;
            let value = &mut group.value[c][row][..FeatureGroup::<N>::WIDTH];
            band.copy_feature(k, first, from_row, value);
            let variance = &mut group.variance[c][row][..FeatureGroup::<N>::WIDTH];
            copy_clamped(&source.feature_variances[k], first, variance);
        }
    }
}
