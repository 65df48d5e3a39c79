//! In-place recursive least squares (LPR Eq. 3), one pixel at a time.
//!
//! In the paper's letters:
//!
//! ```text
//! G(k)    = P(k-1) z_k / (1 + z_k^T P(k-1) z_k)
//! P(k)    = P(k-1) - G(k) z_k^T P(k-1)
//! beta(k) = beta(k-1) + G(k) (y_k - beta(k-1)^T z_k)
//! ```
//!
//! With a weight w the 1 becomes lambda / w, and forgetting divides P by lambda (LPR Eq. 6). P is not carried as
//! written: rounding makes the difference of two large matrices asymmetric and indefinite. It is carried as
//! `P = U D U^T` with U unit upper triangular and D diagonal, updated by Bierman's recursion (Factorization Methods for
//! Discrete Sequential Estimation, 1977, chapter V), in which D is only ever multiplied by positive factors. The
//! stability study in the tests package has the error of this and of the rejected forms.

#![expect(
    clippy::needless_range_loop,
    reason = "the loops follow the indices of the formulas"
)]

use crate::least_squares::dot::{dot, finite_dot};
use crate::least_squares::prior::Prior;
use crate::tile::CHANNELS;

/// Entries of D stay in this range, which keeps P positive definite and finite however long a fit runs: above it
/// lies a direction that forgetting has emptied of information, below it one that is known beyond f32.
const DIAGONAL: (f32, f32) = (1e-30, 1e25);

/// What became of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Taken {
    /// It is in the fit.
    Yes,
    /// The fit is as it was before: a value was not finite, the weight negative, the forgetting factor outside
    /// (0, 1], or the update would have left the range of f32.
    No,
}

/// A linear model of `T` terms (the first is the intercept) fitted recursively to three channels that share P and
/// the gain.
///
/// After any sequence of updates it equals the minimiser of
/// `sum w (beta^T z - y)^2 + sum delta_j (beta_j - beta(0)_j)^2`, to rounding; no sequence of inputs, finite or not, makes a
/// result non-finite. Size: `4 (T^2 + 4 T)` bytes; an update needs about twice that on the stack.
///
/// ```
/// use linpred_core::{Prior, Rls};
///
/// let mut fit = Rls::<2>::new(&Prior::at_centre(&[1.0, 2.0, 3.0], 1e-3, 1e-3));
/// for x in [-1.0, -0.5, 0.0, 0.5, 1.0] {
///     let _ = fit.update(&[1.0, x], &[1.0 + x, 2.0 - x, 3.0], 1.0);
/// }
/// assert!((fit.predict(&[1.0, 0.25])[0] - 1.25).abs() < 1e-3);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rls<const T: usize> {
    /// U above its diagonal; what is on and below the diagonal is 0 and never read.
    upper: [[f32; T]; T],
    diagonal: [f32; T],
    beta: [[f32; T]; CHANNELS],
}

impl<const T: usize> Rls<T> {
    /// A model of no pixel yet: `beta(0)` and `P(0) = diag(1 / delta_j)`.
    ///
    /// A strength below 1e-25 (0, negative and NaN among them) counts as 1e-25, one above 1e30 as 1e30. A
    /// coefficient that is not finite counts as 0.
    pub fn new(prior: &Prior<T>) -> Self {
        const { assert!(T >= 1, "a model has an intercept") };
        let finite = |v: f32| if v.is_finite() { v } else { 0.0 };
        Self {
            upper: [[0.0; T]; T],
            diagonal: prior.strengths.map(|delta| bounded(1.0 / delta.max(0.0))),
            beta: prior.coefficients.map(|beta| beta.map(finite)),
        }
    }

    /// Takes in one pixel: regressors `z` (1 first), radiance `y`, and the `weight` of its squared residual.
    ///
    /// Weight 0 leaves the model as it is. The arithmetic is meant for regressors near [-1, 1] and refuses what would leave
    /// f32: `z^2 / delta` above 1e38. Cost: about `1.5 T^2 + 8 T` multiply-adds and `3 T` divisions.
    pub fn update(&mut self, z: &[f32; T], y: &[f32; CHANNELS], weight: f32) -> Taken {
        self.update_forgetting(z, y, weight, 1.0)
    }

