//! From rows to rows.

use std::num::NonZeroUsize;
use std::ops::ControlFlow;

use linpred_core::Params;

use crate::error::Error;
use crate::row::{InputRow, OutputRow, RowSink, RowSource};

/// How to run.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// What to compute.
    pub params: Params,
    /// Threads that compute; the output's bits do not depend on it.
    pub threads: NonZeroUsize,
}

/// What a run did, in counts of pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// Pixels of the image.
    pub pixels: u64,
    /// Models that were built.
    pub models: u64,
    /// Pixels of zero variance, passed through as they came.
    pub passed_through: u64,
    /// Pixels with a NaN or infinite colour, predicted from their neighbours.
    pub repaired: u64,
}

/// Denoises every row of `source` into `sink`. `progress` is told how many rows have been written after each; when it
/// breaks, the run ends with [`Error::Cancelled`].
pub fn denoise(
    source: &mut dyn RowSource,
    sink: &mut dyn RowSink,
    options: &Options,
    progress: &mut dyn FnMut(usize) -> ControlFlow<()>,
) -> Result<Report, Error> {
    let _ = options;
    let layout = source.layout();
    let mut input = InputRow::new(&layout);
    for y in 0..layout.size.height() {
        source.read_row(y, &mut input)?;
        let width = layout.size.width();
        let output = OutputRow {
            colour: input.colour.clone(),
            error: vec![0.0; width],
            radius: vec![0.0; width],
            rank: vec![0.0; width],
            layers: input.layers.clone(),
        };
        sink.write_row(y, &output)?;
        if progress(y + 1).is_break() {
            return Err(Error::Cancelled);
        }
    }
    Ok(Report {
        pixels: layout.size.pixels(),
        ..Report::default()
    })
}
