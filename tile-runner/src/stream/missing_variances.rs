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

/// Which variances to estimate.
#[derive(Clone, Copy)]
pub(crate) struct Missing {
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

    /// Rows that must be held around an estimated one.
    pub(crate) fn halo(self) -> usize {
        // A missing feature is filled from its neighbours, hence the 1.
        if self.colour || self.features.contains(&true) {
            NOISE_HALO + 1
        } else {
            0
        }
    }

    /// Bytes that estimating takes, on `threads` threads.
    pub(crate) fn working_bytes(self, threads: u64) -> u64 {
        if self.halo() == 0 {
            return 0;
        }
        threads * (BLOCKS_PER_THREAD * size_of::<NoiseBlock>() + size_of::<NoisyBlock>()) as u64
    }

    /// Estimates the variances of `rows`, all of whose neighbours within the halo are held.
    pub(crate) fn fill(
        self,
        held: &mut HeldRows,
        layout: &RowLayout,
        rows: Range<usize>,
        instruction_set: InstructionSet,
    ) {
        if self.halo() == 0 {
            return;
        }
        for first in rows.clone().step_by(BLOCK_HEIGHT) {
            let end = rows.end.min(first + BLOCK_HEIGHT);
            let columns: Vec<usize> = (0..layout.size.width()).step_by(BLOCK_WIDTH).collect();
            for columns in columns.chunks(BLOCKS_PER_THREAD * rayon::current_num_threads()) {
                let from: &HeldRows = held;
                let blocks: Vec<Box<NoiseBlock>> = columns
                    .par_iter()
                    .map(|&x| self.estimate(from, layout, x, first, instruction_set))
                    .collect();
                for (block, &x) in blocks.iter().zip(columns) {
                    self.store(
                        held,
                        block,
                        x..layout.size.width().min(x + BLOCK_WIDTH),
                        first..end,
                    );
                }
            }
        }
    }

    fn estimate(
        self,
        held: &HeldRows,
        layout: &RowLayout,
        x: usize,
        y: usize,
        instruction_set: InstructionSet,
    ) -> Box<NoiseBlock> {
        let input = load(held, layout, x, y);
        let mut block = Box::new(NoiseBlock::NONE);
        if self.features.contains(&true) {
            instruction_set.estimate_feature_noise(&input, &mut block);
        }
        if self.colour {
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
    ) {
        let width = columns.len();
        for (y, row) in rows.enumerate() {
            let (target, colours) = held.variances_mut(row);
            if self.colour {
                let good = &colours.good[columns.clone()];
                let variances = &mut colours.variance[columns.clone()];
                for ((variance, estimate), good) in
                    variances.iter_mut().zip(&block.colour[y]).zip(good)
                {
                    *variance = estimate * good;
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
