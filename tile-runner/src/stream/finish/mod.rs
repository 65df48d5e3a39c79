//! The stages after the blend, from rows to rows: each works on what the one before has finished, and on rows around that.
//!
//! ```text
//! blended rows                        BlendedRows
//!   what pixels may differ by           2 rows behind    Pass
//!     smoothed                            3 behind
//!   what pixels may differ by           1 behind         Pass
//!     smoothed                            12 behind
//!   specks taken out                    1 behind         ClearedRow
//!     rows of output                      16 behind        FinishedRow
//! ```
//!
//! So a row comes out [`LOOK_BELOW`] rows after it went in. Each stage has a ring of rows, which lets go of those that no later one reads.

mod blended_rows;
mod cleared_rows;
mod finished_row;
pub(crate) mod planes;
mod smoothing;

use linpred_core::{DESPECKLE_RADIUS, ERROR_RADIUS, MEAN_RADIUS, RESTORE_RADIUS, SMOOTHINGS};
use linpred_dispatch::InstructionSet;
use rayon::prelude::*;

use crate::row::{OutputRow, RowLayout};
use crate::stream::finish::blended_rows::{BlendedRows, Guides, Own, Rest};
use crate::stream::finish::cleared_rows::ClearedRow;
use crate::stream::finish::finished_row::FinishedRow;
use crate::stream::finish::planes::{Radiance, padded_bytes};
use crate::stream::finish::smoothing::Pass;
use crate::stream::neighbourhood::PixelRow;
use crate::stream::row_ring::RowRing;

/// Rows from one to its farthest neighbour in each pass.
const REACH: [usize; SMOOTHINGS.len()] = [SMOOTHINGS[0].reach(), SMOOTHINGS[1].reach()];
/// Rows below one that the first pass needs, and the second of what the first has smoothed.
const FIRST: usize = ERROR_RADIUS + REACH[0];
const SECOND: usize = MEAN_RADIUS + REACH[1];
const _: () = assert!(MEAN_RADIUS <= ERROR_RADIUS && ERROR_RADIUS <= MEAN_RADIUS + FIRST);

/// Rows above or below one that it depends on.
pub(crate) const LOOK_BELOW: usize = FIRST + SECOND + DESPECKLE_RADIUS + RESTORE_RADIUS;

/// The end of the rows that are ready in an image of `height` rows, where each needs `below` rows below it of the stage before,
/// which has finished those before `next`.
fn ready(next: usize, below: usize, height: usize) -> usize {
    if next == height {
        height
    } else {
        next.saturating_sub(below)
    }
}

/// What is in memory of an image after the blend.
pub(crate) struct Finish {
    instruction_set: InstructionSet,
    blended: BlendedRows,
    passes: [Pass; SMOOTHINGS.len()],
    cleared: RowRing<ClearedRow>,
    /// The row after the last that has been finished.
    next: usize,
    /// Rows that are finished at a time.
    finished: Vec<FinishedRow>,
    /// Of those, the ones that are.
    ready: usize,
}

impl Finish {
    /// Nothing of an image yet, whose rows will come in batches of at most `batch`.
    pub(crate) fn new(layout: RowLayout, batch: usize, instruction_set: InstructionSet) -> Self {
        Self {
            instruction_set,
            blended: BlendedRows::new(layout),
            passes: SMOOTHINGS.map(|pass| Pass::new(pass, &layout, instruction_set)),
            cleared: RowRing::new(),
            next: 0,
            finished: (0..batch).map(|_| FinishedRow::new(&layout)).collect(),
            ready: 0,
        }
    }

    /// Bytes that it takes at most.
    pub(crate) fn bytes(layout: &RowLayout, batch: usize) -> u64 {
        let radiance = Radiance::planes(layout);
        // Rows from the first that a later one reads to the last that is there, beside the batch that was added.
        let rings = [
            (radiance, REACH[0] + FIRST),
            (Guides::planes(layout), REACH[1] + FIRST + SECOND),
            (Own::planes(layout), FIRST + SECOND + DESPECKLE_RADIUS),
            (Rest::planes(layout), LOOK_BELOW),
            (Pass::PRECISION_PLANES, 2 * REACH[0]),
            (Pass::PRECISION_PLANES, 2 * REACH[1]),
            (radiance, REACH[1] + SECOND),
            (radiance, 2 * DESPECKLE_RADIUS),
            (ClearedRow::planes(layout), 2 * RESTORE_RADIUS),
            (FinishedRow::planes(layout), 0),
        ];
        let planes = rings.map(|(planes, rows)| planes * (rows + batch));
        padded_bytes(
            layout.size.width(),
            planes.iter().sum::<usize>() + SMOOTHINGS.len(),
        )
    }

    /// Takes the next rows, as the blend has left them and as they came, and [advances](Self::advance).
    pub(crate) fn push(&mut self, rows: &[(&OutputRow, PixelRow<'_>)]) {
        self.blended.push(rows);
        self.advance();
    }

    /// The rows that were finished last.
    pub(crate) fn rows(&self) -> impl Iterator<Item = &OutputRow> {
        self.finished[..self.ready].iter().map(|row| &row.output)
    }

    /// Takes every stage on by a batch of rows, as far as there is enough of the one before.
    pub(crate) fn advance(&mut self) {
        let batch = self.finished.len();
        let (blended, [first, second]) = (&self.blended, &mut self.passes);
        first.advance(blended, &blended.radiance, batch);
        second.advance(blended, &first.smoothed, batch);
        cleared_rows::advance(
            &mut self.cleared,
            blended,
            &second.smoothed,
            batch,
            self.instruction_set,
        );
        let height = blended.layout.size.height();
        let end = ready(self.cleared.next(), RESTORE_RADIUS, height).min(self.next + batch);
        let rows = end - self.next;
        let (from, cleared, instruction_set) = (self.next, &self.cleared, self.instruction_set);
        let finished = self.finished[..rows].par_iter_mut().enumerate();
        finished.for_each(|(k, row)| row.fill(from + k, blended, cleared, instruction_set));
        self.next = end;
        self.ready = rows;
        self.drop_rows();
    }

    /// Lets go of what no later row needs.
    fn drop_rows(&mut self) {
        let [first, second] = &mut self.passes;
        let blended = &mut self.blended;
        blended.radiance.drop_before(first.first_read());
        blended.guides.drop_before(second.first_read());
        blended.own.drop_before(self.cleared.next());
        blended
            .rest
            .drop_before(self.next.min(second.first_error()));
        first.smoothed.drop_before(second.first_read());
        let despeckled = self.cleared.next().saturating_sub(DESPECKLE_RADIUS);
        second.smoothed.drop_before(despeckled);
        let restored = self.next.saturating_sub(RESTORE_RADIUS);
        self.cleared.drop_before(restored);
    }
}
