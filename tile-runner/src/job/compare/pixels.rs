//! What is measured pixel by pixel.

use crate::row::InputRow;

use super::window::luminance;

/// Added to the squared reference, so that black pixels do not rule the relative error.
const RELATIVE_FLOOR: f64 = 0.01;
/// The least mean squared error that a PSNR is of: 120 dB.
const LEAST_ERROR: f64 = 1e-12;
/// Pixels, and places, listed as the worst.
pub(super) const WORST: usize = 5;

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

/// Sums over samples and pixels. Samples that are not finite in both images are in none.
#[derive(Debug)]
pub(super) struct PixelSums {
    highlight: f64,
    samples: u64,
    relative: f64,
    squared: f64,
    tonemapped: f64,
    /// Of the image, of the reference.
    light: (f64, f64),
    /// The same of the brightest pixels' luminance.
    highlights: (f64, f64),
    non_finite: u64,
    worst: Vec<WorstPixel>,
}

impl PixelSums {
    /// `highlight`: from which luminance of the reference on a pixel is among its brightest.
    pub(super) fn new(highlight: f64) -> Self {
        Self {
            highlight,
            samples: 0,
            relative: 0.0,
            squared: 0.0,
            tonemapped: 0.0,
            light: (0.0, 0.0),
            highlights: (0.0, 0.0),
            non_finite: 0,
            worst: Vec::new(),
        }
    }

    /// Adds row `y`; writes each pixel's relative squared error, mean over the channels, to `errors`.
    pub(super) fn add_row(
        &mut self,
        y: usize,
        image: &[Vec<f32>; 3],
        reference: &InputRow,
        errors: &mut [f32],
    ) {
        for (x, out) in errors.iter_mut().enumerate() {
            let finite = (0..3).filter_map(|k| {
                let a = f64::from(image[k][x]);
                let f = f64::from(reference.colour[k][x]);
                let variance = f64::from(reference.variance[k][x]);
                self.add_sample(a, f, variance)
            });
            let (sum, count) = finite.fold((0.0, 0.0), |sum, e| (sum.0 + e, sum.1 + 1.0));
            let error = sum / count;
            if !error.is_nan() {
                let pixel = WorstPixel { x, y, error };
                keep_worst(&mut self.worst, pixel, |pixel| pixel.error);
            }
            *out = error as f32;
            let (a, f) = (luminance(image, x), luminance(&reference.colour, x));
            if a.is_finite() && f.is_finite() && f >= self.highlight {
                self.highlights = (self.highlights.0 + a, self.highlights.1 + f);
            }
        }
    }

    /// The sample's relative squared error, if it has one.
    fn add_sample(&mut self, a: f64, f: f64, variance: f64) -> Option<f64> {
        if !(a.is_finite() && f.is_finite()) {
            self.non_finite += 1;
            return None;
        }
        let squared = (a - f) * (a - f);
        let relative = (squared - variance) / (f * f + RELATIVE_FLOOR);
        let tonemapped = tone_mapped(a) - tone_mapped(f);
        self.squared += squared;
        self.relative += relative;
        self.tonemapped += tonemapped * tonemapped;
        self.light = (self.light.0 + a, self.light.1 + f);
        self.samples += 1;
        Some(relative)
    }

    pub(super) fn rmse(&self) -> f64 {
        self.relative / self.samples as f64
    }

    pub(super) fn mse(&self) -> f64 {
        self.squared / self.samples as f64
    }

    pub(super) fn psnr(&self) -> f64 {
        let error = self.tonemapped / self.samples as f64;
        // the other way round a maximum would make a number of NaN
        -10.0
            * if error < LEAST_ERROR {
                LEAST_ERROR
            } else {
                error
            }
            .log10()
    }

    pub(super) fn mean(&self) -> f64 {
        self.light.0 / self.samples as f64
    }

    pub(super) fn reference_mean(&self) -> f64 {
        self.light.1 / self.samples as f64
    }

    pub(super) fn energy(&self) -> f64 {
        self.light.0 / self.light.1
    }

    pub(super) fn top1(&self) -> f64 {
        self.highlights.0 / self.highlights.1
    }

    pub(super) fn non_finite(&self) -> u64 {
        self.non_finite
    }

    pub(super) fn into_worst(self) -> Vec<WorstPixel> {
        self.worst
    }
}

/// Keeps `new` if it is among the worst, which are in order; of equals, those that came first.
pub(super) fn keep_worst<T>(worst: &mut Vec<T>, new: T, error: impl Fn(&T) -> f64) {
    let at = worst.partition_point(|other| error(other) >= error(&new));
    if at < WORST {
        worst.insert(at, new);
        worst.truncate(WORST);
    }
}

/// The sRGB curve of a radiance clamped to 0..1 (IEC 61966-2-1), 0 to 1: what PSNR is measured in. NaN of NaN.
pub fn tone_mapped(radiance: f64) -> f64 {
    let value = radiance.clamp(0.0, 1.0);
    if value <= 0.0031308 {
        12.92 * value
    } else {
        1.055 * value.powf(1.0 / 2.4) - 0.055
    }
}
