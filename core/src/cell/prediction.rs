//! The predictions of models, and the confidence in each: how well its model does around the pixel.

use crate::blend::{self, ERROR_SOFTENING, LayerTile, Predictions, Sum};
use crate::cell::feature_space::Basis;
use crate::cell::model::{Coefficients, Models, evaluate, printed_variance};
use crate::cell::rings::{Centre, RING_STEPS, RINGS, window_pixels};
use crate::cell::window::{Colours, Sample, Windows};
use crate::lanes::{Lanes, Rgb, Vector, lanes_stay_innermost};
use crate::params::Formulas;
use crate::tile::{CHANNELS, RADIUS, WINDOW_AREA};

/// Squared distance, in units of a pixel's tolerance, at which a prediction that the pixel itself speaks against loses
/// half its confidence (measured: 2^2 to 3^2 alike; less costs light, for dark samples outnumber bright ones).
const DISAGREEMENT: f32 = 6.0;

/// A squared distance enters the mean over the window no larger than this, in units of the pixel's variance, so that one pixel does not
/// speak for all (measured: 20 to 500 alike).
const LARGEST_DISTANCE: f32 = 100.0;

/// Part of its confidence that a prediction would lose one ring beyond its window: a model is at its best around its centre (measured: 0.5 to
/// 0.9 alike).
const EDGE_LOSS: f32 = 0.7;

/// Where the pixel is nowhere negative, a prediction loses its confidence if a channel is below this part of the magnitudes of all
/// three: a plane drawn beyond a dark edge (measured: 0.03 to 0.3 alike).
const NEGATIVE: f32 = -0.1;

/// Relative to a variance of 0 every error is infinite: this part of the squared radiance bounds it.
const LEAST_VARIANCE: f32 = 1e-6;

/// Half-width of the pixels around a prediction whose mean residual says how far off its model is there (measured: 2 and 3 alike, 1 follows
/// the noise).
const NEAR: usize = 2;
const NEAR_SPAN: usize = 2 * NEAR + 1;

/// Side of a prediction window with a margin of [`NEAR`].
const SIDE: usize = 2 * (RADIUS + NEAR) + 1;

/// One lane of a colour.
#[inline(always)]
fn of_lane<const L: usize>([r, g, b]: &Rgb<L>, l: usize) -> [f32; 3] {
    match (r.get(l), g.get(l), b.get(l)) {
        (Some(&r), Some(&g), Some(&b)) => [r, g, b],
        _ => {
            debug_assert!(false, "there is no lane {l}");
            [0.0; 3]
        }
    }
}

/// Position of each pixel of a window in raster order with a margin of [`NEAR`], ring after ring.
const RASTER: [usize; WINDOW_AREA] = raster();

const fn raster() -> [usize; WINDOW_AREA] {
    let mut positions = [0; WINDOW_AREA];
    let mut i = 0;
    while i < WINDOW_AREA {
        let (column, row) = RINGS[i];
        let centre = (RADIUS + NEAR) as isize;
        positions[i] =
            ((centre + row as isize) * SIDE as isize + centre + column as isize) as usize;
        i += 1;
    }
    positions
}

/// What all predictions of a model have in common.
struct Common<const L: usize> {
    /// Squared residuals without the noise, on average over the window, in units of the pixels' variance: how far the model is to be
    /// believed, but no estimate of its error, for a few bright samples make all of it.
    excess: Lanes<L>,
    /// Part of its confidence that a prediction loses, per ring squared.
    edge_loss: Lanes<L>,
    /// The fit's own variance, in units of the pixels': on average over its window, its terms' share of the noise.
    fit_variance: Lanes<L>,
    /// Variance that the features' noise prints into them, in the window's unit. The pixels that judge the model share their samples
    /// with the features, so what a model prints looks like truth to them; this takes the advantage away.
    printed: Lanes<L>,
    /// What WLR's formulas say of the error at the centre, which is all that they predict, in the window's unit.
    risk: Lanes<L>,
    /// A squared distance of 1 in the window's unit, as radiance squared, mean over the channels.
    per_channel: Lanes<L>,
}

/// Whether a prediction is negative, and not by rounding, where lane `l` of the pixel is not.
#[inline(always)]
fn goes_below<const L: usize>(sample: &Sample<L>, [r, g, b]: [f32; 3], l: usize) -> bool {
    let lit =
        sample.colour[0][l] >= 0.0 && sample.colour[1][l] >= 0.0 && sample.colour[2][l] >= 0.0;
    let least = if r < g { r } else { g };
    let least = if least < b { least } else { b };
    lit && least < NEGATIVE * (r.abs() + g.abs() + b.abs())
}

