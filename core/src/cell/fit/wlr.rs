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

use crate::cell::feature_space::{Basis, project_all};
use crate::cell::fit::Fit;
use crate::cell::model::{Coefficients, Models, constant, regressor};
use crate::cell::window::{Colours, Sample, Windows};
use crate::float::{exp_f64, ln_f64, saturate, sqrt_f64};
use crate::lanes::{
    Aligned, Lanes, Rgb, Vector, WideLanes, WideMatrix, WideVector, lanes_stay_innermost,
};
use crate::least_squares::factor::Factor;
use crate::params::Params;
use crate::tile::{CHANNELS, WINDOW_AREA};

/// Shared bandwidths that are tried (section 7).
const TRIED: [f32; 5] = [0.2, 0.4, 0.6, 0.8, 1.0];
/// `1 / h_q^2`, h_q the bandwidth of every feature in the quadratic fit: it matters little (section 5.2, Table I).
const QUADRATIC_INVERSE: f32 = 1.0;
/// The least second derivative that a bandwidth is taken from: where the radiance is a plane, a bandwidth has no end.
const FLATTEST: f32 = 1e-6;
/// Part of the window's mean variance that no pixel's is thought to be below where weights are divided by it.
const LEAST_VARIANCE: f64 = 1e-3;
/// Pixels that are taken in at a time.
const BATCH: usize = 19;
const _: () = assert!(WINDOW_AREA.is_multiple_of(BATCH));

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
        let largest = basis.rank.iter().fold(0, |a, b| a.max(*b)).min(T - 1);
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

/// The normal equations of one fit of `terms` terms (Eq. 4): `X^T W X`, and `X^T W y` per channel.
///
/// Loops are as long as the windows' largest rank asks for, and not unrolled for each that there may be.
#[repr(C, align(64))]
struct System<const Q: usize, const L: usize> {
    terms: usize,
    gram: WideMatrix<Q, L>,
    moments: [WideVector<Q, L>; CHANNELS],
}

impl<const Q: usize, const L: usize> System<Q, L> {
    #[inline(always)]
    fn new(terms: usize) -> Self {
        Self {
            terms: terms.min(Q),
            gram: [[[0.0; L]; Q]; Q],
            moments: [[[0.0; L]; Q]; CHANNELS],
        }
    }

    /// Adds a window's pixels: the first `linear` terms are 1 and its local features, the others those features' squares. Without these there is no need of
    /// moments.
    #[inline(always)]
    fn take_in<const D: usize>(
        &mut self,
        windows: &Windows<D, L>,
        weights: &Vector<WINDOW_AREA, L>,
        linear: usize,
    ) {
        let features = windows.features.chunks_exact(BATCH);
        let samples = windows.samples.chunks_exact(BATCH);
        let batches = features.zip(samples).zip(weights.chunks_exact(BATCH));
        let mut rows = Aligned([[[0.0f64; L]; BATCH]; Q]);
        for ((features, samples), weights) in batches {
            for (t, row) in rows.0.iter_mut().enumerate().take(self.terms) {
                for (value, features) in row.iter_mut().zip(features) {
                    let is_square = t >= linear;
                    let z = regressor(features, if is_square { t + 1 - linear } else { t });
                    for l in 0..L {
                        let z = f64::from(z[l]);
                        value[l] = if is_square { z * z } else { z };
                    }
                    lanes_stay_innermost();
                }
            }
            self.add(&rows.0, weights);
            if self.terms > linear {
                self.add_moments(&rows.0, samples, weights);
            }
        }
    }

    #[inline(always)]
    fn add(&mut self, rows: &[WideVector<BATCH, L>; Q], weights: &[Lanes<L>]) {
        let sums = rows.iter().zip(&mut self.gram);
        for (i, (row, gram)) in sums.enumerate().take(self.terms) {
            let weighted = weighted(row, weights);
            let others = rows.iter().zip(gram.iter_mut());
            for (other, sum) in others.take(self.terms).skip(i) {
                add_all(sum, &weighted.0, other.iter().copied());
            }
        }
    }

    #[inline(always)]
    fn add_moments(
        &mut self,
        rows: &[WideVector<BATCH, L>; Q],
        samples: &[Sample<L>],
        weights: &[Lanes<L>],
    ) {
        for c in 0..CHANNELS {
            let sums = rows.iter().zip(&mut self.moments[c]);
            for (row, sum) in sums.take(self.terms) {
                let weighted = weighted(row, weights);
                let colours = samples.iter().map(|sample| widened(&sample.colour[c]));
                add_all(sum, &weighted.0, colours);
            }
        }
    }

