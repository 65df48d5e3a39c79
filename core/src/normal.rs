//! The normal equations of the same model: sums over the pixels of rings, factorised once per ring.
//!
//! The minimiser of LPR Eq. 3's problem solves
//!
//! ```text
//! (sum w z z^T + diag(delta)) (beta - beta(0)) = sum w z (y - beta(0)^T z)
//! ```
//!
//! and only ring ends need it, so ten factorisations replace 361 updates. Sums and factor are f64: a condition number k of
//! the features is k^2 here, and f32 sums miss the accuracy this crate promises from k = 100 on, and are indefinite
//! from 10^4 (the stability study in the tests package has the figures). The product of two floats is exact in f64.

#![expect(
    clippy::needless_range_loop,
    reason = "the loops follow the indices of the formulas"
)]

use crate::dot::finite_dot;
use crate::float::{ln_f64, saturate, sqrt_f64};
use crate::prior::{CHANNELS, Prior};

/// A pivot below this part of its diagonal element is rounding, not information.
const PIVOT_NOISE: f64 = 1e-14;

/// A sum was not finite, because a regressor, radiance, weight or the prior was not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct NotFinite;

impl core::fmt::Display for NotFinite {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("a value that entered the normal equations was not finite")
    }
}

impl core::error::Error for NotFinite {}

/// `sum w z z^T` over pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gram<const T: usize> {
    /// The upper triangle; what is below it is 0 and never read.
    upper: [[f64; T]; T],
}

impl<const T: usize> Gram<T> {
    /// The sum over no pixels.
    pub const fn new() -> Self {
        Self {
            upper: [[0.0; T]; T],
        }
    }

    /// Adds one pixel's `w z z^T`.
    #[inline(always)]
    pub fn add(&mut self, z: &[f32; T], weight: f32) {
        let z = z.map(f64::from);
        self.add_scaled(&z, &z.map(|v| v * f64::from(weight)));
    }

    #[inline(always)]
    fn add_scaled(&mut self, z: &[f64; T], wz: &[f64; T]) {
        for i in 0..T {
            for j in i..T {
                self.upper[i][j] += wz[i] * z[j];
            }
        }
    }

    #[inline(always)]
    fn entry(&self, i: usize, j: usize) -> f64 {
        self.upper[i.min(j)][i.max(j)]
    }
}

impl<const T: usize> Default for Gram<T> {
    fn default() -> Self {
        Self::new()
    }
}

/// Sums over the pixels so far, from which a model of `T` terms (the first is the intercept) of three channels follows.
///
/// No finite f32 overflows them: every finite input gives a finite model. Size `8 (T^2 + 3 T + 3)` bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalEquations<const T: usize> {
    gram: Gram<T>,
    /// `sum w z y` per channel.
    moments: [[f64; T]; CHANNELS],
    /// `sum w y^2` per channel.
    squares: [f64; CHANNELS],
}

impl<const T: usize> NormalEquations<T> {
    /// The sums over no pixels.
    pub const fn new() -> Self {
        Self {
            gram: Gram::new(),
            moments: [[0.0; T]; CHANNELS],
            squares: [0.0; CHANNELS],
        }
    }

    /// Adds one pixel: regressors `z` (1 first), radiance `y`, `weight >= 0` of its squared residual.
    ///
    /// A value that is not finite spoils the sums: [`solve`](Self::solve) then says so. Cost: `T (T + 1) / 2 + 3 T` multiply-adds.
    #[inline(always)]
    pub fn add(&mut self, z: &[f32; T], y: &[f32; CHANNELS], weight: f32) {
        let z = z.map(f64::from);
        let wz = z.map(|v| v * f64::from(weight));
        self.gram.add_scaled(&z, &wz);
        add_moments(&mut self.moments, &wz, y);
        for (square, &y) in self.squares.iter_mut().zip(y) {
            *square += f64::from(weight) * f64::from(y) * f64::from(y);
        }
    }

    /// `sum w z z^T`.
    pub const fn gram(&self) -> &Gram<T> {
        &self.gram
    }

    /// The regularised model of the pixels so far.
    ///
    /// A term that the pixels and its prior strength together do not determine (its pivot is rounding: a strength of 0 and
    /// fewer pixels than terms, or collinear regressors) keeps its prior coefficient, and [`Solution::terms`] counts one
    /// less. A negative strength counts as 0. Cost: `T^3 / 3` multiply-adds, `T` square roots.
    ///
    /// # Errors
    /// [`NotFinite`] if a value that was added, or the prior, was not finite.
    #[inline(always)]
    pub fn solve(&self, prior: &Prior<T>) -> Result<Solution<T>, NotFinite> {
        const { assert!(T >= 1, "a model has an intercept") };
        let factor = Factor::new(&self.gram, &prior.strengths)?;
        let beta = factor.minimiser(&self.gram, &self.moments, &prior.coefficients)?;
        Ok(Solution { beta, factor })
    }

