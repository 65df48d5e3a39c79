//! The papers' formulas to the letter, kept as a baseline (LPR Eq. 3 to 7).
//!
//! Beside the raw validation error they differ from [`crate::fit`] in weighting every valid pixel alike.

use crate::feature_space::Terms;
use crate::fit::{Model, Sample, constant_model, padded};
use crate::params::Params;
use crate::prior::Prior;
use crate::rls::Rls;
use crate::tile::{RADIUS, WINDOW_AREA, window_pixels};

/// The coefficients of a layer's channels in the way of a model of half-width `radius`.
#[inline(always)]
pub(crate) fn literal_follow<const T: usize>(
    terms: &[Terms; WINDOW_AREA],
    samples: &[Sample; WINDOW_AREA],
    layer: &[[f32; 3]; WINDOW_AREA],
    radius: usize,
    params: &Params,
) -> [Terms; 3] {
    let [centre, ..] = layer;
    let prior = Prior::at_centre(centre, params.intercept_strength, params.gradient_strength);
    let mut rls = Rls::<T>::new(&prior);
    if radius > 0 {
        for ((terms, sample), layer) in terms
            .iter()
            .zip(samples)
            .zip(layer)
            .take(window_pixels(radius))
        {
            if let Some(terms) = terms.first_chunk::<T>() {
                if sample.weight > 0.0 {
                    // An update that is refused leaves the model as it was.
                    let _ = rls.update(terms, layer, 1.0);
                }
            }
        }
    }
    padded(rls.coefficients())
}

/// Fits the window's samples on the first `T` of its terms by recursive least squares.
#[inline(always)]
pub(crate) fn literal_fit<const T: usize>(
    terms: &[Terms; WINDOW_AREA],
    samples: &[Sample; WINDOW_AREA],
    params: &Params,
) -> Model {
    let [centre, ..] = samples;
    let prior = Prior::at_centre(
        &centre.colour,
        params.intercept_strength,
        params.gradient_strength,
    );
    let mut rls = Rls::<T>::new(&prior);
    let mut best = Model {
        terms: T,
        ..constant_model(centre)
    };
    take_in(&mut rls, terms, samples, 0, 1);
    let mut accumulated = 0.0;
    for radius in 1..=RADIUS {
        let (inner, outer) = (window_pixels(radius - 1), window_pixels(radius));
        if radius > 1 {
            accumulated += test(&rls, terms, samples, inner, outer);
        }
        take_in(&mut rls, terms, samples, inner, outer);
        if radius == 1 {
            accumulated = leave_one_out(&rls, terms, samples);
        }
        let risk = accumulated / outer as f32;
        if risk < best.risk {
            best = Model {
                radius,
                terms: T,
                coefficients: padded(rls.coefficients()),
                risk,
            };
        }
    }
    best
}

#[inline(always)]
fn pixels<'a, const T: usize>(
    terms: &'a [Terms; WINDOW_AREA],
    samples: &'a [Sample; WINDOW_AREA],
    from: usize,
    to: usize,
) -> impl Iterator<Item = (&'a [f32; T], &'a Sample)> {
    let pixels = terms.iter().zip(samples).take(to).skip(from);
    let valid = pixels.filter(|(_, sample)| sample.weight > 0.0);
    valid.filter_map(|(terms, sample)| Some((terms.first_chunk::<T>()?, sample)))
}

#[inline(always)]
fn take_in<const T: usize>(
    rls: &mut Rls<T>,
    terms: &[Terms; WINDOW_AREA],
    samples: &[Sample; WINDOW_AREA],
    from: usize,
    to: usize,
) {
    for (terms, sample) in pixels::<T>(terms, samples, from, to) {
        // An update that is refused leaves the model as it was.
        let _ = rls.update(terms, &sample.colour, 1.0);
    }
}

/// `sum (beta^T z - y)^2` over a ring, by the model fitted before it (LPR Eq. 5).
#[inline(always)]
fn test<const T: usize>(
    rls: &Rls<T>,
    terms: &[Terms; WINDOW_AREA],
    samples: &[Sample; WINDOW_AREA],
    from: usize,
    to: usize,
) -> f32 {
    let mut sum = 0.0;
    for (terms, sample) in pixels::<T>(terms, samples, from, to) {
        for (prediction, y) in rls.predict(terms).iter().zip(&sample.colour) {
            sum += (prediction - y) * (prediction - y);
        }
    }
    sum
}

/// Leave-one-out error of the nine pixels at r = 1, in closed form (LPR Eq. 7).
#[inline(always)]
fn leave_one_out<const T: usize>(
    rls: &Rls<T>,
    terms: &[Terms; WINDOW_AREA],
    samples: &[Sample; WINDOW_AREA],
) -> f32 {
    let mut sum = 0.0;
    for (terms, sample) in pixels::<T>(terms, samples, 0, window_pixels(1)) {
        // The floor is rounding: a pixel that determines the model alone has a left-out error without bound.
        let remaining = (1.0 - rls.leverage(terms)).max(f32::EPSILON);
        for (prediction, y) in rls.predict(terms).iter().zip(&sample.colour) {
            let error = (prediction - y) / remaining;
            sum += error * error;
        }
    }
    sum
}
