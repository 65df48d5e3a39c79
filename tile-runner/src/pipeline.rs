//! From rows to rows, through a moving band.
//!
//! ```text
//! rows of input           19 k - 9 ................................ 19 (k + 2)     HeldRows (+ 5 to estimate variances)
//!   weights, prefilter      19 k - 10 ............... 19 (k + 1) + 9                 2 x PreparedRows
//!     cells of row k          19 k - 9 ............. 19 (k + 1) + 9                   SumRows
//!       rows of output          19 k - 9 .. 19 (k + 1) - 9
//! ```
//!
//! Row k of cells needs the rows that its windows reach prepared, and those need a halo of their own. Once its
//! predictions are added up, no later cell reaches the rows before `19 (k + 1) - 9`, and they leave.

use std::num::NonZeroUsize;
use std::ops::ControlFlow;

use linpred_core::{CELL, HALO, Params, PixelState, resolve, resolve_layer};

use crate::blocks::{BLOCK_HALO, PreparedRows};
use crate::cells::{Neighbourhood, SumRows, prepared_from};
use crate::dispatch::Level;
use crate::error::Error;
use crate::geometry::plane_bytes;
use crate::held_rows::{ColourRow, GuideRow, HeldRows};
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

/// What a run did, and what it could leave.
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
    /// Cells of 19 x 19 pixels.
    pub cells: u64,
    /// Of those, the ones that hold no noise: nothing is fitted in them.
    pub cells_skipped: u64,
    /// Blocks of features: a normal, an albedo or a depth each.
    pub feature_blocks: u64,
    /// Of those, the ones with no noise in reach: they are not filtered.
    pub feature_blocks_skipped: u64,
}

/// Rows below a row of cells that its pixels depend on, beside those that variances are estimated from.
const LOOK_BELOW: usize = HALO + BLOCK_HALO;

/// Rows above or below a pixel that it can depend on, for an image whose rows hold `layout`: it lies in the halo of a cell, the
/// cell's windows reach as far again, and what they read was prepared from a halo of its own.
pub fn reach(layout: &RowLayout) -> usize {
    // counted from a pixel of the halo: to the far edge of the cell, and what lies beyond that
    HALO + CELL + LOOK_BELOW + Missing::of(layout).halo()
}

/// Bytes that denoising an image takes at most, beside the source and the sink.
pub fn bytes(layout: &RowLayout, threads: NonZeroUsize) -> u64 {
    let missing = Missing::of(layout);
    let below = 2 * CELL + missing.halo();
    let colours = plane_bytes(layout.size, HALO + below, ColourRow::planes(layout));
    let guides = plane_bytes(layout.size, GUIDES_ABOVE + below, GuideRow::planes(layout));
    let threads = threads.get() as u64;
    let working = missing
        .working_bytes(threads)
        .max(PreparedRows::working_bytes(threads));
    [
        colours,
        guides,
        PreparedRows::bytes(layout).saturating_mul(2),
        SumRows::bytes(layout, threads),
        InputRow::bytes(layout),
        OutputRow::bytes(layout),
        working,
        threads.saturating_mul(STACK as u64),
    ]
    .into_iter()
    .fold(0, u64::saturating_add)
}

/// Bytes of stack that a thread touches (the core declares 30 KiB; measured with what calls it).
const STACK: usize = 256 << 10;

/// Rows above the next row of cells of which more than the colours is held: what is prepared next begins
/// a halo below the top of those cells.
const GUIDES_ABOVE: usize = BLOCK_HALO - HALO;

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
    let mut frame = Frame::new(source.layout(), options);
    let height = frame.layout.size.height();
    for row in 0..height.div_ceil(CELL) {
        let needed = (row + 1) * CELL + LOOK_BELOW;
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
    /// The two pieces of prepared rows that the current row of cells reads.
    prepared: [PreparedRows; 2],
    sums: SumRows,
    input: InputRow,
    output: OutputRow,
    written: usize,
    report: Report,
}

impl Frame {
    fn new(layout: RowLayout, options: &Options) -> Self {
        Self {
            layout,
            params: options.params,
            level: Level::detect(),
            missing: Missing::of(&layout),
            estimated: 0,
            band: HeldRows::new(layout),
            prepared: std::array::from_fn(|_| PreparedRows::new(&layout)),
            sums: SumRows::new(&layout, options.threads),
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
        for piece in first..=row + 1 {
            let from = prepared_from(piece);
            if from < self.layout.size.height() as isize {
                let filled = self.prepared[piece - row].fill(&self.band, from, self.level);
                self.report.feature_blocks += filled.feature_blocks;
                self.report.feature_blocks_skipped += filled.skipped;
            }
        }
        let around = Neighbourhood {
            size: self.layout.size,
            band: &self.band,
            prepared: &self.prepared,
            row,
        };
        let predicted = self.sums.predict(&around, &self.params, self.level);
        self.report.models += predicted.models;
        self.report.cells += predicted.cells;
        self.report.cells_skipped += predicted.skipped;
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
        let around = Neighbourhood {
            size: self.layout.size,
            band: &self.band,
            prepared: &self.prepared,
            row,
        };
        for (x, sum) in self.sums.row(y).iter().enumerate() {
            let pixel = around.pixel::<0>(x, y);
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
                    &self.band.colours(y as isize).layers[k],
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
        let next = (row + 1) * CELL;
        self.band.drop_before(next - HALO, next - GUIDES_ABOVE);
    }
}
