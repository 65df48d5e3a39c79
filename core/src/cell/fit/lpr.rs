//! The papers' formulas to the letter, kept as a baseline (LPR Eq. 3 to 7).
//!
//! Beside the raw validation error they differ from [`crate::cell::fit::robust`] in weighting every valid pixel alike.

use crate::cell::fit::robust::{Models, term};
use crate::cell::window::Windows;
use crate::least_squares::prior::{CHANNELS, Prior};
use crate::least_squares::rls::Rls;
use crate::params::Params;
use crate::tile::{RADIUS, WINDOW_AREA, window_pixels};

/// One window of several: its pixels as recursive least squares takes them.
pub(crate) struct LiteralWindow<'a, const D: usize, const L: usize> {
    windows: &'a Windows<D, L>,
    lane: usize,
}

impl<'a, const D: usize, const L: usize> LiteralWindow<'a, D, L> {
    pub(crate) fn new(windows: &'a Windows<D, L>, lane: usize) -> Self {
        Self { windows, lane }
    }

    /// Regressors and radiance of the valid pixels `from..to`.
    #[inline(always)]
    fn pixels<const T: usize>(
        &self,
        from: usize,
        to: usize,
    ) -> impl Iterator<Item = (usize, [f32; T], [f32; CHANNELS])> {
        let pixels = self.windows.features.iter().zip(&self.windows.samples);
        let pixels = pixels.enumerate().take(to).skip(from);
        let of_lane = |values: &[f32; L]| values.get(self.lane).copied().unwrap_or(0.0);
        pixels.filter_map(move |(i, (features, sample))| {
            let regressors = core::array::from_fn(|t| of_lane(term(features, t)));
            let colour = sample.colour.each_ref().map(of_lane);
            (of_lane(&sample.weight) > 0.0).then_some((i, regressors, colour))
        })
    }

    /// Fits the window on `T` terms by recursive least squares, into its lane of `models`.
    #[inline(always)]
    pub(crate) fn fit<const T: usize>(&self, params: &Params, models: &mut Models<T, L>) {
        let [centre, ..] = &self.windows.samples;
        let centre = centre.colour.each_ref();
        let colour = centre.map(|v| v.get(self.lane).copied().unwrap_or(0.0));
        let prior = Prior::at_centre(&colour, params.intercept_strength, params.gradient_strength);
        let mut rls = Rls::<T>::new(&prior);
        self.take_in(&mut rls, 0, 1);
        let mut accumulated = 0.0;
        for radius in 1..=RADIUS {
            let (inner, outer) = (window_pixels(radius - 1), window_pixels(radius));
            if radius > 1 {
                accumulated += self.test(&rls, inner, outer);
            }
            self.take_in(&mut rls, inner, outer);
            if radius == 1 {
                accumulated = self.leave_one_out(&rls);
            }
            if self.pixels::<T>(0, outer).next().is_none() {
                // Nothing has been tested yet: a sum over no pixels is no estimate.
                continue;
            }
            let risk = accumulated / outer as f32;
            if models
                .risk
                .get(self.lane)
                .is_some_and(|least| risk < *least)
            {
                self.choose(radius, risk, rls.coefficients(), models);
            }
        }
    }

    #[inline(always)]
    fn choose<const T: usize>(
        &self,
        radius: usize,
        risk: f32,
        coefficients: &[[f32; T]; CHANNELS],
        models: &mut Models<T, L>,
    ) {
        if let (Some(least), Some(own)) = (
            models.risk.get_mut(self.lane),
            models.radius.get_mut(self.lane),
        ) {
            *least = risk;
            *own = radius;
        }
        set_lane(&mut models.coefficients, self.lane, coefficients);
    }

    /// The coefficients of a layer's channels, in the way of a model of half-width `radius`.
    #[inline(always)]
    pub(crate) fn follow<const T: usize>(
        &self,
        layer: &[[[f32; L]; CHANNELS]; WINDOW_AREA],
        radius: usize,
        params: &Params,
    ) -> [[f32; T]; CHANNELS] {
        let colour_at = |i: usize| {
            let colour = layer.get(i).map(|colour| colour.each_ref());
            colour.map_or([0.0; CHANNELS], |colour| {
                colour.map(|v| v.get(self.lane).copied().unwrap_or(0.0))
            })
        };
        let prior = Prior::at_centre(
            &colour_at(0),
            params.intercept_strength,
            params.gradient_strength,
        );
        let mut rls = Rls::<T>::new(&prior);
        if radius > 0 {
            for (i, terms, _) in self.pixels::<T>(0, window_pixels(radius)) {
                // An update that is refused leaves the model as it was.
                let _ = rls.update(&terms, &colour_at(i), 1.0);
            }
        }
        *rls.coefficients()
    }

    #[inline(always)]
    fn take_in<const T: usize>(&self, rls: &mut Rls<T>, from: usize, to: usize) {
        for (_, terms, colour) in self.pixels(from, to) {
            // An update that is refused leaves the model as it was.
            let _ = rls.update(&terms, &colour, 1.0);
        }
    }

    /// `sum (beta^T z - y)^2` over a ring, by the model fitted before it (LPR Eq. 5).
    #[inline(always)]
    fn test<const T: usize>(&self, rls: &Rls<T>, from: usize, to: usize) -> f32 {
        let mut sum = 0.0;
        for (_, terms, colour) in self.pixels(from, to) {
            for (prediction, y) in rls.predict(&terms).iter().zip(&colour) {
                sum += (prediction - y) * (prediction - y);
            }
        }
        sum
    }

    /// Leave-one-out error of the nine pixels at r = 1, in closed form (LPR Eq. 7).
    #[inline(always)]
    fn leave_one_out<const T: usize>(&self, rls: &Rls<T>) -> f32 {
        let mut sum = 0.0;
        for (_, terms, colour) in self.pixels(0, window_pixels(1)) {
            // The floor is rounding: a pixel that determines the model alone has a left-out error without bound.
            let remaining = (1.0 - rls.leverage(&terms)).max(f32::EPSILON);
            for (prediction, y) in rls.predict(&terms).iter().zip(&colour) {
                let error = (prediction - y) / remaining;
                sum += error * error;
            }
        }
        sum
    }
}

/// Writes one lane's coefficients.
#[inline(always)]
pub(crate) fn set_lane<const T: usize, const L: usize>(
    all: &mut [[[f32; L]; T]; CHANNELS],
    lane: usize,
    coefficients: &[[f32; T]; CHANNELS],
) {
    for (all, coefficients) in all.iter_mut().zip(coefficients) {
        for (all, &value) in all.iter_mut().zip(coefficients) {
            if let Some(place) = all.get_mut(lane) {
                *place = value;
            }
        }
    }
}
