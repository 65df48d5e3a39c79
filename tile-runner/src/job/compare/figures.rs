//! The figures of a comparison.

use crate::geometry::{ImageSize, plane_bytes};
use crate::row::InputRow;

use super::light::LocalLight;
use super::pixels::{PixelSums, WorstPixel};
use super::places::WorstPlace;
use super::reference::Scale;
use super::specks::Specks;
use super::window::Window;

/// How far an image is from a reference. NaN where nothing could be measured: no sample is finite, or the reference is black.
///
/// Samples that are not finite in both images take part in no figure. Boxes, medians, extremes and FLIP leave pixels out that have such a sample. They
/// mirror the image at its borders, but for FLIP, which repeats the outermost pixels. Luminance is 0.2126 R + 0.7152 G + 0.0722 B.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Figures {
    /// Mean over pixels and channels of ((a - f)^2 - var f) / (f^2 + 0.01).
    pub rmse: f64,
    /// Mean squared error.
    pub mse: f64,
    /// PSNR in dB of both images clamped to 0..1 and coded as sRGB; 120 for equal ones.
    pub psnr: f64,
    /// HDR-FLIP (Andersson et al. 2021), mean over the pixels: how different the images look when they are shown in turn, 0 the same, 1 as green and blue.
    /// Within 1e-6 of the mean of the map of `flip-evaluator` 1.7 with its defaults, 67 pixels per degree and ACES, for radiance that is not negative.
    /// [`Comparing::measure`](super::Comparing::measure) says what it costs.
    pub flip: f64,
    /// Mean radiance over pixels and channels.
    pub mean: f64,
    /// Mean of the image over the mean of the reference: 1 if no light is lost.
    pub energy: f64,
    /// Mean over pixels of (A - F) / (F + 0.01), with the means A, F of the luminance over 17 x 17 pixels: light lost or won locally.
    pub bias: f64,
    /// Share of the pixels where that is beyond 5 % either way.
    pub off5: f64,
    /// Mean luminance over the brightest 1 % of the reference's pixels over the reference's there: 1 if highlights stay.
    pub top1: f64,
    /// Pixels per megapixel darker than 0.4 times the median of the 25 around, and than half the darkest of the reference's 9; 0.02 of the reference's
    /// mean is added to each luminance.
    pub pinholes: f64,
    /// Pixels per megapixel brighter than 2.5 times that median, and than twice the brightest of those 9.
    pub sparks: f64,
    /// Samples that are NaN or infinite in the image or in the reference.
    pub non_finite: u64,
}

/// The figures of an image, and where it is worst.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Comparison {
    /// The image's.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub figures: Figures,
    /// Those of what it was made of, if that is known.
    pub input: Option<Figures>,
    /// Mean radiance of the reference, over the samples that the image's is of.
    pub reference_mean: f64,
    /// rMSE of the input over that of the image.
    pub gain: Option<f64>,
    /// Whether the reference says how noisy it is itself.
    pub reference_has_variance: bool,
    /// The pixels of the largest relative error, worst first.
    pub worst: Vec<WorstPixel>,
    /// The places of the largest relative error, worst first.
    pub worst_places: Vec<WorstPlace>,
}

impl Comparison {
    pub(super) fn new(
        image: Measured,
        input: Option<Measured>,
        worst_places: Vec<WorstPlace>,
        reference_has_variance: bool,
    ) -> Self {
        let (figures, input) = (image.figures, input.map(|input| input.figures));
        Self {
            gain: input.as_ref().map(|input| input.rmse / figures.rmse),
            figures,
            input,
            reference_mean: image.reference_mean,
            reference_has_variance,
            worst: image.worst,
            worst_places,
        }
    }
}

/// What was found of an image.
pub(super) struct Measured {
    figures: Figures,
    reference_mean: f64,
    worst: Vec<WorstPixel>,
}

/// All measures of an image but FLIP, fed row by row.
pub(super) struct Measures {
    pixels: PixelSums,
    window: Window,
    light: LocalLight,
    specks: Specks,
    errors: Vec<f32>,
}

impl Measures {
    pub(super) fn new(size: ImageSize, scale: Scale) -> Self {
        Self {
            pixels: PixelSums::new(scale.highlight),
            window: Window::new(size),
            light: LocalLight::new(size),
            specks: Specks::new(scale.mean),
            errors: vec![0.0; size.width()],
        }
    }

    /// Bytes of all of them.
    pub(super) fn bytes(size: ImageSize) -> u64 {
        let errors = plane_bytes(size, 1, 1);
        let rows = Window::bytes(size).saturating_add(LocalLight::bytes(size));
        rows.saturating_add(errors)
    }

    /// Adds row `y`; returns its pixels' relative squared errors.
    pub(super) fn add_row(
        &mut self,
        y: usize,
        image: &[Vec<f32>; 3],
        reference: &InputRow,
    ) -> &[f32] {
        self.pixels.add_row(y, image, reference, &mut self.errors);
        let (light, specks) = (&mut self.light, &mut self.specks);
        self.window.push(image, &reference.colour, |window, y| {
            light.add_row(window, y);
            specks.add_row(window, y);
        });
        &self.errors
    }

    /// With the mean of FLIP, which is measured of all images at once.
    pub(super) fn finish(self, flip: f64) -> Measured {
        let Self {
            pixels,
            light,
            specks,
            ..
        } = self;
        let figures = Figures {
            rmse: pixels.rmse(),
            mse: pixels.mse(),
            psnr: pixels.psnr(),
            flip,
            mean: pixels.mean(),
            energy: pixels.energy(),
            bias: light.bias(),
            off5: light.off5(),
            top1: pixels.top1(),
            pinholes: specks.pinholes(),
            sparks: specks.sparks(),
            non_finite: pixels.non_finite(),
        };
        Measured {
            figures,
            reference_mean: pixels.reference_mean(),
            worst: pixels.into_worst(),
        }
    }
}
