//! The error of a fit as a function of the shared bandwidth, and where it is least (WLR section 5.3).

use crate::cell::window::Windows;
use crate::float::{exp_f64, ln_f64, saturate};
use crate::lanes::{Lanes, Rgb};
use crate::tile::CHANNELS;

/// Shared bandwidths that are tried (section 7).
pub(super) const TRIED: [f32; 5] = [0.2, 0.4, 0.6, 0.8, 1.0];

/// Bias and variance at each of [`TRIED`], through which curves go: `bias = a0 + a1 h^2` of each channel (Eq. 12), `variance = c0 + c1 / (n h^k)` (Eq. 13), k the
/// rank. The number of samples n is one for all h, and part of c1 here.
pub(super) struct Curves<const L: usize> {
    rank: [usize; L],
    bias: [Rgb<L>; TRIED.len()],
    variance: [[f64; L]; TRIED.len()],
}

impl<const L: usize> Curves<L> {
    #[inline(always)]
    pub(super) fn of(rank: &[usize; L]) -> Self {
        Self {
            rank: *rank,
            bias: [[[0.0; L]; CHANNELS]; TRIED.len()],
            variance: [[0.0; L]; TRIED.len()],
        }
    }

    /// Sets a point: the bias is what the fit is above its pixel, which has none (Eq. 10).
    #[inline(always)]
    pub(super) fn set<const D: usize>(
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
    pub(super) fn least<const D: usize>(&self, windows: &Windows<D, L>) -> (Lanes<L>, Lanes<L>) {
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
