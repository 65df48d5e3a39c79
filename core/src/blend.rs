//! From models' predictions to pixels: each prediction is weighted by how well its model does around the pixel.

use crate::feature_space::Terms;
use crate::fit::{Model, Sample, Samples};
use crate::float::sqrt;
use crate::params::Formulas;
use crate::tile::{
    Pixel, PixelState, RADIUS, RINGS, TILE, TILE_AREA, WINDOW_AREA, offset, window_pixels,
};

/// Added to a local error, in units of the pixel's variance, before a weight is made of it: an estimate from nine noisy
/// pixels knows no better (measured: 0.2 to 1 alike).
const ERROR_SOFTENING: f32 = 0.5;

/// Squared distance, in units of a pixel's tolerance, at which a prediction that the pixel itself speaks against loses
/// half its weight (measured: 1.5^2; the one remedy for dark pixels beside bright ones).
const DISAGREEMENT: f32 = 2.25;

/// Weight of a pixel's own radiance beside those of its predictions, in the unit of [`reliability`].
const OWN_WEIGHT: f32 = 0.1;

/// Side of a prediction window with a margin of one.
const SIDE: usize = 2 * RADIUS + 3;

/// Weighted sums of the predictions of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sum {
    /// Radiance times weight.
    pub colour: [f32; 3],
    /// Weights.
    pub weight: f32,
    /// Estimated squared error, mean over the channels, times weight.
    pub error: f32,
    /// Half-width of the prediction windows, times weight.
    pub radius: f32,
    /// Local rank, times weight.
    pub rank: f32,
}

impl Sum {
    /// The sum of no predictions.
    pub const NONE: Self = Self {
        colour: [0.0; 3],
        weight: 0.0,
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
        self.weight += other.weight;
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

/// A layer over a tile (diffuse, one light, ...) that is denoised with the models of the beauty: the same windows, weights
/// and blending on its own radiance, so that layers which sum to the beauty still do.
#[derive(Clone, Debug, PartialEq)]
pub struct LayerTile {
    /// Its radiance, red green blue; finite, 0 outside the image.
    pub colour: [[f32; 3]; TILE_AREA],
    /// Predictions times the weights that [`Sum::weight`] adds up.
    pub sums: [[f32; 3]; TILE_AREA],
}

impl LayerTile {
    /// A black layer.
    pub const BLACK: Self = Self {
        colour: [[0.0; 3]; TILE_AREA],
        sums: [[0.0; 3]; TILE_AREA],
    };
}

/// What becomes of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Denoised {
    /// Radiance; finite.
    pub colour: [f32; 3],
    /// Estimated squared error, mean over the channels, radiance squared; 0 for a pixel that passed through.
    pub error: f32,
    /// Half-width of the prediction windows, weighted mean.
    pub radius: f32,
    /// Local rank, weighted mean.
    pub rank: f32,
}

/// The pixel that all its predictions and its own radiance make together.
///
/// A clean pixel comes out as it went in. A bad one is its predictions' mean, or 0 where there are none.
#[inline(always)]
pub fn resolve<const D: usize>(pixel: &Pixel<D>, sum: &Sum, formulas: Formulas) -> Denoised {
    let own = own_weight(pixel, sum, formulas);
    let total = own + sum.weight;
    if total <= 0.0 {
        return Denoised {
            colour: [0.0; 3],
            error: 0.0,
            radius: 0.0,
            rank: 0.0,
        };
    }
    let mut colour = [0.0; 3];
    for ((colour, sum), y) in colour.iter_mut().zip(&sum.colour).zip(&pixel.colour) {
        *colour = mean(*sum, own, *y, total);
    }
    Denoised {
        colour,
        error: (sum.error + own * pixel.variance / 3.0) / total,
        radius: sum.radius / total,
        rank: sum.rank / total,
    }
}

/// One channel of a layer that follows the beauty: the same weights on its own predictions and radiance.
#[inline(always)]
pub fn resolve_layer<const D: usize>(
    pixel: &Pixel<D>,
    sum: &Sum,
    formulas: Formulas,
    layer: f32,
    own: f32,
) -> f32 {
    let weight = own_weight(pixel, sum, formulas);
    let total = weight + sum.weight;
    if total <= 0.0 {
        0.0
    } else {
        mean(layer, weight, own, total)
    }
}

/// `(sum + own y) / total`; exactly y where nothing else has weight.
#[inline(always)]
fn mean(sum: f32, own: f32, y: f32, total: f32) -> f32 {
    if own == total {
        y
    } else {
        (sum + own * y) / total
    }
}

#[inline(always)]
fn own_weight<const D: usize>(pixel: &Pixel<D>, sum: &Sum, formulas: Formulas) -> f32 {
    match pixel.state {
        PixelState::Outside | PixelState::Bad => 0.0,
        // More than any sum of weights, so that the mean is the pixel itself.
        PixelState::Clean => f32::MAX,
        PixelState::Noisy if formulas == Formulas::Robust => {
            OWN_WEIGHT * reliability(1.0 + ERROR_SOFTENING)
        }
        PixelState::Noisy if sum.weight > 0.0 => 0.0,
        PixelState::Noisy => 1.0,
    }
}

/// Weight of a prediction whose squared error is `error`: between the inverse error, which trusts too many, and its
/// square, which trusts the luckiest.
#[inline(always)]
fn reliability(error: f32) -> f32 {
    1.0 / (error * sqrt(error))
}

/// The predictions of one model, ring after ring, in radiance, and their weights.
pub(crate) struct Window {
    colour: [[f32; 3]; WINDOW_AREA],
    weight: [f32; WINDOW_AREA],
    error: [f32; WINDOW_AREA],
    /// Squared distance between prediction and pixel over the pixel's variance, raster order with a margin.
    distance: [[f32; SIDE]; SIDE],
    /// 1 where `distance` has a pixel.
    known: [[f32; SIDE]; SIDE],
}

impl Window {
    pub(crate) const EMPTY: Self = Self {
        colour: [[0.0; 3]; WINDOW_AREA],
        weight: [0.0; WINDOW_AREA],
        error: [0.0; WINDOW_AREA],
        distance: [[0.0; SIDE]; SIDE],
        known: [[0.0; SIDE]; SIDE],
    };

