//! The map of samples of a file.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use exr::meta::attribute::SampleType;

use crate::error::{Error, Remedy};
use crate::exr_file::Part;
use crate::exr_file::attributes::{INPUT_ATTRIBUTE, OPTIONS_ATTRIBUTE, VERSION_ATTRIBUTE};
use crate::exr_file::output::check_output;
use crate::image::area::{Unwrapped, Wrapped};
use crate::image::new_image::NewImage;
use crate::image::rewrite::Rewrite;
use crate::job::denoise::run;
use crate::job::input::Input;
use crate::job::memory::{self, MemoryPlan};
use crate::job::options::JobOptions;
use crate::job::output_name::check_output_name;
use crate::job::plan::{self, Schedule};
use crate::row::{OutputRow, RowSink, RowSource};
use crate::sampling::{self, Goal, Measurement, SampleMap, Scratch};

/// The channel of a map: how many samples more each pixel should get, whole numbers.
pub const MAP_CHANNEL: &str = "samples";

/// Makes the map of a picture that reaches `goal`, into the file `output`, whose one channel is [`MAP_CHANNEL`]. What was not rendered of the picture gets nothing, and takes no part in what is
/// meant by an average. `options` say how to denoise ([`Options::for_sampling`](crate::Options::for_sampling)). `progress` is told how many of the [`rows_to_measure`] have been; the job
/// ends with [`Error::Cancelled`] soon after `stop` is set, and leaves nothing behind.
///
/// [`Error::Incomplete`] if nothing says how many samples pixels have; [`Error::Usage`] if a pixel would get too many, if the options are for a band, or if `output` has the name of another format;
/// and the errors of reading and writing.
pub fn sample_map(
    picture: &Input,
    output: &Path,
    goal: Goal,
    options: &JobOptions,
    stop: &Arc<AtomicBool>,
    progress: &mut (dyn FnMut(usize) + Send),
) -> Result<SampleMap, Error> {
    let inputs: Vec<&Path> = picture
        .names
        .files()
        .iter()
        .map(|file| file.path())
        .collect();
    check_output_name(output)?;
    check_output(output, &inputs)?;
    if options.band.is_some() {
        return Err(Error::Usage(
            "a map of samples is of a whole image: its budget is shared by all of it".into(),
        ));
    }
    let (schedule, plan) = plan_map(picture, options)?;
    plan.check(options.memory_limit)?;
    memory::check_available(&plan, schedule.all_threads())?;
    let mut measured = measure(picture, output, options, schedule, stop, progress)?;
    let mut map = measured.plan(goal)?;
    write(picture, output, &goal, options, &mut map)?;
    Ok(map)
}

/// How many rows [`sample_map`] denoises, which its progress counts.
pub fn rows_to_measure(picture: &Input) -> usize {
    sampling::rows_to_measure(&picture.layout())
}

/// How [`sample_map`] would denoise the picture, and what it would hold in memory. Errors as for [`plan`](super::plan()).
pub fn plan_map(picture: &Input, options: &JobOptions) -> Result<(Schedule, MemoryPlan), Error> {
    let beside = Measurement::bytes(picture.area.size)
        .saturating_add(NewImage::bytes(part(picture), &channels()));
    let options = JobOptions {
        memory_limit: options.memory_limit.saturating_sub(beside),
        ..*options
    };
    // nothing is written while it is denoised
    let rewrite = Rewrite::new(picture.file(), &[], options.output, &[])?;
    let pictures = std::slice::from_ref(picture);
    let (schedule, mut plan) = plan::schedule(pictures, &rewrite, &options);
    plan.add("the map of samples", beside);
    Ok((schedule, plan))
}

/// Denoises the picture twice; what is put aside lies beside the output.
fn measure(
    picture: &Input,
    output: &Path,
    options: &JobOptions,
    schedule: Schedule,
    stop: &AtomicBool,
    progress: &mut (dyn FnMut(usize) + Send),
) -> Result<Measurement, Error> {
    let Some(samples) = &picture.roles.samples else {
        return Err(Error::Incomplete {
            problem: format!(
                "{}: no channel and no attribute states how many samples pixels have",
                picture.path().display()
            ),
            remedy: Remedy::Samples,
        });
    };
    let limit = options.memory_limit;
    let mut source = picture.source(limit)?.with_samples(samples.count);
    let mut before = 0;
    let mut denoise = |source: &mut dyn RowSource, sink: &mut dyn RowSink| {
        let own = source.layout();
        let told = |y: usize, row: &OutputRow| {
            sink.write_row(y, row)?;
            progress(before + y + 1);
            match stop.load(Ordering::Relaxed) {
                true => Err(Error::Cancelled),
                false => Ok(()),
            }
        };
        let mut source = Wrapped::new(source, picture.wrap);
        let mut sink = Unwrapped::new(told, &own, picture.wrap);
        let report = run(&mut source, &mut sink, options.pipeline.params, schedule);
        before += own.size.height();
        report
    };
    sampling::measure_by(&mut source, &scratch(output), &mut denoise)
}

/// Beside the output, where there is room for it.
fn scratch(output: &Path) -> Scratch {
    let folder = output
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty());
    Scratch::Directory(folder.map_or_else(|| PathBuf::from("."), Path::to_owned))
}

fn part(picture: &Input) -> &Part {
    let at = picture.roles.colour[0];
    &picture.names.files()[at.file].parts()[at.part]
}

fn channels() -> [(String, SampleType); 1] {
    [(MAP_CHANNEL.to_owned(), SampleType::F32)]
}

/// Writes the map into the picture's window.
fn write(
    picture: &Input,
    output: &Path,
    goal: &Goal,
    options: &JobOptions,
    map: &mut SampleMap,
) -> Result<(), Error> {
    let params = &options.pipeline.params;
    let made = format!(
        "{goal}; formulas {:?}; coverage {}; vary features {}",
        params.formulas, params.coverage, params.vary_features
    );
    let marks = [
        (VERSION_ATTRIBUTE, env!("CARGO_PKG_VERSION").to_owned()),
        (OPTIONS_ATTRIBUTE, made),
        (INPUT_ATTRIBUTE, picture.fingerprints()?),
    ];
    let mut image = NewImage::create(output, part(picture), &channels(), &marks)?;
    let area = picture.area;
    let mut own = vec![0; area.size.width()];
    let mut row = vec![0.0; picture.width()];
    for y in 0..picture.height() {
        row.fill(0.0);
        let inside = y.checked_sub(area.y);
        if let Some(y) = inside.filter(|y| *y < area.size.height()) {
            map.read_row(y, &mut own)?;
            for (samples, &more) in row[area.x..].iter_mut().zip(&own) {
                // exact: a map has no larger numbers than floats hold
                *samples = more as f32;
            }
        }
        image.write_row(&[&row])?;
    }
    image.finish()
}
