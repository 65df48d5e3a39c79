//! The pipeline turned inside out, for callers that have a loop of their own: it stops whenever it wants a row and whenever it has one.
//!
//! ```
//! use linpred::steps::{Step, Steps};
//! use linpred::{ImageSize, Options, RowLayout, VarianceKind};
//!
//! fn main() -> Result<(), linpred::Error> {
//!     let size = ImageSize::new(50, 40).expect("not empty");
//!     let mut steps = Steps::start(RowLayout::new(size, VarianceKind::Estimated), Options::default())?;
//!     let mut sum = 0.0;
//!     loop {
//!         match steps.next()? {
//!             Step::Wanted { y, row } => row.colour[0].fill(y as f32),
//!             Step::Denoised { y: _, row } => sum += row.colour[0][25],
//!             Step::Done(report) => break assert_eq!(report.counts.pixels, 2000),
//!         }
//!     }
//!     assert!((sum / 40.0 - 19.5).abs() < 0.1);
//!     Ok(())
//! }
//! ```
//!
//! The pipeline runs on a thread of its own, and waits there as long as the caller takes for a row. Rows are wanted from top to bottom, each once, and come out so
//! some 90 rows later, as early as they can be: fewer rows are worked on together than in other runs, which costs narrow images on many threads some speed. No more rows are in memory than in any other run, and which come when says nothing of the bits.

use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread::{Builder, JoinHandle};

use crate::error::Error;
use crate::row::{InputRow, OutputRow, RowLayout, RowSink, RowSource};
use crate::stream::pipeline::{self, Options};
use crate::stream::report::Report;

/// What comes next.
#[derive(Debug)]
pub enum Step<'a> {
    /// Row `y` of the input is wanted.
    Wanted {
        /// Its number.
        y: usize,
        /// Where it goes: planes as [`InputRow::new`] makes them, to be filled without changing their lengths. What they hold is left over from other rows.
        row: &'a mut InputRow,
    },
    /// Row `y` is denoised.
    Denoised {
        /// Its number.
        y: usize,
        /// The row.
        row: &'a OutputRow,
    },
    /// All rows are denoised.
    Done(Report),
}

/// A run that is taken step by step. Dropped before its end, it is given up, which waits for what is being computed: a row of cells at most.
#[derive(Debug)]
pub struct Steps {
    layout: RowLayout,
    at: At,
    ends: Option<Ends>,
    pipeline: Option<JoinHandle<Result<Report, Error>>>,
}

/// Where a run stands.
#[derive(Debug)]
enum At {
    Start,
    Wanted(usize, Box<InputRow>),
    Denoised(usize, OutputRow),
    Done(Report),
    /// The reason has been told.
    Failed,
}

/// The caller's ends of the channels. Without them the pipeline gives up.
#[derive(Debug)]
struct Ends {
    events: Receiver<At>,
    filled: SyncSender<Box<InputRow>>,
    used: Sender<OutputRow>,
}

impl Steps {
    /// Starts a run. [`Error::Budget`] if the system gives no thread.
    pub fn start(layout: RowLayout, options: Options) -> Result<Self, Error> {
        // whoever has a loop of its own wants rows early
        let options = options.with_cell_rows(NonZeroUsize::MIN);
        let (event, events) = sync_channel(1);
        let (filled, rows) = sync_channel(1);
        let (used, free) = channel();
        let denoise = move || {
            let mut source = Wanted {
                layout,
                event: event.clone(),
                rows,
            };
            let mut sink = Denoised { event, free };
            let go_on = &mut |_| ControlFlow::Continue(());
            pipeline::denoise(&mut source, &mut sink, &options, go_on)
        };
        let pipeline = Builder::new()
            .spawn(denoise)
            .map_err(|error| Error::Budget(format!("can't start a thread: {error}")))?;
        Ok(Self {
            layout,
            at: At::Start,
            ends: Some(Ends {
                events,
                filled,
                used,
            }),
            pipeline: Some(pipeline),
        })
    }

