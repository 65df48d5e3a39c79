//! What the commands do to files.

use std::ffi::OsString;
use std::num::{NonZeroU32, NonZeroUsize};
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::atomic::Ordering;

use linpred::channels::{FeatureRequest, Mapping, PRESET_NAMES, Preset, RoleRequest};
use linpred::cli;
use linpred::image::{OutputCompression, OutputOptions};
use linpred::job::{
    self, Band, CompareRequest, FrameFiles, Input, InputRequest, JobOptions, MergeRequest, Merging,
    NeighbourFiles, Remark, Wrap,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::errors::{in_words, raise};
use crate::options::{Computing, threads};
use crate::report;
use crate::watch::watched;

/// Which channels of which files.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Reading {
    path: PathBuf,
    preset: String,
    /// `ROLE=CHANNEL`
    map: Vec<String>,
    features: Vec<String>,
    spp: Option<i64>,
    other_half: Option<PathBuf>,
    layers: Vec<String>,
    wrap: String,
    /// Bytes, or a size as the command line takes it.
    max_memory: Option<String>,
    /// The frames beside it, if they are to help it.
    neighbours: Option<Beside>,
}

/// The frames before and after one, nearest first: of each its file and that of its other half.
type Beside = (
    Vec<(PathBuf, Option<PathBuf>)>,
    Vec<(PathBuf, Option<PathBuf>)>,
);

fn to_files((before, after): Beside) -> NeighbourFiles {
    let side = |frames: Vec<(PathBuf, Option<PathBuf>)>| {
        let frames = frames.into_iter();
        frames
            .map(|(path, other_half)| FrameFiles { path, other_half })
            .collect()
    };
    NeighbourFiles {
        before: side(before),
        after: side(after),
    }
}

fn from_files(files: NeighbourFiles) -> Beside {
    let side = |frames: Vec<FrameFiles>| {
        let frames = frames.into_iter();
        frames.map(|of| (of.path, of.other_half)).collect()
    };
    (side(files.before), side(files.after))
}

fn open(request: &InputRequest, neighbours: Option<Beside>) -> Result<Vec<Input>, linpred::Error> {
    match neighbours {
        None => Input::open_all(request),
        Some(beside) => job::open_frame(request, &to_files(beside)),
    }
}

/// How many frames on each side may help.
fn reach(temporal: i64) -> PyResult<NonZeroUsize> {
    let reach = usize::try_from(temporal).ok().and_then(NonZeroUsize::new);
    reach
        .filter(|reach| *reach <= job::MOST_REACH)
        .ok_or_else(|| {
            PyValueError::new_err(format!(
                "temporal {temporal}: it is 1 to {} frames on each side, or True for {}",
                job::MOST_REACH,
                job::DEFAULT_REACH
            ))
        })
}

impl Reading {
    pub(crate) fn request(self) -> PyResult<InputRequest> {
        let refused = |words: String| PyValueError::new_err(words);
        let preset = Preset::named(&self.preset);
        if preset.is_none() && self.preset != "auto" {
            return Err(refused(format!(
                "preset {:?}: it is one of {}",
                self.preset,
                PRESET_NAMES.join(", ")
            )));
        }
        let spp = |spp: i64| {
            let spp = u32::try_from(spp).ok().and_then(NonZeroU32::new);
            spp.map(NonZeroU32::get)
        };
        let spp = match self.spp {
            None => None,
            Some(given) => Some(
                spp(given)
                    .ok_or_else(|| refused(format!("spp {given}: it is 1 or more samples")))?,
            ),
        };
        let map: Result<Vec<Mapping>, _> =
            self.map.iter().map(|entry| Mapping::parse(entry)).collect();
        let features = self.features.iter();
        let features: Result<Vec<FeatureRequest>, _> =
            features.map(|entry| FeatureRequest::parse(entry)).collect();
        let roles = RoleRequest {
            preset,
            map: map.map_err(raise)?,
            features: features.map_err(raise)?,
            spp,
            other_half: None,
        };
        let wrap = match self.wrap.as_str() {
            "auto" => Wrap::Auto,
            "x" => Wrap::X,
            "none" => Wrap::Never,
            other => return Err(refused(format!("wrap {other:?}: it is auto, x or none"))),
        };
        let limit = self.max_memory.as_deref().map(cli::parse_size).transpose();
        Ok(InputRequest::new(self.path)
            .with_other_half(self.other_half)
            .with_roles(roles)
            .with_layers(self.layers)
            .with_wrap(wrap)
            .with_memory_limit(limit.map_err(raise)?))
    }
}

/// How to write.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Writing {
    output: PathBuf,
    error_layer: bool,
    models_layer: bool,
    band: Option<String>,
    compression: String,
}