/// A pixel's weight, that of its surroundings, and its variance times that, which is relative to the radiance around.
#[inline(always)]
fn relative_noise<const L: usize>(sample: &Sample<L>, l: usize) -> (f32, f32) {
    let weight = sample.weight[l];
    let weight = if weight > 0.0 { weight } else { 1.0 };
    (weight, sample.variance[l] * weight + LEAST_VARIANCE)
}

/// The ring of pixel `i` of a window.
#[inline(always)]
fn ring_of(i: usize) -> f32 {
    let offset = RINGS.get(i);
    debug_assert!(offset.is_some(), "{i} is not in the window");
    let (column, row) = offset.copied().unwrap_or((0, 0));
    f32::from(column.unsigned_abs().max(row.unsigned_abs()))
}

/// Residuals of some pixels, red green blue, and how many there are.
type Residual<const L: usize> = [Lanes<L>; CHANNELS + 1];

/// The predictions of the models of `L` windows, ring after ring, and the confidence in each.
#[repr(C, align(64))]
pub(crate) struct PredictionWindows<const L: usize> {
    /// Radiance, in the end times the confidence.
    colour: Colours<L>,
    /// 0 for a prediction that left f32.
    confidence: Vector<WINDOW_AREA, L>,
    /// Estimated squared error times the confidence.
    error: Vector<WINDOW_AREA, L>,
    /// What each prediction is above its pixel, raster order with a margin; in the end the sums over the [`NEAR_SPAN`] x
    /// [`NEAR_SPAN`] from each on.
    residuals: [Residual<L>; SIDE * SIDE],
    /// Sum over the prediction window of the squared residuals over the pixels' variances, each cut at [`LARGEST_DISTANCE`].
    total: Lanes<L>,
    /// Pixels in that sum.
    pixels: Lanes<L>,
}

impl<const L: usize> PredictionWindows<L> {
    pub(crate) const EMPTY: Self = Self {
        colour: [[[0.0; L]; 3]; WINDOW_AREA],
        confidence: [[0.0; L]; WINDOW_AREA],
        error: [[0.0; L]; WINDOW_AREA],
        residuals: [[[0.0; L]; CHANNELS + 1]; SIDE * SIDE],
        total: [0.0; L],
        pixels: [0.0; L],
    };

    /// Predicts the models' windows and rates the predictions.
    #[inline(always)]
    pub(crate) fn predict<const T: usize, const D: usize>(
        &mut self,
        models: &Models<T, L>,
        windows: &Windows<D, L>,
        basis: &Basis<D, L>,
        formulas: Formulas,
    ) {
        self.residuals = [[[0.0; L]; CHANNELS + 1]; SIDE * SIDE];
        self.total = [0.0; L];
        self.pixels = [0.0; L];
        let widest = models.radius.iter().fold(0, |a, b| a.max(*b));
        let (mut radiance, mut predicted) = ([0.0; L], [0.0; L]);
        for l in 0..L {
            radiance[l] = 1.0 / windows.radiance_scale[l];
            predicted[l] = window_pixels(models.radius[l]) as f32;
        }
        let pixels = windows.features.iter().zip(&windows.samples);
        for (i, (features, sample)) in pixels.enumerate().take(window_pixels(widest)) {
            let colour = evaluate(&models.coefficients, features);
            self.judge(i, &colour, sample, &predicted);
            if let Some(predictions) = self.colour.get_mut(i) {
                for c in 0..3 {
                    for l in 0..L {
                        predictions[c][l] = colour[c][l] * radiance[l];
                    }
                }
            }
            lanes_stay_innermost();
        }
        let common = self.common(models, windows, basis);
        self.sum_residuals(widest);
        self.rate(&common, &windows.samples, formulas, widest);
    }

    /// Compares a prediction of each model with its pixel; `pixels` of each window are predicted.
    #[inline(always)]
    fn judge(&mut self, i: usize, colour: &Rgb<L>, sample: &Sample<L>, pixels: &Lanes<L>) {
        let place = RASTER.get(i).copied().unwrap_or(usize::MAX);
        let (Some(confidence), Some(residual)) =
            (self.confidence.get_mut(i), self.residuals.get_mut(place))
        else {
            debug_assert!(false, "{i} is not in the window");
            return;
        };
        let (place, mut squared) = (i as f32, [0.0; L]);
        let mut known = [0.0; L];
        for l in 0..L {
            let inside = if place < pixels[l] { 1.0 } else { 0.0 };
            known[l] = if sample.weight[l] > 0.0 { inside } else { 0.0 };
        }
        for c in 0..CHANNELS {
            for l in 0..L {
                let difference = colour[c][l] - sample.colour[c][l];
                squared[l] += difference * difference;
                residual[c][l] = if known[l] > 0.0 { difference } else { 0.0 };
            }
        }
        residual[CHANNELS] = known;
        for l in 0..L {
            let valid = sample.weight[l] > 0.0;
            let squared = if valid { squared[l] } else { 0.0 };
            let disagreement = squared / (DISAGREEMENT * sample.tolerance[l] + f32::MIN_POSITIVE);
            confidence[l] = 1.0 / (1.0 + disagreement);
            let (weight, noise) = relative_noise(sample, l);
            let relative = squared * weight / noise;
            let relative = if known[l] > 0.0 { relative } else { 0.0 };
            self.total[l] += if relative < LARGEST_DISTANCE {
                relative
            } else {
                LARGEST_DISTANCE
            };
            self.pixels[l] += known[l];
        }
    }