    /// Predicts the model's window and weighs its predictions.
    #[inline(always)]
    pub(crate) fn predict(
        &mut self,
        model: &Model,
        terms: &[Terms; WINDOW_AREA],
        samples: &Samples,
        formulas: Formulas,
    ) {
        let pixels = window_pixels(model.radius);
        self.distance = [[0.0; SIDE]; SIDE];
        self.known = [[0.0; SIDE]; SIDE];
        for (i, (terms, sample)) in terms.iter().zip(&samples.list).enumerate().take(pixels) {
            let colour = evaluate(&model.coefficients, terms);
            self.judge(i, &colour, sample);
            if let Some(prediction) = self.colour.get_mut(i) {
                *prediction = colour.map(|v| v / samples.per_radiance);
            }
        }
        // The fit's own variance is, on average over its window, its terms' share of the noise.
        let fit_variance = (model.terms as f32 / pixels as f32).min(1.0);
        let radiance_squared = 1.0 / (samples.per_radiance * samples.per_radiance);
        for (i, sample) in samples.list.iter().enumerate().take(pixels) {
            let bias = self.local_error(i);
            let (Some(weight), Some(error)) = (self.weight.get_mut(i), self.error.get_mut(i))
            else {
                return;
            };
            *weight = match formulas {
                Formulas::Robust => *weight * reliability(bias + ERROR_SOFTENING),
                Formulas::Literal => 1.0,
            };
            *error = (bias + fit_variance) * sample.variance * radiance_squared / 3.0;
        }
    }

