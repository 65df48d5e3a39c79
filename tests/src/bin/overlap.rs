//! The three times of the overlap: reading and writing alone, computing alone, and the whole run.
//!
//!     cargo run --release -p linpred-tests --bin overlap -- large.exr output.exr threads
//!
//! Reading and writing overlap each other as they do in a run; computing reads its rows from memory and drops its output.

use std::error::Error;
use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use linpred::exr_file::codec::SharedCodec;
use linpred::job::{self, Input, InputRequest, JobOptions};
use linpred::overlap::{ROWS_IN_FLIGHT, ReadAhead, WriteBehind};
use linpred::pipeline::{self, Options};
use linpred::rewrite::ExtraLayers;
use linpred::row::{InputRow, OutputRow, RowLayout, RowSink, RowSource};
use linpred::sink::ExrSink;
use linpred_core::{Params, Quality};

/// Rows that are kept in memory and repeated.
const ROWS: usize = 256;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [input, output, threads] = arguments.as_slice() else {
        return Err("expected: input.exr output.exr threads".into());
    };
    let request = InputRequest {
        path: input.into(),
        ..InputRequest::default()
    };
    let input = Input::open(&request)?;
    let options = JobOptions {
        pipeline: Options {
            params: Params::new(Quality::Fast),
            threads: threads.parse::<NonZeroUsize>()?,
        },
        extra: ExtraLayers::default(),
        memory_limit: 4 << 30,
        band: None,
    };
    let output = Path::new(output);
    let files = read_and_write(&input, output)?;
    println!("reading and writing alone  {files:8.2} s");
    let computing = compute(&input, &options.pipeline)?;
    println!("computing alone            {computing:8.2} s");
    let started = Instant::now();
    let stop = Arc::new(AtomicBool::new(false));
    job::denoise(&input, output, &options, &stop, &mut |_| {})?;
    let whole = started.elapsed().as_secs_f64();
    let ratio = whole / files.max(computing);
    println!("whole run                  {whole:8.2} s, {ratio:.2} x the longer one");
    Ok(())
}

/// Seconds to read what a run reads and to write what it writes.
fn read_and_write(input: &Input, output: &Path) -> Result<f64, Box<dyn Error>> {
    let started = Instant::now();
    let mut source = input.source(u64::MAX)?;
    let layout = source.layout();
    let plan = input.rewrite(ExtraLayers::default())?;
    let stop = Arc::new(AtomicBool::new(false));
    let codec = SharedCodec::default();
    let mut sink = ExrSink::create(output, input.file().clone(), plan, &codec, u64::MAX, stop)?;
    std::thread::scope(|scope| -> Result<(), linpred::error::Error> {
        let mut ahead = ReadAhead::start(scope, &mut source, ROWS_IN_FLIGHT)?;
        let mut behind = WriteBehind::start(scope, &mut sink, ROWS_IN_FLIGHT)?;
        let (mut row, mut out) = (InputRow::new(&layout), OutputRow::new(&layout));
        for y in 0..layout.size.height() {
            ahead.read_row(y, &mut row)?;
            out.colour.clone_from(&row.colour);
            behind.write_row(y, &out)?;
        }
        behind.finish()
    })?;
    sink.finish()?;
    Ok(started.elapsed().as_secs_f64())
}

/// Seconds to denoise rows from memory into nothing.
fn compute(input: &Input, options: &Options) -> Result<f64, Box<dyn Error>> {
    let mut source = input.source(u64::MAX)?;
    let layout = source.layout();
    let mut rows = Vec::new();
    for y in 0..ROWS.min(layout.size.height()) {
        let mut row = InputRow::new(&layout);
        source.read_row(y, &mut row)?;
        rows.push(row);
    }
    let mut repeated = Repeated { layout, rows };
    let started = Instant::now();
    let go_on = &mut |_| ControlFlow::Continue(());
    pipeline::denoise(&mut repeated, &mut Nowhere, options, go_on)?;
    Ok(started.elapsed().as_secs_f64())
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

    fn read_row(&mut self, y: usize, row: &mut InputRow) -> Result<(), linpred::error::Error> {
        let inside = y % (2 * self.rows.len());
        row.clone_from(&self.rows[inside.min(2 * self.rows.len() - 1 - inside)]);
        Ok(())
    }
}

struct Nowhere;

impl RowSink for Nowhere {
    fn write_row(&mut self, _: usize, _: &OutputRow) -> Result<(), linpred::error::Error> {
        Ok(())
    }
}
