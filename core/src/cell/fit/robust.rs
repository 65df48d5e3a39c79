//! Weighted fits, ring by ring; of each window the one whose risk is least is kept (LPR section 4).
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

use crate::cell::feature_space::{Basis, project};
use crate::cell::fit::Fit;
use crate::cell::model::{Coefficients, Models, constant, copy_lane, regressor, squared_distance};
use crate::cell::rings::window_pixels;
use crate::cell::window::{Colours, Sample, Windows};
use crate::float::saturate;
use crate::lanes::{Aligned, Lanes, Rgb, Vector, WideMatrix, WideVector, lanes_stay_innermost};
use crate::least_squares::factor::Factor;
use crate::least_squares::sums::{Batch, Sums, centred_moments};
use crate::params::Params;
use crate::tile::{CHANNELS, RADIUS};

/// No risk is below this part of the fit's own variance (measured: 0.3 to 0.6 alike; without, gloss suffers).
const RISK_FLOOR: f32 = 0.3;

/// From this radius on the ring tests the model; below, Stein's estimate does (measured: 3; method of LPR: 2).
const FIRST_TEST_RING: usize = 3;

/// Squared length of the local features at which a pixel has half its weight; a feature's range in the window is 2 long (measured: 2 to
/// 10 alike).
const HALF_WEIGHT: f32 = 5.0;

/// What fitting more channels in the way of the models needs.
#[repr(C, align(64))]
pub(crate) struct Systems<const T: usize, const L: usize> {
    gram: WideMatrix<T, L>,
    factor: Factor<T, L>,
}

impl<const T: usize, const L: usize> Systems<T, L> {
    const NONE: Self = Self {
        gram: [[[0.0; L]; T]; T],
        factor: Factor::ZERO,
    };

    #[inline(always)]
    fn keep(&mut self, lane: usize, gram: &WideMatrix<T, L>, factor: &Factor<T, L>) {
        for i in 0..T {
            for j in 0..T {
                self.gram[i][j][lane] = gram[i][j][lane];
                self.factor.lower[i][j][lane] = factor.lower[i][j][lane];
            }
            self.factor.inverse[i][lane] = factor.inverse[i][lane];
        }
    }
}

impl<const T: usize, const D: usize, const L: usize> Fit<T, D, L> for Systems<T, L> {
    #[inline(always)]
    fn fit(
        windows: &mut Windows<D, L>,
        basis: &Basis<D, L>,
        params: &Params,
        layers: bool,
    ) -> (Models<T, L>, Self) {
        let [centre, ..] = &windows.samples;
        let mut growth = Growth::<T, L>::new(centre, basis.rank, layers);
        let (centre, rings) = windows.features.split_at_mut(1);
        let (own, samples) = windows.samples.split_at(1);
        if let (Some(features), Some(samples)) = (centre.first_chunk_mut(), own.first_chunk()) {
            let mut alone = Batch::ZERO;
            growth.take_in::<1, D>(0, features, samples, basis, &mut alone);
        }
        let mut batch = Batch::ZERO;
        // A ring is 8 r pixels: r batches.
        let batches = rings
            .chunks_exact_mut(BATCH)
            .zip(samples.chunks_exact(BATCH));
        let mut batches = batches.filter_map(|(rings, samples)| {
            Some((
                rings.first_chunk_mut::<BATCH>()?,
                samples.first_chunk::<BATCH>()?,
            ))
        });
        for radius in 1..=RADIUS {
            for (features, samples) in batches.by_ref().take(radius) {
                growth.take_in::<BATCH, D>(radius, features, samples, basis, &mut batch);
                lanes_stay_innermost();
            }
            growth.choose(radius, params);
        }
        (growth.best, growth.systems)
    }

    #[inline(always)]
    fn fit_layer(
        &self,
        windows: &Windows<D, L>,
        radius: &[usize; L],
        layer: &Colours<L>,
    ) -> Coefficients<T, L> {
        let [centre, ..] = layer;
        let mut moments = [[[0.0; L]; T]; CHANNELS];
        let mut batch = Batch::<T, L, 1>::ZERO;
        let pixels = windows.features.iter().zip(&windows.samples).zip(layer);
        for (i, ((features, sample), colour)) in pixels.enumerate() {
            let mut weight = nearness_times::<T, D, L>(features, &sample.weight);
            for l in 0..L {
                if radius[l] == 0 || i >= window_pixels(radius[l]) {
                    weight[l] = 0.0;
                }
            }
            batch.set(0, |t| regressor(features, t), colour, &weight);
            batch.add_to_moments(&mut moments);
            lanes_stay_innermost();
        }
        let change = centred_moments(&self.gram, &moments, centre);
        minimiser(&self.factor, change, centre).0
    }
}