    /// Adds the predictions of a layer, with the weights of the beauty's.
    #[inline(always)]
    pub(crate) fn add_layer(
        &self,
        (x, y): (usize, usize),
        radius: usize,
        coefficients: &[Terms; 3],
        terms: &[Terms; WINDOW_AREA],
        layer: &mut LayerTile,
    ) {
        for (i, (terms, &by)) in terms
            .iter()
            .zip(&RINGS)
            .enumerate()
            .take(window_pixels(radius))
        {
            let (px, py) = offset(x, y, by);
            let (Some(&weight), Some(sum)) =
                (self.weight.get(i), layer.sums.get_mut(py * TILE + px))
            else {
                return;
            };
            for (sum, value) in sum.iter_mut().zip(evaluate(coefficients, terms)) {
                let added = value * weight;
                if added.is_finite() {
                    *sum += added;
                }
            }
        }
    }

    /// Compares a prediction with its pixel.
    #[inline(always)]
    fn judge(&mut self, i: usize, colour: &[f32; 3], sample: &Sample) {
        let Some(weight) = self.weight.get_mut(i) else {
            return;
        };
        *weight = 1.0;
        if sample.weight <= 0.0 {
            return;
        }
        let mut squared = 0.0;
        for (prediction, y) in colour.iter().zip(&sample.colour) {
            squared += (prediction - y) * (prediction - y);
        }
        *weight = 1.0 / (1.0 + squared / (DISAGREEMENT * sample.tolerance + f32::MIN_POSITIVE));
        let (column, row) = raster(i);
        // Relative to a variance of 0 every error is infinite: a millionth of the squared radiance bounds it.
        let variance = sample.variance + 1e-6 / sample.weight;
        if let (Some(distance), Some(known)) = (
            cell_mut(&mut self.distance, column, row),
            cell_mut(&mut self.known, column, row),
        ) {
            *distance = squared / variance;
            *known = 1.0;
        }
    }

    /// Squared error without the noise, in units of the pixel's variance: the mean over the 3 x 3 pixels around, less 1.
    #[inline(always)]
    fn local_error(&self, i: usize) -> f32 {
        let (column, row) = raster(i);
        let (mut sum, mut count) = (0.0, 0.0);
        for y in row.saturating_sub(1)..=row + 1 {
            for x in column.saturating_sub(1)..=column + 1 {
                sum += self
                    .distance
                    .get(y)
                    .and_then(|r| r.get(x))
                    .copied()
                    .unwrap_or(0.0);
                count += self
                    .known
                    .get(y)
                    .and_then(|r| r.get(x))
                    .copied()
                    .unwrap_or(0.0);
            }
        }
        if count > 0.0 {
            (sum / count - 1.0).max(0.0)
        } else {
            0.0
        }
    }

    /// Adds the predictions to the cell's.
    #[inline(always)]
    pub(crate) fn add_to(
        &self,
        (x, y): (usize, usize),
        model: &Model,
        predictions: &mut Predictions,
    ) {
        let rank = (model.terms - 1) as f32;
        for (i, &by) in RINGS.iter().enumerate().take(window_pixels(model.radius)) {
            let (px, py) = offset(x, y, by);
            let (Some(colour), Some(&weight), Some(&error), Some(sum)) = (
                self.colour.get(i),
                self.weight.get(i),
                self.error.get(i),
                predictions.sums.get_mut(py * TILE + px),
            ) else {
                return;
            };
            let added = Sum {
                colour: colour.map(|v| v * weight),
                weight,
                error: error * weight,
                radius: model.radius as f32 * weight,
                rank: rank * weight,
            };
            if added.colour.iter().all(|v| v.is_finite()) && added.error.is_finite() {
                sum.add(&added);
            }
        }
    }
}

/// Column and row of the i-th pixel of a window in raster order with a margin of one.
#[inline(always)]
fn raster(i: usize) -> (usize, usize) {
    let by = RINGS.get(i).copied().unwrap_or((0, 0));
    offset(RADIUS + 1, RADIUS + 1, by)
}

#[inline(always)]
fn cell_mut(grid: &mut [[f32; SIDE]; SIDE], column: usize, row: usize) -> Option<&mut f32> {
    grid.get_mut(row).and_then(|r| r.get_mut(column))
}

#[inline(always)]
fn evaluate(coefficients: &[Terms; 3], terms: &Terms) -> [f32; 3] {
    coefficients.map(|channel| {
        let mut sum = 0.0;
        for (b, z) in channel.iter().zip(terms) {
            sum += b * z;
        }
        sum
    })
}