    /// Confidences of the predictions by how well the model does around each, and their estimated errors.
    #[inline(always)]
    fn rate(
        &mut self,
        common: &Common<L>,
        samples: &[Sample<L>; WINDOW_AREA],
        formulas: Formulas,
        widest: usize,
    ) {
        for (i, sample) in samples.iter().enumerate().take(window_pixels(widest)) {
            let near = self.squared_bias(i, &sample.variance);
            let (Some(confidence), Some(error), Some(colour)) = (
                self.confidence.get_mut(i),
                self.error.get_mut(i),
                self.colour.get_mut(i),
            ) else {
                debug_assert!(false, "{i} is not in the window");
                return;
            };
            let ring = ring_of(i);
            for l in 0..L {
                let (weight, noise) = relative_noise(sample, l);
                let bias = common.excess[l] + (near[l] + common.printed[l] * weight) / noise;
                let own = match formulas {
                    Formulas::Robust => {
                        let share = 1.0 - common.edge_loss[l] * ring * ring;
                        confidence[l] * share * blend::confidence(bias + ERROR_SOFTENING)
                    }
                    Formulas::Literal | Formulas::Wlr => 1.0,
                };
                let variance = common.fit_variance[l] * sample.variance[l];
                let squared = match formulas {
                    Formulas::Robust | Formulas::Literal => near[l] + common.printed[l] + variance,
                    Formulas::Wlr => common.risk[l],
                } * common.per_channel[l];
                let (r, g, b) = (colour[0][l] * own, colour[1][l] * own, colour[2][l] * own);
                let squared = squared * own;
                // Not a number, too, where two of them are infinite.
                let finite = (r + g + b + squared).is_finite();
                let kept =
                    finite && !(formulas == Formulas::Robust && goes_below(sample, [r, g, b], l));
                confidence[l] = if kept { own } else { 0.0 };
                error[l] = if kept { squared } else { 0.0 };
                colour[0][l] = if kept { r } else { 0.0 };
                colour[1][l] = if kept { g } else { 0.0 };
                colour[2][l] = if kept { b } else { 0.0 };
            }
            lanes_stay_innermost();
        }
    }

    /// What all predictions of each model have in common, once they are compared with their pixels.
    #[inline(always)]
    fn common<const T: usize, const D: usize>(
        &self,
        models: &Models<T, L>,
        windows: &Windows<D, L>,
        basis: &Basis<D, L>,
    ) -> Common<L> {
        let mut common = Common {
            excess: [0.0; L],
            edge_loss: [0.0; L],
            fit_variance: [0.0; L],
            printed: printed_variance(&models.coefficients, basis),
            risk: models.risk,
            per_channel: [0.0; L],
        };
        for l in 0..L {
            let excess = self.total[l] - self.pixels[l];
            common.excess[l] = if excess > 0.0 {
                excess / self.pixels[l]
            } else {
                0.0
            };
            let beyond = (models.radius[l] + 1) as f32;
            common.edge_loss[l] = EDGE_LOSS / (beyond * beyond);
            let pixels = window_pixels(models.radius[l]) as f32;
            common.fit_variance[l] = (models.terms[l] as f32 / pixels).min(1.0);
            let radiance_scale = windows.radiance_scale[l];
            common.per_channel[l] = 1.0 / (radiance_scale * radiance_scale) / 3.0;
        }
        common
    }

    /// Sums the residuals over [`NEAR_SPAN`] x [`NEAR_SPAN`] pixels, into the first of them; every window is within `widest` rings.
    #[inline(always)]
    fn sum_residuals(&mut self, widest: usize) {
        let (first, span) = (RADIUS - widest.min(RADIUS), 2 * widest.min(RADIUS) + 1);
        for y in first..first + span + 2 * NEAR {
            for x in first..first + span {
                self.sum_five(y * SIDE + x, 1);
            }
        }
        for y in first..first + span {
            for x in first..first + span {
                self.sum_five(y * SIDE + x, SIDE);
            }
        }
    }

