//! `linpred denoise`.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::io::Write;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use linpred::channels::{Preset, RoleRequest};
use linpred::image::ExtraLayers;
use linpred::job::{self, Input, InputRequest, JobOptions};
use linpred::{Error, Options};
use linpred_core::{Params, Quality};

use super::args::{
    DenoiseArguments, FormulasName, InputArguments, LogArguments, LogFormat, ProgressStyle,
    QualityName,
};
use super::errors;
use super::frames;
use super::progress::Progress;
use super::report::report;
use super::stop;

/// Denoises one image, or the frames of a sequence.
pub(crate) fn run(arguments: DenoiseArguments, log: &LogArguments) -> Result<ExitCode, Error> {
    let run = Run {
        options: options(&arguments),
        skip_existing: arguments.skip_existing,
        dry_run: arguments.dry_run,
        progress: arguments.progress,
        log_format: log.log_format,
        stop: stop::on_signals(),
        said: RefCell::default(),
    };
    let request = request(arguments.input);
    match frames::find(&request, &arguments.output, arguments.frames)? {
        None => run
            .image(&request, &arguments.output)
            .map(|()| ExitCode::SUCCESS),
        Some(frames) => run.sequence(&frames),
    }
}

/// What is the same for every frame.
struct Run {
    options: JobOptions,
    skip_existing: bool,
    dry_run: bool,
    progress: ProgressStyle,
    log_format: LogFormat,
    stop: Arc<AtomicBool>,
    /// Notes that have been written: what holds for every frame is said once.
    said: RefCell<BTreeSet<String>>,
}

impl Run {
    fn image(&self, request: &InputRequest, output: &Path) -> Result<(), Error> {
        if self.skip_existing && output.exists() {
            tracing::info!("{} exists, skipped", output.display());
            return Ok(());
        }
        let started = Instant::now();
        let input = Input::open(request)?;
        if self.dry_run {
            return dry_run(&input, &self.options);
        }
        self.announce(&input)?;
        let label = request.path.display().to_string();
        let mut progress = Progress::new(self.progress, input.height(), label);
        let mut told = |rows| progress.set(rows);
        let result = job::denoise(&input, output, &self.options, &self.stop, &mut told);
        progress.end();
        report(&result?, started.elapsed(), self.log_format, output);
        Ok(())
    }

    /// Says what a user should know before the job begins.
    fn announce(&self, input: &Input) -> Result<(), Error> {
        for assignment in &input.roles.assignments {
            tracing::debug!("{}: {}", assignment.role.name(), assignment.rule);
        }
        let new = |note: &&String| self.said.borrow_mut().insert((*note).clone());
        for note in input.roles.notes.iter().filter(new) {
            tracing::info!("{note}");
        }
        let notes = input.notes_on_output(self.options.extra)?;
        for note in notes.iter().filter(new) {
            tracing::warn!("{note}");
        }
        Ok(())
    }

    /// A frame that fails does not stop the others; the first failure's exit code is the sequence's.
    fn sequence(&self, frames: &[(InputRequest, PathBuf)]) -> Result<ExitCode, Error> {
        let mut failures = Vec::new();
        for (request, output) in frames {
            match self.image(request, output) {
                Ok(()) => {}
                Err(error @ Error::Cancelled) => return Err(error),
                Err(error) => {
                    tracing::error!("{}", errors::in_words(&error));
                    failures.push(errors::code(&error));
                }
            }
        }
        match failures.first() {
            None => Ok(ExitCode::SUCCESS),
            Some(&code) => {
                tracing::error!("{} of {} frames failed", failures.len(), frames.len());
                Ok(ExitCode::from(code))
            }
        }
    }
}

fn options(arguments: &DenoiseArguments) -> JobOptions {
    let quality = match arguments.quality {
        QualityName::Fast => Quality::Fast,
        QualityName::Balanced => Quality::Balanced,
        QualityName::High => Quality::High,
    };
    let mut params = match arguments.formulas {
        FormulasName::Robust => Params::new(quality),
        FormulasName::Literal => Params::literal(),
    };
    if let Some(coverage) = arguments.coverage {
        params.coverage = coverage;
    }
    let mut pipeline = Options::new(params);
    if let Some(threads) = arguments.threads {
        pipeline = pipeline.with_threads(threads);
    }
    let mut options = JobOptions::new(pipeline).with_extra(ExtraLayers {
        error: arguments.error_layer,
        models: arguments.models_layer,
    });
    if let Some(limit) = arguments.max_memory {
        options = options.with_memory_limit(limit);
    }
    match arguments.band {
        Some(band) => options.with_band(band),
        None => options,
    }
}

/// As many as there are processors.
pub(crate) fn all_threads() -> NonZeroUsize {
    std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN)
}

/// What the input arguments ask for.
pub(crate) fn request(arguments: InputArguments) -> InputRequest {
    InputRequest {
        path: arguments.noisy,
        other_half: arguments.other_half,
        roles: RoleRequest {
            preset: Preset::named(&arguments.preset),
            map: arguments.map,
            spp: arguments.spp.map(|spp| spp.get()),
            other_half: None,
        },
        layers: arguments.layers,
    }
}

fn dry_run(input: &Input, options: &JobOptions) -> Result<(), Error> {
    let (schedule, plan) = job::plan(input, options)?;
    let inspection = job::describe(input);
    let threads = schedule.threads;
    let rows = schedule.rows_in_flight;
    // nobody is left to be told when standard output is closed
    let _ = write!(
        std::io::stdout(),
        "{inspection}threads: {threads}, rows read ahead: {rows}\nmemory:\n{plan}\n"
    );
    plan.check(options.memory_limit)
}
