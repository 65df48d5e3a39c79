//! The three times of the overlap: reading and writing alone, computing alone, and the whole run.
//!
//!     cargo run --release -p linpred-tests --bin overlap -- large.exr output.exr threads [fast|balanced|high]
//!
//! Reading and writing overlap each other as they do in a run; computing reads its rows from memory and drops its output. Processor
//! seconds are printed too, where the system tells: unlike the others they say something on a machine that does more than this.

use std::error::Error;
use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use linpred::image::OutputOptions;
use linpred::job::{Input, InputRequest, JobOptions};
use linpred::overlap::{ROWS_IN_FLIGHT, ReadAhead, WriteBehind};
use linpred::{InputRow, Options, OutputRow, RowLayout, RowSink, RowSource, denoise};
use linpred_core::{Params, Quality};

/// Rows that are kept in memory, and repeated if the image has more.
const ROWS: usize = 4096;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [input, output, threads, quality @ ..] = arguments.as_slice() else {
        return Err("expected: input.exr output.exr threads [fast|balanced|high]".into());
    };
    let quality = match quality {
        [] => Quality::default(),
        [name] if name == "fast" => Quality::Fast,
        [name] if name == "balanced" => Quality::Balanced,
        [name] if name == "high" => Quality::High,
        _ => return Err("expected fast, balanced or high".into()),
    };
    let request = InputRequest::new(input);
    let input = Input::open(&request)?;
    let threads = threads.parse::<NonZeroUsize>()?;
    let pipeline = Options::new(Params::new(quality)).with_threads(threads);
    let options = JobOptions::new(pipeline).with_memory_limit(4 << 30);
    let output = Path::new(output);
    let files = timed("reading and writing alone", || {
        read_and_write(&input, output)
    })?;
    let mut rows = repeated_rows(&input)?;
    let computing = timed("computing alone", || compute(&mut rows, &options.pipeline))?;
    let whole = timed("whole run", || {
        let stop = Arc::new(AtomicBool::new(false));
        linpred::job::denoise(
            std::slice::from_ref(&input),
            output,
            &options,
            &stop,
            &mut |_| {},
        )
        .map(drop)
    })?;
    println!("{:.2} times the longer one", whole / files.max(computing));
    Ok(())
}

/// Prints how long `work` takes, and gives its seconds.
fn timed(
    what: &str,
    work: impl FnOnce() -> Result<(), linpred::Error>,
) -> Result<f64, linpred::Error> {
    let (started, before) = (Instant::now(), processor_seconds());
    work()?;
    let seconds = started.elapsed().as_secs_f64();
    let processors = before.zip(processor_seconds()).map(|(a, b)| b - a);
    let processors = processors.map_or(String::new(), |s| format!(", {s:.2} s of processors"));
    println!("{what:26} {seconds:8.2} s{processors}");
    Ok(seconds)
}

/// Processor time of this process so far, in Linux's hundredths of a second.
fn processor_seconds() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // the second field, the name, may hold anything but ends in the last parenthesis; user and system are the 14th and 15th
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks = fields
        .get(11..13)?
        .iter()
        .map(|field| field.parse::<f64>().ok());
    Some(ticks.sum::<Option<f64>>()? / 100.0)
}

/// Reads what a run reads, and writes what it writes.
fn read_and_write(input: &Input, output: &Path) -> Result<(), linpred::Error> {
    let mut source = input.source(u64::MAX)?;
    let layout = source.layout();
    let stop = Arc::new(AtomicBool::new(false));
    let mut sink = input.sink(output, OutputOptions::default(), u64::MAX, stop)?;
    std::thread::scope(|scope| -> Result<(), linpred::Error> {
        let mut ahead = ReadAhead::start(scope, &mut source, ROWS_IN_FLIGHT)?;
        let mut behind = WriteBehind::start(scope, &mut sink, ROWS_IN_FLIGHT)?;
        let (mut row, mut out) = (InputRow::new(&layout), OutputRow::new(&layout));
        for y in 0..layout.size.height() {
            ahead.read_row(y, &mut row)?;
            // none is as it came, or its chunk would be copied as it is stored
            for (own, came) in out.colour.iter_mut().zip(&row.colour) {
                own.iter_mut()
                    .zip(came)
                    .for_each(|(own, came)| *own = 1.25 * came);
            }
            behind.write_row(y, &out)?;
        }
        behind.finish()
    })?;
    sink.finish().map(drop)
}

/// The first rows of a file.
fn repeated_rows(input: &Input) -> Result<Repeated, linpred::Error> {
    let mut source = input.source(u64::MAX)?;
    let layout = source.layout();
    let mut rows = Vec::new();
    for y in 0..ROWS.min(layout.size.height()) {
        let mut row = InputRow::new(&layout);
        source.read_row(y, &mut row)?;
        rows.push(row);
    }
    Ok(Repeated { layout, rows })
}

/// Denoises rows from memory into nothing.
fn compute(rows: &mut Repeated, options: &Options) -> Result<(), linpred::Error> {
    let go_on = &mut |_| ControlFlow::Continue(());
    denoise(rows, &mut Nowhere, options, go_on).map(drop)
}

/// Rows from memory, forth and back.
struct Repeated {
    layout: RowLayout,
    rows: Vec<InputRow>,
}

impl RowSource for Repeated {
    fn layout(&self) -> RowLayout {
        self.layout
    }

    fn read_row(&mut self, y: usize, row: &mut InputRow) -> Result<(), linpred::Error> {
        let inside = y % (2 * self.rows.len());
        row.clone_from(&self.rows[inside.min(2 * self.rows.len() - 1 - inside)]);
        Ok(())
    }
}

struct Nowhere;

impl RowSink for Nowhere {
    fn write_row(&mut self, _: usize, _: &OutputRow) -> Result<(), linpred::Error> {
        Ok(())
    }
}
