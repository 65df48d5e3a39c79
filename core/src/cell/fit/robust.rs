//! The model of one window: fitted ring by ring, and stopped where its risk is least (LPR section 4).
//!
//! Against the papers' formulas (see [`crate::cell::fit::lpr`]):
//!
//! - Pixels weigh 1 / radiance^2, as in the relative error that images are judged by; radiance enters in units of the
//!   window's darkest weight, so that no exposure overflows. Of that, pixels far from the centre in feature space have a
//!   smaller share, as in the kernels of WLR section 3.
//! - Every risk has the pixels' own variance taken off, so that r = 0, which has none to take off, is not favoured.
//! - Up to r = 2 the risk is Stein's unbiased estimate of the fit, which needs no pixels outside; from r = 3 on each
//!   ring tests the model fitted before it (LPR Eq. 5).
//! - No risk is below 0.3 of the fit's own variance, or the luckiest of ten noisy estimates wins.

#![expect(
    clippy::needless_range_loop,
    reason = "the loops follow the indices of the formulas"
)]

use crate::cell::feature_space::Basis;
use crate::cell::window::{Sample, Windows};
use crate::float::saturate;
use crate::lanes::{Aligned, add_products, lanes_stay_innermost};
use crate::least_squares::prior::CHANNELS;
use crate::least_squares::sums::{Chunk, Equations, Factor, about};
use crate::params::Params;
use crate::tile::{RADIUS, WINDOW_AREA, window_pixels};

/// No risk is below this part of the fit's own variance (measured: 0.3 to 0.6 alike; without, gloss suffers).
const RISK_FLOOR: f32 = 0.3;

/// From this radius on the ring tests the model; below, Stein's estimate does (measured: 3; method of LPR: 2).
const FIRST_TEST_RING: usize = 3;

/// Squared length of the local features at which a pixel has half its weight; a feature's range in the window is 2 long (measured: 2 to
/// 10 alike).
const HALF_WEIGHT: f32 = 5.0;

/// Coefficients of each channel, in the window's unit of radiance; 0 beyond a lane's terms.
pub(crate) type Coefficients<const T: usize, const L: usize> = [[[f32; L]; T]; CHANNELS];

/// Fitted models and how far they predict, in the windows' units of radiance.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Models<const T: usize, const L: usize> {
    pub(crate) coefficients: Coefficients<T, L>,
    /// Estimated mean squared error over the prediction window, by which the radius was chosen.
    pub(crate) risk: [f32; L],
    /// Half-width of the prediction window.
    pub(crate) radius: [usize; L],
    /// Terms of the fit: rank + 1.
    pub(crate) terms: [usize; L],
}

impl<const T: usize, const L: usize> Models<T, L> {
    /// The centres themselves, as models of r = 0: their risk is their variance (LPR section 4.2).
    #[inline(always)]
    pub(crate) fn of_centres(centre: &Sample<L>) -> Self {
        let mut risk = [f32::MAX; L];
        for l in 0..L {
            if centre.weight[l] > 0.0 {
                risk[l] = centre.variance[l];
            }
        }
        Self {
            coefficients: constant(&centre.colour),
            risk,
            radius: [0; L],
            terms: [1; L],
        }
    }
}

/// What it takes to fit more channels in the way of the models.
#[repr(C, align(64))]
pub(crate) struct Systems<const T: usize, const L: usize> {
    gram: [[[f64; L]; T]; T],
    factor: Factor<T, L>,
}

impl<const T: usize, const L: usize> Systems<T, L> {
    const NONE: Self = Self {
        gram: [[[0.0; L]; T]; T],
        factor: Factor::ZERO,
    };

    #[inline(always)]
    fn keep(&mut self, lane: usize, gram: &[[[f64; L]; T]; T], factor: &Factor<T, L>) {
        for i in 0..T {
            for j in 0..T {
                self.gram[i][j][lane] = gram[i][j][lane];
                self.factor.lower[i][j][lane] = factor.lower[i][j][lane];
            }
            self.factor.inverse[i][lane] = factor.inverse[i][lane];
        }
    }

