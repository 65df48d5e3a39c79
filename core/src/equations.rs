//! Normal equations of `L` models side by side, one in each lane.
//!
//! Every lane does what a single model would, in the same order, so the bits do not depend on how many there are; the
//! compiler makes vector instructions of the innermost loops. What they mean is said in [`crate::normal`], whose types
//! are these with one lane.

#![expect(
    clippy::needless_range_loop,
    reason = "the loops follow the indices of the formulas"
)]

use crate::float::saturate;
use crate::lanes::lanes_stay_innermost;
use crate::prior::CHANNELS;

/// A pivot below this part of its diagonal element is rounding, not information.
const PIVOT_NOISE: f64 = 1e-14;

/// Memory that vector loads like.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Aligned<A>(pub(crate) A);

/// Sums over the pixels so far; the first regressor is the intercept.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Equations<const T: usize, const L: usize> {
    /// Upper triangle of `sum w z z^T`; what is below it is 0 and never read.
    pub(crate) gram: [[[f64; L]; T]; T],
    /// `sum w z y` per channel.
    pub(crate) moments: [[[f64; L]; T]; CHANNELS],
    /// `sum w y^2` per channel.
    pub(crate) squares: [[f64; L]; CHANNELS],
}

impl<const T: usize, const L: usize> Equations<T, L> {
    /// The sums over no pixels.
    pub(crate) const fn new() -> Self {
        Self {
            gram: [[[0.0; L]; T]; T],
            moments: [[[0.0; L]; T]; CHANNELS],
            squares: [[0.0; L]; CHANNELS],
        }
    }

    /// Adds `N` pixels to each lane, in order; a weight of 0 adds nothing.
    ///
    /// Several at a time, so that a row of sums stays in registers over them.
    #[inline(always)]
    pub(crate) fn add<const N: usize>(
        &mut self,
        z: &[[[f32; L]; T]; N],
        y: &[[[f32; L]; CHANNELS]; N],
        weight: &[[f32; L]; N],
    ) {
        let (z, wz) = weighted(z, weight);
        for i in 0..T {
            let mut row = self.gram[i];
            for p in 0..N {
                for j in i..T {
                    multiply_add(&mut row[j], &wz.0[p][i], &z.0[p][j]);
                }
            }
            self.gram[i] = row;
            lanes_stay_innermost();
        }
        for c in 0..CHANNELS {
            add_moments(&mut self.moments[c], &wz.0, c, y);
            for p in 0..N {
                let y = widened(&y[p][c]);
                for l in 0..L {
                    self.squares[c][l] += f64::from(weight[p][l]) * y[l] * y[l];
                }
                lanes_stay_innermost();
            }
        }
    }

    /// `sum w z (y - beta^T z)` for a model `beta` that is but an intercept.
    #[inline(always)]
    pub(crate) fn moments_about(
        &self,
        intercepts: &[[f32; L]; CHANNELS],
    ) -> [[[f64; L]; T]; CHANNELS] {
        about(&self.gram, &self.moments, intercepts)
    }

    /// `sum w (beta^T z - y)^2` per channel over the pixels so far, without touching them again; never negative.
    ///
    /// Absolute error: some 1e-15 of `sum w y^2` and `sum w (beta^T z)^2`, the price of a difference of large sums.
    #[inline(always)]
    pub(crate) fn residual_squares(
        &self,
        beta: &[[[f32; L]; T]; CHANNELS],
    ) -> [[f32; L]; CHANNELS] {
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
pub(crate) fn about<const T: usize, const L: usize>(
    gram: &[[[f64; L]; T]; T],
    moments: &[[[f64; L]; T]; CHANNELS],
    intercepts: &[[f32; L]; CHANNELS],
) -> [[[f64; L]; T]; CHANNELS] {
    let mut about = *moments;
    for c in 0..CHANNELS {
        let intercept = widened(&intercepts[c]);
        for j in 0..T {
            for l in 0..L {
                about[c][j][l] -= gram[0][j][l] * intercept[l];
            }
            lanes_stay_innermost();
        }
    }
    about
}

/// Adds `N` pixels' `w z y` to each lane's moments.
#[inline(always)]
pub(crate) fn add_to_moments<const T: usize, const L: usize, const N: usize>(
    moments: &mut [[[f64; L]; T]; CHANNELS],
    z: &[[[f32; L]; T]; N],
    y: &[[[f32; L]; CHANNELS]; N],
    weight: &[[f32; L]; N],
) {
    let (_, wz) = weighted(z, weight);
    for c in 0..CHANNELS {
        add_moments(&mut moments[c], &wz.0, c, y);
    }
}

#[inline(always)]
fn add_moments<const T: usize, const L: usize, const N: usize>(
    moments: &mut [[f64; L]; T],
    wz: &[[[f64; L]; T]; N],
    channel: usize,
    y: &[[[f32; L]; CHANNELS]; N],
) {
    let mut row = *moments;
    for p in 0..N {
        let y = widened(&y[p][channel]);
        for j in 0..T {
            multiply_add(&mut row[j], &wz[p][j], &y);
        }
    }
    *moments = row;
    lanes_stay_innermost();
}

/// Regressors of `N` pixels in double precision.
type Wide<const T: usize, const L: usize, const N: usize> = Aligned<[[[f64; L]; T]; N]>;

/// `z` and `w z`.
#[inline(always)]
fn weighted<const T: usize, const L: usize, const N: usize>(
    z: &[[[f32; L]; T]; N],
    weight: &[[f32; L]; N],
) -> (Wide<T, L, N>, Wide<T, L, N>) {
    let mut wide = Aligned([[[0.0; L]; T]; N]);
    let mut scaled = Aligned([[[0.0; L]; T]; N]);
    for p in 0..N {
        let weight = widened(&weight[p]);
        for j in 0..T {
            for l in 0..L {
                wide.0[p][j][l] = f64::from(z[p][j][l]);
                scaled.0[p][j][l] = wide.0[p][j][l] * weight[l];
            }
            lanes_stay_innermost();
        }
    }
    (wide, scaled)
}

#[inline(always)]
fn multiply_add<const L: usize>(sum: &mut [f64; L], a: &[f64; L], b: &[f64; L]) {
    for l in 0..L {
        sum[l] += a[l] * b[l];
    }
    lanes_stay_innermost();
}

#[inline(always)]
fn widened<const L: usize>(values: &[f32; L]) -> [f64; L] {
    let mut wide = [0.0; L];
    for l in 0..L {
        wide[l] = f64::from(values[l]);
    }
    wide
}

/// `L D L^T` of each lane's `sum w z z^T + diag(strengths)`, L unit lower triangular.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Factor<const T: usize, const L: usize> {
    pub(crate) lower: [[[f64; L]; T]; T],
    /// 1 / D, 0 for a term without information.
    pub(crate) inverse: [[f64; L]; T],
    /// Whether every sum and strength was a number.
    pub(crate) finite: [bool; L],
}

impl<const T: usize, const L: usize> Factor<T, L> {
    /// The factor of nothing.
    pub(crate) const ZERO: Self = Self {
        lower: [[[0.0; L]; T]; T],
        inverse: [[0.0; L]; T],
        finite: [true; L],
    };