    /// [`update`](Self::update) after multiplying the weight of every earlier pixel and of the prior by `lambda` in (0, 1]
    /// (LPR Eq. 6). With weight 0 the model ages and learns nothing.
    pub fn update_forgetting(
        &mut self,
        z: &[f32; T],
        y: &[f32; CHANNELS],
        weight: f32,
        lambda: f32,
    ) -> Taken {
        let usable = weight >= 0.0 && weight.is_finite() && lambda > 0.0 && lambda <= 1.0;
        if !usable {
            return Taken::No;
        }
        let noise = lambda / weight;
        let mut next = *self;
        if noise.is_finite() {
            let gain = next.update_covariance(z, noise);
            next.correct(&gain, z, y);
        }
        let growth = 1.0 / lambda;
        for d in &mut next.diagonal {
            *d = bounded(*d * growth);
        }
        if !next.is_finite() {
            return Taken::No;
        }
        *self = next;
        Taken::Yes
    }

    /// P(k-1) becomes P(k) (before forgetting divides it); returns G(k).
    ///
    /// With `f = U^T z` and `v = D f`, alpha runs from the noise to `noise + z^T P z`; each step divides a variance by a
    /// growth of alpha, so D stays positive without any subtraction.
    fn update_covariance(&mut self, z: &[f32; T], noise: f32) -> [f32; T] {
        let f = self.transposed_product(z);
        let mut gain = [0.0; T];
        let mut alpha = noise;
        for j in 0..T {
            let v = self.diagonal[j] * f[j];
            let before = alpha;
            alpha += v * f[j];
            self.diagonal[j] *= before / alpha;
            gain[j] = v;
            let slope = f[j] / before;
            for i in 0..j {
                let u = self.upper[i][j];
                self.upper[i][j] = u - gain[i] * slope;
                gain[i] += u * v;
            }
        }
        gain.map(|g| g / alpha)
    }

    /// beta(k) = beta(k-1) + G(k) (y_k - beta(k-1)^T z_k)
    fn correct(&mut self, gain: &[f32; T], z: &[f32; T], y: &[f32; CHANNELS]) {
        for (beta, &y) in self.beta.iter_mut().zip(y) {
            let innovation = y - dot(beta, z);
            for (beta, &gain) in beta.iter_mut().zip(gain) {
                *beta += gain * innovation;
            }
        }
    }

    /// U^T z
    fn transposed_product(&self, z: &[f32; T]) -> [f32; T] {
        let mut f = *z;
        for j in 0..T {
            for i in 0..j {
                f[j] += self.upper[i][j] * z[i];
            }
        }
        f
    }

    fn is_finite(&self) -> bool {
        // 0 times a value that is not finite is NaN and stays it; a lane per term keeps the additions independent.
        let mut probe = [0.0; T];
        for row in self.upper.iter().chain(&self.beta).chain([&self.diagonal]) {
            for j in 0..T {
                probe[j] += row[j] * 0.0;
            }
        }
        probe.iter().all(|&lane| lane == 0.0)
    }

    /// `beta^T z` of each channel, at the largest finite value where it would overflow; 0 if `z` is not finite.
    pub fn predict(&self, z: &[f32; T]) -> [f32; CHANNELS] {
        self.beta.map(|beta| finite_dot(&beta, z))
    }

    /// `z^T P z >= 0`: the variance of the prediction at `z` in units of the variance of a pixel of weight 1; the
    /// largest finite value where it would overflow or `z` is not finite.
    pub fn leverage(&self, z: &[f32; T]) -> f32 {
        let f = self.transposed_product(z);
        let mut sum = 0.0;
        for (f, d) in f.iter().zip(&self.diagonal) {
            sum += d * f * f;
        }
        if sum.is_finite() { sum } else { f32::MAX }
    }

    /// Coefficients per channel.
    pub fn coefficients(&self) -> &[[f32; T]; CHANNELS] {
        &self.beta
    }

    /// P: symmetric to the bit.
    pub fn covariance(&self) -> [[f32; T]; T] {
        let (upper, diagonal) = self.factors();
        let mut p = [[0.0; T]; T];
        for i in 0..T {
            for j in i..T {
                let mut sum = 0.0;
                for k in j..T {
                    sum += upper[i][k] * diagonal[k] * upper[j][k];
                }
                p[i][j] = sum;
                p[j][i] = sum;
            }
        }
        p
    }

    /// U (unit upper triangular) and D (positive) of `P = U D U^T`.
    pub fn factors(&self) -> ([[f32; T]; T], [f32; T]) {
        let mut upper = self.upper;
        for (j, row) in upper.iter_mut().enumerate() {
            if let Some(unit) = row.get_mut(j) {
                *unit = 1.0;
            }
        }
        (upper, self.diagonal)
    }
}

/// `d` inside the range of D; NaN stays NaN.
fn bounded(d: f32) -> f32 {
    d.clamp(DIAGONAL.0, DIAGONAL.1)
}
