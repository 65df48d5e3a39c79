//! Variances of rows whose source has none.

use std::ops::Range;

use linpred_core::{
    BLOCK_COLUMNS, BLOCK_HEIGHT, BLOCK_WIDTH, BlockPlane, FEATURES, FURTHER, MAX_FEATURES,
    NOISE_HALO, NoiseBlock, NoisePlane, NoisyBlock,
};
use linpred_dispatch::InstructionSet;
use rayon::prelude::*;

use crate::row::{RowLayout, VarianceKind};
use crate::stream::borders::{copy_mirrored, mirrored};
use crate::stream::held_rows::HeldRows;

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
    features: [bool; MAX_FEATURES],
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
    pub(crate) fn working_bytes(layout: &RowLayout, threads: u64) -> u64 {
        let wide = usize::from(layout.is_wide());
        let results = size_of::<Estimated>() + wide * FURTHER * size_of::<BlockPlane>();
        let planes = size_of::<NoisyBlock>() + wide * size_of::<NoisePlane>();
        threads * (BLOCKS_PER_THREAD * results + planes) as u64
    }

    /// Whether the variance of a feature that is known by its name is to be estimated.
    fn wants_features(self) -> bool {
        self.features[..FEATURES].contains(&true)
    }

    /// The channels of further features whose variances are to be estimated.
    fn further(self) -> impl Iterator<Item = usize> {
        (FEATURES..MAX_FEATURES).filter(move |k| self.features[*k])
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
                let blocks: Vec<Estimated> = wanted.par_iter().map(estimate).collect();
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
    ) -> Estimated {
        let block = Block::new(held, layout, (x, y));
        let mut known = Box::new(NoiseBlock::NONE);
        if colour || self.wants_features() {
            let input = block.load();
            if self.wants_features() {
                instruction_set.estimate_feature_noise(&input, &mut known);
            }
            if colour {
                instruction_set.estimate_colour_noise(&input, &mut known);
            }
        }
        let further = self.further().map(|k| {
            let mut variances = Box::new([[0.0; BLOCK_COLUMNS]; BLOCK_HEIGHT]);
            instruction_set.estimate_further_noise(&block.load_feature(k), &mut variances);
            (k, variances)
        });
        Estimated {
            known,
            further: further.collect(),
        }
    }

    fn store(
        self,
        held: &mut HeldRows,
        block: &Estimated,
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
                    variances.iter_mut().zip(&block.known.colour[y]).zip(good)
                {
                    if self.colour || variance.is_nan() {
                        *variance = estimate * good;
                    }
                }
            }
            let known = block.known.features.iter().enumerate();
            let known = known.filter(|(k, _)| self.features[*k]);
            let further = block.further.iter().map(|(k, plane)| (*k, &**plane));
            for (k, plane) in known.chain(further) {
                target.feature_variances[k][columns.clone()].copy_from_slice(&plane[y][..width]);
                target.find_noise(k);
            }
        }
    }
}

/// The variances of a block.
struct Estimated {
    known: Box<NoiseBlock>,
    /// Those of channels of further features, and which these are.
    further: Vec<(usize, Box<BlockPlane>)>,
}

/// A block of the rows that are held, which its planes are loaded from.
struct Block<'a> {
    held: &'a HeldRows,
    /// The first column of its halo.
    column: isize,
    /// The rows that its rows and those of its halo are taken from.
    rows: [isize; NoisyBlock::HEIGHT],
}

impl<'a> Block<'a> {
    /// The block from (x, y) on.
    fn new(held: &'a HeldRows, layout: &RowLayout, (x, y): (usize, usize)) -> Self {
        let height = layout.size.height();
        // Rows beyond the halo of those that are wanted may not be held, below the last or mirrored to above the first: any will do
        // whose neighbours are, from which a missing feature is filled.
        let first = match held.first() {
            0 => 0,
            first => first + 1,
        };
        let last = if held.next() == height {
            height - 1
        } else {
            held.next() - 2
        };
        Self {
            held,
            column: x as isize - NOISE_HALO as isize,
            rows: std::array::from_fn(|row| {
                let wanted = mirrored((y + row) as isize - NOISE_HALO as isize, height);
                wanted.clamp(first, last) as isize
            }),
        }
    }

    /// The colour and the features that are known by their names.
    fn load(&self) -> Box<NoisyBlock> {
        let mut block = Box::new(NoisyBlock::BLACK);
        for (row, &y) in self.rows.iter().enumerate() {
            let source = self.held.colours(y);
            for (plane, colour) in block.colour.iter_mut().zip(&source.colour) {
                let target = &mut plane[row][..NoisyBlock::WIDTH];
                copy_mirrored(colour, self.column, target);
            }
        }
        for (k, plane) in block.features.iter_mut().enumerate() {
            self.copy_feature(k, plane);
        }
        block
    }

    /// A channel of a feature.
    fn load_feature(&self, k: usize) -> Box<NoisePlane> {
        let [zeros, ..] = NoisyBlock::BLACK.colour;
        let mut plane = Box::new(zeros);
        self.copy_feature(k, &mut plane);
        plane
    }

    fn copy_feature(&self, k: usize, plane: &mut NoisePlane) {
        for (own, &y) in plane.iter_mut().zip(&self.rows) {
            let target = &mut own[..NoisyBlock::WIDTH];
            self.held.copy_feature_mirrored(k, self.column, y, target);
        }
    }
}
