//! The candidate arithmetics of one recursive fit, generic over the float type.
//!
//! All minimise the same `sum w (beta^T z - y)^2 + sum delta_j (beta_j - beta0_j)^2` (LPR Eq. 3); they differ in
//! what they carry from pixel to pixel, and so in what rounding does to it. What the core ships is measured through its
//! own public interface.

#![expect(
    clippy::needless_range_loop,
    reason = "the loops follow the indices of the formulas"
)]

use linpred_core::{NormalEquations, Prior, Rls, Taken};
use num_traits::Float;

/// Responses fitted with one shared gain.
pub(crate) const CHANNELS: usize = 3;

/// One arithmetic of the recursive fit.
pub(crate) trait Form<R: Float, const T: usize> {
    /// A fit of no pixel yet: prior coefficients per channel, prior strength per term.
    fn new(initial: &[[R; T]; CHANNELS], delta: &[R; T]) -> Self;
    /// Takes one pixel in, after forgetting the earlier ones by `lambda`.
    fn update(&mut self, z: &[R; T], y: &[R; CHANNELS], weight: R, lambda: R);
    /// Coefficients after the pixels so far; not finite where the form broke down.
    fn coefficients(&self) -> [[R; T]; CHANNELS];
    /// P as the form holds it, products of factors formed in f64, for the check of symmetry and definiteness; `None` where
    /// the form holds no P.
    fn covariance(&self) -> Option<[[f64; T]; T]> {
        None
    }
}

fn dot<R: Float, const T: usize>(a: &[R; T], b: &[R; T]) -> R {
    let mut sum = R::zero();
    for j in 0..T {
        sum = sum + a[j] * b[j];
    }
    sum
}

fn correct<R: Float, const T: usize>(
    beta: &mut [[R; T]; CHANNELS],
    gain: &[R; T],
    z: &[R; T],
    y: &[R; CHANNELS],
) {
    for (beta, &y) in beta.iter_mut().zip(y) {
        let innovation = y - dot(beta, z);
        for (beta, &gain) in beta.iter_mut().zip(gain) {
            *beta = *beta + gain * innovation;
        }
    }
}

fn inverse_diagonal<R: Float, const T: usize>(delta: &[R; T]) -> [[R; T]; T] {
    let mut p = [[R::zero(); T]; T];
    for j in 0..T {
        p[j][j] = R::one() / delta[j];
    }
    p
}

fn to_f64<R: Float>(v: R) -> f64 {
    v.to_f64().unwrap_or(f64::NAN)
}

/// U D U^T.
fn product_of_factors<R: Float, const T: usize>(u: &[[R; T]; T], d: &[R; T]) -> [[f64; T]; T] {
    let mut p = [[0.0; T]; T];
    for i in 0..T {
        for j in i..T {
            for k in j..T {
                p[i][j] += to_f64(u[i][k]) * to_f64(d[k]) * to_f64(u[j][k]);
            }
            p[j][i] = p[i][j];
        }
    }
    p
}

/// The covariance form as LPR Eq. 3 writes it: `P - G z^T P`, both products computed from P as it stands.
pub(crate) struct Covariance<R, const T: usize> {
    p: [[R; T]; T],
    beta: [[R; T]; CHANNELS],
}

impl<R: Float, const T: usize> Form<R, T> for Covariance<R, T> {
    fn new(initial: &[[R; T]; CHANNELS], delta: &[R; T]) -> Self {
        Self {
            p: inverse_diagonal(delta),
            beta: *initial,
        }
    }

    fn update(&mut self, z: &[R; T], y: &[R; CHANNELS], weight: R, lambda: R) {
        let mut pz = [R::zero(); T];
        let mut zp = [R::zero(); T];
        for i in 0..T {
            for j in 0..T {
                pz[i] = pz[i] + self.p[i][j] * z[j];
                zp[j] = zp[j] + z[i] * self.p[i][j];
            }
        }
        let denominator = lambda / weight + dot(z, &pz);
        let gain = pz.map(|v| v / denominator);
        for i in 0..T {
            for j in 0..T {
                self.p[i][j] = (self.p[i][j] - gain[i] * zp[j]) / lambda;
            }
        }
        correct(&mut self.beta, &gain, z, y);
    }

    fn coefficients(&self) -> [[R; T]; CHANNELS] {
        self.beta
    }

    fn covariance(&self) -> Option<[[f64; T]; T]> {
        Some(self.p.map(|row| row.map(to_f64)))
    }
}

