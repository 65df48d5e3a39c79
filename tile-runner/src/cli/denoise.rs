//! `linpred denoise`.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use crate::channels::{Preset, RoleRequest};
use crate::image::OutputOptions;
use crate::job::{
    self, Frame, Input, InputRequest, JobOptions, MemoryPlan, NeighbourFiles, Remark, Schedule,
    Wrap,
};
use crate::{Error, Options};
use linpred_core::{Params, Quality};

use super::args::{
    DenoiseArguments, FormulasName, InputArguments, LogArguments, LogFormat, ProgressStyle,
    QualityName, WrapName,
};
use super::errors::DONE;
use super::progress::{Place, Progress};
use super::report::report;
use super::{errors, log, openjd, progress, stdout, stop, threads};

/// Denoises one image, or the frames of a sequence.
pub(crate) fn run(arguments: DenoiseArguments, log: &LogArguments) -> Result<u8, Error> {
    job::check_output_name(&arguments.output)?;
    let run = Run {
        options: options(&arguments),
        skip_existing: arguments.skip_existing,
        dry_run: arguments.dry_run,
        progress: arguments.progress,
        log_format: log.log_format,
        stop: stop::on_signals(),
        said: RefCell::default(),
    };
    let request = request(arguments.input).with_memory_limit(arguments.max_memory);
    let reach = arguments.temporal;
    let beside = [arguments.before, arguments.after];
    match job::frames(&request, &arguments.output, arguments.frames, reach)? {
        None => {
            let neighbours = reach.map(|reach| neighbours(&request, &beside, reach));
            let neighbours = neighbours.transpose()?;
            let files = (&request, neighbours.as_ref());
            run.image(files, &arguments.output, Place::ALONE)
                .map(|()| DONE)
        }
        Some(_) if beside.iter().any(|side| !side.is_empty()) => Err(Error::Usage(
            "--before and --after are for a single image: the frames of a sequence find those beside them by their numbers".into(),
        )),
        Some(frames) => run.sequence(&frames),
    }
}

/// The files of the frames beside a single image.
fn neighbours(
    request: &InputRequest,
    [before, after]: &[Vec<PathBuf>; 2],
    reach: NonZeroUsize,
) -> Result<NeighbourFiles, Error> {
    if before.is_empty() && after.is_empty() {
        return Err(Error::Usage(format!(
            "{} is a single image: say with --before and --after which frames are beside it, or name a sequence (shot.####.exr) and, with --frames, its number",
            request.path.display()
        )));
    }
    job::frames_beside(request, before, after, reach)
}