    /// Its factor, with a small part of an average pixel's weight on every term but the intercept: a kernel may reach fewer pixels than there are terms.
    #[inline(always)]
    fn factor(&self, weights: &Vector<WINDOW_AREA, L>, strength: f32) -> Factor<Q, L> {
        let mut pixels = [0.0f64; L];
        for weight in weights {
            for l in 0..L {
                pixels[l] += if weight[l] > 0.0 { 1.0 } else { 0.0 };
            }
            lanes_stay_innermost();
        }
        let mut share = [0.0; L];
        for l in 0..L {
            // 0 / 0 in a window without pixels.
            let mean = self.gram[0][0][l] / pixels[l];
            share[l] = if pixels[l] > 0.0 {
                strength * saturate(mean)
            } else {
                0.0
            };
        }
        let mut strengths = [share; Q];
        strengths[0] = [0.0; L];
        Factor::new(&self.gram, &strengths)
    }

    /// `|d^2 f / d z_j^2| = 1 / b_j^2` of each local feature in the caller's unit of radiance, root mean square over the channels: twice the coefficients
    /// of the squares (Eq. 9), which are those from term `linear` on.
    #[inline(always)]
    fn curvatures<const D: usize>(
        &self,
        factor: &Factor<Q, L>,
        linear: usize,
        radiance_scale: &Lanes<L>,
    ) -> Vector<D, L> {
        let mut squares = [[0.0f64; L]; D];
        for moments in &self.moments {
            let mut coefficients = *moments;
            factor.solve(&mut coefficients);
            for (sum, own) in squares.iter_mut().zip(coefficients.iter().skip(linear)) {
                for l in 0..L {
                    sum[l] += 4.0 * own[l] * own[l] / CHANNELS as f64;
                }
                lanes_stay_innermost();
            }
        }
        let mut curvatures = [[0.0; L]; D];
        for (curvature, square) in curvatures.iter_mut().zip(&squares) {
            for l in 0..L {
                let own = saturate(sqrt_f64(square[l]) / f64::from(radiance_scale[l]));
                // Not a number, too, where no fit has a solution.
                curvature[l] = if own > FLATTEST { own } else { FLATTEST };
            }
        }
        curvatures
    }
}

/// A batch's pixels times their weights.
#[inline(always)]
fn weighted<const L: usize>(
    row: &WideVector<BATCH, L>,
    weights: &[Lanes<L>],
) -> Aligned<WideVector<BATCH, L>> {
    let mut weighted = Aligned(*row);
    for (value, weight) in weighted.0.iter_mut().zip(weights) {
        for l in 0..L {
            value[l] *= f64::from(weight[l]);
        }
        lanes_stay_innermost();
    }
    weighted
}

/// Adds the products of a batch's pixels to their sum.
#[inline(always)]
fn add_all<const L: usize>(
    sum: &mut WideLanes<L>,
    weighted: &WideVector<BATCH, L>,
    values: impl Iterator<Item = WideLanes<L>>,
) {
    let mut total = *sum;
    for (weighted, value) in weighted.iter().zip(values) {
        for l in 0..L {
            total[l] += weighted[l] * value[l];
        }
        lanes_stay_innermost();
    }
    *sum = total;
}