    /// A term whose pivot is rounding is left out; a negative strength counts as 0.
    #[inline(always)]
    pub(crate) fn new(gram: &[[[f64; L]; T]; T], strengths: &[[f32; L]; T]) -> Self {
        let mut factor = Self::ZERO;
        // Until a column is divided by its pivot it holds L D.
        for j in 0..T {
            let mut scaled = Aligned([[0.0; L]; T]);
            let mut pivot = [0.0; L];
            for l in 0..L {
                let strength = strengths[j][l];
                factor.finite[l] &= !strength.is_nan();
                pivot[l] = gram[j][j][l] + f64::from(if strength > 0.0 { strength } else { 0.0 });
            }
            let diagonal = pivot;
            for k in 0..j {
                for l in 0..L {
                    scaled.0[k][l] = factor.lower[j][k][l] * factor.inverse[k][l];
                    pivot[l] -= factor.lower[j][k][l] * scaled.0[k][l];
                }
                lanes_stay_innermost();
            }
            for l in 0..L {
                factor.finite[l] &= pivot[l].is_finite();
                let informed = pivot[l] > PIVOT_NOISE * diagonal[l];
                factor.inverse[j][l] = if informed { 1.0 / pivot[l] } else { 0.0 };
            }
            for i in j + 1..T {
                let mut sum = gram[j][i];
                for k in 0..j {
                    for l in 0..L {
                        sum[l] -= factor.lower[i][k][l] * scaled.0[k][l];
                    }
                    lanes_stay_innermost();
                }
                for l in 0..L {
                    let informed = factor.inverse[j][l] > 0.0;
                    factor.lower[i][j][l] = if informed { sum[l] } else { 0.0 };
                }
                lanes_stay_innermost();
            }
        }
        for j in 0..T {
            for k in 0..j {
                for l in 0..L {
                    factor.lower[j][k][l] *= factor.inverse[k][l];
                }
                lanes_stay_innermost();
            }
        }
        factor
    }

    /// `P x`, P the inverse of what was factorised.
    #[inline(always)]
    pub(crate) fn solve(&self, x: &mut [[f64; L]; T]) {
        for j in 0..T {
            for k in 0..j {
                for l in 0..L {
                    x[j][l] -= self.lower[j][k][l] * x[k][l];
                }
                lanes_stay_innermost();
            }
        }
        for j in (0..T).rev() {
            for l in 0..L {
                x[j][l] *= self.inverse[j][l];
            }
            for k in j + 1..T {
                for l in 0..L {
                    x[j][l] -= self.lower[k][j][l] * x[k][l];
                }
                lanes_stay_innermost();
            }
        }
    }

    /// Degrees of freedom, `trace(P sum w z z^T) = sum over terms of (1 - strength P_jj)`; terms without information
    /// have none, and those that are 0 at every pixel none at all, however many of them there are.
    #[inline(always)]
    pub(crate) fn freedom(&self, gram: &[[[f64; L]; T]; T], strengths: &[[f32; L]; T]) -> [f32; L] {
        let mut sum = [0.0; L];
        for column in 0..T {
            let mut x = Aligned([[0.0; L]; T]);
            let mut own = self.inverse[column];
            for j in column + 1..T {
                for l in 0..L {
                    x.0[j][l] = -self.lower[j][column][l];
                }
                for k in column + 1..j {
                    for l in 0..L {
                        x.0[j][l] -= self.lower[j][k][l] * x.0[k][l];
                    }
                    lanes_stay_innermost();
                }
                for l in 0..L {
                    own[l] += x.0[j][l] * x.0[j][l] * self.inverse[j][l];
                }
                lanes_stay_innermost();
            }
            for l in 0..L {
                let left = 1.0 - f64::from(strengths[column][l]) * own[l];
                let informed = self.inverse[column][l] > 0.0 && gram[column][column][l] > 0.0;
                sum[l] += if informed && left > 0.0 { left } else { 0.0 };
            }
        }
        let mut freedom = [0.0; L];
        for l in 0..L {
            freedom[l] = saturate(sum[l]);
        }
        freedom
    }
}