/// Joseph's form: `(I - G z^T) P (I - G z^T)^T + G G^T / w`, one triangle computed and mirrored.
pub(crate) struct Joseph<R, const T: usize> {
    p: [[R; T]; T],
    beta: [[R; T]; CHANNELS],
}

impl<R: Float, const T: usize> Form<R, T> for Joseph<R, T> {
    fn new(initial: &[[R; T]; CHANNELS], delta: &[R; T]) -> Self {
        Self {
            p: inverse_diagonal(delta),
            beta: *initial,
        }
    }

    fn update(&mut self, z: &[R; T], y: &[R; CHANNELS], weight: R, lambda: R) {
        let noise = lambda / weight;
        let pz = self.p.map(|row| dot(&row, z));
        let denominator = noise + dot(z, &pz);
        let gain = pz.map(|v| v / denominator);
        // A = (I - G z^T) P, then A (I - G z^T)^T = A - (A z) G^T.
        let mut a = self.p;
        for i in 0..T {
            for j in 0..T {
                a[i][j] = self.p[i][j] - gain[i] * pz[j];
            }
        }
        let az = a.map(|row| dot(&row, z));
        for i in 0..T {
            for j in i..T {
                let value = (a[i][j] - az[i] * gain[j] + noise * gain[i] * gain[j]) / lambda;
                self.p[i][j] = value;
                self.p[j][i] = value;
            }
        }
        correct(&mut self.beta, &gain, z, y);
    }

    fn coefficients(&self) -> [[R; T]; CHANNELS] {
        self.beta
    }

    fn covariance(&self) -> Option<[[f64; T]; T]> {
        Some(self.p.map(|row| row.map(to_f64)))
    }
}

/// Bierman's factored form: P = U D U^T with U unit upper triangular (Bierman 1977, chapter V).
pub(crate) struct Bierman<R, const T: usize> {
    u: [[R; T]; T],
    d: [R; T],
    beta: [[R; T]; CHANNELS],
}

impl<R: Float, const T: usize> Form<R, T> for Bierman<R, T> {
    fn new(initial: &[[R; T]; CHANNELS], delta: &[R; T]) -> Self {
        Self {
            u: inverse_diagonal(&[R::one(); T]),
            d: delta.map(|v| R::one() / v),
            beta: *initial,
        }
    }

    fn update(&mut self, z: &[R; T], y: &[R; CHANNELS], weight: R, lambda: R) {
        let mut f = *z;
        for j in 0..T {
            for i in 0..j {
                f[j] = f[j] + self.u[i][j] * z[i];
            }
        }
        let mut gain = [R::zero(); T];
        let mut alpha = lambda / weight;
        for j in 0..T {
            let v = self.d[j] * f[j];
            let before = alpha;
            alpha = alpha + v * f[j];
            self.d[j] = self.d[j] * (before / alpha) / lambda;
            gain[j] = v;
            let p = -f[j] / before;
            for i in 0..j {
                let u = self.u[i][j];
                self.u[i][j] = u + gain[i] * p;
                gain[i] = gain[i] + u * v;
            }
        }
        let gain = gain.map(|v| v / alpha);
        correct(&mut self.beta, &gain, z, y);
    }

    fn coefficients(&self) -> [[R; T]; CHANNELS] {
        self.beta
    }

    fn covariance(&self) -> Option<[[f64; T]; T]> {
        Some(product_of_factors(&self.u, &self.d))
    }
}

/// The square-root information form without square roots: P^-1 = R^T D R with R unit upper triangular, updated
/// by Gentleman's planar rotations (Gentleman 1973; Miller 1992, AS 274).
pub(crate) struct Rotations<R, const T: usize> {
    r: [[R; T]; T],
    d: [R; T],
    theta: [[R; T]; CHANNELS],
}

impl<R: Float, const T: usize> Form<R, T> for Rotations<R, T> {
    fn new(initial: &[[R; T]; CHANNELS], delta: &[R; T]) -> Self {
        Self {
            r: inverse_diagonal(&[R::one(); T]),
            d: *delta,
            theta: *initial,
        }
    }

    fn update(&mut self, z: &[R; T], y: &[R; CHANNELS], weight: R, lambda: R) {
        let (mut z, mut y, mut weight) = (*z, *y, weight);
        for j in 0..T {
            let pivot = z[j];
            let aged = self.d[j] * lambda;
            let d = aged + weight * pivot * pivot;
            let (keep, take) = (aged / d, weight * pivot / d);
            self.d[j] = d;
            weight = weight * keep;
            for k in j + 1..T {
                let incoming = z[k];
                z[k] = incoming - pivot * self.r[j][k];
                self.r[j][k] = keep * self.r[j][k] + take * incoming;
            }
            for (theta, y) in self.theta.iter_mut().zip(&mut y) {
                let incoming = *y;
                *y = incoming - pivot * theta[j];
                theta[j] = keep * theta[j] + take * incoming;
            }
        }
    }

