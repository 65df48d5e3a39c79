//! From rows to rows, through the few that are held.
//!
//! ```text
//! rows of input           19 k - 9 ................................ 19 (k + 2)     HeldRows (+ 4 to tell fireflies, + 5 to estimate variances)
//!   weights, prefilter      19 k - 10 ............... 19 (k + 1) + 9                 2 x PreparedRows
//!     cells of row k          19 k - 9 ............. 19 (k + 1) + 9                   SumRows
//!       blended                 19 k - 9 .. 19 (k + 1) - 9
//!         rows of output          35 rows later                                       Finish
//! ```
//!
//! Several rows of cells are worked on together where one is too short for all threads (see [`best_rows`]): k is the first of them then, and what is drawn for k + 1 is for the one after the
//! last. Row k of cells needs the rows that its windows reach prepared, and those need a halo of their own. Once its
//! predictions are added up, no later cell reaches the rows before `19 (k + 1) - 9`: they are blended, and pass through the stages after
//! that. The papers have none of those; by their formulas what is blended leaves.

use std::num::NonZeroUsize;
use std::ops::{ControlFlow, Range};

use linpred_core::{CELL, HALO, Params};
use linpred_dispatch::InstructionSet;
use rayon::prelude::*;

use crate::error::Error;
use crate::row::{OutputRow, RowLayout, RowSink, RowSource};
use crate::stream::finish::{self, Finish};
use crate::stream::preparation::{INPUT_HALO, LOOK_BELOW, Preparation};
use crate::stream::report::{Counts, Report};
use crate::stream::resolved_row::{ResolvedRow, rows_per_thread};
use crate::stream::rows_of_cells::{CellBenches, best_rows};
use crate::stream::sum_rows::SumRows;
use crate::stream::threads::{Threads, pool, stack_bytes, threads_to_use};

/// How to run: what to compute, and on how many threads.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Options {
    /// What to compute.
    pub params: Params,
    /// Threads that compute; the output's bits do not depend on it.
    pub threads: NonZeroUsize,
    /// Rows of cells that are worked on together, as many as are best unless said; the bits do not depend on it either.
    pub(crate) cell_rows: Option<NonZeroUsize>,
}

impl Options {
    /// Computes `params` on as many threads as there are processors.
    pub fn new(params: Params) -> Self {
        Self {
            params,
            threads: threads_to_use(None),
            cell_rows: None,
        }
    }

    /// Computes on this many threads.
    pub fn with_threads(self, threads: NonZeroUsize) -> Self {
        Self { threads, ..self }
    }

    /// Works on this many rows of cells together.
    pub(crate) fn with_cell_rows(self, cell_rows: NonZeroUsize) -> Self {
        Self {
            cell_rows: Some(cell_rows),
            ..self
        }
    }

    /// Rows of cells that are worked on together: no more than the image has.
    fn cell_rows(&self, layout: &RowLayout) -> usize {
        let best = best_rows(layout, self.threads);
        let all = layout.size.height().div_ceil(CELL);
        self.cell_rows.unwrap_or(best).get().min(all)
    }
}

impl Default for Options {
    /// Computes the default parameters on as many threads as there are processors.
    fn default() -> Self {
        Self::new(Params::default())
    }
}

/// Rows above or below a pixel, or columns beside it, that it can depend on: it lies in the halo of a cell, the
/// cell's windows reach as far again, and what they read was prepared from a halo of its own; the stages
/// after the blend reach further. Counted from a pixel of the halo: to the far edge of the cell, and what lies beyond that.
pub(crate) const REACH: usize = HALO + CELL + LOOK_BELOW + INPUT_HALO + finish::LOOK_BELOW;

/// Bytes that denoising an image takes at most, beside the source and the sink.
pub(crate) fn bytes(layout: &RowLayout, options: &Options) -> u64 {
    let (batch, cell_rows) = (batch(layout, options.threads), options.cell_rows(layout));
    let (threads, vary) = (options.threads.get() as u64, options.params.vary_features);
    [
        Preparation::bytes(layout, threads, cell_rows, vary),
        CellBenches::bytes(layout, threads, vary),
        SumRows::bytes(layout, cell_rows),
        OutputRow::bytes(layout).saturating_mul(batch as u64),
        Finish::bytes(layout, batch),
        stack_bytes(threads),
    ]
    .into_iter()
    .fold(0, u64::saturating_add)
}

/// Rows that are blended and finished at a time: some for each thread, no more than a row of cells gives.
fn batch(layout: &RowLayout, threads: NonZeroUsize) -> usize {
    threads
        .get()
        .saturating_mul(rows_per_thread(layout.size.width()))
        .min(CELL + HALO)
}

