//! The model of one window: fitted ring by ring, and stopped where its risk is least (LPR section 4).
//!
//! Against the papers' formulas (see [`crate::literal`]):
//!
//! - Pixels weigh 1 / radiance^2, as in the relative error that images are judged by; radiance enters in units of the
//!   window's darkest weight, so that no exposure overflows.
//! - Every risk has the pixels' own variance taken off, so that r = 0, which has none to take off, is not favoured.
//! - Up to r = 2 the risk is Stein's unbiased estimate of the fit, which needs no pixels outside; from r = 3 on each
//!   ring tests the model fitted before it (LPR Eq. 5).
//! - No risk is below 0.3 of the fit's own variance, or the luckiest of ten noisy estimates wins.

use crate::feature_space::{MAX_TERMS, Terms};
use crate::float::sqrt;
use crate::normal::{Gram, Moments, NormalEquations, Solution};
use crate::params::Params;
use crate::prior::Prior;
use crate::tile::{RADIUS, RINGS, Tile, WINDOW_AREA, offset, window_pixels};

/// No risk is below this part of the fit's own variance (measured: 0.3 to 0.6 alike; without, gloss suffers).
const RISK_FLOOR: f32 = 0.3;

/// From this radius on the ring tests the model; below, Stein's estimate does (measured: 3; method of LPR: 2).
const FIRST_TEST_RING: usize = 3;

/// A pixel of a window, in the window's unit of radiance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Sample {
    pub(crate) colour: [f32; 3],
    /// 0 to 1; 0 keeps it out.
    pub(crate) weight: f32,
    /// Variance of the mean, summed over the channels.
    pub(crate) variance: f32,
    /// Squared distance at which a prediction disagrees.
    pub(crate) tolerance: f32,
}

/// The samples of a window, ring after ring, and their unit.
pub(crate) struct Samples {
    pub(crate) list: [Sample; WINDOW_AREA],
    /// Radiance of 1 in the samples' unit.
    pub(crate) per_radiance: f32,
}

impl Samples {
    pub(crate) const EMPTY: Self = Self {
        list: [Sample {
            colour: [0.0; 3],
            weight: 0.0,
            variance: 0.0,
            tolerance: 0.0,
        }; WINDOW_AREA],
        per_radiance: 1.0,
    };

    /// Reads the window around (x, y); false if it has no valid pixel.
    #[inline(always)]
    pub(crate) fn read<const D: usize>(&mut self, tile: &Tile<D>, (x, y): (usize, usize)) -> bool {
        let mut largest = 0.0f32;
        for &by in &RINGS {
            let (px, py) = offset(x, y, by);
            largest = largest.max(tile.pixel(px, py).weight);
        }
        if !(largest > 0.0 && largest.is_finite()) {
            return false;
        }
        self.per_radiance = sqrt(largest);
        for (sample, &by) in self.list.iter_mut().zip(&RINGS) {
            let (px, py) = offset(x, y, by);
            let pixel = tile.pixel(px, py);
            *sample = Sample {
                colour: pixel.colour.map(|v| v * self.per_radiance),
                weight: pixel.weight / largest,
                variance: pixel.variance * largest,
                tolerance: pixel.tolerance * largest,
            };
        }
        true
    }
}

/// A fitted model and how far it predicts, in the window's unit of radiance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Model {
    /// Half-width of its prediction window.
    pub(crate) radius: usize,
    /// Terms of the fit: rank + 1.
    pub(crate) terms: usize,
    /// Coefficients per channel; 0 beyond the terms.
    pub(crate) coefficients: [Terms; 3],
    /// Estimated mean squared error over its prediction window, by which its radius was chosen.
    pub(crate) risk: f32,
}

/// A model, and what it takes to fit more channels in its way.
pub(crate) struct Fitted<const T: usize> {
    pub(crate) model: Model,
    /// Sums and factor at the model's radius; `None` at r = 0.
    system: Option<(Gram<T>, Solution<T>)>,
}

impl<const T: usize> Fitted<T> {
    /// The coefficients of a layer's channels: same window, same weights, same strengths.
    #[inline(always)]
    pub(crate) fn follow(
        &self,
        terms: &[Terms; WINDOW_AREA],
        samples: &[Sample; WINDOW_AREA],
        layer: &[[f32; 3]; WINDOW_AREA],
    ) -> [Terms; 3] {
        let [centre, ..] = layer;
        let start = Prior::<T>::at_centre(centre, 0.0, 0.0).coefficients;
        let Some((gram, solution)) = &self.system else {
            return padded(&start);
        };
        let mut moments = Moments::new();
        for ((terms, sample), layer) in terms
            .iter()
            .zip(samples)
            .zip(layer)
            .take(window_pixels(self.model.radius))
        {
            if let Some(terms) = terms.first_chunk::<T>() {
                moments.add(terms, layer, sample.weight);
            }
        }
        padded(&solution.follow(gram, &moments, &start).unwrap_or(start))
    }
}

/// Fits the window's samples on the first `T` of its terms.
#[inline(always)]
pub(crate) fn fit<const T: usize>(
    terms: &[Terms; WINDOW_AREA],
    samples: &[Sample; WINDOW_AREA],
    params: &Params,
) -> Fitted<T> {
    let mut growth = Growth::<T>::new(samples);
    for radius in 1..=RADIUS {
        growth.grow(radius, terms, samples, params);
    }
    growth.best
}

