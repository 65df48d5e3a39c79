//! The factor of the normal equations of `L` models side by side, one in each lane.

#![expect(
    clippy::needless_range_loop,
    reason = "the loops follow the indices of the formulas"
)]

use crate::float::saturate;
use crate::lanes::{Aligned, Lanes, Vector, WideMatrix, WideVector, lanes_stay_innermost};

/// A pivot below this part of its diagonal element is rounding, not information.
const PIVOT_NOISE: f64 = 1e-14;

/// `L D L^T` of each lane's `sum w z z^T + diag(strengths)`, L unit lower triangular.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Factor<const T: usize, const L: usize> {
    pub(crate) lower: WideMatrix<T, L>,
    /// 1 / D, 0 for a term without information.
    pub(crate) inverse: WideVector<T, L>,
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
    pub(crate) fn new(gram: &WideMatrix<T, L>, strengths: &Vector<T, L>) -> Self {
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
    pub(crate) fn solve(&self, x: &mut WideVector<T, L>) {
        for j in 0..T {
            let mut sum = x[j];
            for k in 0..j {
                for l in 0..L {
                    sum[l] -= self.lower[j][k][l] * x[k][l];
                }
                lanes_stay_innermost();
            }
            x[j] = sum;
        }
        for j in (0..T).rev() {
            let mut sum = x[j];
            for l in 0..L {
                sum[l] *= self.inverse[j][l];
            }
            for k in j + 1..T {
                for l in 0..L {
                    sum[l] -= self.lower[k][j][l] * x[k][l];
                }
                lanes_stay_innermost();
            }
            x[j] = sum;
        }
    }

    /// Degrees of freedom, `trace(P sum w z z^T) = sum over terms of (1 - strength P_jj)`; terms without information
    /// have none, and those that are 0 at every pixel none at all, however many of them there are.
    #[inline(always)]
    pub(crate) fn degrees_of_freedom(
        &self,
        gram: &WideMatrix<T, L>,
        strengths: &Vector<T, L>,
    ) -> Lanes<L> {
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
        let mut degrees_of_freedom = [0.0; L];
        for l in 0..L {
            degrees_of_freedom[l] = saturate(sum[l]);
        }
        degrees_of_freedom
    }
}
