//! Rows pushed in and pulled out, for a program that has its buffers in memory and its own idea of when they are ready.
//!
//! A [`RowSource`] is asked for its rows; a renderer would rather hand them over as they become complete. [`start`] puts
//! the pipeline on threads of its own between two ends: [`Push`] takes rows from the top, [`Denoised`] is an iterator over rows from the top.
//! Both ends hold a bounded number of rows, so the memory is that of the pipeline and of the rows in flight.
//!
//! A row comes out some hundred rows after it went in, and a full pipeline makes its ends wait: push and pull on different threads. Whatever the
//! order in which the pixels became ready, the bits are those of [`pipeline::denoise`].

use std::ops::ControlFlow;
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread::{Builder, JoinHandle};

use crate::error::Error;
use crate::row::{InputRow, OutputRow, RowLayout, RowSink, RowSource};
use crate::stream::overlap::ROWS_IN_FLIGHT;
use crate::stream::pipeline::{self, Options};
use crate::stream::report::Report;

/// Starts to denoise an image whose rows will be pushed. [`Error::Budget`] if the system gives no thread.
pub fn start(layout: RowLayout, options: Options) -> Result<(Push, Denoised), Error> {
    let (push, pushed) = sync_channel(ROWS_IN_FLIGHT);
    let (used, free) = channel();
    let (denoised, rows) = sync_channel(ROWS_IN_FLIGHT);
    let denoise = move || {
        let mut source = Pushed {
            layout,
            rows: pushed,
            used,
        };
        let mut sink = Pulled(denoised);
        let go_on = &mut |_| ControlFlow::Continue(());
        pipeline::denoise(&mut source, &mut sink, &options, go_on)
    };
    let pipeline = Builder::new()
        .spawn(denoise)
        .map_err(|error| Error::Budget(format!("can't start a thread: {error}")))?;
    let push = Push {
        layout,
        next: 0,
        rows: push,
        free,
    };
    let denoised = Denoised {
        rows,
        pipeline: Some(pipeline),
        report: None,
    };
    Ok((push, denoised))
}

/// Takes the rows of an image. Dropped before the last row, it ends the run with [`Error::Cancelled`].
#[derive(Debug)]
pub struct Push {
    layout: RowLayout,
    next: usize,
    rows: SyncSender<InputRow>,
    free: Receiver<InputRow>,
}

impl Push {
    /// The next row to push; the image's height after the last.
    pub fn next_row(&self) -> usize {
        self.next
    }

    /// Takes row `y`, a copy; waits while the pipeline has enough to do.
    ///
    /// [`Error::Usage`] if `y` is not the next row, or planes do not have the sizes of [`InputRow::new`]; [`Error::Cancelled`] if the
    /// run has ended, whose reason the other end tells.
    pub fn push_row(&mut self, y: usize, row: &InputRow) -> Result<(), Error> {
        if y != self.next || y >= self.layout.size.height() {
            return Err(Error::Usage(format!(
                "row {y} was pushed: the next of {} is row {}",
                self.layout.size.height(),
                self.next
            )));
        }
        if !row.fits(&self.layout) {
            return Err(Error::Usage(format!(
                "row {y}: its planes are not those of an image {} pixels wide with these features and {} layers",
                self.layout.size.width(),
                self.layout.layers
            )));
        }
        let mut copy = self.free.try_recv().unwrap_or_default();
        copy.clone_from(row);
        self.rows.send(copy).map_err(|_| Error::Cancelled)?;
        self.next += 1;
        Ok(())
    }
}

/// The denoised rows, each with its number, from 0 on. An error is the last item. Dropped before the last row, it ends the run.
#[derive(Debug)]
pub struct Denoised {
    rows: Receiver<(usize, OutputRow)>,
    pipeline: Option<JoinHandle<Result<Report, Error>>>,
    report: Option<Report>,
}

impl Denoised {
    /// What the run did, once the iterator has ended without an error.
    pub fn report(&self) -> Option<Report> {
        self.report
    }
}

impl Iterator for Denoised {
    type Item = Result<(usize, OutputRow), Error>;

    fn next(&mut self) -> Option<Self::Item> {
        if let Ok(row) = self.rows.recv() {
            return Some(Ok(row));
        }
        match self.pipeline.take()?.join() {
            Ok(Ok(report)) => {
                self.report = Some(report);
                None
            }
            Ok(Err(error)) => Some(Err(error)),
            Err(panic) => std::panic::resume_unwind(panic),
        }
    }
}

/// The pipeline's end of [`Push`].
struct Pushed {
    layout: RowLayout,
    rows: Receiver<InputRow>,
    used: Sender<InputRow>,
}

impl RowSource for Pushed {
    fn layout(&self) -> RowLayout {
        self.layout
    }

    fn read_row(&mut self, _: usize, row: &mut InputRow) -> Result<(), Error> {
        let next = self.rows.recv().map_err(|_| Error::Cancelled)?;
        let used = std::mem::replace(row, next);
        // who has pushed the last row needs no more
        let _ = self.used.send(used);
        Ok(())
    }
}

/// The pipeline's end of [`Denoised`].
struct Pulled(SyncSender<(usize, OutputRow)>);

impl RowSink for Pulled {
    fn write_row(&mut self, y: usize, row: &OutputRow) -> Result<(), Error> {
        self.0.send((y, row.clone())).map_err(|_| Error::Cancelled)
    }
}