/// Pixels that are taken in at a time.
const BATCH: usize = 8;

/// A pixel's weight, less as it is farther from the centre in the local features of `T` terms: a line holds nearby.
#[inline(always)]
fn nearness_times<const T: usize, const D: usize, const L: usize>(
    features: &Vector<D, L>,
    weight: &Lanes<L>,
) -> Lanes<L> {
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
    sums: Sums<T, L>,
    previous: Aligned<Coefficients<T, L>>,
    centre: Rgb<L>,
    /// 1 where the centre is fitted, 0 where it only starts the prior.
    centre_counts: Lanes<L>,
    terms: [usize; L],
    pixels: Lanes<L>,
    weights: Lanes<L>,
    /// Sum of weight times variance.
    noise: Lanes<L>,
    /// Squared error of the current ring under the model fitted before it, without the noise.
    test: Lanes<L>,
    /// Accumulated risk, xi_acc of LPR Eq. 4, without the noise.
    risk: Lanes<L>,
    best: Models<T, L>,
    systems: Systems<T, L>,
    keep_systems: bool,
}

impl<const T: usize, const L: usize> Growth<T, L> {
    #[inline(always)]
    fn new(centre: &Sample<L>, rank: [usize; L], keep_systems: bool) -> Self {
        let mut growth = Self {
            sums: Sums::new(),
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
        features: &mut [Vector<D, L>; N],
        samples: &[Sample<L>; N],
        basis: &Basis<D, L>,
        batch: &mut Batch<T, L, N>,
    ) {
        for p in 0..N {
            let (features, sample) = (&mut features[p], &samples[p]);
            project::<T, D, L>(features, basis);
            let weight = nearness_times::<T, D, L>(features, &sample.weight);
            batch.set(p, |t| regressor(features, t), &sample.colour, &weight);
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
        self.sums.add(batch);
    }

    /// Fits what has been taken in up to ring `radius`, and keeps each model whose risk is the least so far.
    #[inline(always)]
    fn choose(&mut self, radius: usize, params: &Params) {
        let (strengths, noise) = self.per_pixel(params);
        let factor = Factor::new(&self.sums.gram, &strengths);
        let change = self.sums.centred_moments(&self.centre);
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
            copy_lane(&mut self.previous.0, &coefficients, l);
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
                copy_lane(&mut self.best.coefficients, &coefficients, l);
                if self.keep_systems {
                    self.systems.keep(l, &self.sums.gram, &factor);
                }
            }
        }
    }

    /// Strengths of the prior as parts of an average pixel's weight, and the variance of a pixel of that weight: with weights of
    /// 1 / variance it is 1 whatever the brightness.
    #[inline(always)]
    fn per_pixel(&self, params: &Params) -> (Vector<T, L>, Lanes<L>) {
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
            noise[l] = self.noise[l] / pixels;
        }
        (strengths, noise)
    }

    /// Stein's unbiased risk, `RSS - sum w var + 2 trace(P sum w^2 var z z^T)` with `w var` at its mean.
    #[inline(always)]
    fn stein(
        &self,
        coefficients: &Coefficients<T, L>,
        factor: &Factor<T, L>,
        strengths: &Vector<T, L>,
        noise: &Lanes<L>,
    ) -> Lanes<L> {
        let residual = self.sums.residual_squares(coefficients);
        let degrees_of_freedom = factor.degrees_of_freedom(&self.sums.gram, strengths);
        let mut risk = [0.0; L];
        for l in 0..L {
            let sum = residual[0][l] + residual[1][l] + residual[2][l];
            let unbiased = sum - self.noise[l] + 2.0 * noise[l] * degrees_of_freedom[l];
            let floor = RISK_FLOOR * noise[l] * degrees_of_freedom[l];
            risk[l] = if unbiased > floor { unbiased } else { floor };
        }
        risk
    }
}

/// `beta(0) + P change`, beta(0) the centre and no gradients, and whether it is finite.
#[inline(always)]
fn minimiser<const T: usize, const L: usize>(
    factor: &Factor<T, L>,
    mut change: [WideVector<T, L>; CHANNELS],
    centre: &Rgb<L>,
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
