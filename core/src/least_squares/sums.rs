//! Normal equations of `L` models side by side, one in each lane.
//!
//! Every lane does what a single model would, in the same order, so the bits do not depend on how many there are; the
//! compiler makes vector instructions of the innermost loops. What they mean is said in [`crate::least_squares::normal_equations`], whose types
//! are these with one lane.

#![expect(
    clippy::needless_range_loop,
    reason = "the loops follow the indices of the formulas"
)]

use crate::float::saturate;
use crate::lanes::{
    Lanes, Rgb, Vector, WideLanes, WideMatrix, WideVector, add_products, lanes_stay_innermost,
};
use crate::tile::CHANNELS;

/// Sums over the pixels so far; the first regressor is the intercept.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Sums<const T: usize, const L: usize> {
    /// Upper triangle of `sum w z z^T`; what is below it is 0 and never read.
    pub(crate) gram: WideMatrix<T, L>,
    /// `sum w z y` per channel.
    pub(crate) moments: [WideVector<T, L>; CHANNELS],
    /// `sum w y^2` per channel.
    pub(crate) squares: WideVector<CHANNELS, L>,
}

impl<const T: usize, const L: usize> Sums<T, L> {
    /// The sums over no pixels.
    pub(crate) const fn new() -> Self {
        Self {
            gram: [[[0.0; L]; T]; T],
            moments: [[[0.0; L]; T]; CHANNELS],
            squares: [[0.0; L]; CHANNELS],
        }
    }

    /// Adds the pixels of a batch to each lane, in order; a weight of 0 adds nothing.
    #[inline(always)]
    pub(crate) fn add<const N: usize>(&mut self, batch: &Batch<T, L, N>) {
        for i in 0..T {
            add_products::<f64, T, N, L>(
                &mut self.gram[i],
                i..T,
                |p| &batch.weighted[p][i],
                |p| &batch.regressors[p],
            );
        }
        batch.add_to_moments(&mut self.moments);
        for p in 0..N {
            for c in 0..CHANNELS {
                for l in 0..L {
                    let y = batch.response[p][c][l];
                    self.squares[c][l] += batch.weight[p][l] * y * y;
                }
                lanes_stay_innermost();
            }
        }
    }

    /// `sum w z (y - beta^T z)` for a model `beta` that is but an intercept.
    #[inline(always)]
    pub(crate) fn centred_moments(&self, intercepts: &Rgb<L>) -> [WideVector<T, L>; CHANNELS] {
        centred_moments(&self.gram, &self.moments, intercepts)
    }

    /// `sum w (beta^T z - y)^2` per channel over the pixels so far, without touching them again; never negative.
    ///
    /// Absolute error: some 1e-15 of `sum w y^2` and `sum w (beta^T z)^2`, the price of a difference of large sums.
    #[inline(always)]
    pub(crate) fn residual_squares(&self, beta: &[Vector<T, L>; CHANNELS]) -> Rgb<L> {
        let mut residual = [[0.0; L]; CHANNELS];
        for c in 0..CHANNELS {
            let mut sum = self.squares[c];
            for i in 0..T {
                let mut fitted = [0.0; L];
                for j in 0..T {
                    let entry = &self.gram[i.min(j)][i.max(j)];
                    multiply_add(&mut fitted, entry, &widened(&beta[c][j]));
                }
                for l in 0..L {
                    sum[l] += f64::from(beta[c][i][l]) * (fitted[l] - 2.0 * self.moments[c][i][l]);
                }
                lanes_stay_innermost();
            }
            for l in 0..L {
                residual[c][l] = saturate(if sum[l] > 0.0 { sum[l] } else { 0.0 });
            }
        }
        residual
    }
}

/// `moments - gram beta` for a model `beta` that is but an intercept.
#[inline(always)]
pub(crate) fn centred_moments<const T: usize, const L: usize>(
    gram: &WideMatrix<T, L>,
    moments: &[WideVector<T, L>; CHANNELS],
    intercepts: &Rgb<L>,
) -> [WideVector<T, L>; CHANNELS] {
    let mut centred = *moments;
    for c in 0..CHANNELS {
        let intercept = widened(&intercepts[c]);
        for j in 0..T {
            for l in 0..L {
                centred[c][j][l] -= gram[0][j][l] * intercept[l];
            }
            lanes_stay_innermost();
        }
    }
    centred
}

/// `N` pixels of each lane in double precision: several at a time, so that sums stay in registers over them.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Batch<const T: usize, const L: usize, const N: usize> {
    /// z.
    regressors: [WideVector<T, L>; N],
    /// w z.
    weighted: [WideVector<T, L>; N],
    /// y.
    response: [WideVector<CHANNELS, L>; N],
    /// w.
    weight: WideVector<N, L>,
}

impl<const T: usize, const L: usize, const N: usize> Batch<T, L, N> {
    /// Pixels without weight.
    pub(crate) const ZERO: Self = Self {
        regressors: [[[0.0; L]; T]; N],
        weighted: [[[0.0; L]; T]; N],
        response: [[[0.0; L]; CHANNELS]; N],
        weight: [[0.0; L]; N],
    };

    /// Sets pixel `p`, whose regressor `t` is `regressor(t)`.
    #[inline(always)]
    pub(crate) fn set<'a>(
        &mut self,
        p: usize,
        regressor: impl Fn(usize) -> &'a Lanes<L>,
        response: &Rgb<L>,
        weight: &Lanes<L>,
    ) {
        let (Some(regressors), Some(weighted), Some(responses), Some(weights)) = (
            self.regressors.get_mut(p),
            self.weighted.get_mut(p),
            self.response.get_mut(p),
            self.weight.get_mut(p),
        ) else {
            debug_assert!(false, "there is no pixel {p} in a batch of {N}");
            return;
        };
        for l in 0..L {
            weights[l] = f64::from(weight[l]);
        }
        for t in 0..T {
            let z = regressor(t);
            for l in 0..L {
                regressors[t][l] = f64::from(z[l]);
                weighted[t][l] = regressors[t][l] * weights[l];
            }
            lanes_stay_innermost();
        }
        for c in 0..CHANNELS {
            for l in 0..L {
                responses[c][l] = f64::from(response[c][l]);
            }
            lanes_stay_innermost();
        }
    }

    /// Adds the pixels' `w z y`.
    #[inline(always)]
    pub(crate) fn add_to_moments(&self, moments: &mut [WideVector<T, L>; CHANNELS]) {
        for c in 0..CHANNELS {
            add_products::<f64, T, N, L>(
                &mut moments[c],
                0..T,
                |p| &self.response[p][c],
                |p| &self.weighted[p],
            );
        }
    }
}

#[inline(always)]
fn multiply_add<const L: usize>(sum: &mut WideLanes<L>, a: &WideLanes<L>, b: &WideLanes<L>) {
    for l in 0..L {
        sum[l] += a[l] * b[l];
    }
    lanes_stay_innermost();
}

/// Each lane in double precision.
#[inline(always)]
pub(crate) fn widened<const L: usize>(values: &Lanes<L>) -> WideLanes<L> {
    let mut wide = [0.0; L];
    for l in 0..L {
        wide[l] = f64::from(values[l]);
    }
    wide
}
