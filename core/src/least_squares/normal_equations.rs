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
//!
//! One model at a time, for whoever wants the fit alone; cells fit several with the same code (`sums.rs`, `factor.rs`).

#![expect(
    clippy::needless_range_loop,
    reason = "the loops follow the indices of the formulas"
)]

use crate::float::{ln_f64, saturate, sqrt_f64};
use crate::least_squares::dot::finite_dot;
use crate::least_squares::factor::Factor;
use crate::least_squares::prior::Prior;
use crate::least_squares::sums::{Batch, Sums};
use crate::tile::CHANNELS;

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
    sums: Sums<T, 1>,
}

impl<const T: usize> Gram<T> {
    /// The sum over no pixels.
    pub const fn new() -> Self {
        Self { sums: Sums::new() }
    }

    /// Adds one pixel's `w z z^T`.
    pub fn add(&mut self, z: &[f32; T], weight: f32) {
        self.sums.add(&one_pixel(z, &[0.0; CHANNELS], weight));
    }

    fn times(&self, x: &[f32; T]) -> [f64; T] {
        let mut product = [0.0; T];
        for i in 0..T {
            for j in 0..T {
                product[i] += self.sums.gram[i.min(j)][i.max(j)][0] * f64::from(x[j]);
            }
        }
        product
    }
}

impl<const T: usize> Default for Gram<T> {
    fn default() -> Self {
        Self::new()
    }
}

/// Sums over the pixels so far, from which a model of `T` terms (the first is the intercept) of three channels follows.
///
/// No finite f32 overflows them: every finite input gives a finite model. Size `8 (T^2 + 3 T + 3)` bytes, and what
/// aligns them to 64.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalEquations<const T: usize> {
    sums: Sums<T, 1>,
}

impl<const T: usize> NormalEquations<T> {
    /// The sums over no pixels.
    pub const fn new() -> Self {
        Self { sums: Sums::new() }
    }

    /// Adds one pixel: regressors `z` (1 first), radiance `y`, `weight >= 0` of its squared residual.
    ///
    /// A value that is not finite spoils the sums: [`solve`](Self::solve) then says so. Cost: `T (T + 1) / 2 + 3 T` multiply-adds.
    pub fn add(&mut self, z: &[f32; T], y: &[f32; CHANNELS], weight: f32) {
        self.sums.add(&one_pixel(z, y, weight));
    }

    /// `sum w z z^T`.
    pub fn gram(&self) -> Gram<T> {
        Gram { sums: self.sums }
    }

    /// The regularised model of the pixels so far.
    ///
    /// A term that the pixels and its prior strength together do not determine (its pivot is rounding: a strength of 0 and
    /// fewer pixels than terms, or collinear regressors) keeps its prior coefficient, and [`Solution::terms`] counts one
    /// less. A negative strength counts as 0. Cost: `T^3 / 3` multiply-adds, `T` square roots.
    ///
    /// # Errors
    /// [`NotFinite`] if a value that was added, or the prior, was not finite.
    pub fn solve(&self, prior: &Prior<T>) -> Result<Solution<T>, NotFinite> {
        const { assert!(T >= 1, "a model has an intercept") };
        let factor = Factor::new(&self.sums.gram, &prior.strengths.map(|v| [v]));
        if !factor.finite[0] {
            return Err(NotFinite);
        }
        let mut beta = prior.coefficients;
        for c in 0..CHANNELS {
            let pull = self.gram().times(&beta[c]);
            let mut change = self.sums.moments[c];
            for j in 0..T {
                change[j][0] -= pull[j];
            }
            factor.solve(&mut change);
            for j in 0..T {
                let value = f64::from(beta[c][j]) + change[j][0];
                if !value.is_finite() {
                    return Err(NotFinite);
                }
                beta[c][j] = saturate(value);
            }
        }
        Ok(Solution { beta, factor })
    }

    /// `sum w (beta^T z - y)^2` per channel over the pixels so far, without touching them again; never negative.
    ///
    /// Absolute error: some 1e-15 of `sum w y^2` and `sum w (beta^T z)^2`, the price of a difference of large sums.
    pub fn residual_squares(&self, beta: &[[f32; T]; CHANNELS]) -> [f32; CHANNELS] {
        let residual = self
            .sums
            .residual_squares(&beta.map(|channel| channel.map(|v| [v])));
        residual.map(|[sum]| sum)
    }
}

impl<const T: usize> Default for NormalEquations<T> {
    fn default() -> Self {
        Self::new()
    }
}

fn one_pixel<const T: usize>(z: &[f32; T], y: &[f32; CHANNELS], weight: f32) -> Batch<T, 1, 1> {
    let mut batch = Batch::ZERO;
    let regressors = z.map(|v| [v]);
    let regressor = |t: usize| regressors.get(t).unwrap_or(&[0.0]);
    batch.set(0, regressor, &y.map(|v| [v]), &[weight]);
    batch
}

/// A fitted model: coefficients, and the factor of P that its uncertainty needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution<const T: usize> {
    beta: [[f32; T]; CHANNELS],
    factor: Factor<T, 1>,
}

impl<const T: usize> Solution<T> {
    /// Coefficients per channel, the largest finite value where one would overflow.
    pub const fn coefficients(&self) -> &[[f32; T]; CHANNELS] {
        &self.beta
    }

    /// `beta^T z` of each channel, at the largest finite value where it would overflow; 0 if `z` is not finite.
    pub fn predict(&self, z: &[f32; T]) -> [f32; CHANNELS] {
        self.beta.map(|beta| finite_dot(&beta, z))
    }

    /// `z^T P z >= 0`: the weight of a pixel of weight 1 in its own prediction, and the variance of the
    /// prediction in units of that pixel's; the largest finite value where it would overflow or `z` is not finite.
    pub fn leverage(&self, z: &[f32; T]) -> f32 {
        let mut sum = 0.0;
        for (i, row) in self.whitening().iter().enumerate() {
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
    pub fn trace(&self, gram: &Gram<T>) -> f32 {
        let mut sum = 0.0;
        for row in &self.whitening() {
            let product = gram.times(row);
            for (w, v) in row.iter().zip(&product) {
                sum += f64::from(*w) * v;
            }
        }
        saturate(sum.max(0.0))
    }

    /// Terms that the pixels and the prior determine, at most `T`.
    pub fn terms(&self) -> usize {
        let inverse = self.factor.inverse.iter();
        inverse.filter(|[inverse]| *inverse > 0.0).count()
    }

    /// Natural logarithm of the determinant of the regularised Gramian, over the determined terms.
    pub fn log_determinant(&self) -> f64 {
        let mut sum = 0.0;
        for &[inverse] in &self.factor.inverse {
            if inverse > 0.0 {
                sum -= ln_f64(inverse);
            }
        }
        sum
    }

    /// `D^-1/2 L^-1`.
    fn whitening(&self) -> [[f32; T]; T] {
        let mut whitening = [[0.0; T]; T];
        for column in 0..T {
            let mut x = [0.0; T];
            x[column] = 1.0;
            for j in column + 1..T {
                for k in column..j {
                    x[j] -= self.factor.lower[j][k][0] * x[k];
                }
            }
            for row in column..T {
                let scale = sqrt_f64(self.factor.inverse[row][0]);
                whitening[row][column] = saturate(x[row] * scale);
            }
        }
        whitening
    }
}