    /// The coefficients of a layer's channels: same windows, same weights, same strengths.
    #[inline(always)]
    pub(crate) fn follow<const D: usize>(
        &self,
        windows: &Windows<D, L>,
        radius: &[usize; L],
        layer: &[[[f32; L]; 3]; WINDOW_AREA],
    ) -> Coefficients<T, L> {
        let [centre, ..] = layer;
        let mut moments = [[[0.0; L]; T]; CHANNELS];
        let mut chunk = Chunk::<T, L, 1>::ZERO;
        let pixels = windows.features.iter().zip(&windows.samples).zip(layer);
        for (i, ((features, sample), colour)) in pixels.enumerate() {
            let mut weight = nearness_times::<T, D, L>(features, &sample.weight);
            for l in 0..L {
                if radius[l] == 0 || i >= window_pixels(radius[l]) {
                    weight[l] = 0.0;
                }
            }
            chunk.set(0, |t| term(features, t), colour, &weight);
            chunk.add_to_moments(&mut moments);
            lanes_stay_innermost();
        }
        let change = about(&self.gram, &moments, centre);
        minimiser(&self.factor, change, centre).0
    }
}

/// Regressor `t` of a pixel: 1, then its local features, then 0.
#[inline(always)]
pub(crate) fn term<const D: usize, const L: usize>(
    features: &[[f32; L]; D],
    t: usize,
) -> &[f32; L] {
    match t.checked_sub(1) {
        None => const { &[1.0; L] },
        Some(feature) => features.get(feature).unwrap_or(const { &[0.0; L] }),
    }
}

/// Fits each window on the first `T` of its terms, and leaves the local features in the windows. The systems are there
/// if `keep_systems`.
#[inline(always)]
pub(crate) fn fit<const T: usize, const D: usize, const L: usize>(
    windows: &mut Windows<D, L>,
    basis: &Basis<D, L>,
    params: &Params,
    keep_systems: bool,
) -> (Models<T, L>, Systems<T, L>) {
    let [centre, ..] = &windows.samples;
    let mut growth = Growth::<T, L>::new(centre, basis.rank, keep_systems);
    let (centre, rings) = windows.features.split_at_mut(1);
    let (own, samples) = windows.samples.split_at(1);
    if let (Some(features), Some(samples)) = (centre.first_chunk_mut(), own.first_chunk()) {
        let mut alone = Chunk::ZERO;
        growth.take_in::<1, D>(0, features, samples, basis, &mut alone);
    }
    let mut chunk = Chunk::ZERO;
    // A ring is 8 r pixels: r chunks.
    let chunks = rings
        .chunks_exact_mut(CHUNK)
        .zip(samples.chunks_exact(CHUNK));
    let mut chunks = chunks.filter_map(|(rings, samples)| {
        Some((
            rings.first_chunk_mut::<CHUNK>()?,
            samples.first_chunk::<CHUNK>()?,
        ))
    });
    for radius in 1..=RADIUS {
        for (features, samples) in chunks.by_ref().take(radius) {
            growth.take_in::<CHUNK, D>(radius, features, samples, basis, &mut chunk);
            lanes_stay_innermost();
        }
        growth.choose(radius, params);
    }
    (growth.best, growth.systems)
}

/// Pixels that are taken in at a time.
const CHUNK: usize = 8;

/// Replaces the features of all pixels by local ones, where no fit does.
#[inline(always)]
pub(crate) fn project_all<const T: usize, const D: usize, const L: usize>(
    windows: &mut Windows<D, L>,
    basis: &Basis<D, L>,
) {
    for features in &mut windows.features {
        project::<T, D, L>(features, basis);
        lanes_stay_innermost();
    }
}

/// Replaces a pixel's features by the local ones that `T` terms need.
#[inline(always)]
fn project<const T: usize, const D: usize, const L: usize>(
    features: &mut [[f32; L]; D],
    basis: &Basis<D, L>,
) {
    let mut local = Aligned([[0.0; L]; D]);
    add_products::<f32, D, D, L>(
        &mut local.0,
        0..(T - 1).min(D),
        |j| &features[j],
        |j| &basis.axes[j],
    );
    for k in 0..D {
        features[k] = local.0[k];
        lanes_stay_innermost();
    }
}

/// A pixel's weight, less as it is farther from the centre in the local features of `T` terms: a line holds nearby.
#[inline(always)]
fn nearness_times<const T: usize, const D: usize, const L: usize>(
    features: &[[f32; L]; D],
    weight: &[f32; L],
) -> [f32; L] {
    let mut squared = [0.0; L];
    for feature in features.iter().take(T - 1) {
        for l in 0..L {
            squared[l] += feature[l] * feature[l];
        }
        lanes_stay_innermost();
    }
    let mut near = *weight;
    for l in 0..L {
        near[l] *= HALF_WEIGHT / (HALF_WEIGHT + squared[l]);
    }
    near
}

