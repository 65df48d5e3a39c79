//! Weighted local regression to the letter, kept as a baseline (WLR, Moon et al. 2014): a fit of its own at every pixel, within bandwidths that are least
//! in error.
//!
//! ```text
//! bandwidth b_j of each local feature, from a quadratic fit          section 5.2, Eq. 7 and 9    Step::Curvatures
//! for each shared bandwidth h: a linear fit within h b_j             Eq. 6                       Step::Try
//!     its bias and its variance                                      Eq. 10 and 11               Curves::set
//! curves through them; the h of least squared bias and variance      section 5.3, Eq. 12 and 13  Curves::least
//! a last fit                                                                                     Step::Last
//! ```
//!
//! The local features are those of [`crate::cell::feature_space`] (section 4). What the paper leaves open: the three channels share their bandwidths, as they
//! share everything else here, so second derivatives are root mean squares over the channels, squared biases and variances sums over them. Bandwidths are in
//! the caller's unit of radiance, on which the picture therefore depends, alone of all formulas.

mod curves;
mod system;

use crate::cell::feature_space::{Basis, project_all};
use crate::cell::fit::Fit;
use crate::cell::fit::wlr::curves::{Curves, TRIED};
use crate::cell::fit::wlr::system::System;
use crate::cell::model::{Coefficients, Models, constant, regressor};
use crate::cell::window::{Colours, Windows};
use crate::float::saturate;
use crate::lanes::{Lanes, Rgb, Vector, WideVector, lanes_stay_innermost};
use crate::params::Params;
use crate::tile::{CHANNELS, WINDOW_AREA};

/// `1 / h_q^2`, h_q the bandwidth of every feature in the quadratic fit: it matters little (section 5.2, Table I).
const QUADRATIC_INVERSE: f32 = 1.0;
/// Part of the window's mean variance that no pixel's is thought to be below where weights are divided by it.
const LEAST_VARIANCE: f64 = 1e-3;

/// One of the fits to a window.
#[derive(Clone, Copy)]
enum Step {
    /// The quadratic one, for second derivatives.
    Curvatures,
    /// The linear one within a shared bandwidth, that at this place of [`TRIED`].
    Try(usize, f32),
    /// The linear one within the best bandwidth.
    Last,
}

/// All of them go through the same code: what is slow need not be large, too.
const STEPS: [Step; TRIED.len() + 2] = [
    Step::Curvatures,
    Step::Try(0, TRIED[0]),
    Step::Try(1, TRIED[1]),
    Step::Try(2, TRIED[2]),
    Step::Try(3, TRIED[3]),
    Step::Try(4, TRIED[4]),
    Step::Last,
];

/// The weights of the windows' pixels in the last fit, by which layers follow; `Q` terms of the quadratic fit, `2 T - 1`.
#[repr(C, align(64))]
pub(crate) struct Wlr<const Q: usize, const L: usize> {
    last: EquivalentWeights<L>,
}

