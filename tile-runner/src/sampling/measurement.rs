//! An image denoised, and looked at a second time: what its pixels' errors are estimated from.

use std::ops::ControlFlow;

use linpred_core::{Params, Quality, Sampler};

use super::allocation::allocate;
use super::demands::{Demands, around_planes};
use super::goal::Goal;
use super::map::SampleMap;
use super::scratch::{RowFile, Scratch};
use super::second_look::Noisier;
use crate::error::Error;
use crate::geometry::{ImageSize, plane_bytes};
use crate::quantile;
use crate::row::{InputRow, OutputRow, RowLayout, RowSink, RowSource, VarianceKind};
use crate::stream::pipeline::{self, Options};
use crate::stream::report::Report;

impl Options {
    /// Those that a map of samples is made with: the quality [`Fast`](Quality::Fast), on as many threads as there are processors. A better one takes longer and finds no better map
    /// (measured: mean errors within 1 %).
    pub fn for_sampling() -> Self {
        Self::new(Params::new(Quality::Fast))
    }
}

/// What is known of a row of pixels. All planes have the image's width.
#[derive(Clone, Copy, Debug)]
pub struct MeasuredRow<'a> {
    /// Denoised radiance, red green blue.
    pub colour: [&'a [f32]; 3],
    /// Estimated mean squared error of it, mean over the channels, radiance squared. Pixels of 0, none of whose 8 neighbours has more, are exact, and get nothing.
    pub error: &'a [f32],
    /// The radiance denoised otherwise: of half the samples, or from noisier pixels. Where there is none, or a NaN, the error stands alone.
    pub second: Option<[&'a [f32]; 3]>,
    /// Samples that each pixel has; what is no number counts as 0.
    pub samples: &'a [f32],
}

/// The relative errors of an image's pixels, and their samples.
#[derive(Debug)]
pub struct Measurement {
    size: ImageSize,
    sampler: Sampler,
    scratch: Scratch,
    rows: RowFile,
    next: usize,
    /// A row as it is put aside.
    claimed: Vec<f32>,
    seen: Vec<f32>,
    samples: Vec<f32>,
}

/// Planes of a row that is put aside: the error that was claimed, the one that was seen, and the samples.
pub(super) const PLANES: usize = 3;

/// Planes of a row that the first run leaves: the denoised colour with its error, and the samples with what is known of their noise.
const FIRST: [usize; 2] = [4, 2];

impl Measurement {
    /// For a renderer that has its denoised pixels at hand: nothing yet of an image of this size.
    pub fn new(size: ImageSize, scratch: Scratch) -> Self {
        let plane = || vec![0.0; size.width()];
        Self {
            size,
            sampler: Sampler::default(),
            rows: RowFile::new(&scratch, size.width(), PLANES),
            scratch,
            next: 0,
            claimed: plane(),
            seen: plane(),
            samples: plane(),
        }
    }

    /// Bytes of memory that measuring an image and planning a map takes, beside denoising it.
    pub(crate) fn bytes(size: ImageSize) -> u64 {
        // rows around one that is smoothed; what is put aside, once read and once written; what was seen the second time; a row of demands, of a map, and to work in
        let planes = around_planes() + 2 * (FIRST[0] + FIRST[1] + PLANES) + 3 + 4;
        let rows = plane_bytes(size, 1, planes);
        rows.saturating_add(quantile::bytes(1))
    }

    /// Bytes that are put aside at most: while the image is looked at for the second time.
    pub(crate) fn bytes_aside(size: ImageSize) -> u64 {
        plane_bytes(size, size.height(), FIRST[0] + FIRST[1] + PLANES)
    }

    /// Takes the next row, from top to bottom. [`Error::Usage`] if its planes have another length or the image has no more rows, [`Error::Write`] if there is no room for it.
    pub fn push(&mut self, row: &MeasuredRow) -> Result<(), Error> {
        self.check(row)?;
        for x in 0..self.size.width() {
            let colour = row.colour.map(|plane| plane[x]);
            let claimed = self.sampler.relative_error(row.error[x], colour);
            let seen = row.second.map(|second| {
                let difference = |c: usize| second[c][x] - colour[c];
                let [red, green, blue] = [0, 1, 2].map(|c| difference(c) * difference(c));
                self.sampler
                    .relative_error((red + green + blue) / 3.0, colour)
            });
            self.claimed[x] = usable(claimed);
            self.seen[x] = usable(seen.filter(|seen| !seen.is_nan()).unwrap_or(claimed));
            self.samples[x] = usable(row.samples[x]).round();
        }
        let planes = [&self.claimed[..], &self.seen, &self.samples];
        self.rows.push(&planes)?;
        self.next += 1;
        Ok(())
    }

    fn check(&self, row: &MeasuredRow) -> Result<(), Error> {
        let (width, height) = (self.size.width(), self.size.height());
        let second = row.second.iter().flatten();
        let planes = row.colour.iter().chain(second).copied();
        let mut planes = planes.chain([row.error, row.samples]);
        if let Some(odd) = planes.find(|plane| plane.len() != width) {
            return Err(Error::Usage(format!(
                "row {}: a plane of {} values in an image {width} pixels wide",
                self.next,
                odd.len()
            )));
        }
        match self.next < height {
            true => Ok(()),
            false => Err(Error::Usage(format!(
                "the image has {height} rows, all are there"
            ))),
        }
    }

    /// The map that reaches a goal. As many goals as one likes can be planned for.
    ///
    /// [`Error::Usage`] if rows are missing, or if a pixel would get more than [`MOST_SAMPLES`](super::MOST_SAMPLES); [`Error::Write`] or [`Error::Read`] if the scratch fails.
    pub fn plan(&mut self, goal: Goal) -> Result<SampleMap, Error> {
        let (rows, height) = (self.next, self.size.height());
        if rows < height {
            return Err(Error::Usage(format!(
                "{rows} of the image's {height} rows are there: a budget is shared by all of it"
            )));
        }
        let mut demands = Demands::new(self.size, self.sampler, &self.scratch, &mut self.rows)?;
        allocate(&mut demands, goal, &self.scratch)
    }
}

/// Errors and counts are numbers from 0 on.
fn usable(value: f32) -> f32 {
    match value > 0.0 && value.is_finite() {
        true => value,
        false => 0.0,
    }
}

/// How many rows [`measure`] denoises of such an image, which its progress counts: all of them twice, or once if nothing is known of the colour's noise.
pub fn rows_to_measure(layout: &RowLayout) -> usize {
    let runs = match layout.variance {
        VarianceKind::Estimated => 1,
        _ => 2,
    };
    runs * layout.size.height()
}

/// Measures an image: denoises it as it is, and with more noise. `source` says how many samples each pixel has ([`RowLayout::with_samples`]), and is asked for every row from 0 to
/// `height - 1`, and if it has a variance once more. `progress` is told how many of the [`rows_to_measure`] have been denoised; when it breaks, the run ends with
/// [`Error::Cancelled`].
///
/// [`Error::Usage`] if the source says nothing of samples, [`Error::Write`] if there is no room in the scratch.
pub fn measure(
    source: &mut dyn RowSource,
    options: &Options,
    scratch: &Scratch,
    progress: &mut dyn FnMut(usize) -> ControlFlow<()>,
) -> Result<Measurement, Error> {
    let mut before = 0;
    let mut denoise = |source: &mut dyn RowSource, sink: &mut dyn RowSink| {
        let height = source.layout().size.height();
        let report = pipeline::denoise(source, sink, options, &mut |rows| progress(before + rows));
        before += height;
        report
    };
    measure_by(source, scratch, &mut denoise)
}

/// Denoises a source into a sink.
pub(crate) type Denoise<'a> =
    dyn FnMut(&mut dyn RowSource, &mut dyn RowSink) -> Result<Report, Error> + 'a;

/// The same with runs that `denoise` does.
pub(crate) fn measure_by(
    source: &mut dyn RowSource,
    scratch: &Scratch,
    denoise: &mut Denoise,
) -> Result<Measurement, Error> {
    let layout = source.layout();
    if !layout.samples {
        return Err(Error::Usage(
            "the source does not say how many samples each pixel has".into(),
        ));
    }
    let mut once = Once::new(&layout, scratch);
    let mut source = Sampled(source);
    let mut counted = Counted {
        source: &mut source,
        rows: &mut once.known,
        unknown: vec![0.0; layout.size.width()],
    };
    denoise(&mut counted, &mut Kept(&mut once.denoised))?;
    let mut measurement = Measurement::new(layout.size, scratch.clone());
    match layout.variance {
        VarianceKind::Estimated => once.into(&mut measurement)?,
        _ => {
            let mut compare = |y: usize, row: &OutputRow| {
                let [red, green, blue] = &row.colour;
                once.push_into(&mut measurement, y, Some([red, green, blue]))
            };
            denoise(&mut Noisier(source), &mut compare)?;
        }
    }
    Ok(measurement)
}

/// What the first run left.
struct Once {
    size: ImageSize,
    denoised: RowFile,
    known: RowFile,
    /// A row of each.
    row: Vec<f32>,
    known_row: Vec<f32>,
    /// A row of what was seen the second time, where that says something.
    seen: [Vec<f32>; 3],
}

impl Once {
    fn new(layout: &RowLayout, scratch: &Scratch) -> Self {
        let width = layout.size.width();
        Self {
            size: layout.size,
            denoised: RowFile::new(scratch, width, FIRST[0]),
            known: RowFile::new(scratch, width, FIRST[1]),
            row: vec![0.0; FIRST[0] * width],
            known_row: vec![0.0; FIRST[1] * width],
            seen: std::array::from_fn(|_| vec![0.0; width]),
        }
    }

    /// Pushes row `y`, with how the second run saw it.
    fn push_into(
        &mut self,
        measurement: &mut Measurement,
        y: usize,
        second: Option<[&[f32]; 3]>,
    ) -> Result<(), Error> {
        let width = self.size.width();
        self.denoised.read(y, &mut self.row)?;
        self.known.read(y, &mut self.known_row)?;
        let (samples, unknown) = self.known_row.split_at(width);
        if let Some(second) = second {
            for (seen, plane) in self.seen.iter_mut().zip(second) {
                let values = plane.iter().zip(unknown);
                let values = values.map(|(value, unknown)| value + unknown);
                seen.iter_mut()
                    .zip(values)
                    .for_each(|(own, value)| *own = value);
            }
        }
        let plane = |k: usize| &self.row[k * width..(k + 1) * width];
        let [red, green, blue] = &self.seen;
        measurement.push(&MeasuredRow {
            colour: [plane(0), plane(1), plane(2)],
            error: plane(3),
            second: second.map(|_| [&red[..], green, blue]),
            samples,
        })
    }

    /// Pushes all rows, which were seen once.
    fn into(mut self, measurement: &mut Measurement) -> Result<(), Error> {
        (0..self.size.height()).try_for_each(|y| self.push_into(measurement, y, None))
    }
}

/// A source that says of pixels without samples that nothing is known of them.
struct Sampled<'a>(&'a mut dyn RowSource);