#[inline(always)]
fn widened<const L: usize>(values: &Lanes<L>) -> WideLanes<L> {
    let mut wide = [0.0; L];
    for l in 0..L {
        wide[l] = f64::from(values[l]);
    }
    wide
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

/// Bias and variance at each of [`TRIED`], through which curves go: `bias = a0 + a1 h^2` of each channel (Eq. 12), `variance = c0 + c1 / (n h^k)` (Eq. 13), k the
/// rank. The number of samples n is one for all h, and part of c1 here.
struct Curves<const L: usize> {
    rank: [usize; L],
    bias: [Rgb<L>; TRIED.len()],
    variance: [[f64; L]; TRIED.len()],
}

impl<const L: usize> Curves<L> {
    #[inline(always)]
    fn of(rank: &[usize; L]) -> Self {
        Self {
            rank: *rank,
            bias: [[[0.0; L]; CHANNELS]; TRIED.len()],
            variance: [[0.0; L]; TRIED.len()],
        }
    }

    /// Sets a point: the bias is what the fit is above its pixel, which has none (Eq. 10).
    #[inline(always)]
    fn set<const D: usize>(
        &mut self,
        place: usize,
        windows: &Windows<D, L>,
        estimate: &Rgb<L>,
        variance: &[f64; L],
    ) {
        let [centre, ..] = &windows.samples;
        let (Some(bias), Some(own)) = (self.bias.get_mut(place), self.variance.get_mut(place))
        else {
            debug_assert!(false, "{place} is none of the bandwidths");
            return;
        };
        *own = *variance;
        for c in 0..CHANNELS {
            for l in 0..L {
                bias[c][l] = estimate[c][l] - centre.colour[c][l];
            }
        }
    }

    /// The shared bandwidth of least squared bias and variance, `(k c1 / (4 a1^2 n))^(1 / (k + 4))` within those tried, and their sum there. A centre that does not
    /// count tells no bias: the widest, and the variance alone.
    #[inline(always)]
    fn least<const D: usize>(&self, windows: &Windows<D, L>) -> (Lanes<L>, Lanes<L>) {
        let [centre, ..] = &windows.samples;
        let (mut best, mut errors) = ([0.0; L], [0.0; L]);
        for l in 0..L {
            let known = centre.weight[l] > 0.0;
            let (h, error) = self.least_of_lane(l, known);
            best[l] = h as f32;
            errors[l] = saturate(error);
        }
        (best, errors)
    }

    #[inline(always)]
    fn least_of_lane(&self, l: usize, known: bool) -> (f64, f64) {
        let rank = self.rank[l];
        let squares = TRIED.map(|h| f64::from(h) * f64::from(h));
        let falls = TRIED.map(|h| 1.0 / power(f64::from(h), rank));
        let variances: [f64; TRIED.len()] = core::array::from_fn(|place| self.variance[place][l]);
        let fall = Line::through(&falls, &variances);
        let biases: [Line; CHANNELS] = core::array::from_fn(|c| {
            let biases = core::array::from_fn(|place| f64::from(self.bias[place][c][l]));
            if known {
                Line::through(&squares, &biases)
            } else {
                Line::ZERO
            }
        });
        let curvature: f64 = biases.iter().map(|line| line.slope * line.slope).sum();
        let h = optimum(rank, fall.slope, curvature);
        let bias: f64 = biases.iter().map(|line| square(line.at(h * h))).sum();
        let variance = fall.at(1.0 / power(h, rank));
        (h, bias + if variance > 0.0 { variance } else { 0.0 })
    }
}

/// `(k c1 / (4 a1^2))^(1 / (k + 4))`, where the derivative of `(a1 h^2)^2 + c1 / h^k` is 0, within [`TRIED`]: the widest where no bias grows, the narrowest
/// where no variance falls.
#[inline(always)]
fn optimum(rank: usize, fall: f64, curvature: f64) -> f64 {
    let [narrowest, .., widest] = TRIED.map(f64::from);
    let balance = rank as f64 * fall / (4.0 * curvature);
    if rank == 0 || curvature == 0.0 {
        widest
    } else if balance > 0.0 {
        exp_f64(ln_f64(balance) / (rank as f64 + 4.0)).clamp(narrowest, widest)
    } else {
        narrowest
    }
}

/// A straight line.
#[derive(Clone, Copy)]
struct Line {
    intercept: f64,
    slope: f64,
}

impl Line {
    const ZERO: Self = Self {
        intercept: 0.0,
        slope: 0.0,
    };

    /// By ordinary least squares; level where all are at one place.
    #[inline(always)]
    fn through(at: &[f64; TRIED.len()], values: &[f64; TRIED.len()]) -> Self {
        let mean = |values: &[f64; TRIED.len()]| values.iter().sum::<f64>() / TRIED.len() as f64;
        let (middle, level) = (mean(at), mean(values));
        let (mut products, mut squares) = (0.0, 0.0);
        for (at, value) in at.iter().zip(values) {
            products += (at - middle) * (value - level);
            squares += (at - middle) * (at - middle);
        }
        let slope = if squares > 0.0 {
            products / squares
        } else {
            0.0
        };
        Self {
            intercept: level - slope * middle,
            slope,
        }
    }

    #[inline(always)]
    fn at(self, place: f64) -> f64 {
        self.intercept + self.slope * place
    }
}

#[inline(always)]
fn square(value: f64) -> f64 {
    value * value
}

/// `base` to the power of `exponent`, which is small.
#[inline(always)]
fn power(base: f64, exponent: usize) -> f64 {
    (0..exponent).fold(1.0, |product, _| product * base)
}
