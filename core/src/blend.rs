//! From models' predictions to pixels: their mean by confidence, with the pixel's own radiance as one of them.

use crate::float::reciprocal_sqrt;
use crate::params::Formulas;
use crate::tile::{CHANNELS, Pixel, PixelState, TILE_AREA};

/// Confidence in a pixel's own radiance beside its predictions, as a part of [`confidence`] in one that is off by the pixel's variance
/// (measured: 0.1 to 0.3 alike).
const OWN_CONFIDENCE: f32 = 0.3;

/// Added to a local error, in units of the pixel's variance, before a confidence is made of it: an estimate from noisy
/// pixels knows no better (measured: 0.35 to 0.7 alike).
pub(crate) const ERROR_SOFTENING: f32 = 0.5;

/// Confidence in a prediction whose squared error is `error`: between the inverse error, which trusts too many, and its
/// square, which trusts the luckiest.
#[inline(always)]
pub(crate) fn confidence(error: f32) -> f32 {
    let root = reciprocal_sqrt(error);
    root * root * root
}

/// Sums over the predictions of a pixel, each times the confidence in it: its weight in their mean.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Sum {
    /// Radiance times confidence.
    pub colour: [f32; 3],
    /// Confidences.
    pub confidence: f32,
    /// Estimated squared error, mean over the channels, times confidence.
    pub error: f32,
    /// Half-width of the prediction windows, times confidence.
    pub radius: f32,
    /// Local rank, times confidence.
    pub rank: f32,
}

impl Sum {
    /// The sum of no predictions.
    pub const NONE: Self = Self {
        colour: [0.0; 3],
        confidence: 0.0,
        error: 0.0,
        radius: 0.0,
        rank: 0.0,
    };

    /// Adds the predictions of another cell for the same pixel. Floats' sums depend on their order: add cells in the
    /// order of their rows, and in a row from left to right, for the same bits in every run.
    #[inline(always)]
    pub fn add(&mut self, other: &Self) {
        for (sum, value) in self.colour.iter_mut().zip(&other.colour) {
            *sum += value;
        }
        self.confidence += other.confidence;
        self.error += other.error;
        self.radius += other.radius;
        self.rank += other.rank;
    }
}

/// The predictions of one cell's models, over its tile.
#[derive(Clone, Debug, PartialEq)]
pub struct Predictions {
    /// Sums per pixel of the tile.
    pub sums: [Sum; TILE_AREA],
}

impl Predictions {
    /// No predictions.
    pub const NONE: Self = Self {
        sums: [Sum::NONE; TILE_AREA],
    };
}

/// A layer over a tile (diffuse, one light, ...) that is denoised with the models of the colour: the same windows, weights,
/// confidences and blending on its own radiance, so that layers which sum to the colour still do.
#[derive(Clone, Debug, PartialEq)]
pub struct LayerTile {
    /// Its radiance, red green blue; finite, 0 outside the image.
    pub colour: [[f32; 3]; TILE_AREA],
    /// Predictions times the confidences that [`Sum::confidence`] adds up.
    pub sums: [[f32; 3]; TILE_AREA],
}

impl LayerTile {
    /// A black layer.
    pub const BLACK: Self = Self {
        colour: [[0.0; 3]; TILE_AREA],
        sums: [[0.0; 3]; TILE_AREA],
    };

    /// The radiance at `y * TILE + x`.
    #[inline(always)]
    pub(crate) fn colour_at(&self, position: usize) -> [f32; 3] {
        let colour = self.colour.get(position);
        debug_assert!(colour.is_some(), "{position} is not in the tile");
        colour.copied().unwrap_or([0.0; 3])
    }

    /// Clears the sums.
    pub fn clear(&mut self) {
        self.sums = [[0.0; 3]; TILE_AREA];
    }
}

/// A denoised pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Denoised {
    /// Radiance; finite.
    pub colour: [f32; 3],
    /// Estimated squared error, mean over the channels, radiance squared; 0 for a pixel that passed through.
    pub error: f32,
    /// Half-width of the prediction windows, mean by confidence.
    pub radius: f32,
    /// Local rank, mean by confidence.
    pub rank: f32,
}

