//! Variances of rows whose source has none.

use std::ops::Range;

use linpred_core::{BLOCK_HEIGHT, BLOCK_WIDTH, FEATURES, NOISE_HALO, NoiseBlock, NoisyBlock};
use rayon::prelude::*;

use crate::row::{RowLayout, VarianceKind};
use crate::stream::borders::{copy_mirrored, mirrored};
use crate::stream::held_rows::HeldRows;
use crate::stream::instruction_set::InstructionSet;

/// Blocks that each thread estimates before their results are stored.
const BLOCKS_PER_THREAD: usize = 4;

/// Rows that must be held around one whose variances are estimated. A missing feature is filled from its neighbours, hence the 1. Any image may have pixels
/// of unknown variance.
pub(crate) const MISSING_HALO: usize = NOISE_HALO + 1;

/// Which variances to estimate.
#[derive(Clone, Copy)]
pub(crate) struct Missing {
    /// Those of the colour, at every pixel; at those that have none otherwise.
    colour: bool,
    features: [bool; FEATURES],
}

impl Missing {
    /// What `layout` lacks: a feature that is there without a variance needs one.
    pub(crate) fn of(layout: &RowLayout) -> Self {
        Self {
            colour: layout.variance == VarianceKind::Estimated,
            features: std::array::from_fn(|k| layout.features[k] && !layout.feature_variances[k]),
        }
    }

    /// Bytes that estimating takes, on `threads` threads.
    pub(crate) fn working_bytes(threads: u64) -> u64 {
        threads * (BLOCKS_PER_THREAD * size_of::<NoiseBlock>() + size_of::<NoisyBlock>()) as u64
    }

    /// Whether the colour's variances are to be estimated in a block.
    fn wants_colour(self, held: &HeldRows, columns: Range<usize>, rows: Range<usize>) -> bool {
        let unknown = |y: usize| {
            let variance = &held.colours(y as isize).variance[columns.clone()];
            variance.iter().any(|v| v.is_nan())
        };
        self.colour || rows.into_iter().any(unknown)
    }

    /// Estimates the variances of `rows`, all of whose neighbours within the halo are held.
    pub(crate) fn fill(
        self,
        held: &mut HeldRows,
        layout: &RowLayout,
        rows: Range<usize>,
        instruction_set: InstructionSet,
    ) {
        let width = layout.size.width();
        for first in rows.clone().step_by(BLOCK_HEIGHT) {
            let end = rows.end.min(first + BLOCK_HEIGHT);
            let features = self.features.contains(&true);
            let block = |x: usize| {
                let columns = x..width.min(x + BLOCK_WIDTH);
                let colour = self.wants_colour(held, columns.clone(), first..end);
                (columns, colour)
            };
            let blocks = (0..width).step_by(BLOCK_WIDTH).map(block);
            let wanted: Vec<_> = blocks.filter(|(_, colour)| *colour || features).collect();
            for wanted in wanted.chunks(BLOCKS_PER_THREAD * rayon::current_num_threads()) {
                let from: &HeldRows = held;
                let estimate = |(columns, colour): &(Range<usize>, bool)| {
                    self.estimate(
                        from,
                        layout,
                        (columns.start, first),
                        *colour,
                        instruction_set,
                    )
                };
                let blocks: Vec<Box<NoiseBlock>> = wanted.par_iter().map(estimate).collect();
                for (block, (columns, colour)) in blocks.iter().zip(wanted) {
                    self.store(held, block, columns.clone(), first..end, *colour);
                }
            }
        }
    }

    fn estimate(
        self,
        held: &HeldRows,
        layout: &RowLayout,
        (x, y): (usize, usize),
        colour: bool,
        instruction_set: InstructionSet,
    ) -> Box<NoiseBlock> {
        let input = load(held, layout, x, y);
        let mut block = Box::new(NoiseBlock::NONE);
        if self.features.contains(&true) {
            instruction_set.estimate_feature_noise(&input, &mut block);
        }
        if colour {
            instruction_set.estimate_colour_noise(&input, &mut block);
        }
        block
    }

    fn store(
        self,
        held: &mut HeldRows,
        block: &NoiseBlock,
        columns: Range<usize>,
        rows: Range<usize>,
        colour: bool,
    ) {
        let width = columns.len();
        for (y, row) in rows.enumerate() {
            let (target, colours) = held.variances_mut(row);
            if colour {
                let good = &colours.good[columns.clone()];
                let variances = &mut colours.variance[columns.clone()];
                for ((variance, estimate), good) in
                    variances.iter_mut().zip(&block.colour[y]).zip(good)
                {
                    if self.colour || variance.is_nan() {
                        *variance = estimate * good;
                    }
                }
            }
            for k in (0..FEATURES).filter(|k| self.features[*k]) {
                target.feature_variances[k][columns.clone()]
                    .copy_from_slice(&block.features[k][y][..width]);
                target.find_noise(k);
            }
        }
    }
}

fn load(held: &HeldRows, layout: &RowLayout, x: usize, y: usize) -> Box<NoisyBlock> {
    let mut block = Box::new(NoisyBlock::BLACK);
    let size = layout.size;
    // Rows beyond the halo of those that are wanted may not be held, below the last or mirrored to above the first: any will do
    // whose neighbours are, from which a missing feature is filled.
    let first = match held.first() {
        0 => 0,
        first => first + 1,
    };
    let last = if held.next() == size.height() {
        size.height() - 1
    } else {
        held.next() - 2
    };
    for row in 0..NoisyBlock::HEIGHT {
        let wanted = mirrored((y + row) as isize - NOISE_HALO as isize, size.height());
        let from_row = wanted.clamp(first, last);
        let source = held.colours(from_row as isize);
        let column = x as isize - NOISE_HALO as isize;
        for (plane, colour) in block.colour.iter_mut().zip(&source.colour) {
            copy_mirrored(colour, column, &mut plane[row][..NoisyBlock::WIDTH]);
        }
        for (k, plane) in block.features.iter_mut().enumerate() {
            let target = &mut plane[row][..NoisyBlock::WIDTH];
            held.copy_feature_mirrored(k, column, from_row as isize, target);
        }
    }
    block
}
