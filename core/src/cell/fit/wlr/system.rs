//! The normal equations of a fit, and what a quadratic one tells of second derivatives.

use crate::cell::model::regressor;
use crate::cell::window::{Sample, Windows};
use crate::float::{saturate, sqrt_f64};
use crate::lanes::{
    Aligned, Lanes, Vector, WideLanes, WideMatrix, WideVector, lanes_stay_innermost,
};
use crate::least_squares::factor::Factor;
use crate::least_squares::sums::widened;
use crate::tile::{CHANNELS, WINDOW_AREA};

/// The least second derivative that a bandwidth is taken from: where the radiance is a plane, a bandwidth has no end.
const FLATTEST: f32 = 1e-6;
/// Pixels that are taken in at a time.
const BATCH: usize = 19;
const _: () = assert!(WINDOW_AREA.is_multiple_of(BATCH));

/// The normal equations of one fit of `terms` terms (Eq. 4): `X^T W X`, and `X^T W y` per channel.
///
/// Loops are as long as the windows' largest rank asks for, and not unrolled for each that there may be.
#[repr(C, align(64))]
pub(super) struct System<const Q: usize, const L: usize> {
    terms: usize,
    gram: WideMatrix<Q, L>,
    moments: [WideVector<Q, L>; CHANNELS],
}

impl<const Q: usize, const L: usize> System<Q, L> {
    #[inline(always)]
    pub(super) fn new(terms: usize) -> Self {
        Self {
            terms: terms.min(Q),
            gram: [[[0.0; L]; Q]; Q],
            moments: [[[0.0; L]; Q]; CHANNELS],
        }
    }

    /// Adds a window's pixels: the first `linear` terms are 1 and its local features, the others those features' squares. Without these there is no need of
    /// moments.
    #[inline(always)]
    pub(super) fn take_in<const D: usize>(
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
    pub(super) fn factor(&self, weights: &Vector<WINDOW_AREA, L>, strength: f32) -> Factor<Q, L> {
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
    pub(super) fn curvatures<const D: usize>(
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
