//! The stages before the fit, for some rows of cells after others: rows read, fireflies taken out, variances estimated, weights and features prepared.
//!
//! What a run can skip is known from here on, so a survey of an image goes through the same stages as a run and counts what that
//! will skip (see [`Counts`]).

use std::num::NonZeroUsize;
use std::ops::Range;

use linpred_core::{CELL, FIREFLY_HALO, HALO, Params};
use linpred_dispatch::InstructionSet;

use crate::error::Error;
use crate::row::{InputRow, RowLayout, RowSource};
use crate::stream::fireflies::Fireflies;
use crate::stream::held_rows::{ColourRow, GuideRow, HeldRows};
use crate::stream::missing_variances::{MISSING_HALO, Missing};
use crate::stream::neighbourhood::{Neighbourhood, prepared_from};
use crate::stream::prepared_rows::{BLOCK_HALO, BlockBench, PreparedRows};
use crate::stream::report::Counts;

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
    /// The pieces of prepared rows that the current rows of cells read: one more than there are rows.
    prepared: Vec<PreparedRows>,
    benches: Vec<Box<BlockBench>>,
    input: InputRow,
}

impl Preparation {
    /// Nothing of an image yet, to be prepared on `threads` threads for at most `cell_rows` rows of cells at a time. Models may vary in the features that they see; the papers' formulas
    /// know of no fireflies.
    pub(crate) fn new(
        layout: RowLayout,
        params: &Params,
        (threads, cell_rows): (NonZeroUsize, usize),
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
            prepared: (0..=cell_rows)
                .map(|_| PreparedRows::new(&layout, params.vary_features))
                .collect(),
            benches: (0..threads.get())
                .map(|_| BlockBench::new(&layout, params.vary_features))
                .collect(),
            input: InputRow::new(&layout),
        }
    }

    /// Bytes that it takes at most, on `threads` threads for so many rows of cells at a time.
    pub(crate) fn bytes(layout: &RowLayout, threads: u64, cell_rows: usize, vary: bool) -> u64 {
        let below = (cell_rows + 1) * CELL + INPUT_HALO;
        [
            ColourRow::bytes(layout, HALO + below),
            GuideRow::bytes(layout, guides_above(vary) + below),
            Fireflies::bytes(layout),
            PreparedRows::bytes(layout, vary).saturating_mul(cell_rows as u64 + 1),
            InputRow::bytes(layout),
            Missing::working_bytes(layout, threads),
            threads.saturating_mul(BlockBench::bytes(layout)),
        ]
        .into_iter()
        .fold(0, u64::saturating_add)
    }

    /// Reads all that these rows of cells depend on.
    pub(crate) fn read(
        &mut self,
        source: &mut dyn RowSource,
        cells: &Range<usize>,
    ) -> Result<(), Error> {
        let end = needed(cells) + INPUT_HALO;
        while self.held.next() < end.min(self.layout.size.height()) {
            source.read_row(self.held.next(), &mut self.input)?;
            self.held.push(&self.input);
            if let Some(fireflies) = &mut self.fireflies {
                fireflies.follow(&mut self.held);
            }
        }
        Ok(())
    }

    /// Works out what these rows of cells lack, once it is read; counts feature blocks.
    pub(crate) fn prepare(&mut self, cells: &Range<usize>, counts: &mut Counts) {
        self.estimate(needed(cells));
        let first = if cells.start == 0 { 0 } else { cells.start + 1 };
        let height = self.layout.size.height() as isize;
        let pieces = (first..=cells.end).filter(|piece| prepared_from(*piece) < height);
        let pieces: Vec<_> = self.prepared[first - cells.start..]
            .iter_mut()
            .zip(pieces)
            .map(|(prepared, piece)| (prepared_from(piece), prepared))
            .collect();
        let filled =
            PreparedRows::fill(pieces, &self.held, self.instruction_set, &mut self.benches);
        counts.feature_blocks += filled.feature_blocks;
        counts.feature_blocks_skipped += filled.skipped;
    }

    /// Estimates the variances that the source lacks, up to row `end` or the last.
    fn estimate(&mut self, end: usize) {
        let rows = self.estimated..end.min(self.layout.size.height());
        self.estimated = rows.end;
        self.missing
            .fill(&mut self.held, &self.layout, rows, self.instruction_set);
    }

    /// What these rows of cells read.
    pub(crate) fn around(&self, cells: &Range<usize>) -> Neighbourhood<'_> {
        Neighbourhood {
            size: self.layout.size,
            held: &self.held,
            prepared: &self.prepared,
            cells: cells.clone(),
        }
    }

    /// Moves on to the rows of cells after these.
    pub(crate) fn advance(&mut self, cells: &Range<usize>) {
        self.prepared.rotate_left(cells.len());
        let next = cells.end * CELL;
        self.held
            .drop_before(next - HALO, next - guides_above(self.vary));
    }
}

/// Rows around others that must be there before anything is made of them: variances are estimated from some, and fireflies are told by
/// those around each.
pub(crate) const INPUT_HALO: usize = MISSING_HALO + FIREFLY_HALO;

/// The end of the rows that these rows of cells depend on, beside [`INPUT_HALO`].
fn needed(cells: &Range<usize>) -> usize {
    cells.end * CELL + LOOK_BELOW
}