impl Writing {
    fn options(&self, computing: &Computing, limit: Option<u64>) -> PyResult<JobOptions> {
        let options = JobOptions::new(computing.options()?).with_output(OutputOptions {
            error: self.error_layer,
            models: self.models_layer,
            compression: OutputCompression::parse(&self.compression).map_err(raise)?,
        });
        let limit = limit.unwrap_or(options.memory_limit);
        let options = options.with_memory_limit(limit);
        match &self.band {
            None => Ok(options),
            Some(band) => Ok(options.with_band(Band::parse(band).map_err(raise)?)),
        }
    }
}

/// The frames of a sequence, (number, input, other half, output, frames beside it) each; `None` if the names are those of single images. Without `output` nothing is to be
/// written.
#[pyfunction]
#[expect(clippy::type_complexity, reason = "a tuple is what Python reads")]
pub(crate) fn frames(
    reading: Reading,
    output: Option<PathBuf>,
    wanted: Option<Bound<'_, PyAny>>,
    temporal: Option<i64>,
) -> PyResult<Option<Vec<(u32, PathBuf, Option<PathBuf>, PathBuf, Option<Beside>)>>> {
    let temporal = temporal.map(reach).transpose()?;
    let wanted = match wanted {
        None => None,
        Some(wanted) => Some(match wanted.extract::<String>() {
            Ok(text) => job::parse_frames(&text).map_err(raise)?,
            Err(_) => wanted.extract::<Vec<u32>>()?,
        }),
    };
    let request = reading.request()?;
    let names = output.as_ref().unwrap_or(&request.path);
    let frames = job::frames(&request, names, wanted, temporal).map_err(raise)?;
    if let (Some(frames), Some(_)) = (&frames, &output) {
        job::check_outputs(frames).map_err(raise)?;
    }
    let tuple = |frame: job::Frame| {
        let request = frame.request;
        let beside = frame.neighbours.map(from_files);
        (
            frame.number,
            request.path,
            request.other_half,
            frame.output,
            beside,
        )
    };
    Ok(frames.map(|frames| frames.into_iter().map(tuple).collect()))
}

/// The frames beside a single image.
#[pyfunction]
pub(crate) fn beside(
    reading: Reading,
    before: Vec<PathBuf>,
    after: Vec<PathBuf>,
    temporal: i64,
) -> PyResult<Beside> {
    let files = job::frames_beside(&reading.request()?, &before, &after, reach(temporal)?);
    files.map(from_files).map_err(raise)
}

/// Refuses what makes no sense whatever a file holds.
#[pyfunction]
pub(crate) fn check(reading: Reading, writing: Writing, computing: Computing) -> PyResult<()> {
    let request = reading.request()?;
    job::check_output_name(&writing.output).map_err(raise)?;
    writing
        .options(&computing, request.memory_limit)
        .map(|_| ())
}

/// Denoises a file into another: the fields of the package's `FileReport`. Warnings are given to `warn` before it begins.
#[pyfunction]
pub(crate) fn denoise_file<'py>(
    py: Python<'py>,
    reading: Reading,
    writing: Writing,
    computing: Computing,
    warn: &Bound<'py, PyAny>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let mut reading = reading;
    let neighbours = reading.neighbours.take();
    let request = reading.request()?;
    let options = writing.options(&computing, request.memory_limit)?;
    let pictures = py.detach(|| open(&request, neighbours)).map_err(raise)?;
    let rows = job::rows_to_write(&pictures, &options).map_err(raise)?;
    let (mut notes, mut warnings) = (Vec::new(), Vec::new());
    for remark in job::remarks(&pictures, options.output).map_err(raise)? {
        match remark {
            Remark::Note(note) => notes.push(note),
            Remark::Warning(warning) => warnings.push(warning),
        }
    }
    for warning in &warnings {
        warn.call1((warning,))?;
    }
    let output = &writing.output;
    let done = watched(py, rows, progress.as_ref(), |stop, tell| {
        job::denoise(&pictures, output, &options, stop, tell)
    })?;
    let fields = PyDict::new(py);
    let reports: PyResult<Vec<_>> = done.reports.iter().map(|r| report::fields(py, r)).collect();
    fields.set_item("pictures", PyList::new(py, reports?)?)?;
    fields.set_item("notes", notes)?;
    fields.set_item("warnings", &warnings)?;
    fields.set_item("clamped", done.clamped)?;
    fields.set_item("layers_off", done.layers_off.iter().sum::<u64>())?;
    let help = done.help.iter();
    let help: Vec<_> = help
        .map(|help| (help.frames, help.before.clone(), help.after.clone()))
        .collect();
    fields.set_item("help", help)?;
    let unused: Vec<_> = done.unused.iter().map(ToString::to_string).collect();
    for text in unused.iter().filter(|text| !warnings.contains(text)) {
        warn.call1((text,))?;
    }
    fields.set_item("unused", unused)?;
    Ok(fields)
}