/// An image, and the frames beside it if they are to help it.
type Files<'a> = (&'a InputRequest, Option<&'a NeighbourFiles>);

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
    /// Denoises an image, which has this place among those of the command.
    fn image(&self, files: Files, output: &Path, place: Place) -> Result<(), Error> {
        let (request, neighbours) = files;
        if self.skip_existing && output.exists() {
            tracing::info!("{} exists, skipped", output.display());
            progress::skipped(self.progress, place);
            return Ok(());
        }
        let started = Instant::now();
        let pictures = match neighbours {
            None => Input::open_all(request)?,
            Some(neighbours) => job::open_frame(request, neighbours)?,
        };
        if self.dry_run {
            return dry_run(&pictures, &self.options);
        }
        self.announce(&pictures)?;
        let (rows, file) = (job::rows_to_write(&pictures, &self.options)?, &request.path);
        let mut progress = Progress::new(self.progress, rows, file, place, started);
        let mut told = |rows| progress.set(rows);
        let result = job::denoise(&pictures, output, &self.options, &self.stop, &mut told);
        progress.end();
        let done = result?;
        let broken = done.unused.iter().map(ToString::to_string);
        self.say_once(broken.map(Remark::Warning));
        report(&done, &pictures, started.elapsed(), self.log_format, output);
        Ok(())
    }

    /// Says what a user should know before the job begins.
    fn announce(&self, pictures: &[Input]) -> Result<(), Error> {
        let assignments = pictures.iter().flat_map(|input| &input.roles.assignments);
        for assignment in assignments {
            tracing::debug!("{}: {}", assignment.role.name(), assignment.rule);
        }
        self.say_once(job::remarks(pictures, self.options.output)?);
        Ok(())
    }

    fn say_once(&self, remarks: impl IntoIterator<Item = Remark>) {
        let mut said = self.said.borrow_mut();
        for remark in remarks {
            let (Remark::Note(text) | Remark::Warning(text)) = &remark;
            if said.insert(text.clone()) {
                log::remark(&remark);
            }
        }
    }

    /// A frame that fails does not stop the others; the first failure's exit code is the sequence's.
    fn sequence(&self, frames: &[Frame]) -> Result<u8, Error> {
        job::check_outputs(frames)?;
        let mut failures = Vec::new();
        for (before, frame) in frames.iter().enumerate() {
            let place = Place {
                frame: Some(frame.number),
                before,
                of: frames.len(),
            };
            let files = (&frame.request, frame.neighbours.as_ref());
            match self.image(files, &frame.output, place) {
                Ok(()) => {}
                Err(error @ Error::Cancelled) => return Err(error),
                Err(error) => {
                    tracing::error!("{}", errors::in_words(&error));
                    failures.push(error);
                }
            }
        }
        let Some(first) = failures.first() else {
            return Ok(DONE);
        };
        let how_many = format!("{} of {} frames failed", failures.len(), frames.len());
        if self.progress == ProgressStyle::Openjd {
            openjd::fail(&format!("{how_many}: {}", errors::in_words(first)));
        }
        tracing::error!("{how_many}");
        Ok(errors::code(first))
    }
}

fn options(arguments: &DenoiseArguments) -> JobOptions {
    let mut params = match arguments.formulas {
        FormulasName::Robust => Params::new(quality(arguments.quality)),
        FormulasName::Literal => Params::literal(),
        FormulasName::Wlr => Params::wlr(),
    };
    if let Some(coverage) = arguments.coverage {
        params.coverage = coverage;
    }
    let pipeline = Options::new(params).with_threads(threads::to_use(arguments.threads));
    let mut options = JobOptions::new(pipeline).with_output(OutputOptions {
        error: arguments.error_layer,
        models: arguments.models_layer,
        compression: arguments.compression,
    });
    if let Some(limit) = arguments.max_memory {
        options = options.with_memory_limit(limit);
    }
    match arguments.band {
        Some(band) => options.with_band(band),
        None => options,
    }
}

pub(crate) fn quality(name: QualityName) -> Quality {
    match name {
        QualityName::Fast => Quality::Fast,
        QualityName::Balanced => Quality::Balanced,
        QualityName::High => Quality::High,
    }
}

/// What the input arguments ask for.
pub(crate) fn request(arguments: InputArguments) -> InputRequest {
    let roles = RoleRequest {
        preset: Preset::named(&arguments.preset),
        map: arguments.map,
        features: arguments.feature,
        spp: arguments.spp.map(|spp| spp.get()),
        other_half: None,
    };
    let wrap = match arguments.wrap {
        WrapName::Auto => Wrap::Auto,
        WrapName::X => Wrap::X,
        WrapName::None => Wrap::Never,
    };
    InputRequest::new(arguments.noisy)
        .with_other_half(arguments.other_half)
        .with_roles(roles)
        .with_layers(arguments.layers)
        .with_wrap(wrap)
}

fn dry_run(pictures: &[Input], options: &JobOptions) -> Result<(), Error> {
    let (schedule, plan) = job::plan(pictures, options)?;
    print_plan(pictures, schedule, &plan)?;
    plan.check(options.memory_limit)
}

/// Prints how pictures would be denoised.
pub(crate) fn print_plan(
    pictures: &[Input],
    schedule: Schedule,
    plan: &MemoryPlan,
) -> Result<(), Error> {
    let inspection = job::describe(pictures);
    let threads = schedule.threads;
    let rows = schedule.rows_in_flight;
    stdout::print(&format!(
        "{inspection}threads: {threads}, rows read ahead: {rows}\nmemory:\n{plan}\n"
    ))
}
