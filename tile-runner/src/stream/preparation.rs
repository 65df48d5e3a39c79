//! The stages before the fit, for one row of cells after another: rows read, fireflies taken out, variances estimated, weights and features prepared.
//!
//! What a run can skip is known from here on, so a survey of an image goes through the same stages as a run and counts what that
//! will skip (see [`Counts`]).

use std::num::NonZeroUsize;

use linpred_core::{CELL, FIREFLY_HALO, HALO, Params};

use crate::error::Error;
use crate::row::{InputRow, RowLayout, RowSource};
use crate::stream::fireflies::Fireflies;
use crate::stream::held_rows::{ColourRow, GuideRow, HeldRows};
use crate::stream::missing_variances::{MISSING_HALO, Missing};
use crate::stream::neighbourhood::{Neighbourhood, prepared_from};
use crate::stream::prepared_rows::{BLOCK_HALO, BlockBench, PreparedRows};
use crate::stream::report::Counts;
use linpred_dispatch::InstructionSet;

/// Rows below a row of cells that its pixels depend on, beside [`INPUT_HALO`].
pub(crate) const LOOK_BELOW: usize = HALO + BLOCK_HALO;

/// Rows above the next row of cells of which more than the colours is held: what is prepared next begins
/// a halo below the top of those cells. Features as rendered are read by the cells themselves, a missing one from the row above, too.
const fn guides_above(vary: bool) -> usize {
    if vary { HALO + 1 } else { BLOCK_HALO - HALO }
}

/// What is in memory of an image's input.
pub(crate) struct Preparation {
    layout: RowLayout,
    instruction_set: InstructionSet,
    vary: bool,
    missing: Missing,
    /// Rows whose variances are there.
    estimated: usize,
    held: HeldRows,
    /// `None` where fireflies stay.
    fireflies: Option<Fireflies>,
    /// The two pieces of prepared rows that the current row of cells reads.
    prepared: [PreparedRows; 2],
    benches: Vec<Box<BlockBench>>,
    input: InputRow,
}

impl Preparation {
    /// Nothing of an image yet, to be prepared on `threads` threads. Models may vary in the features that they see; the papers' formulas
    /// know of no fireflies.
    pub(crate) fn new(
        layout: RowLayout,
        params: &Params,
        threads: NonZeroUsize,
        instruction_set: InstructionSet,
    ) -> Self {
        Self {
            layout,
            instruction_set,
            vary: params.vary_features,
            missing: Missing::of(&layout),
            estimated: 0,
            held: HeldRows::new(layout),
            fireflies: (!params.formulas.are_published()).then(|| Fireflies::new(&layout)),
            prepared: std::array::from_fn(|_| PreparedRows::new(&layout, params.vary_features)),
            benches: (0..threads.get())
                .map(|_| BlockBench::new(&layout, params.vary_features))
                .collect(),
            input: InputRow::new(&layout),
        }
    }

    /// Bytes that it takes at most, on `threads` threads.
    pub(crate) fn bytes(layout: &RowLayout, threads: u64, vary: bool) -> u64 {
        let below = 2 * CELL + INPUT_HALO;
        [
            ColourRow::bytes(layout, HALO + below),
            GuideRow::bytes(layout, guides_above(vary) + below),
            Fireflies::bytes(layout),
            PreparedRows::bytes(layout, vary).saturating_mul(2),
            InputRow::bytes(layout),
            Missing::working_bytes(layout, threads),
            threads.saturating_mul(BlockBench::bytes(layout)),
        ]
        .into_iter()
        .fold(0, u64::saturating_add)
    }

    /// Reads all that row `row` of cells depends on.
    pub(crate) fn read(&mut self, source: &mut dyn RowSource, row: usize) -> Result<(), Error> {
        let end = needed(row) + INPUT_HALO;
        while self.held.next() < end.min(self.layout.size.height()) {
            source.read_row(self.held.next(), &mut self.input)?;
            self.held.push(&self.input);
            if let Some(fireflies) = &mut self.fireflies {
                fireflies.follow(&mut self.held);
            }
        }
        Ok(())
    }

    /// Works out what row `row` of cells lacks, once it is read; counts feature blocks.
    pub(crate) fn prepare(&mut self, row: usize, counts: &mut Counts) {
        self.estimate(needed(row));
        let first = if row == 0 { 0 } else { row + 1 };
        for piece in first..=row + 1 {
            let from = prepared_from(piece);
            if from < self.layout.size.height() as isize {
                let prepared = &mut self.prepared[piece - row];
                let filled =
                    prepared.fill(&self.held, from, self.instruction_set, &mut self.benches);
                counts.feature_blocks += filled.feature_blocks;
                counts.feature_blocks_skipped += filled.skipped;
            }
        }
    }

    /// Estimates the variances that the source lacks, up to row `end` or the last.
    fn estimate(&mut self, end: usize) {
        let rows = self.estimated..end.min(self.layout.size.height());
        self.estimated = rows.end;
        self.missing
            .fill(&mut self.held, &self.layout, rows, self.instruction_set);
    }

    /// What row `row` of cells reads.
    pub(crate) fn around(&self, row: usize) -> Neighbourhood<'_> {
        Neighbourhood {
            size: self.layout.size,
            held: &self.held,
            prepared: &self.prepared,
            row,
        }
    }

    /// Moves on to the row of cells after `row`.
    pub(crate) fn advance(&mut self, row: usize) {
        self.prepared.rotate_left(1);
        let next = (row + 1) * CELL;
        self.held
            .drop_before(next - HALO, next - guides_above(self.vary));
    }
}

/// Rows around others that must be there before anything is made of them: variances are estimated from some, and fireflies are told by
/// those around each.
pub(crate) const INPUT_HALO: usize = MISSING_HALO + FIREFLY_HALO;

/// The end of the rows that row `row` of cells depends on, beside [`INPUT_HALO`].
fn needed(row: usize) -> usize {
    (row + 1) * CELL + LOOK_BELOW
}
