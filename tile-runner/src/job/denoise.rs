//! One file denoised into another.

use std::borrow::Cow;
use std::ops::{ControlFlow, Range};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::sync_channel;

use linpred_core::Params;

use crate::error::Error;
use crate::exr_file::compression::SharedCodec;
use crate::exr_file::output::check_output;
use crate::geometry::ImageSize;
use crate::image::area::{Area, Placed, Unwrapped, Wrapped};
use crate::image::rewrite::Rewrite;
use crate::image::sink::ExrSink;
use crate::job::band::{BandSink, BandSource};
use crate::job::helped_rows::{Broken, Help, HelpedRows};
use crate::job::input::{Input, Unused, rewrite};
use crate::job::marks::marks;
use crate::job::memory;
use crate::job::options::JobOptions;
use crate::job::output_name::check_output_name;
use crate::job::plan::{self, Schedule};
use crate::row::{OutputRow, RowLayout, RowSink, RowSource};
use crate::stream::overlap::{ReadAhead, WriteBehind};
use crate::stream::pipeline::{self, Options};
use crate::stream::report::Report;

/// What a job did.
#[derive(Clone, Debug, Default)]
pub struct Summary {
    /// What each picture's run counted, in their order.
    pub reports: Vec<Report>,
    /// Samples that half precision cannot hold, clamped to its largest value.
    pub clamped: u64,
    /// Of each picture, the pixels whose extra layers do not sum to the colour in the input (so they cannot in the output).
    pub layers_off: Vec<u64>,
    /// Of each picture of a frame of a sequence, how the frames beside it helped.
    pub help: Vec<Help>,
    /// Frames beside it that did not help, as in [`Neighbours::unused`](super::Neighbours), and those that turned out on the way to be damaged.
    pub unused: Vec<Unused>,
    /// Bytes of memory that the process had in use at most so far, where the system tells.
    pub peak_memory: Option<u64>,
}

/// Denoises the pictures of a file, as [`Input::open_all`] gives them, into `output`. `progress` is told how many of
/// the [`rows_to_write`] have been; the job ends
/// with [`Error::Cancelled`] soon after `stop` is set, and leaves nothing behind. Where a frame that helps turns out to be damaged, the job begins anew without it and those
/// beyond it, and tells so in [`Summary::unused`].
///
/// [`Error::Usage`] if `output` has the name of another format (see [`check_output_name`]).
pub fn denoise(
    pictures: &[Input],
    output: &Path,
    options: &JobOptions,
    stop: &Arc<AtomicBool>,
    progress: &mut (dyn FnMut(usize) + Send),
) -> Result<Summary, Error> {
    check_output_name(output)?;
    let mut pictures = Cow::Borrowed(pictures);
    loop {
        let broken = Broken::default();
        let done = denoise_with(&pictures, output, options, stop, progress, &broken);
        // begun anew without the frame that cannot be read, so that every pixel is made in one way
        let again = done.is_err()
            && !stop.load(Ordering::Relaxed)
            && broken.leave_out_of(pictures.to_mut());
        if !again {
            return done;
        }
    }
}

/// The same with the help of all frames that pictures name; an error of one of those is told to `broken`.
fn denoise_with(
    pictures: &[Input],
    output: &Path,
    options: &JobOptions,
    stop: &Arc<AtomicBool>,
    progress: &mut (dyn FnMut(usize) + Send),
    broken: &Broken,
) -> Result<Summary, Error> {
    let [input, ..] = pictures else {
        return Err(Error::Usage("no picture to denoise".into()));
    };
    let files = std::iter::once(input).chain(input.helpers());
    let files = files.flat_map(|input| input.names.files());
    let inputs: Vec<&Path> = files.map(|file| file.path()).collect();
    check_output(output, &inputs)?;
    let mut rewrite = rewrite(pictures, options.output, &marks(pictures, options)?)?;
    let (schedule, plan) = plan::schedule(pictures, &rewrite, options);
    plan.check(options.memory_limit)?;
    memory::check_available(&plan, schedule.all_threads() * pictures.len())?;
    let rows = match options.band {
        Some(band) => band.restrict(&mut rewrite, input.file())?,
        None => 0..pictures.iter().map(Input::height).max().unwrap_or(0),
    };
    let mut sources = Vec::new();
    for picture in pictures {
        let threads = schedule.threads_of_each(pictures.len());
        let source = HelpedRows::of(picture, options.memory_limit, schedule, threads, broken)?;
        sources.push(Rows::of(picture, source, &rows));
    }
    let mut sink = sink(input, output, rewrite, options, schedule, stop)?;
    let mut written = |sink: &mut ExrSink, picture: usize, y: usize, row: &OutputRow| {
        sink.write_picture_row(picture, y, row)?;
        if picture == 0 {
            progress(y + 1);
        }
        match stop.load(Ordering::Relaxed) {
            true => Err(Error::Cancelled),
            false => Ok(()),
        }
    };
    let params = options.pipeline.params;
    let reports = match &mut sources[..] {
        [one] => {
            let mut sink = |y: usize, row: &OutputRow| written(&mut sink, 0, y, row);
            vec![one.run(&mut sink, params, schedule)?]
        }
        several => run_in_turns(several, params, schedule, &mut |picture, y, row| {
            written(&mut sink, picture, y, row)
        })?,
    };
    Ok(Summary {
        reports,
        clamped: sink.finish()?,
        layers_off: sources.iter().map(Rows::layers_off).collect(),
        help: sources.iter().filter_map(Rows::help).collect(),
        unused: (input.neighbours.as_ref()).map_or(Vec::new(), |of| of.unused.clone()),
        peak_memory: memory::peak(),
    })
}