    /// Sums the residuals of five pixels, one `step` from the next, into the first of them.
    #[inline(always)]
    fn sum_five(&mut self, at: usize, step: usize) {
        let mut sums = [[0.0; L]; CHANNELS + 1];
        for k in 0..NEAR_SPAN {
            let Some(residual) = self.residuals.get(at + k * step) else {
                debug_assert!(false, "{at} is beyond the margin");
                return;
            };
            for c in 0..CHANNELS + 1 {
                for l in 0..L {
                    sums[c][l] += residual[c][l];
                }
            }
        }
        if let Some(first) = self.residuals.get_mut(at) {
            *first = sums;
        }
        lanes_stay_innermost();
    }

    /// The square of the model's bias around pixel `i`, summed over the channels: that of its mean residual there, less the noise's share of it.
    ///
    /// It is compared with the pixel's noise without the pixel's weight, which is 1 where the window's surroundings are darkest: a model that spans
    /// dark and bright has to do better in the bright, or it washes highlights out.
    ///
    /// The mean of the squared residuals exceeds the variance by the same, but varies itself by sqrt(2 / n) of the variance over n pixels, more
    /// where the noise is skewed; the square of their mean by 1 / n.
    #[inline(always)]
    fn squared_bias(&self, i: usize, variance: &Lanes<L>) -> Lanes<L> {
        const MARGIN: usize = NEAR * SIDE + NEAR;
        let place = RASTER.get(i).map(|centre| centre - MARGIN);
        let Some([red, green, blue, pixels]) = place.and_then(|place| self.residuals.get(place))
        else {
            debug_assert!(false, "{i} is not in the window");
            return [0.0; L];
        };
        let mut bias = [0.0; L];
        for l in 0..L {
            let squares = red[l] * red[l] + green[l] * green[l] + blue[l] * blue[l];
            let pixels = if pixels[l] > 1.0 { pixels[l] } else { 1.0 };
            let excess = squares / (pixels * pixels) - variance[l] / pixels;
            bias[l] = if excess > 0.0 { excess } else { 0.0 };
        }
        bias
    }

    /// Adds the predictions of lane `l`, around `centre`, to its cell's.
    #[inline(always)]
    pub(crate) fn add_to<const T: usize>(
        &self,
        l: usize,
        centre: Centre,
        models: &Models<T, L>,
        predictions: &mut Predictions,
    ) {
        let (Some(&radius), Some(&terms)) = (models.radius.get(l), models.terms.get(l)) else {
            debug_assert!(false, "there is no lane {l}");
            return;
        };
        let rank = (terms - 1) as f32;
        let centre = centre.position();
        let own = self.colour.iter().zip(&self.confidence).zip(&self.error);
        for (((colour, confidence), error), &step) in
            own.zip(&RING_STEPS).take(window_pixels(radius))
        {
            let (Some(sum), Some(&confidence), Some(&error)) = (
                predictions.sums.get_mut(centre.wrapping_add_signed(step)),
                confidence.get(l),
                error.get(l),
            ) else {
                debug_assert!(false, "the window leaves the tile, or there is no lane {l}");
                return;
            };
            sum.add(&Sum {
                colour: of_lane(colour, l),
                confidence,
                error,
                radius: radius as f32 * confidence,
                rank: rank * confidence,
            });
            lanes_stay_innermost();
        }
    }

    /// Predicts a layer by its coefficients; [`add_layer_to`](Self::add_layer_to) has the confidences of the colour's.
    #[inline(always)]
    pub(crate) fn predict_layer<const T: usize, const D: usize>(
        &mut self,
        coefficients: &Coefficients<T, L>,
        windows: &Windows<D, L>,
    ) {
        for (colour, features) in self.colour.iter_mut().zip(&windows.features) {
            *colour = evaluate(coefficients, features);
            lanes_stay_innermost();
        }
    }

    /// Adds the predictions of lane `l` to its cell's layer.
    #[inline(always)]
    pub(crate) fn add_layer_to(
        &self,
        l: usize,
        centre: Centre,
        radius: &[usize; L],
        layer: &mut LayerTile,
    ) {
        let Some(&radius) = radius.get(l) else {
            debug_assert!(false, "there is no lane {l}");
            return;
        };
        let centre = centre.position();
        let own = self.colour.iter().zip(&self.confidence).zip(&RING_STEPS);
        for ((colour, confidence), &step) in own.take(window_pixels(radius)) {
            let (Some(sum), Some(&confidence)) = (
                layer.sums.get_mut(centre.wrapping_add_signed(step)),
                confidence.get(l),
            ) else {
                debug_assert!(false, "the window leaves the tile, or there is no lane {l}");
                return;
            };
            for (sum, value) in sum.iter_mut().zip(of_lane(colour, l)) {
                let added = value * confidence;
                if added.is_finite() {
                    *sum += added;
                }
            }
        }
    }

    /// Where a layer's radiance waits until [`predict_layer`](Self::predict_layer) overwrites it.
    pub(crate) fn colours(&mut self) -> &mut Colours<L> {
        &mut self.colour
    }
}