    /// What the rows hold.
    pub fn layout(&self) -> RowLayout {
        self.layout
    }

    /// Goes on to the next step; a row that was wanted is taken now, as it was filled. The last step comes again if it is asked for again.
    ///
    /// [`Error::Usage`] if the planes of a row have other lengths than they had, and whatever ends a run; from then on [`Error::Cancelled`].
    #[expect(
        clippy::should_implement_trait,
        reason = "steps lend rows, an iterator can't"
    )]
    pub fn next(&mut self) -> Result<Step<'_>, Error> {
        self.at = match std::mem::replace(&mut self.at, At::Failed) {
            done @ At::Done(_) => done,
            At::Failed => return Err(Error::Cancelled),
            At::Wanted(y, row) if !row.fits(&self.layout) => {
                // what was wrong is this
                let _ = self.give_up();
                return Err(Error::Usage(format!(
                    "row {y}: its planes are not those of an image {} pixels wide with these features and {} layers",
                    self.layout.size.width(),
                    self.layout.layers
                )));
            }
            before => self.advance(before)?,
        };
        Ok(match &mut self.at {
            At::Wanted(y, row) => Step::Wanted { y: *y, row },
            At::Denoised(y, row) => Step::Denoised { y: *y, row },
            At::Done(report) => Step::Done(*report),
            At::Start | At::Failed => return Err(Error::Cancelled),
        })
    }

    /// The row that is wanted now, for callers that do not fill it where they were told.
    pub fn wanted(&mut self) -> Option<&mut InputRow> {
        match &mut self.at {
            At::Wanted(_, row) => Some(row),
            _ => None,
        }
    }

    /// Hands back what was lent, and waits for what comes.
    fn advance(&mut self, before: At) -> Result<At, Error> {
        if let Some(ends) = &self.ends {
            // a pipeline that takes no rows has ended, and says why below
            match before {
                At::Wanted(_, row) => drop(ends.filled.send(row)),
                At::Denoised(_, row) => drop(ends.used.send(row)),
                _ => {}
            }
            if let Ok(event) = ends.events.recv() {
                return Ok(event);
            }
        }
        self.give_up().map(At::Done)
    }

    /// Ends the run.
    fn give_up(&mut self) -> Result<Report, Error> {
        self.ends = None;
        match self.pipeline.take().map(JoinHandle::join) {
            None => Err(Error::Cancelled),
            Some(Ok(result)) => result,
            Some(Err(panic)) => std::panic::resume_unwind(panic),
        }
    }
}

impl Drop for Steps {
    fn drop(&mut self) {
        self.ends = None;
        if let Some(pipeline) = self.pipeline.take() {
            // nobody is left to be told how it went
            let _ = pipeline.join();
        }
    }
}

/// The pipeline's end of the rows that it wants.
struct Wanted {
    layout: RowLayout,
    event: SyncSender<At>,
    rows: Receiver<Box<InputRow>>,
}

impl RowSource for Wanted {
    fn layout(&self) -> RowLayout {
        self.layout
    }

    fn read_row(&mut self, y: usize, row: &mut InputRow) -> Result<(), Error> {
        let empty = At::Wanted(y, Box::new(std::mem::take(row)));
        self.event.send(empty).map_err(|_| Error::Cancelled)?;
        *row = *self.rows.recv().map_err(|_| Error::Cancelled)?;
        Ok(())
    }
}

/// The pipeline's end of the denoised rows.
struct Denoised {
    event: SyncSender<At>,
    free: Receiver<OutputRow>,
}

impl RowSink for Denoised {
    fn write_row(&mut self, y: usize, row: &OutputRow) -> Result<(), Error> {
        let mut copy = self.free.try_recv().unwrap_or_default();
        copy.clone_from(row);
        let denoised = At::Denoised(y, copy);
        self.event.send(denoised).map_err(|_| Error::Cancelled)
    }
}
