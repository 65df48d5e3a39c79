//! Reading ahead and writing behind, each on a thread of its own, while the pipeline computes between them.
//!
//! Rows pass in order through channels of bounded length and are used again, so the memory is that of the rows in flight. An
//! error travels with the row it belongs to: a failed read arrives when its row is asked for, a failed write with the next row
//! that is written, or at the end.

use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread::{Builder, Scope, ScopedJoinHandle};

use crate::error::Error;
use crate::row::{InputRow, OutputRow, RowLayout, RowSink, RowSource};

/// Rows that are best in flight at each end: those of one row of cells, which is what the pipeline takes at once; as many times that as it works on rows of cells together.
pub const ROWS_IN_FLIGHT: usize = 19;

/// A source that is read by another thread.
#[derive(Debug)]
pub struct ReadAhead {
    layout: RowLayout,
    rows: Receiver<Result<InputRow, Error>>,
    used: Sender<InputRow>,
}

impl ReadAhead {
    /// Begins to read `source` from row 0 on a thread of `scope`, `ahead` rows ahead. The thread ends after the last row, after an error, or when
    /// the value is dropped. [`Error::Budget`] if the system gives no thread.
    pub fn start<'scope>(
        scope: &'scope Scope<'scope, '_>,
        source: &'scope mut dyn RowSource,
        ahead: usize,
    ) -> Result<Self, Error> {
        let layout = source.layout();
        let (filled, rows) = sync_channel(ahead);
        let (used, free) = channel::<InputRow>();
        let read = move || {
            for y in 0..layout.size.height() {
                let mut row = free.try_recv().unwrap_or_else(|_| InputRow::new(&layout));
                let result = source.read_row(y, &mut row).map(|()| row);
                let failed = result.is_err();
                // nobody takes rows any more, or there are none to give
                if filled.send(result).is_err() || failed {
                    return;
                }
            }
        };
        spawn(scope, "read", read)?;
        Ok(Self { layout, rows, used })
    }
}

impl RowSource for ReadAhead {
    fn layout(&self) -> RowLayout {
        self.layout
    }

    /// Rows come in the order in which they were read, whatever `y`: the pipeline asks for each once, from the top.
    fn read_row(&mut self, _: usize, row: &mut InputRow) -> Result<(), Error> {
        // the thread ends early only after an error, which has been passed on
        let next = self.rows.recv().map_err(|_| Error::Cancelled)??;
        let used = std::mem::replace(row, next);
        // a reader that has finished needs no rows
        let _ = self.used.send(used);
        Ok(())
    }
}

/// Starts a thread; `what` tells which in the error.
fn spawn<'scope, T: Send + 'scope>(
    scope: &'scope Scope<'scope, '_>,
    what: &str,
    work: impl FnOnce() -> T + Send + 'scope,
) -> Result<ScopedJoinHandle<'scope, T>, Error> {
    let named = Builder::new().name(format!("linpred {what}"));
    let started = named.spawn_scoped(scope, work);
    started.map_err(|error| Error::Budget(format!("can't start the thread to {what}: {error}")))
}

/// A sink that another thread writes to.
#[derive(Debug)]
pub struct WriteBehind<'scope> {
    rows: SyncSender<(usize, OutputRow)>,
    free: Receiver<OutputRow>,
    writer: ScopedJoinHandle<'scope, Result<(), Error>>,
}

impl<'scope> WriteBehind<'scope> {
    /// Begins to write to `sink` on a thread of `scope`, at most `behind` rows behind. [`Error::Budget`] if the system gives no thread.
    pub fn start(
        scope: &'scope Scope<'scope, '_>,
        sink: &'scope mut dyn RowSink,
        behind: usize,
    ) -> Result<Self, Error> {
        let (rows, filled) = sync_channel::<(usize, OutputRow)>(behind);
        let (used, free) = channel();
        let write = move || {
            for (y, row) in filled {
                sink.write_row(y, &row)?;
                // a pipeline that has finished needs no rows
                let _ = used.send(row);
            }
            Ok(())
        };
        let writer = spawn(scope, "write", write)?;
        Ok(Self { rows, free, writer })
    }

    /// Waits until every row is written; the error of the row that could not be, if there is one.
    pub fn finish(self) -> Result<(), Error> {
        drop(self.rows);
        match self.writer.join() {
            Ok(result) => result,
            Err(panic) => std::panic::resume_unwind(panic),
        }
    }
}

impl RowSink for WriteBehind<'_> {
    fn write_row(&mut self, y: usize, row: &OutputRow) -> Result<(), Error> {
        let mut copy = self.free.try_recv().unwrap_or_default();
        copy.clone_from(row);
        // the thread ends early only after an error, which finish tells
        self.rows.send((y, copy)).map_err(|_| Error::Cancelled)
    }
}