    /// `sum w (beta^T z - y)^2` per channel over the pixels so far, without touching them again; never negative.
    ///
    /// Absolute error: some 1e-15 of `sum w y^2` and `sum w (beta^T z)^2`, the price of a difference of large sums.
    #[inline(always)]
    pub fn residual_squares(&self, beta: &[[f32; T]; CHANNELS]) -> [f32; CHANNELS] {
        let mut residual = [0.0; CHANNELS];
        for c in 0..CHANNELS {
            let fitted = self.gram.times(&beta[c]);
            let mut sum = self.squares[c];
            for j in 0..T {
                sum += f64::from(beta[c][j]) * (fitted[j] - 2.0 * self.moments[c][j]);
            }
            residual[c] = saturate(sum.max(0.0));
        }
        residual
    }
}

impl<const T: usize> Default for NormalEquations<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const T: usize> Gram<T> {
    #[inline(always)]
    fn times(&self, x: &[f32; T]) -> [f64; T] {
        let mut product = [0.0; T];
        for i in 0..T {
            for j in 0..T {
                product[i] += self.entry(i, j) * f64::from(x[j]);
            }
        }
        product
    }
}

/// `sum w z y` over pixels, for three more channels on the same regressors and weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moments<const T: usize> {
    sums: [[f64; T]; CHANNELS],
}

impl<const T: usize> Moments<T> {
    /// The sums over no pixels.
    pub const fn new() -> Self {
        Self {
            sums: [[0.0; T]; CHANNELS],
        }
    }

    /// Adds one pixel's `w z y`. Cost: `3 T` multiply-adds.
    #[inline(always)]
    pub fn add(&mut self, z: &[f32; T], y: &[f32; CHANNELS], weight: f32) {
        let wz = z.map(|v| f64::from(v) * f64::from(weight));
        add_moments(&mut self.sums, &wz, y);
    }
}

impl<const T: usize> Default for Moments<T> {
    fn default() -> Self {
        Self::new()
    }
}

#[inline(always)]
fn add_moments<const T: usize>(
    sums: &mut [[f64; T]; CHANNELS],
    wz: &[f64; T],
    y: &[f32; CHANNELS],
) {
    for (sums, &y) in sums.iter_mut().zip(y) {
        for (sum, wz) in sums.iter_mut().zip(wz) {
            *sum += wz * f64::from(y);
        }
    }
}

/// A fitted model: coefficients, and the factor of P that its uncertainty and further channels need.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution<const T: usize> {
    beta: [[f32; T]; CHANNELS],
    factor: Factor<T>,
}

impl<const T: usize> Solution<T> {
    /// Coefficients per channel, the largest finite value where one would overflow.
    pub const fn coefficients(&self) -> &[[f32; T]; CHANNELS] {
        &self.beta
    }

    /// The coefficients of further channels on the same pixels, with the same strengths: linear in the moments and in
    /// `prior`, so those of parts of a radiance add up to those of the whole. `gram` is that of the fit.
    ///
    /// # Errors
    /// [`NotFinite`] if a moment or prior coefficient was not finite.
    #[inline(always)]
    pub fn follow(
        &self,
        gram: &Gram<T>,
        moments: &Moments<T>,
        prior: &[[f32; T]; CHANNELS],
    ) -> Result<[[f32; T]; CHANNELS], NotFinite> {
        self.factor.minimiser(gram, &moments.sums, prior)
    }

    /// `beta^T z` of each channel, at the largest finite value where it would overflow; 0 if `z` is not finite.
    pub fn predict(&self, z: &[f32; T]) -> [f32; CHANNELS] {
        self.beta.map(|beta| finite_dot(&beta, z))
    }

    /// `z^T P z >= 0`: the weight of a pixel of weight 1 in its own prediction, and the variance of the
    /// prediction in units of that pixel's; the largest finite value where it would overflow or `z` is not finite.
    pub fn leverage(&self, z: &[f32; T]) -> f32 {
        let mut sum = 0.0;
        for (i, row) in self.factor.whitening().iter().enumerate() {
            let mut white = 0.0;
            for (w, z) in row.iter().zip(z).take(i + 1) {
                white += w * z;
            }
            sum += white * white;
        }
        if sum.is_finite() { sum } else { f32::MAX }
    }