/// Models while their windows grow.
struct Growth<const T: usize, const L: usize> {
    sums: Equations<T, L>,
    previous: Aligned<Coefficients<T, L>>,
    centre: [[f32; L]; CHANNELS],
    /// 1 where the centre is fitted, 0 where it only starts the prior.
    centre_counts: [f32; L],
    terms: [usize; L],
    pixels: [f32; L],
    weights: [f32; L],
    /// Sum of weight times variance.
    noise: [f32; L],
    /// Of a ring, by the model fitted before it.
    test: [f32; L],
    /// Accumulated risk, xi_acc of LPR Eq. 4, without the noise.
    risk: [f32; L],
    best: Models<T, L>,
    systems: Systems<T, L>,
    keep_systems: bool,
}

impl<const T: usize, const L: usize> Growth<T, L> {
    #[inline(always)]
    fn new(centre: &Sample<L>, rank: [usize; L], keep_systems: bool) -> Self {
        let mut growth = Self {
            sums: Equations::new(),
            previous: Aligned([[[0.0; L]; T]; CHANNELS]),
            centre: centre.colour,
            centre_counts: [0.0; L],
            terms: rank.map(|rank| rank + 1),
            pixels: [0.0; L],
            weights: [0.0; L],
            noise: [0.0; L],
            test: [0.0; L],
            risk: [0.0; L],
            best: Models::of_centres(centre),
            systems: Systems::NONE,
            keep_systems,
        };
        for l in 0..L {
            if centre.weight[l] > 0.0 {
                growth.centre_counts[l] = 1.0;
            }
        }
        growth
    }

    /// Takes in `N` pixels of ring `radius`, whose features become local ones.
    #[inline(always)]
    fn take_in<const N: usize, const D: usize>(
        &mut self,
        radius: usize,
        features: &mut [[[f32; L]; D]; N],
        samples: &[Sample<L>; N],
        basis: &Basis<D, L>,
        chunk: &mut Chunk<T, L, N>,
    ) {
        for p in 0..N {
            let (features, sample) = (&mut features[p], &samples[p]);
            project::<T, D, L>(features, basis);
            let weight = nearness_times::<T, D, L>(features, &sample.weight);
            chunk.set(p, |t| term(features, t), &sample.colour, &weight);
            if radius >= FIRST_TEST_RING {
                let squared = squared_distance(&self.previous.0, features, &sample.colour);
                for l in 0..L {
                    let test = weight[l] * (squared[l] - sample.variance[l]);
                    self.test[l] += if weight[l] > 0.0 { test } else { 0.0 };
                }
            }
            for l in 0..L {
                self.pixels[l] += if weight[l] > 0.0 { 1.0 } else { 0.0 };
                self.weights[l] += weight[l];
                self.noise[l] += weight[l] * sample.variance[l];
            }
            lanes_stay_innermost();
        }
        self.sums.add(chunk);
    }

    /// Fits what has been taken in up to ring `radius`, and keeps each model whose risk is the least so far.
    #[inline(always)]
    fn choose(&mut self, radius: usize, params: &Params) {
        let mut strengths = [[0.0; L]; T];
        let mut noise = [0.0; L];
        for l in 0..L {
            let pixels = if self.pixels[l] > 1.0 {
                self.pixels[l]
            } else {
                1.0
            };
            let share = self.weights[l] / pixels;
            strengths[0][l] = params.intercept_strength * share * self.centre_counts[l];
            for t in 1..T {
                strengths[t][l] = params.gradient_strength * share;
            }
            // Variance of a pixel of average weight: with weights of 1 / variance it is 1 whatever the brightness.
            noise[l] = self.noise[l] / pixels;
        }
        let factor = Factor::new(&self.sums.gram, &strengths);
        let change = self.sums.moments_about(&self.centre);
        let (coefficients, finite) = minimiser(&factor, change, &self.centre);
        if radius < FIRST_TEST_RING {
            self.risk = self.stein(&coefficients, &factor, &strengths, &noise);
        } else {
            for l in 0..L {
                self.risk[l] += self.test[l];
            }
        }
        self.test = [0.0; L];
        for l in 0..L {
            if !(finite[l] && factor.finite[l]) {
                continue;
            }
            for c in 0..CHANNELS {
                for t in 0..T {
                    self.previous.0[c][t][l] = coefficients[c][t][l];
                }
            }
            let floor = RISK_FLOOR * noise[l] * self.terms[l] as f32;
            let risk = if self.risk[l] > floor {
                self.risk[l]
            } else {
                floor
            };
            let risk = risk / self.weights[l];
            if risk < self.best.risk[l] {
                self.best.risk[l] = risk;
                self.best.radius[l] = radius;
                self.best.terms[l] = self.terms[l];
                for c in 0..CHANNELS {
                    for t in 0..T {
                        self.best.coefficients[c][t][l] = coefficients[c][t][l];
                    }
                }
                if self.keep_systems {
                    self.systems.keep(l, &self.sums.gram, &factor);
                }
            }
        }
    }