/// Denoises every row of `source` into `sink`. `progress` is told how many rows have been written after each; when it
/// breaks, the run ends with [`Error::Cancelled`]. Memory is taken without asking: [`check_memory`](crate::job::check_memory) asks.
pub fn denoise(
    source: &mut dyn RowSource,
    sink: &mut dyn RowSink,
    options: &Options,
    progress: &mut dyn FnMut(usize) -> ControlFlow<()>,
) -> Result<Report, Error> {
    let pool = pool(options.threads)?;
    let mut pipeline = Pipeline::new(source.layout(), options);
    let height = pipeline.layout.size.height();
    let (all, together) = (height.div_ceil(CELL), options.cell_rows(&pipeline.layout));
    for first in (0..all).step_by(together) {
        let cells = first..all.min(first + together);
        pipeline.input.read(source, &cells)?;
        pool.install(|| pipeline.compute(&cells));
        let done = if cells.end * CELL >= height {
            height
        } else {
            cells.end * CELL - HALO
        };
        pipeline.write(&pool, sink, &cells, done, progress)?;
        pipeline.advance(&cells);
    }
    pipeline.write_rest(&pool, sink, progress)?;
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
    blended: usize,
    /// The stages after that, if the formulas have any.
    finish: Option<Finish>,
    written: usize,
    report: Report,
}

impl Pipeline {
    fn new(layout: RowLayout, options: &Options) -> Self {
        let (instruction_set, threads) = (InstructionSet::detect(), options.threads);
        let cell_rows = options.cell_rows(&layout);
        let batch = batch(&layout, threads);
        let finishes = !options.params.formulas.are_published();
        let finish = finishes.then(|| Finish::new(layout, batch, instruction_set));
        Self {
            layout,
            params: options.params,
            instruction_set,
            input: Preparation::new(
                layout,
                &options.params,
                (threads, cell_rows),
                instruction_set,
            ),
            cells: CellBenches::new(&layout, threads, options.params.vary_features),
            sums: SumRows::new(&layout, cell_rows),
            resolved: (0..batch).map(|_| ResolvedRow::new(&layout)).collect(),
            blended: 0,
            finish,
            written: 0,
            report: Report {
                counts: Counts {
                    pixels: layout.pixels(),
                    ..Counts::default()
                },
                ..Report::default()
            },
        }
    }

    /// Prepares what these rows of cells lack, and predicts them.
    fn compute(&mut self, cells: &Range<usize>) {
        let counts = &mut self.report.counts;
        self.input.prepare(cells, counts);
        let around = self.input.around(cells);
        let sums = &mut self.sums;
        let predicted = self
            .cells
            .predict(&around, &self.params, self.instruction_set, sums);
        counts.cells += predicted.cells;
        counts.cells_skipped += predicted.skipped;
        self.report.models += predicted.models;
        self.report.fitting += predicted.time;
    }

    /// Blends the rows before `end`, and writes those that can be finished then.
    fn write(
        &mut self,
        pool: &Threads,
        sink: &mut dyn RowSink,
        cells: &Range<usize>,
        end: usize,
        progress: &mut dyn FnMut(usize) -> ControlFlow<()>,
    ) -> Result<(), Error> {
        while self.blended < end {
            let rows = self.resolved.len().min(end - self.blended);
            pool.install(|| self.blend(cells, rows));
            let around = self.input.around(cells);
            let Some(finish) = &mut self.finish else {
                let rows = self.resolved[..rows].iter().map(|row| &row.output);
                write_rows(rows, &mut self.written, sink, progress)?;
                continue;
            };
            let numbers = self.blended - rows..;
            let rows = numbers.zip(&self.resolved[..rows]);
            let rows: Vec<_> = rows.map(|(y, row)| (&row.output, around.row(y))).collect();
            pool.install(|| finish.push(&rows));
            write_rows(finish.rows(), &mut self.written, sink, progress)?;
        }
        Ok(())
    }

    /// Works out the next `rows` rows of predictions.
    fn blend(&mut self, cells: &Range<usize>, rows: usize) {
        let (around, formulas) = (self.input.around(cells), self.params.formulas);
        let sums = self.sums.rows_from(self.blended);
        let resolved = &mut self.resolved[..rows];
        let targets: Vec<_> = (self.blended..).zip(sums).zip(&mut *resolved).collect();
        targets
            .into_par_iter()
            .for_each(|((y, (own, before)), resolved)| {
                if let Some(before) = before {
                    own.take(before);
                }
                resolved.fill(&around.row(y), own, formulas);
                own.clear();
            });
        for row in resolved {
            self.report.counts.add_rows(&row.counts);
        }
        self.blended += rows;
    }

    /// Finishes and writes the rows that are left once all are blended.
    fn write_rest(
        &mut self,
        pool: &Threads,
        sink: &mut dyn RowSink,
        progress: &mut dyn FnMut(usize) -> ControlFlow<()>,
    ) -> Result<(), Error> {
        let Some(finish) = &mut self.finish else {
            return Ok(());
        };
        while self.written < self.layout.size.height() {
            pool.install(|| finish.advance());
            write_rows(finish.rows(), &mut self.written, sink, progress)?;
        }
        Ok(())
    }

    /// Moves on to the rows of cells after these.
    fn advance(&mut self, cells: &Range<usize>) {
        self.sums.advance(cells.len());
        self.input.advance(cells);
    }
}

/// Writes rows from row `written` on, which it counts.
fn write_rows<'a>(
    rows: impl Iterator<Item = &'a OutputRow>,
    written: &mut usize,
    sink: &mut dyn RowSink,
    progress: &mut dyn FnMut(usize) -> ControlFlow<()>,
) -> Result<(), Error> {
    for row in rows {
        sink.write_row(*written, row)?;
        *written += 1;
        if progress(*written).is_break() {
            return Err(Error::Cancelled);
        }
    }
    Ok(())
}
