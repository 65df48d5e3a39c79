//! What a run counts.

use std::time::Duration;

use linpred_core::PixelState;

use crate::stream::held_rows::ColourRow;

/// What a run did, and what it could leave.
#[derive(Clone, Copy, Debug, Default)]
#[non_exhaustive]
pub struct Report {
    /// What was worked on and what was skipped.
    pub counts: Counts,
    /// Models that were built.
    pub models: u64,
    /// Time that threads spent on the cells that were not skipped, added up over the threads.
    pub fitting: Duration,
}

impl Report {
    /// Adds the report of another picture.
    pub fn add(&mut self, other: &Self) {
        let (own, more) = (&mut self.counts, &other.counts);
        own.pixels += more.pixels;
        own.cells += more.cells;
        own.cells_skipped += more.cells_skipped;
        own.feature_blocks += more.feature_blocks;
        own.feature_blocks_skipped += more.feature_blocks_skipped;
        own.add_rows(more);
        self.models += other.models;
        self.fitting += other.fitting;
    }

    /// What the skipped cells would have taken of a thread's time, had each taken the mean of the others. `None` where none was skipped, or
    /// none was fitted that would tell.
    pub fn saved(&self) -> Option<Duration> {
        let skipped = self.counts.cells_skipped;
        let fitted = self.counts.cells - skipped;
        (skipped > 0 && fitted > 0).then(|| self.fitting.mul_f64(skipped as f64 / fitted as f64))
    }
}

/// What of an image a run works on, and what it skips. It depends on the image alone, not on the quality or on threads; the papers'
/// formulas skip no cell and know no fireflies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Counts {
    /// Pixels of the image.
    pub pixels: u64,
    /// Pixels of zero variance, and black ones where the features say that nothing is there, passed through as they came.
    pub passed_through: u64,
    /// Pixels with a NaN or infinite colour, predicted from their neighbours.
    pub repaired: u64,
    /// Pixels far brighter than all around by no more than a sample, predicted from their neighbours.
    pub fireflies: u64,
    /// Pixels of an image with variances that have none that is known: theirs is estimated from the picture.
    pub estimated: u64,
    /// Cells of 19 x 19 pixels.
    pub cells: u64,
    /// Of those, the ones that hold no noise: nothing is fitted in them.
    pub cells_skipped: u64,
    /// Blocks of features: a normal, an albedo or a depth each.
    pub feature_blocks: u64,
    /// Of those, the ones with no noise in reach: they are not filtered.
    pub feature_blocks_skipped: u64,
}

impl Counts {
    /// Counts pixel `x` of a row, which is in this state.
    pub(crate) fn add_pixel(&mut self, state: PixelState, row: &ColourRow, x: usize) {
        let is_firefly = row.firefly[x];
        self.passed_through += u64::from(state == PixelState::Clean);
        self.repaired += u64::from(state == PixelState::Bad && !is_firefly);
        self.fireflies += u64::from(is_firefly);
        self.estimated += u64::from(row.estimated[x]);
    }

    /// Adds what was counted in rows of the same image.
    pub(crate) fn add_rows(&mut self, rows: &Self) {
        self.passed_through += rows.passed_through;
        self.repaired += rows.repaired;
        self.fireflies += rows.fireflies;
        self.estimated += rows.estimated;
    }
}