impl RowSource for Sampled<'_> {
    fn layout(&self) -> RowLayout {
        self.0.layout()
    }

    fn read_row(&mut self, y: usize, row: &mut InputRow) -> Result<(), Error> {
        self.0.read_row(y, row)?;
        let samples = std::mem::take(&mut row.samples);
        row.forget_unsampled(&samples);
        row.samples = samples;
        Ok(())
    }
}

/// A source that puts aside, as they pass, how many samples pixels have, and which of them will not be seen otherwise: NaN where no variance is known, else 0.
struct Counted<'a> {
    source: &'a mut dyn RowSource,
    rows: &'a mut RowFile,
    unknown: Vec<f32>,
}

impl RowSource for Counted<'_> {
    fn layout(&self) -> RowLayout {
        self.source.layout()
    }

    fn read_row(&mut self, y: usize, row: &mut InputRow) -> Result<(), Error> {
        self.source.read_row(y, row)?;
        let [red, green, blue] = &row.variance;
        let variances = red.iter().zip(green).zip(blue);
        for (unknown, ((red, green), blue)) in self.unknown.iter_mut().zip(variances) {
            let known = [red, green, blue]
                .iter()
                .all(|variance| variance.is_finite());
            *unknown = if known { 0.0 } else { f32::NAN };
        }
        self.rows.push(&[&row.samples[..], &self.unknown])
    }
}

/// A sink that puts the denoised colour and its error aside.
struct Kept<'a>(&'a mut RowFile);

impl RowSink for Kept<'_> {
    fn write_row(&mut self, _y: usize, row: &OutputRow) -> Result<(), Error> {
        let [red, green, blue] = &row.colour;
        self.0.push(&[&red[..], green, blue, &row.error])
    }
}
