//! One file denoised into another.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use linpred_core::Params;

use crate::error::Error;
use crate::exr_file::compression::SharedCodec;
use crate::exr_file::output::check_output;
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
    let limit = options.memory_limit;
    let codec = match schedule.codes_at_once {
        true => SharedCodec::default(),
        false => input.file().codec().clone(),
    };
    let sink = ExrSink::create(
        output,
        input.file().clone(),
        rewrite,
        &codec,
        limit,
        stop.clone(),
    )?;
    let mut sink = BandSink::new(sink, within.clone());
    let mut told = |done: usize| {
        progress(done.min(within.end).saturating_sub(within.start));
        if stop.load(Ordering::Relaxed) {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    };
    let report = run(
        &mut source,
        &mut sink,
        options.pipeline.params,
        schedule,
        &mut told,
    )?;
    let clamped = sink.into_inner().finish()?;
    Ok(Summary {
        report,
        clamped,
        layers_off: source.inner().layers_off(),
        peak_memory: memory::peak(),
    })
}

/// Runs the pipeline; reads ahead and writes behind it if the schedule says so.
fn run(
    source: &mut dyn RowSource,
    sink: &mut dyn RowSink,
    params: Params,
    schedule: Schedule,
    progress: &mut dyn FnMut(usize) -> ControlFlow<()>,
) -> Result<Report, Error> {
    let options = &Options {
        params,
        threads: schedule.threads,
    };
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