/// How many rows of the first picture [`denoise`] will write, which its progress counts: all, or those of the band.
///
/// [`Error::Setting`] if the band is empty, [`Error::Unsupported`] if the file cannot be cut.
pub fn rows_to_write(pictures: &[Input], options: &JobOptions) -> Result<usize, Error> {
    let [input, ..] = pictures else {
        return Err(Error::Usage("no picture to denoise".into()));
    };
    let Some(band) = options.band else {
        return Ok(input.height());
    };
    let mut rewrite = rewrite(pictures, options.output, &[])?;
    let rows = band.restrict(&mut rewrite, input.file())?;
    let end = rows.end.min(input.height());
    // where another picture reaches below the first, a band may have none of its rows, and writes an empty one
    Ok(end.saturating_sub(rows.start).max(1))
}

/// Begins the output. It is coded by turns with the input where `schedule` has no memory for both at once.
fn sink(
    input: &Input,
    output: &Path,
    rewrite: Rewrite,
    options: &JobOptions,
    schedule: Schedule,
    stop: &Arc<AtomicBool>,
) -> Result<ExrSink, Error> {
    let codec = match schedule.codes_at_once {
        true => SharedCodec::default(),
        false => input.file().codec().clone(),
    };
    let (file, limit) = (input.file().clone(), options.memory_limit);
    ExrSink::create(output, file, rewrite, &codec, limit, stop.clone())
}

/// The rows of a picture that are to be written.
struct Rows {
    /// What is computed; `None` if nothing was rendered in them.
    source: Option<BandSource<Wrapped<HelpedRows>>>,
    /// The rows to be written of those that are computed.
    within: Range<usize>,
    /// Where they are in the rows to be written.
    area: Area,
    /// What is written.
    layout: RowLayout,
    /// What is computed, before the ends of a panorama are put on.
    own_layout: RowLayout,
    wraps: bool,
    /// Of a frame of a sequence, how many frames its pixels are made of.
    frames: Option<Mean>,
}

impl Rows {
    /// The rows `wanted` of a picture's window.
    fn of(picture: &Input, source: HelpedRows, wanted: &Range<usize>) -> Self {
        let Area { x, y, size } = picture.area;
        let wanted = wanted.start..wanted.end.min(picture.height());
        let first = wanted.start.max(y);
        let end = wanted.end.min(y + size.height());
        // a band is not empty
        let height = wanted.len().max(1);
        let window = ImageSize::new(picture.width(), height).unwrap_or(size);
        let frames = picture.neighbours.as_ref().map(|_| Mean::default());
        let mut layout = picture.layout().with_size(window);
        layout.frames = frames.is_some();
        let Some(own) = end
            .checked_sub(first)
            .and_then(|rows| ImageSize::new(size.width(), rows))
        else {
            return Self {
                source: None,
                within: 0..0,
                area: Area::whole(window),
                layout,
                own_layout: layout,
                wraps: false,
                frames,
            };
        };
        let own_layout = picture.layout().with_size(own);
        let rows = first - y..end - y;
        let source = Wrapped::new(source, picture.wrap);
        let source = BandSource::new(source, &rows);
        let above = source.first();
        Self {
            source: Some(source),
            within: rows.start - above..rows.end - above,
            area: Area {
                x,
                y: first - wanted.start,
                size: own,
            },
            layout,
            own_layout,
            wraps: picture.wrap,
            frames,
        }
    }

    fn layers_off(&self) -> u64 {
        let source = self.source.as_ref();
        source.map_or(0, |source| source.inner().inner().layers_off())
    }

    /// How the frames beside it helped, of a frame of a sequence.
    fn help(&self) -> Option<Help> {
        let frames = self.frames?.value();
        let source = self.source.as_ref();
        let weights = source.map(|source| source.inner().inner().weights());
        let [before, after] = weights.unwrap_or_default();
        Some(Help {
            frames,
            before,
            after,
        })
    }