    /// Stein's unbiased risk, `RSS - sum w var + 2 trace(P sum w^2 var z z^T)` with `w var` at its mean.
    #[inline(always)]
    fn stein(
        &self,
        coefficients: &Coefficients<T, L>,
        factor: &Factor<T, L>,
        strengths: &[[f32; L]; T],
        noise: &[f32; L],
    ) -> [f32; L] {
        let residual = self.sums.residual_squares(coefficients);
        let freedom = factor.freedom(&self.sums.gram, strengths);
        let mut risk = [0.0; L];
        for l in 0..L {
            let sum = residual[0][l] + residual[1][l] + residual[2][l];
            let unbiased = sum - self.noise[l] + 2.0 * noise[l] * freedom[l];
            let floor = RISK_FLOOR * noise[l] * freedom[l];
            risk[l] = if unbiased > floor { unbiased } else { floor };
        }
        risk
    }
}

/// `beta(0) + P change`, beta(0) the centre and no gradients, and whether it is finite.
#[inline(always)]
fn minimiser<const T: usize, const L: usize>(
    factor: &Factor<T, L>,
    mut change: [[[f64; L]; T]; CHANNELS],
    centre: &[[f32; L]; CHANNELS],
) -> (Coefficients<T, L>, [bool; L]) {
    let mut coefficients = constant(centre);
    let mut finite = [true; L];
    for c in 0..CHANNELS {
        factor.solve(&mut change[c]);
        for t in 0..T {
            for l in 0..L {
                let value = f64::from(coefficients[c][t][l]) + change[c][t][l];
                finite[l] &= value.is_finite();
                coefficients[c][t][l] = saturate(value);
            }
            lanes_stay_innermost();
        }
    }
    (coefficients, finite)
}

/// The centre's radiance, whatever the features.
#[inline(always)]
fn constant<const T: usize, const L: usize>(centre: &[[f32; L]; CHANNELS]) -> Coefficients<T, L> {
    let mut coefficients = [[[0.0; L]; T]; CHANNELS];
    for c in 0..CHANNELS {
        coefficients[c][0] = centre[c];
    }
    coefficients
}

/// `beta^T z` of each channel, from a pixel's local features.
#[inline(always)]
pub(crate) fn evaluate<const T: usize, const D: usize, const L: usize>(
    coefficients: &Coefficients<T, L>,
    features: &[[f32; L]; D],
) -> [[f32; L]; CHANNELS] {
    let mut values = [[0.0; L]; CHANNELS];
    for c in 0..CHANNELS {
        values[c] = coefficients[c][0];
    }
    for t in 1..T {
        if let Some(feature) = features.get(t - 1) {
            for c in 0..CHANNELS {
                for l in 0..L {
                    values[c][l] += coefficients[c][t][l] * feature[l];
                }
            }
        }
        lanes_stay_innermost();
    }
    values
}

/// `sum over channels (beta^T z - y)^2`.
#[inline(always)]
fn squared_distance<const T: usize, const D: usize, const L: usize>(
    coefficients: &Coefficients<T, L>,
    features: &[[f32; L]; D],
    colour: &[[f32; L]; CHANNELS],
) -> [f32; L] {
    let values = evaluate(coefficients, features);
    let mut sum = [0.0; L];
    for c in 0..CHANNELS {
        for l in 0..L {
            let difference = values[c][l] - colour[c][l];
            sum[l] += difference * difference;
        }
    }
    sum
}
