//! How far an image is from a reference, row by row.

use std::path::Path;
use std::sync::Arc;

use crate::channels::names::{ChannelNames, ChannelRef};
use crate::channels::roles::{Mapping, RoleRequest, Roles};
use crate::channels::variance::{Meaning, Variance};
use crate::error::Error;
use crate::exr_file::ExrFile;
use crate::geometry::ImageSize;
use crate::image::source::ExrSource;
use crate::job::input::{Input, InputRequest};
use crate::row::{InputRow, RowSource};

/// Added to the squared reference, so that black pixels do not rule the relative error.
const RELATIVE_FLOOR: f64 = 0.01;
/// Pixels listed as the worst.
const WORST: usize = 5;

/// A pixel far from the reference.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct WorstPixel {
    /// Column, from the data window's left edge.
    pub x: usize,
    /// Row, from its top.
    pub y: usize,
    /// Relative squared error, mean over the channels, the reference's own variance taken off.
    pub error: f64,
}

/// The figures of a comparison.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Comparison {
    /// Mean over pixels and channels of ((a - f)^2 - var f) / (f^2 + 0.01).
    pub rmse: f64,
    /// Mean squared error.
    pub mse: f64,
    /// PSNR in dB of both images clamped to 0..1 and coded as sRGB; 120 for equal ones.
    pub psnr_tonemapped: f64,
    /// Samples of the image that are NaN or infinite. They take part in no figure.
    pub non_finite: u64,
    /// Whether the reference says how noisy it is itself.
    pub reference_has_variance: bool,
    /// The pixels of the largest relative error, worst first.
    pub worst: Vec<WorstPixel>,
}

/// Compares the colours of two images; gives `heat` the relative squared error of each pixel, row by row.
///
/// [`Error::Invalid`] if their sizes differ or one has no colour.
pub fn compare(
    image: &Path,
    reference: &Path,
    map: &[Mapping],
    limit: u64,
    mut heat: impl FnMut(ImageSize, &[f32]) -> Result<(), Error>,
) -> Result<Comparison, Error> {
    let mut first = open(image, map, limit)?;
    let mut second = open(reference, map, limit)?;
    let (size, other) = (first.0.layout().size, second.0.layout().size);
    if size != other {
        return Err(Error::Invalid(format!(
            "{} is {} x {} pixels, {} is {} x {}",
            image.display(),
            size.width(),
            size.height(),
            reference.display(),
            other.width(),
            other.height()
        )));
    }
    let mut sums = Sums::default();
    let mut rows = (
        InputRow::new(&first.0.layout()),
        InputRow::new(&second.0.layout()),
    );
    for y in 0..size.height() {
        first.0.read_row(y, &mut rows.0)?;
        second.0.read_row(y, &mut rows.1)?;
        let errors = sums.add_row(y, &rows.0, &rows.1);
        heat(size, &errors)?;
    }
    Ok(sums.finish(second.1))
}

/// A source of the colour and, as the referee reads it, of bare `variance.R/G/B`; whether there are such.
fn open(path: &Path, map: &[Mapping], limit: u64) -> Result<(ExrSource, bool), Error> {
    let plain = RoleRequest {
        // nothing but the colour is wanted, and a variance that lacks its sample count is no obstacle
        map: [Mapping {
            role: crate::channels::presets::Role::Variance,
            meaning: Meaning::OfMean,
            target: "none".into(),
        }]
        .into_iter()
        .chain(map.iter().cloned())
        .collect(),
        ..RoleRequest::default()
    };
    let request = InputRequest {
        path: path.to_owned(),
        roles: plain,
        ..InputRequest::default()
    };
    let input = Input::open(&request)?;
    let variance = own_variance(&input.names);
    let roles = Roles {
        variance: variance.map_or(Variance::None, |channels| Variance::Given {
            meaning: Meaning::OfMean,
            channels: channels.to_vec(),
            count: None,
        }),
        features: Vec::new(),
        ..input.roles
    };
    let files: Vec<Arc<ExrFile>> = input.names.files().to_vec();
    Ok((
        ExrSource::new(&files, &roles, &[], limit)?,
        variance.is_some(),
    ))
}

fn own_variance(names: &ChannelNames) -> Option<[ChannelRef; 3]> {
    names.components(0, "variance", &[["R", "G", "B"]])
}

#[derive(Debug, Default)]
struct Sums {
    samples: u64,
    relative: f64,
    squared: f64,
    tonemapped: f64,
    non_finite: u64,
    worst: Vec<WorstPixel>,
}

impl Sums {
    /// Adds a row; returns each pixel's relative squared error, mean over the channels.
    fn add_row(&mut self, y: usize, image: &InputRow, reference: &InputRow) -> Vec<f32> {
        let width = image.colour[0].len();
        (0..width)
            .map(|x| {
                let mut pixel = (0.0, 0);
                for k in 0..3 {
                    let a = f64::from(image.colour[k][x]);
                    let f = f64::from(reference.colour[k][x]);
                    if !(a.is_finite() && f.is_finite()) {
                        self.non_finite += 1;
                        continue;
                    }
                    let squared = (a - f) * (a - f);
                    let relative =
                        (squared - f64::from(reference.variance[k][x])) / (f * f + RELATIVE_FLOOR);
                    let tonemapped = srgb(a) - srgb(f);
                    self.squared += squared;
                    self.relative += relative;
                    self.tonemapped += tonemapped * tonemapped;
                    self.samples += 1;
                    pixel = (pixel.0 + relative, pixel.1 + 1);
                }
                let error = if pixel.1 == 0 {
                    f64::NAN
                } else {
                    pixel.0 / f64::from(pixel.1)
                };
                self.note(WorstPixel { x, y, error });
                error as f32
            })
            .collect()
    }

    fn note(&mut self, pixel: WorstPixel) {
        if pixel.error.is_nan()
            || (self.worst.len() == WORST && self.worst[WORST - 1].error >= pixel.error)
        {
            return;
        }
        let at = self
            .worst
            .partition_point(|other| other.error >= pixel.error);
        self.worst.insert(at, pixel);
        self.worst.truncate(WORST);
    }

    fn finish(self, reference_has_variance: bool) -> Comparison {
        let count = self.samples as f64;
        Comparison {
            rmse: self.relative / count,
            mse: self.squared / count,
            psnr_tonemapped: -10.0 * (self.tonemapped / count).max(1e-12).log10(),
            non_finite: self.non_finite,
            reference_has_variance,
            worst: self.worst,
        }
    }
}

/// The sRGB curve of a value clamped to 0..1 (IEC 61966-2-1).
fn srgb(value: f64) -> f64 {
    let value = value.clamp(0.0, 1.0);
    if value <= 0.0031308 {
        12.92 * value
    } else {
        1.055 * value.powf(1.0 / 2.4) - 0.055
    }
}