/// Combines a pixel's predictions with its own radiance.
///
/// A clean pixel comes out as it went in. A bad one is its predictions' mean, or 0 where there are none. No channel that came without
/// negative radiance leaves with it, but by the papers' formulas.
#[inline(always)]
pub fn resolve<const D: usize>(pixel: &Pixel<D>, sum: &Sum, formulas: Formulas) -> Denoised {
    let own = own_confidence(pixel, sum, formulas);
    let total = own + sum.confidence;
    if total <= 0.0 {
        return Denoised {
            colour: [0.0; 3],
            error: 0.0,
            radius: 0.0,
            rank: 0.0,
        };
    }
    let channels = sum.colour.iter().zip(&pixel.colour);
    let mut colour = [0.0; CHANNELS];
    for (colour, (sum, y)) in colour.iter_mut().zip(channels) {
        let value = mean(*sum, own, *y, total);
        *colour = if goes_below(value, *y, formulas) {
            0.0
        } else {
            value
        };
    }
    Denoised {
        colour,
        error: (sum.error + own * pixel.variance / 3.0) / total,
        radius: sum.radius / total,
        rank: sum.rank / total,
    }
}

/// A layer that follows the colour: the same confidences on its own predictions, `layer`, and radiance, `own`.
///
/// Where a channel of the colour was about to become negative the layers, which may be, are 0 in it, so that they sum to it.
#[inline(always)]
pub fn resolve_layer<const D: usize>(
    pixel: &Pixel<D>,
    sum: &Sum,
    formulas: Formulas,
    layer: &[f32; CHANNELS],
    own: &[f32; CHANNELS],
) -> [f32; CHANNELS] {
    let confidence = own_confidence(pixel, sum, formulas);
    let total = confidence + sum.confidence;
    let mut resolved = [0.0; CHANNELS];
    if total <= 0.0 {
        return resolved;
    }
    let colours = sum.colour.iter().zip(&pixel.colour);
    let layers = layer.iter().zip(own);
    for (resolved, ((sum, y), (layer, own))) in resolved.iter_mut().zip(colours.zip(layers)) {
        let below = goes_below(mean(*sum, confidence, *y, total), *y, formulas);
        *resolved = if below {
            0.0
        } else {
            mean(*layer, confidence, *own, total)
        };
    }
    resolved
}

/// A channel that is no light (alpha, a mask, a depth) and follows the colour: the same confidences on its own predictions, `sum_of_scalar`, and value,
/// `own`. It does not become negative where it was not, but by the papers' formulas.
#[inline(always)]
pub fn resolve_scalar<const D: usize>(
    pixel: &Pixel<D>,
    sum: &Sum,
    formulas: Formulas,
    sum_of_scalar: f32,
    own: f32,
) -> f32 {
    let confidence = own_confidence(pixel, sum, formulas);
    let total = confidence + sum.confidence;
    if total <= 0.0 {
        return 0.0;
    }
    let value = mean(sum_of_scalar, confidence, own, total);
    if goes_below(value, own, formulas) {
        0.0
    } else {
        value
    }
}

/// Whether a channel that came as `y` is negative, and was not.
#[inline(always)]
fn goes_below(value: f32, y: f32, formulas: Formulas) -> bool {
    formulas == Formulas::Robust && y >= 0.0 && value < 0.0
}

/// `(sum + own y) / total`; exactly y where nothing else has confidence.
#[inline(always)]
fn mean(sum: f32, own: f32, y: f32, total: f32) -> f32 {
    if own == total {
        y
    } else {
        (sum + own * y) / total
    }
}

#[inline(always)]
fn own_confidence<const D: usize>(pixel: &Pixel<D>, sum: &Sum, formulas: Formulas) -> f32 {
    match pixel.state {
        PixelState::Outside | PixelState::Bad => 0.0,
        // More than any sum of confidences, so that the mean is the pixel itself.
        PixelState::Clean => f32::MAX,
        PixelState::Noisy if formulas == Formulas::Robust => {
            OWN_CONFIDENCE * confidence(1.0 + ERROR_SOFTENING)
        }
        PixelState::Noisy if sum.confidence > 0.0 => 0.0,
        PixelState::Noisy => 1.0,
    }
}
