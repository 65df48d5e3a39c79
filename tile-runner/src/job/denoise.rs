//! One file denoised into another.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use linpred_core::Params;

use crate::channels::layers::{self, Layer};
use crate::channels::names::{ChannelNames, ChannelRef};
use crate::channels::roles::{RoleRequest, Roles, resolve};
use crate::error::Error;
use crate::exr_file::ExrFile;
use crate::exr_file::compression::SharedCodec;
use crate::geometry::ImageSize;
use crate::image::rewrite::{ExtraLayers, Rewrite};
use crate::image::sink::ExrSink;
use crate::image::source::{self, ExrSource};
use crate::job::band::{Band, BandSink, BandSource};
use crate::job::memory;
use crate::job::plan::{self, Schedule};
use crate::row::{RowLayout, RowSink, RowSource};
use crate::stream::overlap::{ReadAhead, WriteBehind};
use crate::stream::pipeline::{self, Options, Report};

/// Which channels of which files.
#[derive(Clone, Debug, Default)]
pub struct InputRequest {
    /// The noisy image.
    pub path: PathBuf,
    /// The image from the other half of the samples, if the noisy image is from one half.
    pub other_half: Option<PathBuf>,
    /// How roles are assigned.
    pub roles: RoleRequest,
    /// Names, with `*` and `?`, of layers to denoise with the models of the colour.
    pub layers: Vec<String>,
}

/// An opened input whose channels have their roles.
#[derive(Clone, Debug)]
pub struct Input {
    /// The files, and their channels by name.
    pub names: ChannelNames,
    /// Which channel does what.
    pub roles: Roles,
    /// The layers to be denoised beside the colour.
    pub layers: Vec<Layer>,
}

impl Input {
    /// Opens the files and assigns the roles.
    pub fn open(request: &InputRequest) -> Result<Self, Error> {
        let mut names = ChannelNames::new(Arc::new(ExrFile::open(&request.path)?));
        let mut roles = request.roles.clone();
        if let Some(path) = &request.other_half {
            if same_file::is_same_file(path, &request.path).unwrap_or(false) {
                return Err(Error::Usage(format!(
                    "--other-half {} is the noisy image itself",
                    path.display()
                )));
            }
            roles.other_half = Some(names.add(Arc::new(ExrFile::open(path)?)));
        }
        let roles = resolve(&names, &roles)?;
        let layers = layers::select(&names, &roles, &request.layers)?;
        Ok(Self {
            names,
            roles,
            layers,
        })
    }

    /// The noisy image.
    pub fn file(&self) -> &Arc<ExrFile> {
        &self.names.files()[0]
    }

    /// Rows of the image.
    pub fn height(&self) -> usize {
        let at = self.roles.colour[0];
        self.names.files()[at.file].parts()[at.part]
            .header
            .layer_size
            .1
    }

    /// Columns of the image.
    pub fn width(&self) -> usize {
        let at = self.roles.colour[0];
        self.names.files()[at.file].parts()[at.part]
            .header
            .layer_size
            .0
    }

    /// What its rows hold; of an empty image, those of one pixel.
    pub fn layout(&self) -> RowLayout {
        let pixel = || ImageSize::new(1, 1).expect("one pixel is an image");
        let size = ImageSize::new(self.width(), self.height()).unwrap_or_else(pixel);
        source::layout(&self.roles, size, self.layers.len())
    }

    /// Every channel that is read.
    pub fn channels(&self) -> Vec<ChannelRef> {
        let assigned = self.roles.assignments.iter().flat_map(|a| &a.channels);
        let mut all: Vec<ChannelRef> = assigned.copied().collect();
        for layer in &self.layers {
            all.extend(layer.channels);
            all.extend(layer.variance.channels());
        }
        all
    }

    /// A source of its rows (see [`ExrSource::new`]).
    pub fn source(&self, limit: u64) -> Result<ExrSource, Error> {
        let layers = self
            .layers
            .iter()
            .map(|layer| (layer.channels, layer.variance))
            .collect();
        ExrSource::new(self.names.files(), &self.roles, layers, limit)
    }

    /// The output file that denoising it makes.
    pub fn rewrite(&self, extra: ExtraLayers) -> Result<Rewrite, Error> {
        let layers: Vec<_> = self.layers.iter().map(|layer| layer.channels).collect();
        Rewrite::plan(self.file(), &self.roles.colour, &layers, extra)
    }
}

/// How to denoise.
#[derive(Clone, Copy, Debug)]
pub struct JobOptions {
    /// What to compute, on how many threads.
    pub pipeline: Options,
    /// What to write beside the colour.
    pub extra: ExtraLayers,
    /// Bytes of memory that may be used.
    pub memory_limit: u64,
    /// Only this band of the frame.
    pub band: Option<Band>,
}

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

/// Refuses an `output` that is one of the inputs, by whatever name, or whose unfinished file would be.
pub fn check_output(output: &Path, inputs: &[&Path]) -> Result<(), Error> {
    let mut unfinished = output.as_os_str().to_owned();
    unfinished.push(".part");
    for input in inputs {
        let same = |path: &Path| same_file::is_same_file(path, input).unwrap_or(false);
        if same(output) || same(Path::new(&unfinished)) {
            return Err(Error::Usage(format!(
                "the output {} is the input {}: the input is read until the end, so it cannot be replaced on the way",
                output.display(),
                input.display()
            )));
        }
    }
    Ok(())
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_output_may_not_be_the_input_by_another_name() {
        let folder = std::env::temp_dir().join(format!("linpred-same-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let (input, link) = (folder.join("in.exr"), folder.join("link.exr"));
        std::fs::write(&input, b"x").unwrap();
        std::fs::hard_link(&input, &link).unwrap();
        assert!(matches!(
            check_output(&link, &[&input]),
            Err(Error::Usage(_))
        ));
        assert!(check_output(&folder.join("out.exr"), &[&input]).is_ok());
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