    fn coefficients(&self) -> [[R; T]; CHANNELS] {
        let mut beta = self.theta;
        for beta in &mut beta {
            for j in (0..T).rev() {
                for k in j + 1..T {
                    beta[j] = beta[j] - self.r[j][k] * beta[k];
                }
            }
        }
        beta
    }
}

/// The normal equations, factorised by Cholesky's square roots when coefficients are asked for.
pub(crate) struct Cholesky<R, const T: usize> {
    gram: [[R; T]; T],
    moment: [[R; T]; CHANNELS],
}

impl<R: Float, const T: usize> Form<R, T> for Cholesky<R, T> {
    fn new(initial: &[[R; T]; CHANNELS], delta: &[R; T]) -> Self {
        let mut gram = [[R::zero(); T]; T];
        let mut moment = *initial;
        for j in 0..T {
            gram[j][j] = delta[j];
            for moment in &mut moment {
                moment[j] = moment[j] * delta[j];
            }
        }
        Self { gram, moment }
    }

    fn update(&mut self, z: &[R; T], y: &[R; CHANNELS], weight: R, lambda: R) {
        for i in 0..T {
            let wz = weight * z[i];
            for j in i..T {
                self.gram[i][j] = self.gram[i][j] * lambda + wz * z[j];
            }
            for (moment, &y) in self.moment.iter_mut().zip(y) {
                moment[i] = moment[i] * lambda + wz * y;
            }
        }
    }

    fn coefficients(&self) -> [[R; T]; CHANNELS] {
        let mut factor = self.gram;
        for j in 0..T {
            for k in 0..j {
                factor[j][j] = factor[j][j] - factor[k][j] * factor[k][j];
            }
            factor[j][j] = factor[j][j].sqrt();
            for i in j + 1..T {
                for k in 0..j {
                    factor[j][i] = factor[j][i] - factor[k][j] * factor[k][i];
                }
                factor[j][i] = factor[j][i] / factor[j][j];
            }
        }
        self.moment.map(|moment| solve_factored(&factor, moment))
    }
}

fn solve_factored<R: Float, const T: usize>(factor: &[[R; T]; T], mut x: [R; T]) -> [R; T] {
    for j in 0..T {
        for k in 0..j {
            x[j] = x[j] - factor[k][j] * x[k];
        }
        x[j] = x[j] / factor[j][j];
    }
    for j in (0..T).rev() {
        for k in j + 1..T {
            x[j] = x[j] - factor[j][k] * x[k];
        }
        x[j] = x[j] / factor[j][j];
    }
    x
}

/// The core's recursive fit.
pub(crate) struct ShippedRls<const T: usize>(Rls<T>);

impl<const T: usize> Form<f32, T> for ShippedRls<T> {
    fn new(initial: &[[f32; T]; CHANNELS], delta: &[f32; T]) -> Self {
        Self(Rls::new(&Prior {
            coefficients: *initial,
            strengths: *delta,
        }))
    }

    fn update(&mut self, z: &[f32; T], y: &[f32; CHANNELS], weight: f32, lambda: f32) {
        assert_eq!(self.0.update_forgetting(z, y, weight, lambda), Taken::Yes);
    }

    fn coefficients(&self) -> [[f32; T]; CHANNELS] {
        *self.0.coefficients()
    }

    fn covariance(&self) -> Option<[[f64; T]; T]> {
        let (u, d) = self.0.factors();
        Some(product_of_factors(&u, &d))
    }
}

/// The core's normal equations, which know no forgetting.
pub(crate) struct ShippedNormal<const T: usize> {
    sums: NormalEquations<T>,
    prior: Prior<T>,
}

impl<const T: usize> Form<f32, T> for ShippedNormal<T> {
    fn new(initial: &[[f32; T]; CHANNELS], delta: &[f32; T]) -> Self {
        Self {
            sums: NormalEquations::new(),
            prior: Prior {
                coefficients: *initial,
                strengths: *delta,
            },
        }
    }

    fn update(&mut self, z: &[f32; T], y: &[f32; CHANNELS], weight: f32, _lambda: f32) {
        self.sums.add(z, y, weight);
    }

    fn coefficients(&self) -> [[f32; T]; CHANNELS] {
        let solution = self.sums.solve(&self.prior).expect("finite pixels");
        *solution.coefficients()
    }
}