/// A model while its window grows.
struct Growth<const T: usize> {
    sums: NormalEquations<T>,
    previous: [[f32; T]; 3],
    pixels: f32,
    weights: f32,
    /// Sum of weight times variance.
    noise: f32,
    /// Accumulated risk, xi_acc of LPR Eq. 4, without the noise.
    risk: f32,
    best: Fitted<T>,
}

impl<const T: usize> Growth<T> {
    #[inline(always)]
    fn new(samples: &[Sample; WINDOW_AREA]) -> Self {
        let [centre, ..] = samples;
        let mut growth = Self {
            sums: NormalEquations::new(),
            previous: [[0.0; T]; 3],
            pixels: 0.0,
            weights: 0.0,
            noise: 0.0,
            risk: 0.0,
            best: Fitted {
                model: constant_model(centre),
                system: None,
            },
        };
        let mut first = [0.0; T];
        if let Some(one) = first.first_mut() {
            *one = 1.0;
        }
        growth.add(&first, centre);
        growth
    }

    #[inline(always)]
    fn add(&mut self, terms: &[f32; T], sample: &Sample) {
        if sample.weight > 0.0 {
            self.sums.add(terms, &sample.colour, sample.weight);
            self.pixels += 1.0;
            self.weights += sample.weight;
            self.noise += sample.weight * sample.variance;
        }
    }

    /// Takes in ring `radius`, and keeps the model if its risk is the least so far.
    #[inline(always)]
    fn grow(
        &mut self,
        radius: usize,
        terms: &[Terms; WINDOW_AREA],
        samples: &[Sample; WINDOW_AREA],
        params: &Params,
    ) {
        let (inner, outer) = (window_pixels(radius - 1), window_pixels(radius));
        let mut test = 0.0;
        for (terms, sample) in terms.iter().zip(samples).take(outer).skip(inner) {
            let Some(terms) = terms.first_chunk::<T>() else {
                return;
            };
            if radius >= FIRST_TEST_RING && sample.weight > 0.0 {
                test += sample.weight
                    * (squared_distance(&self.previous, terms, &sample.colour) - sample.variance);
            }
            self.add(terms, sample);
        }
        let share = self.weights / self.pixels.max(1.0);
        let [centre, ..] = samples;
        let intercept = if centre.weight > 0.0 {
            params.intercept_strength * share
        } else {
            0.0
        };
        let prior = Prior::at_centre(&centre.colour, intercept, params.gradient_strength * share);
        let Ok(solution) = self.sums.solve(&prior) else {
            return;
        };
        self.previous = *solution.coefficients();
        // Variance of a pixel of average weight: with weights of 1 / variance it is 1 whatever the brightness.
        let noise = self.noise / self.pixels.max(1.0);
        if radius < FIRST_TEST_RING {
            self.risk = self.stein(&solution, noise);
        } else {
            self.risk += test;
        }
        let floor = RISK_FLOOR * noise * T as f32;
        let risk = self.risk.max(floor) / self.weights;
        if risk < self.best.model.risk {
            let model = Model {
                radius,
                terms: T,
                coefficients: padded(&self.previous),
                risk,
            };
            self.best = Fitted {
                model,
                system: Some((*self.sums.gram(), solution)),
            };
        }
    }

    /// Stein's unbiased risk, `RSS - sum w var + 2 trace(P sum w^2 var z z^T)` with `w var` at its mean.
    #[inline(always)]
    fn stein(&self, solution: &Solution<T>, noise: f32) -> f32 {
        let residual: f32 = self.sums.residual_squares(&self.previous).iter().sum();
        let freedom = solution.trace(self.sums.gram());
        (residual - self.noise + 2.0 * noise * freedom).max(RISK_FLOOR * noise * freedom)
    }
}

/// The centre itself, as a model of r = 0: its risk is its variance (LPR section 4.2).
pub(crate) fn constant_model(centre: &Sample) -> Model {
    let mut coefficients = [[0.0; MAX_TERMS]; 3];
    for (coefficients, &colour) in coefficients.iter_mut().zip(&centre.colour) {
        if let Some(intercept) = coefficients.first_mut() {
            *intercept = colour;
        }
    }
    let risk = if centre.weight > 0.0 {
        centre.variance
    } else {
        f32::MAX
    };
    Model {
        radius: 0,
        terms: 1,
        coefficients,
        risk,
    }
}

/// `sum over channels (beta^T z - y)^2`.
#[inline(always)]
fn squared_distance<const T: usize>(
    coefficients: &[[f32; T]; 3],
    terms: &[f32; T],
    colour: &[f32; 3],
) -> f32 {
    let mut sum = 0.0;
    for (beta, y) in coefficients.iter().zip(colour) {
        let mut value = 0.0;
        for (b, z) in beta.iter().zip(terms) {
            value += b * z;
        }
        sum += (value - y) * (value - y);
    }
    sum
}

pub(crate) fn padded<const T: usize>(coefficients: &[[f32; T]; 3]) -> [Terms; 3] {
    coefficients.map(|channel| {
        let mut terms = [0.0; MAX_TERMS];
        for (term, value) in terms.iter_mut().zip(channel) {
            *term = value;
        }
        terms
    })
}
