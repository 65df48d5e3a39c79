//! `linpred denoise`.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::path::Path;
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
use super::frames::{self, Frame};
use super::progress::Progress;
use super::report::report;
use super::{errors, output_name, stdout, stop, threads};

/// Denoises one image, or the frames of a sequence.
pub(crate) fn run(arguments: DenoiseArguments, log: &LogArguments) -> Result<ExitCode, Error> {
    output_name::check(&arguments.output)?;
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
            .image(&request, &arguments.output, None)
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
    /// Denoises an image, which is `frame` of a sequence.
    fn image(
        &self,
        request: &InputRequest,
        output: &Path,
        frame: Option<u32>,
    ) -> Result<(), Error> {
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
        let (rows, file) = (input.height(), &request.path);
        let mut progress = Progress::new(self.progress, rows, file, frame, started);
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
    fn sequence(&self, frames: &[Frame]) -> Result<ExitCode, Error> {
        let mut failures = Vec::new();
        for frame in frames {
            match self.image(&frame.request, &frame.output, Some(frame.number)) {
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
    let pipeline = Options::new(params).with_threads(threads::to_use(arguments.threads));
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
    stdout::print(&format!(
        "{inspection}threads: {threads}, rows read ahead: {rows}\nmemory:\n{plan}\n"
    ))?;
    plan.check(options.memory_limit)
}
