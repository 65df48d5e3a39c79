//! From rows to rows, through a moving band.
//!
//! ```text
//! rows of input          19 k - 9 ......................................... 19 (k + 2) + 10      HeldRows
//!   weights, prefilter     19 (k - 1) .................. 19 (k + 2)                              3 x PreparedRows
//!     cells of row k         19 k - 9 ......... 19 (k + 1) + 9                                   SumRows
//!       rows of output         19 k - 9 .. 19 (k + 1) - 9
//! ```
//!
//! Row k of cells needs the rows of cells above and below it prepared, and those need their halo. Once its
//! predictions are added up, no later cell reaches the rows before `19 (k + 1) - 9`, and they leave.

use std::num::NonZeroUsize;
use std::ops::ControlFlow;

use linpred_core::{CELL, HALO, Params, PixelState, resolve, resolve_layer};

use crate::blocks::{BLOCK_HALO, PreparedRows};
use crate::cells::{Neighbourhood, SumRows};
use crate::dispatch::Level;
use crate::error::Error;
use crate::held_rows::HeldRows;
use crate::noise::Missing;
use crate::row::{InputRow, OutputRow, RowLayout, RowSink, RowSource};

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
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(options.threads.get())
        .build();
    let pool =
        pool.map_err(|e| Error::Budget(format!("can't start {} threads: {e}", options.threads)))?;
    let mut frame = Frame::new(source.layout(), options.params);
    let height = frame.layout.size.height();
    for row in 0..height.div_ceil(CELL) {
        let needed = (row + 2) * CELL + BLOCK_HALO;
        frame.read(source, needed + frame.missing.halo())?;
        pool.install(|| {
            frame.estimate(needed);
            frame.compute(row);
        });
        let done = if (row + 1) * CELL >= height {
            height
        } else {
            (row + 1) * CELL - HALO
        };
        frame.write(sink, row, done, progress)?;
        frame.advance(row);
    }
    Ok(frame.report)
}

/// What is in memory of an image.
struct Frame {
    layout: RowLayout,
    params: Params,
    level: Level,
    missing: Missing,
    /// Rows whose variances are there.
    estimated: usize,
    band: HeldRows,
    /// Prepared rows of the cells above, at and below the current row.
    prepared: [PreparedRows; 3],
    sums: SumRows,
    input: InputRow,
    output: OutputRow,
    written: usize,
    report: Report,
}

impl Frame {
    fn new(layout: RowLayout, params: Params) -> Self {
        Self {
            layout,
            params,
            level: Level::detect(),
            missing: Missing::of(&layout),
            estimated: 0,
            band: HeldRows::new(layout),
            prepared: std::array::from_fn(|_| PreparedRows::new(layout.size)),
            sums: SumRows::new(&layout),
            input: InputRow::new(&layout),
            output: OutputRow::new(&layout),
            written: 0,
            report: Report {
                pixels: layout.size.pixels(),
                ..Report::default()
            },
        }
    }

    /// Reads up to row `end` or the last.
    fn read(&mut self, source: &mut dyn RowSource, end: usize) -> Result<(), Error> {
        while self.band.next() < end.min(self.layout.size.height()) {
            source.read_row(self.band.next(), &mut self.input)?;
            self.band.push(&self.input);
        }
        Ok(())
    }

    /// Estimates the variances that the source lacks, up to row `end` or the last.
    fn estimate(&mut self, end: usize) {
        let rows = self.estimated..end.min(self.layout.size.height());
        self.estimated = rows.end;
        self.missing
            .fill(&mut self.band, &self.layout, rows, self.level);
    }

    /// Prepares what row `row` of cells lacks, and predicts it.
    fn compute(&mut self, row: usize) {
        let first = if row == 0 { 0 } else { row + 1 };
        for prepared in first..=row + 1 {
            if prepared * CELL < self.layout.size.height() {
                let rows = &mut self.prepared[prepared + 1 - row];
                rows.fill(&self.band, self.layout.size, prepared * CELL, self.level);
            }
        }
        let [above, own, below] = &self.prepared;
        let around = Neighbourhood {
            size: self.layout.size,
            band: &self.band,
            prepared: [above, own, below],
            row,
        };
        self.report.models += self.sums.predict(&around, &self.params, self.level);
    }

    /// Writes the rows before `end`.
    fn write(
        &mut self,
        sink: &mut dyn RowSink,
        row: usize,
        end: usize,
        progress: &mut dyn FnMut(usize) -> ControlFlow<()>,
    ) -> Result<(), Error> {
        while self.written < end {
            self.resolve_row(row, self.written);
            sink.write_row(self.written, &self.output)?;
            self.written += 1;
            if progress(self.written).is_break() {
                return Err(Error::Cancelled);
            }
        }
        Ok(())
    }

    fn resolve_row(&mut self, row: usize, y: usize) {
        let [above, own, below] = &self.prepared;
        let around = Neighbourhood {
            size: self.layout.size,
            band: &self.band,
            prepared: [above, own, below],
            row,
        };
        for (x, sum) in self.sums.row(y).iter().enumerate() {
            let pixel = around.pixel(x, y);
            self.report.passed_through += u64::from(pixel.state == PixelState::Clean);
            self.report.repaired += u64::from(pixel.state == PixelState::Bad);
            let denoised = resolve(&pixel, sum, self.params.formulas);
            for (plane, value) in self.output.colour.iter_mut().zip(denoised.colour) {
                plane[x] = value;
            }
            self.output.error[x] = denoised.error;
            self.output.radius[x] = denoised.radius;
            self.output.rank[x] = denoised.rank;
            for (k, layer) in self.output.layers.iter_mut().enumerate() {
                let (sums, own) = (
                    self.sums.layer_row(k, y)[x],
                    &self.band.row(y as isize).layers[k],
                );
                for (c, plane) in layer.iter_mut().enumerate() {
                    plane[x] = resolve_layer(&pixel, sum, self.params.formulas, sums[c], own[c][x]);
                }
            }
        }
    }

    /// Moves on to the next row of cells.
    fn advance(&mut self, row: usize) {
        self.sums.advance();
        self.prepared.rotate_left(1);
        self.band
            .drop_before(((row + 1) * CELL).saturating_sub(BLOCK_HALO + self.missing.halo()));
    }
}
