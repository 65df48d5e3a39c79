//! One file denoised into another.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use linpred_core::Params;

use crate::error::Error;
use crate::exr_file::compression::SharedCodec;
use crate::exr_file::output::check_output;
use crate::image::rewrite::Rewrite;
use crate::image::sink::ExrSink;
use crate::job::band::{BandSink, BandSource};
use crate::job::input::Input;
use crate::job::memory;
use crate::job::options::JobOptions;
use crate::job::plan::{self, Schedule};
use crate::row::{RowSink, RowSource};
use crate::stream::overlap::{ReadAhead, WriteBehind};
use crate::stream::pipeline::{self, Options};
use crate::stream::report::Report;

/// What a job did.
#[derive(Clone, Debug, Default)]
pub struct Summary {
    /// What the pipeline counted.
    pub report: Report,
    /// Samples that half precision cannot hold, clamped to its largest value.
    pub clamped: u64,
    /// Pixels whose extra layers do not sum to the colour in the input (so they cannot in the output).
    pub layers_off: u64,
    /// Bytes of memory that the process had in use at most so far, where the system tells.
    pub peak_memory: Option<u64>,
}

/// Denoises `input` into `output`. `progress` is told how many rows have been written; the job ends
/// with [`Error::Cancelled`] soon after `stop` is set, and leaves nothing behind.
pub fn denoise(
    input: &Input,
    output: &Path,
    options: &JobOptions,
    stop: &Arc<AtomicBool>,
    progress: &mut dyn FnMut(usize),
) -> Result<Summary, Error> {
    let inputs: Vec<&Path> = input.names.files().iter().map(|file| file.path()).collect();
    check_output(output, &inputs)?;
    let mut rewrite = input.rewrite(options.extra)?;
    let (schedule, plan) = plan::schedule(input, &rewrite, options);
    plan.check(options.memory_limit)?;
    memory::check_available(&plan, schedule.all_threads())?;
    let rows = match options.band {
        Some(band) => band.restrict(&mut rewrite, input.file())?,
        None => 0..input.height(),
    };
    let mut source = BandSource::new(input.source(options.memory_limit)?, &rows);
    let within = rows.start - source.first()..rows.end - source.first();
    let sink = sink(input, output, rewrite, options, schedule, stop)?;
    let mut sink = BandSink::new(sink, within.clone());
    let mut told = |done: usize| {
        progress(done.min(within.end).saturating_sub(within.start));
        match stop.load(Ordering::Relaxed) {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    };
    let params = options.pipeline.params;
    let report = run(&mut source, &mut sink, params, schedule, &mut told)?;
    Ok(Summary {
        report,
        clamped: sink.into_inner().finish()?,
        layers_off: source.inner().layers_off(),
        peak_memory: memory::peak(),
    })
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

/// Runs the pipeline; reads ahead and writes behind it if the schedule says so.
fn run(
    source: &mut dyn RowSource,
    sink: &mut dyn RowSink,
    params: Params,
    schedule: Schedule,
    progress: &mut dyn FnMut(usize) -> ControlFlow<()>,
) -> Result<Report, Error> {
    let options = &Options::new(params).with_threads(schedule.threads);
    let rows = schedule.rows_in_flight;
    if rows == 0 {
        return pipeline::denoise(source, sink, options, progress);
    }
    std::thread::scope(|scope| {
        let mut ahead = ReadAhead::start(scope, source, rows)?;
        let mut behind = WriteBehind::start(scope, sink, rows)?;
        let report = pipeline::denoise(&mut ahead, &mut behind, options, progress);
        drop(ahead);
        // what went wrong at the far end is the reason for what the pipeline saw
        behind.finish()?;
        report
    })
}
