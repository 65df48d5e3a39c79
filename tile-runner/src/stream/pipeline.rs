//! From rows to rows, through the few that are held.
//!
//! ```text
//! rows of input           19 k - 9 ................................ 19 (k + 2)     HeldRows (+ 4 to tell fireflies, + 5 to estimate variances)
//!   weights, prefilter      19 k - 10 ............... 19 (k + 1) + 9                 2 x PreparedRows
//!     cells of row k          19 k - 9 ............. 19 (k + 1) + 9                   SumRows
//!       rows of output          19 k - 9 .. 19 (k + 1) - 9
//! ```
//!
//! Row k of cells needs the rows that its windows reach prepared, and those need a halo of their own. Once its
//! predictions are added up, no later cell reaches the rows before `19 (k + 1) - 9`, and they leave.

use std::num::NonZeroUsize;
use std::ops::ControlFlow;

use linpred_core::{CELL, HALO, Params};
use rayon::ThreadPool;
use rayon::prelude::*;

use crate::error::Error;
use crate::row::{OutputRow, RowLayout, RowSink, RowSource};
use crate::stream::instruction_set::InstructionSet;
use crate::stream::preparation::{LOOK_BELOW, Preparation, halo};
use crate::stream::report::{Counts, Report};
use crate::stream::resolved_row::{ROWS_PER_THREAD, ResolvedRow};
use crate::stream::row_of_cells::CellBenches;
use crate::stream::sum_rows::SumRows;
use crate::stream::threads::{pool, stack_bytes};

/// How to run: what to compute, and on how many threads.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Options {
    /// What to compute.
    pub params: Params,
    /// Threads that compute; the output's bits do not depend on it.
    pub threads: NonZeroUsize,
}

impl Options {
    /// Computes `params` on as many threads as there are processors.
    pub fn new(params: Params) -> Self {
        Self {
            params,
            threads: std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN),
        }
    }

    /// Computes on this many threads.
    pub fn with_threads(self, threads: NonZeroUsize) -> Self {
        Self { threads, ..self }
    }
}

impl Default for Options {
    /// Computes the default parameters on as many threads as there are processors.
    fn default() -> Self {
        Self::new(Params::default())
    }
}

/// Rows above or below a pixel that it can depend on, for an image whose rows hold `layout`: it lies in the halo of a cell, the
/// cell's windows reach as far again, and what they read was prepared from a halo of its own.
pub(crate) fn reach(layout: &RowLayout) -> usize {
    // counted from a pixel of the halo: to the far edge of the cell, and what lies beyond that
    HALO + CELL + LOOK_BELOW + halo(layout)
}

/// Bytes that denoising an image takes at most, beside the source and the sink.
pub(crate) fn bytes(layout: &RowLayout, options: &Options) -> u64 {
    let threads = options.threads.get() as u64;
    [
        Preparation::bytes(layout, threads, options.params.vary_features),
        CellBenches::bytes(layout, threads),
        SumRows::bytes(layout),
        OutputRow::bytes(layout).saturating_mul(threads.saturating_mul(ROWS_PER_THREAD as u64)),
        stack_bytes(threads),
    ]
    .into_iter()
    .fold(0, u64::saturating_add)
}

/// Denoises every row of `source` into `sink`. `progress` is told how many rows have been written after each; when it
/// breaks, the run ends with [`Error::Cancelled`].
pub fn denoise(
    source: &mut dyn RowSource,
    sink: &mut dyn RowSink,
    options: &Options,
    progress: &mut dyn FnMut(usize) -> ControlFlow<()>,
) -> Result<Report, Error> {
    let pool = pool(options.threads)?;
    let mut pipeline = Pipeline::new(source.layout(), options);
    let height = pipeline.layout.size.height();
    for row in 0..height.div_ceil(CELL) {
        pipeline.input.read(source, row)?;
        pool.install(|| pipeline.compute(row));
        let done = if (row + 1) * CELL >= height {
            height
        } else {
            (row + 1) * CELL - HALO
        };
        pipeline.write(&pool, sink, row, done, progress)?;
        pipeline.advance(row);
    }
    Ok(pipeline.report)
}

/// What is in memory of an image.
struct Pipeline {
    layout: RowLayout,
    params: Params,
    instruction_set: InstructionSet,
    input: Preparation,
    cells: CellBenches,
    sums: SumRows,
    /// Rows that are worked out at a time.
    resolved: Vec<ResolvedRow>,
    written: usize,
    report: Report,
}

impl Pipeline {
    fn new(layout: RowLayout, options: &Options) -> Self {
        let (instruction_set, threads) = (InstructionSet::detect(), options.threads);
        Self {
            layout,
            params: options.params,
            instruction_set,
            input: Preparation::new(layout, &options.params, threads, instruction_set),
            cells: CellBenches::new(&layout, threads),
            sums: SumRows::new(&layout),
            resolved: (0..threads.get() * ROWS_PER_THREAD)
                .map(|_| ResolvedRow::new(&layout))
                .collect(),
            written: 0,
            report: Report {
                counts: Counts {
                    pixels: layout.size.pixels(),
                    ..Counts::default()
                },
                ..Report::default()
            },
        }
    }

    /// Prepares what row `row` of cells lacks, and predicts it.
    fn compute(&mut self, row: usize) {
        let counts = &mut self.report.counts;
        self.input.prepare(row, counts);
        let around = self.input.around(row);
        let sums = &mut self.sums;
        let predicted = self
            .cells
            .predict(&around, &self.params, self.instruction_set, sums);
        counts.cells += predicted.cells;
        counts.cells_skipped += predicted.skipped;
        self.report.models += predicted.models;
        self.report.fitting += predicted.time;
    }

    /// Writes the rows before `end`.
    fn write(
        &mut self,
        pool: &ThreadPool,
        sink: &mut dyn RowSink,
        row: usize,
        end: usize,
        progress: &mut dyn FnMut(usize) -> ControlFlow<()>,
    ) -> Result<(), Error> {
        while self.written < end {
            let rows = self.resolved.len().min(end - self.written);
            pool.install(|| self.resolve(row, rows));
            for resolved in &self.resolved[..rows] {
                sink.write_row(self.written, &resolved.output)?;
                self.report.counts.passed_through += resolved.counts.passed_through;
                self.report.counts.repaired += resolved.counts.repaired;
                self.report.counts.fireflies += resolved.counts.fireflies;
                self.written += 1;
                if progress(self.written).is_break() {
                    return Err(Error::Cancelled);
                }
            }
        }
        Ok(())
    }

    /// Works out the next `rows` rows of output.
    fn resolve(&mut self, row: usize, rows: usize) {
        let (around, formulas) = (self.input.around(row), self.params.formulas);
        let sums = self.sums.rows_from(self.written);
        let rows: Vec<_> = (self.written..)
            .zip(sums)
            .zip(&mut self.resolved[..rows])
            .collect();
        rows.into_par_iter()
            .for_each(|((y, (own, before)), resolved)| {
                if let Some(before) = before {
                    own.take(before);
                }
                resolved.fill(&around.row(y), own, formulas);
                own.clear();
            });
    }

    /// Moves on to the next row of cells.
    fn advance(&mut self, row: usize) {
        self.sums.advance();
        self.input.advance(row);
    }
}