impl<const Q: usize, const T: usize, const D: usize, const L: usize> Fit<T, D, L> for Wlr<Q, L> {
    #[inline(always)]
    fn fit(
        windows: &mut Windows<D, L>,
        basis: &Basis<D, L>,
        params: &Params,
        _: bool,
    ) -> (Models<T, L>, Self) {
        const { assert!(Q == 2 * T - 1, "a square for each local feature") };
        project_all::<T, D, L>(windows, basis);
        let windows = &*windows;
        let largest = basis.largest_rank().min(T - 1);
        let guards = against_outliers(windows);
        let mut curvatures = [[0.0; L]; D];
        let mut curves = Curves::of(&basis.rank);
        let mut errors = [0.0; L];
        let mut weights = [[0.0; L]; WINDOW_AREA];
        for step in STEPS {
            let (kernel, squares) = match step {
                Step::Curvatures => (Kernel([[QUADRATIC_INVERSE; L]; D]), largest),
                Step::Try(_, h) => (Kernel::new(&curvatures, &[h; L]), 0),
                Step::Last => {
                    let (best, error) = curves.least(windows);
                    errors = error;
                    (Kernel::new(&curvatures, &best), 0)
                }
            };
            kernel.weigh(windows, &guards, &mut weights);
            let mut system = System::<Q, L>::new(1 + largest + squares);
            system.take_in(windows, &weights, 1 + largest);
            let factor = system.factor(&weights, params.gradient_strength);
            if let Step::Curvatures = step {
                curvatures = system.curvatures(&factor, 1 + largest, &windows.radiance_scale);
                continue;
            }
            let mut row = [[0.0f64; L]; Q];
            row[0] = [1.0; L];
            factor.solve(&mut row);
            let equivalent = EquivalentWeights::new(windows, &row, 1 + largest, &weights);
            if let Step::Try(place, _) = step {
                let estimate = equivalent.apply(colours(windows));
                curves.set(place, windows, &estimate, &equivalent.variance(windows));
            } else {
                weights = equivalent.0;
            }
        }
        let fit = Self {
            last: EquivalentWeights(weights),
        };
        let [centre, ..] = &windows.samples;
        let mut models = Models::of_centres(centre);
        models.coefficients = constant(&fit.last.apply(colours(windows)));
        models.terms = basis.rank.map(|rank| rank + 1);
        models.risk = errors;
        (models, fit)
    }

    #[inline(always)]
    fn fit_layer(
        &self,
        _: &Windows<D, L>,
        _: &[usize; L],
        layer: &Colours<L>,
    ) -> Coefficients<T, L> {
        constant(&self.last.apply(layer.iter()))
    }
}

/// What each sample's weight is multiplied by: one over its variance of the mean, which suppresses outliers (section 8), relative to the window's mean;
/// 0 keeps a pixel out.
#[inline(always)]
fn against_outliers<const D: usize, const L: usize>(
    windows: &Windows<D, L>,
) -> Vector<WINDOW_AREA, L> {
    let (mut sum, mut pixels) = ([0.0f64; L], [0.0f64; L]);
    for sample in &windows.samples {
        for l in 0..L {
            let valid = sample.weight[l] > 0.0;
            sum[l] += if valid {
                f64::from(sample.variance[l])
            } else {
                0.0
            };
            pixels[l] += if valid { 1.0 } else { 0.0 };
        }
        lanes_stay_innermost();
    }
    let mut guards = [[0.0; L]; WINDOW_AREA];
    for (guard, sample) in guards.iter_mut().zip(&windows.samples) {
        for l in 0..L {
            // 0 / 0 in a window without pixels.
            let mean = sum[l] / pixels[l];
            let guarded = mean / (f64::from(sample.variance[l]) + LEAST_VARIANCE * mean);
            let known = mean > 0.0 && guarded.is_finite();
            let own = if known { guarded as f32 } else { 1.0 };
            guard[l] = if sample.weight[l] > 0.0 { own } else { 0.0 };
        }
        lanes_stay_innermost();
    }
    guards
}

/// The product of Epanechnikov's kernels over the local features, `1 - (z_j / (h b_j))^2` within their bandwidths and 0 beyond (Eq. 3 and 6), without the 3/4 of
/// each, by which nothing changes: `1 / (h b_j)^2`.
struct Kernel<const D: usize, const L: usize>(Vector<D, L>);

impl<const D: usize, const L: usize> Kernel<D, L> {
    #[inline(always)]
    fn new(curvatures: &Vector<D, L>, h: &Lanes<L>) -> Self {
        let mut inverse = *curvatures;
        for own in &mut inverse {
            for l in 0..L {
                let value = own[l] / (h[l] * h[l]);
                own[l] = if value < f32::MAX { value } else { f32::MAX };
            }
        }
        Self(inverse)
    }