    /// Denoises them into `sink`, which takes rows from 0.
    fn run(
        &mut self,
        sink: &mut (dyn RowSink + Send),
        params: Params,
        schedule: Schedule,
    ) -> Result<Report, Error> {
        let mut placed = Placed::new(Borrowed(sink), self.area, &self.layout);
        let Some(source) = &mut self.source else {
            placed.write_empty(0, self.layout.size.height())?;
            return Ok(Report::default());
        };
        let frames = &mut self.frames;
        let counted = |y: usize, row: &OutputRow| match frames {
            None => placed.write_row(y, row),
            Some(mean) => write_counted(&mut placed, y, row, mean),
        };
        let unwrapped = Unwrapped::new(counted, &self.own_layout, self.wraps);
        let mut sink = BandSink::new(unwrapped, self.within.clone());
        run(source, &mut sink, params, schedule)
    }
}

/// Passes on a row of a frame of a sequence, of which every pixel is made of that frame at least.
fn write_counted(
    sink: &mut impl RowSink,
    y: usize,
    row: &OutputRow,
    mean: &mut Mean,
) -> Result<(), Error> {
    if !row.frames.is_empty() {
        mean.add(&row.frames);
        return sink.write_row(y, row);
    }
    let mut row = row.clone();
    row.frames = vec![1.0; row.error.len()];
    mean.add(&row.frames);
    sink.write_row(y, &row)
}

/// A mean over pixels.
#[derive(Clone, Copy, Debug, Default)]
struct Mean {
    sum: f64,
    pixels: u64,
}

impl Mean {
    fn add(&mut self, row: &[f32]) {
        self.sum += row.iter().copied().map(f64::from).sum::<f64>();
        self.pixels += row.len() as u64;
    }

    fn value(self) -> f64 {
        self.sum / self.pixels.max(1) as f64
    }
}

/// A sink that belongs to another.
struct Borrowed<'a>(&'a mut (dyn RowSink + Send));

impl RowSink for Borrowed<'_> {
    fn write_row(&mut self, y: usize, row: &OutputRow) -> Result<(), Error> {
        self.0.write_row(y, row)
    }
}

/// Runs the pipelines of several pictures side by side, and writes a row of each in turns: some may lie in one part of the file, whose chunks are written
/// once all of them are there.
fn run_in_turns(
    pictures: &mut [Rows],
    params: Params,
    schedule: Schedule,
    write: &mut dyn FnMut(usize, usize, &OutputRow) -> Result<(), Error>,
) -> Result<Vec<Report>, Error> {
    let schedule = Schedule {
        threads: schedule.threads_of_each(pictures.len()),
        ..schedule
    };
    let heights: Vec<usize> = pictures
        .iter()
        .map(|rows| rows.layout.size.height())
        .collect();
    let height = heights.iter().copied().max().unwrap_or(0);
    std::thread::scope(|scope| {
        let mut running = Vec::new();
        for rows in pictures {
            let (sender, rows_out) = sync_channel::<OutputRow>(1);
            let compute = move || {
                // whoever takes the rows tells what went wrong there
                let mut sink = move |_: usize, row: &OutputRow| {
                    sender.send(row.clone()).map_err(|_| Error::Cancelled)
                };
                rows.run(&mut sink, params, schedule)
            };
            let handle = std::thread::Builder::new().spawn_scoped(scope, compute);
            let handle =
                handle.map_err(|error| Error::Budget(format!("can't start a thread: {error}")))?;
            running.push((handle, rows_out));
        }
        let mut result = Ok(());
        'rows: for y in 0..height {
            for (picture, (_, rows)) in running.iter().enumerate() {
                if y >= heights[picture] {
                    continue;
                }
                // one that failed sends no more
                let Ok(row) = rows.recv() else { break 'rows };
                result = write(picture, y, &row);
                if result.is_err() {
                    break 'rows;
                }
            }
        }
        let mut reports = Vec::new();
        let mut failures = Vec::new();
        for (handle, rows) in running {
            drop(rows);
            match handle.join() {
                Ok(Ok(report)) => reports.push(report),
                Ok(Err(error)) => failures.push(error),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
        result?;
        // others were cancelled by the one that failed
        let own = failures
            .iter()
            .position(|error| !matches!(error, Error::Cancelled));
        match failures.is_empty() {
            true => Ok(reports),
            false => Err(failures.swap_remove(own.unwrap_or(0))),
        }
    })
}

/// Runs the pipeline; reads ahead and writes behind it if the schedule says so.
pub(super) fn run(
    source: &mut dyn RowSource,
    sink: &mut dyn RowSink,
    params: Params,
    schedule: Schedule,
) -> Result<Report, Error> {
    let go_on = &mut |_| ControlFlow::Continue(());
    let options = &Options::new(params)
        .with_threads(schedule.threads)
        .with_cell_rows(schedule.cell_rows);
    let rows = schedule.rows_in_flight;
    if rows == 0 {
        return pipeline::denoise(source, sink, options, go_on);
    }
    std::thread::scope(|scope| {
        let mut ahead = ReadAhead::start(scope, source, rows)?;
        let mut behind = WriteBehind::start(scope, sink, rows)?;
        let report = pipeline::denoise(&mut ahead, &mut behind, options, go_on);
        drop(ahead);
        // what went wrong at the far end is the reason for what the pipeline saw
        behind.finish()?;
        report
    })
}