/// How a file would be denoised: threads, bytes of memory, and both in words; refused as the run would be if that is too much.
#[pyfunction]
pub(crate) fn plan(
    py: Python<'_>,
    reading: Reading,
    writing: Writing,
    computing: Computing,
) -> PyResult<(usize, u64, String)> {
    let mut reading = reading;
    let neighbours = reading.neighbours.take();
    let request = reading.request()?;
    let options = writing.options(&computing, request.memory_limit)?;
    let pictures = py.detach(|| open(&request, neighbours)).map_err(raise)?;
    let (schedule, plan) = job::plan(&pictures, &options).map_err(raise)?;
    plan.check(options.memory_limit).map_err(raise)?;
    Ok((schedule.threads.get(), plan.total(), plan.to_string()))
}

/// What a file holds, as JSON; and what stands in the way of denoising it.
#[pyfunction]
pub(crate) fn inspect(
    py: Python<'_>,
    reading: Reading,
    pixels: bool,
    asked: Option<i64>,
) -> PyResult<String> {
    let request = reading.request()?;
    let (threads, limit) = (
        threads(asked)?,
        request.memory_limit.unwrap_or(job::DEFAULT_MEMORY_LIMIT),
    );
    let found = watched(py, 0, None, |stop, _| {
        let mut go_on = |_| match stop.load(Ordering::Relaxed) {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        };
        job::inspect_with(&request, |input| match pixels {
            true => job::survey(input, threads, limit, &mut go_on).map(Some),
            false => Ok(None),
        })
    });
    let (mut inspection, problem) = found?;
    inspection.problem = problem.as_ref().map(in_words);
    Ok(serde_json::json!(inspection).to_string())
}

/// Compares an image with a reference, as JSON.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "the package's own are named")]
pub(crate) fn compare(
    py: Python<'_>,
    image: PathBuf,
    reference: PathBuf,
    input: Option<PathBuf>,
    map: Vec<String>,
    heatmap: Option<PathBuf>,
    picture: Option<PathBuf>,
    asked: Option<i64>,
    max_memory: Option<String>,
) -> PyResult<String> {
    let map: Result<Vec<Mapping>, _> = map.iter().map(|entry| Mapping::parse(entry)).collect();
    let limit = max_memory.as_deref().map(cli::parse_size).transpose();
    let request = CompareRequest::new(image, reference)
        .with_input(input)
        .with_map(map.map_err(raise)?)
        .with_memory_limit(limit.map_err(raise)?.unwrap_or(job::DEFAULT_MEMORY_LIMIT))
        .with_threads(threads(asked)?);
    let pictures = cli::Pictures { heatmap, picture };
    let found = watched(py, 0, None, |stop, _| {
        cli::compare(&request, &pictures, stop)
    })?;
    Ok(serde_json::json!(found).to_string())
}

/// Puts the bands of an image together.
#[pyfunction]
pub(crate) fn stitch(py: Python<'_>, bands: Vec<PathBuf>, output: PathBuf) -> PyResult<()> {
    watched(py, 0, None, |stop, _| {
        let bands: Vec<_> = bands.iter().map(PathBuf::as_path).collect();
        job::stitch(&bands, &output, stop)
    })
}

/// Merges the passes of an image. `reading` is of each of them, but for the path. Warnings are given to `warn` before it begins.
#[pyfunction]
pub(crate) fn merge<'py>(
    py: Python<'py>,
    passes: Vec<PathBuf>,
    reading: Reading,
    output: PathBuf,
    warn: &Bound<'py, PyAny>,
    progress: Option<Py<PyAny>>,
) -> PyResult<()> {
    let InputRequest {
        roles,
        memory_limit,
        ..
    } = reading.request()?;
    job::check_output_name(&output).map_err(raise)?;
    let request = MergeRequest::new(passes)
        .with_roles(roles)
        .with_memory_limit(memory_limit.unwrap_or(job::DEFAULT_MEMORY_LIMIT));
    let merging = py.detach(|| Merging::open(&request)).map_err(raise)?;
    for remark in merging.remarks() {
        if let Remark::Warning(warning) = remark {
            warn.call1((warning,))?;
        }
    }
    let merged = watched(py, merging.height(), progress.as_ref(), |stop, tell| {
        merging.write(&output, stop, tell)
    })?;
    match merged.lost {
        0 => Ok(()),
        lost => warn
            .call1((format!(
                "{lost} pixels of the passes are not finite: they took no part, and their samples are not counted"
            ),))
            .map(|_| ()),
    }
}

/// The command line; its exit code.
#[pyfunction]
pub(crate) fn main(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| cli::run(arguments))
}
