//! LPR's formulas to the letter, kept as a baseline (Eq. 3 to 7).
//!
//! Beside the raw validation error they differ from [`crate::cell::fit::robust`] in weighting every valid pixel alike.

use crate::cell::feature_space::{Basis, project_all};
use crate::cell::fit::Fit;
use crate::cell::model::{Coefficients, Models, regressor, set_lane};
use crate::cell::rings::window_pixels;
use crate::cell::window::{Colours, Windows};
use crate::lanes::Lanes;
use crate::least_squares::prior::Prior;
use crate::least_squares::rls::Rls;
use crate::params::Params;
use crate::tile::{CHANNELS, RADIUS};

/// Recursive least squares, one window after the other, with one prior for all of them.
pub(crate) struct Lpr {
    intercept_strength: f32,
    gradient_strength: f32,
}

impl<const T: usize, const D: usize, const L: usize> Fit<T, D, L> for Lpr {
    #[inline(always)]
    fn fit(
        windows: &mut Windows<D, L>,
        basis: &Basis<D, L>,
        params: &Params,
        _: bool,
    ) -> (Models<T, L>, Self) {
        let lpr = Self {
            intercept_strength: params.intercept_strength,
            gradient_strength: params.gradient_strength,
        };
        project_all::<T, D, L>(windows, basis);
        let [centre, ..] = &windows.samples;
        let mut models = Models::of_centres(centre);
        models.terms = basis.rank.map(|rank| rank + 1);
        for lane in 0..L {
            let window = Window { windows, lane };
            window.fit(
                lpr.model_of_centre(centre.colour.each_ref().map(|v| window.own(v))),
                &mut models,
            );
        }
        (models, lpr)
    }

    #[inline(always)]
    fn fit_layer(
        &self,
        windows: &Windows<D, L>,
        radius: &[usize; L],
        layer: &Colours<L>,
    ) -> Coefficients<T, L> {
        let mut coefficients = [[[0.0; L]; T]; CHANNELS];
        for (lane, &radius) in radius.iter().enumerate() {
            let window = Window { windows, lane };
            let centre = self.model_of_centre(window.colour(layer, 0));
            let fitted = window.fit_layer(centre, layer, radius);
            set_lane(&mut coefficients, lane, fitted.coefficients());
        }
        coefficients
    }
}

impl Lpr {
    /// The model before its first pixel (LPR Eq. 3): the centre's radiance and no gradients.
    #[inline(always)]
    fn model_of_centre<const T: usize>(&self, radiance: [f32; CHANNELS]) -> Rls<T> {
        Rls::new(&Prior::at_centre(
            &radiance,
            self.intercept_strength,
            self.gradient_strength,
        ))
    }
}

/// One window of several: its pixels as recursive least squares takes them.
struct Window<'a, const D: usize, const L: usize> {
    windows: &'a Windows<D, L>,
    lane: usize,
}

impl<const D: usize, const L: usize> Window<'_, D, L> {
    /// Its lane of several values.
    #[inline(always)]
    fn own(&self, values: &Lanes<L>) -> f32 {
        let value = values.get(self.lane);
        debug_assert!(value.is_some(), "there is no lane {}", self.lane);
        value.copied().unwrap_or(0.0)
    }

    /// A layer's radiance at pixel `i`.
    #[inline(always)]
    fn colour(&self, layer: &Colours<L>, i: usize) -> [f32; CHANNELS] {
        let colour = layer.get(i);
        debug_assert!(colour.is_some(), "{i} is not in the window");
        colour.map_or([0.0; CHANNELS], |colour| {
            colour.each_ref().map(|v| self.own(v))
        })
    }

    /// Position, regressors and radiance of the valid pixels `from..to`.
    #[inline(always)]
    fn pixels<const T: usize>(
        &self,
        from: usize,
        to: usize,
    ) -> impl Iterator<Item = (usize, [f32; T], [f32; CHANNELS])> {
        let pixels = self.windows.features.iter().zip(&self.windows.samples);
        let pixels = pixels.enumerate().take(to).skip(from);
        pixels.filter_map(|(i, (features, sample))| {
            let regressors = core::array::from_fn(|t| self.own(regressor(features, t)));
            let colour = sample.colour.each_ref().map(|v| self.own(v));
            (self.own(&sample.weight) > 0.0).then_some((i, regressors, colour))
        })
    }

    /// Fits the window on `T` terms ring by ring, into its lane of `models` where the risk is less than what is there.
    #[inline(always)]
    fn fit<const T: usize>(&self, mut rls: Rls<T>, models: &mut Models<T, L>) {
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
            self.choose(radius, accumulated / outer as f32, &rls, models);
        }
    }

    /// Keeps the model if its risk is the least so far.
    #[inline(always)]
    fn choose<const T: usize>(
        &self,
        radius: usize,
        risk: f32,
        rls: &Rls<T>,
        models: &mut Models<T, L>,
    ) {
        if let (Some(least), Some(own)) = (
            models.risk.get_mut(self.lane),
            models.radius.get_mut(self.lane),
        ) && risk < *least
        {
            *least = risk;
            *own = radius;
            set_lane(&mut models.coefficients, self.lane, rls.coefficients());
        }
    }

    /// Fits a layer in the way of a model of half-width `radius`.
    #[inline(always)]
    fn fit_layer<const T: usize>(
        &self,
        mut rls: Rls<T>,
        layer: &Colours<L>,
        radius: usize,
    ) -> Rls<T> {
        if radius > 0 {
            for (i, regressors, _) in self.pixels(0, window_pixels(radius)) {
                // An update that is refused leaves the model as it was.
                let _ = rls.update(&regressors, &self.colour(layer, i), 1.0);
            }
        }
        rls
    }

    #[inline(always)]
    fn take_in<const T: usize>(&self, rls: &mut Rls<T>, from: usize, to: usize) {
        for (_, regressors, colour) in self.pixels(from, to) {
            // As above.
            let _ = rls.update(&regressors, &colour, 1.0);
        }
    }

    /// `sum (beta^T z - y)^2` over a ring, by the model fitted before it (LPR Eq. 5).
    #[inline(always)]
    fn test<const T: usize>(&self, rls: &Rls<T>, from: usize, to: usize) -> f32 {
        let mut sum = 0.0;
        for (_, regressors, colour) in self.pixels(from, to) {
            for (prediction, y) in rls.predict(&regressors).iter().zip(&colour) {
                sum += (prediction - y) * (prediction - y);
            }
        }
        sum
    }

    /// Leave-one-out error of the nine pixels at r = 1, in closed form (LPR Eq. 7).
    #[inline(always)]
    fn leave_one_out<const T: usize>(&self, rls: &Rls<T>) -> f32 {
        let mut sum = 0.0;
        for (_, regressors, colour) in self.pixels(0, window_pixels(1)) {
            // The floor is rounding: a pixel that determines the model alone has a left-out error without bound.
            let remaining = (1.0 - rls.leverage(&regressors)).max(f32::EPSILON);
            for (prediction, y) in rls.predict(&regressors).iter().zip(&colour) {
                let error = (prediction - y) / remaining;
                sum += error * error;
            }
        }
        sum
    }
}
