//! A model: a plane through the radiance of its window, over the local features.

#![expect(
    clippy::needless_range_loop,
    reason = "the loops follow the indices of the formulas"
)]

use crate::cell::feature_space::Basis;
use crate::cell::window::Sample;
use crate::lanes::{Lanes, Rgb, Vector, lanes_stay_innermost};
use crate::tile::CHANNELS;

/// Coefficients of each channel, in the window's unit of radiance; 0 beyond a lane's terms.
pub(crate) type Coefficients<const T: usize, const L: usize> = [Vector<T, L>; CHANNELS];

/// Fitted models and how far they predict, in the windows' units of radiance.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Models<const T: usize, const L: usize> {
    pub(crate) coefficients: Coefficients<T, L>,
    /// Estimated mean squared error over the prediction window, by which the radius was chosen.
    pub(crate) risk: Lanes<L>,
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

/// Regressor `t` of a pixel: 1, then its local features, then 0.
#[inline(always)]
pub(crate) fn regressor<const D: usize, const L: usize>(
    features: &Vector<D, L>,
    t: usize,
) -> &Lanes<L> {
    match t.checked_sub(1) {
        None => const { &[1.0; L] },
        Some(feature) => features.get(feature).unwrap_or(const { &[0.0; L] }),
    }
}

/// The centre's radiance, whatever the features.
#[inline(always)]
pub(crate) fn constant<const T: usize, const L: usize>(centre: &Rgb<L>) -> Coefficients<T, L> {
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
    features: &Vector<D, L>,
) -> Rgb<L> {
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

/// Variance that the features' noise prints into the predictions, `sum over channels and features of (V beta)^2 var`: what the renderer
/// says of the features' noise times what the model makes of it, as if that of one feature knew nothing of another's.
#[inline(always)]
pub(crate) fn printed_variance<const T: usize, const D: usize, const L: usize>(
    coefficients: &Coefficients<T, L>,
    basis: &Basis<D, L>,
) -> Lanes<L> {
    let mut printed = [0.0; L];
    for j in 0..D {
        for c in 0..CHANNELS {
            let mut slope = [0.0; L];
            for t in 1..T {
                if let Some(axis) = basis.axes[j].get(t - 1) {
                    for l in 0..L {
                        slope[l] += axis[l] * coefficients[c][t][l];
                    }
                }
                lanes_stay_innermost();
            }
            for l in 0..L {
                printed[l] += slope[l] * slope[l] * basis.noise[j][l];
            }
        }
        lanes_stay_innermost();
    }
    printed
}

/// `sum over channels (beta^T z - y)^2`.
#[inline(always)]
pub(crate) fn squared_distance<const T: usize, const D: usize, const L: usize>(
    coefficients: &Coefficients<T, L>,
    features: &Vector<D, L>,
    colour: &Rgb<L>,
) -> Lanes<L> {
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

/// Copies the coefficients of lane `l`.
#[inline(always)]
pub(crate) fn copy_lane<const T: usize, const L: usize>(
    to: &mut Coefficients<T, L>,
    from: &Coefficients<T, L>,
    l: usize,
) {
    for c in 0..CHANNELS {
        for t in 0..T {
            to[c][t][l] = from[c][t][l];
        }
    }
}

/// Writes one lane's coefficients.
#[inline(always)]
pub(crate) fn set_lane<const T: usize, const L: usize>(
    all: &mut [Vector<T, L>; CHANNELS],
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
