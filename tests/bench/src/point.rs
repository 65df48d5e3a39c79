//! One measurement, in a process of its own, so that its peak memory is its own.

use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args;
use linpred::{Options, Report, RowSink, denoise};
use linpred_core::Params;
use serde::{Deserialize, Serialize};

use crate::baselines;
use crate::clock::{Cost, measure};
use crate::image::{Colour, Image, MirroredRows, Nowhere};
use crate::method::Method;
use crate::oidn;
use crate::score::figures;

/// What to measure.
#[derive(Args, Clone, Debug)]
pub(crate) struct PointArguments {
    /// Noisy image.
    #[arg(long)]
    pub(crate) image: PathBuf,
    /// Reference, for the error at the image's own size.
    #[arg(long)]
    pub(crate) reference: PathBuf,
    /// How to denoise it.
    #[arg(long, value_enum)]
    pub(crate) method: Method,
    /// Size it is mirrored up to; 0 is its own.
    #[arg(long, default_value_t = 0.0)]
    pub(crate) megapixels: f64,
    /// Threads that compute.
    #[arg(long, default_value = "1")]
    pub(crate) threads: NonZeroUsize,
}

/// What was measured.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct Measured {
    /// Pixels of the mirrored image.
    pub(crate) pixels: u64,
    pub(crate) cost: Cost,
    /// At the image's own size only.
    pub(crate) rmse: Option<f64>,
    /// Tone-mapped, decibels; likewise.
    pub(crate) psnr: Option<f64>,
    /// HDR-FLIP, likewise.
    pub(crate) flip: Option<f64>,
    /// Models built, for linpred.
    pub(crate) models: Option<u64>,
    /// Pixels that passed through, for linpred.
    pub(crate) passed_through: Option<u64>,
}

/// Denoises and measures.
pub(crate) fn measure_point(arguments: &PointArguments) -> Result<Measured> {
    let image = Image::read(&arguments.image)?;
    let copies = image.copies(arguments.megapixels);
    let method = arguments.method;
    let done = match (method.params(), method.oidn()) {
        (Some(params), _) => by_linpred(&image, copies, params, arguments.threads)?,
        (None, Some(how)) => oidn::denoise(&image, copies, arguments.threads, how)?,
        (None, None) => baselines::denoise(&image, copies, method)?,
    };
    let figures = if copies == 1 {
        let colour = done.colour.context("no image was kept")?;
        Some(figures(&colour, image.layout.size, &arguments.reference)?)
    } else {
        None
    };
    Ok(Measured {
        pixels: image.layout.size.pixels() * (copies * copies) as u64,
        cost: done.cost,
        rmse: figures.as_ref().map(|figures| figures.rmse),
        psnr: figures.as_ref().map(|figures| figures.psnr),
        flip: figures.as_ref().map(|figures| figures.flip),
        models: done.report.map(|report| report.models),
        passed_through: done.report.map(|report| report.counts.passed_through),
    })
}

/// A denoised image and its cost.
pub(crate) struct Done {
    /// Kept at the image's own size.
    pub(crate) colour: Option<Colour>,
    pub(crate) cost: Cost,
    pub(crate) report: Option<Report>,
}

fn by_linpred(image: &Image, copies: usize, params: Params, threads: NonZeroUsize) -> Result<Done> {
    let mut source = MirroredRows::new(image, copies)?;
    let options = Options::new(params).with_threads(threads);
    let mut kept = Colour::default();
    let sink: &mut dyn RowSink = if copies == 1 { &mut kept } else { &mut Nowhere };
    let (report, cost) = measure(|| {
        denoise(&mut source, sink, &options, &mut |_| {
            ControlFlow::Continue(())
        })
    });
    Ok(Done {
        colour: (copies == 1).then_some(kept),
        cost,
        report: Some(report?),
    })
}