    /// `trace(P gram)`: the sum over that sum's pixels of `w z^T P z`. With the model's own [`NormalEquations::gram`], its degrees of
    /// freedom; with weights of `variance`, Stein's penalty. Cost: `T^3` multiply-adds.
    #[inline(always)]
    pub fn trace(&self, gram: &Gram<T>) -> f32 {
        let mut sum = 0.0;
        for row in &self.factor.whitening() {
            let product = gram.times(row);
            for (w, v) in row.iter().zip(&product) {
                sum += f64::from(*w) * v;
            }
        }
        saturate(sum.max(0.0))
    }

    /// Terms that the pixels and the prior determine, at most `T`.
    pub const fn terms(&self) -> usize {
        self.factor.terms
    }

    /// Natural logarithm of the determinant of the regularised Gramian, over the determined terms.
    pub fn log_determinant(&self) -> f64 {
        let mut sum = 0.0;
        for &inverse in &self.factor.inverse {
            if inverse > 0.0 {
                sum -= ln_f64(inverse);
            }
        }
        sum
    }
}

/// `L D L^T` of the regularised Gramian, L unit lower triangular.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Factor<const T: usize> {
    lower: [[f64; T]; T],
    /// 1 / D, 0 for a term without information.
    inverse: [f64; T],
    terms: usize,
}

impl<const T: usize> Factor<T> {
    #[inline(always)]
    fn new(gram: &Gram<T>, strengths: &[f32; T]) -> Result<Self, NotFinite> {
        let mut factor = Self {
            lower: [[0.0; T]; T],
            inverse: [0.0; T],
            terms: 0,
        };
        // Until a column is divided by its pivot it holds L D.
        for j in 0..T {
            let diagonal = gram.upper[j][j] + f64::from(strengths[j].max(0.0));
            let mut pivot = diagonal;
            for k in 0..j {
                pivot -= factor.lower[j][k] * factor.lower[j][k] * factor.inverse[k];
            }
            if !pivot.is_finite() || strengths[j].is_nan() {
                return Err(NotFinite);
            }
            if pivot > PIVOT_NOISE * diagonal {
                factor.eliminate(gram, j, pivot);
            }
        }
        for j in 0..T {
            for k in 0..j {
                factor.lower[j][k] *= factor.inverse[k];
            }
        }
        Ok(factor)
    }

    #[inline(always)]
    fn eliminate(&mut self, gram: &Gram<T>, j: usize, pivot: f64) {
        self.inverse[j] = 1.0 / pivot;
        self.terms += 1;
        for i in j + 1..T {
            let mut sum = gram.upper[j][i];
            for k in 0..j {
                sum -= self.lower[i][k] * self.lower[j][k] * self.inverse[k];
            }
            self.lower[i][j] = sum;
        }
    }

    /// `beta(0) + P (moments - gram beta(0))` per channel.
    #[inline(always)]
    fn minimiser(
        &self,
        gram: &Gram<T>,
        moments: &[[f64; T]; CHANNELS],
        prior: &[[f32; T]; CHANNELS],
    ) -> Result<[[f32; T]; CHANNELS], NotFinite> {
        let mut beta = *prior;
        for (beta, moments) in beta.iter_mut().zip(moments) {
            let pull = gram.times(beta);
            let mut change = [0.0; T];
            for j in 0..T {
                change[j] = moments[j] - pull[j];
            }
            self.solve(&mut change);
            for j in 0..T {
                let value = f64::from(beta[j]) + change[j];
                if !value.is_finite() {
                    return Err(NotFinite);
                }
                beta[j] = saturate(value);
            }
        }
        Ok(beta)
    }

    #[inline(always)]
    fn solve(&self, x: &mut [f64; T]) {
        for j in 0..T {
            for k in 0..j {
                x[j] -= self.lower[j][k] * x[k];
            }
        }
        for j in (0..T).rev() {
            x[j] *= self.inverse[j];
            for k in j + 1..T {
                x[j] -= self.lower[k][j] * x[k];
            }
        }
    }

    /// `D^-1/2 L^-1`.
    #[inline(always)]
    fn whitening(&self) -> [[f32; T]; T] {
        let mut whitening = [[0.0; T]; T];
        for column in 0..T {
            let mut x = [0.0; T];
            x[column] = 1.0;
            for j in column + 1..T {
                for k in column..j {
                    x[j] -= self.lower[j][k] * x[k];
                }
            }
            for row in column..T {
                whitening[row][column] = saturate(x[row] * sqrt_f64(self.inverse[row]));
            }
        }
        whitening
    }
}