    /// The kernel times `guards`. Where it reaches no pixel that counts, which only a centre that does not has around it, all weigh by their guards.
    #[inline(always)]
    fn weigh(
        &self,
        windows: &Windows<D, L>,
        guards: &Vector<WINDOW_AREA, L>,
        weights: &mut Vector<WINDOW_AREA, L>,
    ) {
        let mut reached = [false; L];
        for ((weight, features), guard) in weights.iter_mut().zip(&windows.features).zip(guards) {
            *weight = *guard;
            for (z, inverse) in features.iter().zip(&self.0) {
                for l in 0..L {
                    let kernel = 1.0 - z[l] * z[l] * inverse[l];
                    weight[l] *= if kernel > 0.0 { kernel } else { 0.0 };
                }
            }
            for l in 0..L {
                reached[l] |= weight[l] > 0.0;
            }
            lanes_stay_innermost();
        }
        if reached != [true; L] {
            for (weight, guard) in weights.iter_mut().zip(guards) {
                for l in 0..L {
                    weight[l] = if reached[l] { weight[l] } else { guard[l] };
                }
            }
        }
    }
}

/// The radiance of a window's pixels.
#[inline(always)]
fn colours<const D: usize, const L: usize>(
    windows: &Windows<D, L>,
) -> impl Iterator<Item = &Rgb<L>> {
    windows.samples.iter().map(|sample| &sample.colour)
}

/// Weights `l_i` of a window's pixels, by which a linear fit is the sum `sum l_i y_i` (section 5.3): it is linear in the radiance.
#[repr(C, align(64))]
struct EquivalentWeights<const L: usize>(Vector<WINDOW_AREA, L>);

impl<const L: usize> EquivalentWeights<L> {
    /// Those of the linear fit whose samples weigh `weights`: `row`, the row of the intercept of `(X^T W X)^-1`, times `X^T W` (Eq. 4 and 6).
    #[inline(always)]
    fn new<const Q: usize, const D: usize>(
        windows: &Windows<D, L>,
        row: &WideVector<Q, L>,
        terms: usize,
        weights: &Vector<WINDOW_AREA, L>,
    ) -> Self {
        let mut equivalent = *weights;
        for (weight, features) in equivalent.iter_mut().zip(&windows.features) {
            let mut at = row[0];
            for (t, row) in row.iter().enumerate().take(terms).skip(1) {
                let z = regressor(features, t);
                for l in 0..L {
                    at[l] += row[l] * f64::from(z[l]);
                }
                lanes_stay_innermost();
            }
            for l in 0..L {
                weight[l] = saturate(at[l] * f64::from(weight[l]));
            }
        }
        Self(equivalent)
    }

    /// The fit's value at the centre: `sum l_i y_i` of each channel.
    #[inline(always)]
    fn apply<'a>(&self, colours: impl Iterator<Item = &'a Rgb<L>>) -> Rgb<L> {
        let mut sums = [[0.0f64; L]; CHANNELS];
        for (weight, colour) in self.0.iter().zip(colours) {
            for (sum, y) in sums.iter_mut().zip(colour) {
                for l in 0..L {
                    let counts = weight[l] != 0.0;
                    let term = f64::from(weight[l]) * f64::from(y[l]);
                    sum[l] += if counts { term } else { 0.0 };
                }
            }
            lanes_stay_innermost();
        }
        let mut values = [[0.0; L]; CHANNELS];
        for (value, sum) in values.iter_mut().zip(&sums) {
            for l in 0..L {
                value[l] = saturate(sum[l]);
            }
        }
        values
    }

    /// Its variance, `sum l_i^2 var(y_i)` (Eq. 11), summed over the channels.
    #[inline(always)]
    fn variance<const D: usize>(&self, windows: &Windows<D, L>) -> [f64; L] {
        let mut sum = [0.0f64; L];
        for (weight, sample) in self.0.iter().zip(&windows.samples) {
            for l in 0..L {
                let weight = f64::from(weight[l]);
                let term = weight * weight * f64::from(sample.variance[l]);
                sum[l] += if weight != 0.0 { term } else { 0.0 };
            }
            lanes_stay_innermost();
        }
        sum
    }
}
