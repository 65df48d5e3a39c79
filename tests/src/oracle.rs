//! The linear models in f64, written for clarity: whole matrices, QR and SVD, nothing recursive.

use nalgebra::{DMatrix, DVector};

/// One pixel of a fit.
#[derive(Clone, Debug)]
pub struct Row {
    /// Regressors, the intercept's 1 first; one per term.
    pub z: Vec<f64>,
    /// The three responses.
    pub y: [f64; 3],
    /// Weight of the pixel's squared residual, positive.
    pub weight: f64,
}

impl Row {
    /// The row that an f32 fit was given.
    pub fn from_f32(z: &[f32], y: &[f32; 3], weight: f32) -> Self {
        Self {
            z: z.iter().map(|&v| f64::from(v)).collect(),
            y: y.map(f64::from),
            weight: f64::from(weight),
        }
    }
}

/// What a fit starts from: coefficients that it is pulled to, and how strongly.
#[derive(Clone, Debug)]
pub struct Prior {
    /// Coefficients per channel, one per term.
    pub initial: [Vec<f64>; 3],
    /// Prior precision per term, positive.
    pub delta: Vec<f64>,
}

impl Prior {
    /// The prior that an f32 fit was given.
    pub fn from_f32<const T: usize>(prior: &linpred_core::Prior<T>) -> Self {
        Self {
            initial: prior
                .coefficients
                .map(|beta| beta.iter().map(|&v| f64::from(v)).collect()),
            delta: prior.strengths.iter().map(|&v| f64::from(v)).collect(),
        }
    }
}

/// Minimiser of `sum w (beta^T z - y)^2 + sum delta_j (beta_j - initial_j)^2`.
#[derive(Clone, Debug)]
pub struct BatchFit {
    /// Coefficients per channel.
    pub beta: [DVector<f64>; 3],
    /// P, the inverse of the regularised Gramian.
    pub covariance: DMatrix<f64>,
}

impl BatchFit {
    /// Solves the regularised problem by QR of the rows, the prior's rows among them.
    ///
    /// Rows enter by falling norm and columns are pivoted: Householder QR is then row-wise backward stable (Higham,
    /// Accuracy and Stability of Numerical Algorithms, section 20.3), which weights over many decades need.
    pub fn new(rows: &[Row], prior: &Prior) -> Self {
        let terms = prior.delta.len();
        let mut stacked = stack(rows, prior);
        stacked.sort_by(|a, b| largest(&b[..terms]).total_cmp(&largest(&a[..terms])));
        let height = stacked.len();
        let z = DMatrix::from_fn(height, terms, |i, j| stacked[i][j]);
        let y = DMatrix::from_fn(height, 3, |i, j| stacked[i][terms + j]);
        let qr = z.col_piv_qr();
        let mut right = y;
        qr.q_tr_mul(&mut right);
        let r = qr.r();
        let solved = r
            .solve_upper_triangular(&right.rows(0, terms).into_owned())
            .expect("the prior makes R regular");
        let inverse = r
            .solve_upper_triangular(&DMatrix::identity(terms, terms))
            .expect("the prior makes R regular");
        let mut beta = solved;
        qr.p().inv_permute_rows(&mut beta);
        let mut half = inverse;
        qr.p().inv_permute_rows(&mut half);
        Self {
            beta: [0, 1, 2].map(|c| beta.column(c).into_owned()),
            covariance: &half * half.transpose(),
        }
    }

    /// `beta^T z` of each channel.
    pub fn predict(&self, z: &[f64]) -> [f64; 3] {
        let z = DVector::from_column_slice(z);
        [0, 1, 2].map(|c| self.beta[c].dot(&z))
    }

    /// `z^T P z`.
    pub fn leverage(&self, z: &[f64]) -> f64 {
        let z = DVector::from_column_slice(z);
        (z.transpose() * &self.covariance * &z)[(0, 0)]
    }
}

fn largest(row: &[f64]) -> f64 {
    row.iter().fold(0.0, |largest, v| v.abs().max(largest))
}

/// `sqrt(w) (z, y)` of every pixel, and `sqrt(delta_j) (e_j, initial_j)` of every term.
fn stack(rows: &[Row], prior: &Prior) -> Vec<Vec<f64>> {
    let pixels = rows.iter().map(|row| {
        let scale = row.weight.sqrt();
        row.z.iter().chain(&row.y).map(|v| v * scale).collect()
    });
    let pulls = prior.delta.iter().enumerate().map(|(j, delta)| {
        let mut pull = vec![0.0; prior.delta.len() + 3];
        pull[j] = delta.sqrt();
        for c in 0..3 {
            pull[prior.delta.len() + c] = delta.sqrt() * prior.initial[c][j];
        }
        pull
    });
    pixels.chain(pulls).collect()
}

/// The same problem after forgetting: the pixel of age a, and the prior of age n, weigh `lambda^age` of their weight.
pub fn forget(rows: &[Row], prior: &Prior, lambda: f64) -> (Vec<Row>, Prior) {
    let count = rows.len() as i32;
    let aged = rows.iter().enumerate().map(|(i, row)| Row {
        weight: row.weight * lambda.powi(count - 1 - i as i32),
        ..row.clone()
    });
    let prior = Prior {
        initial: prior.initial.clone(),
        delta: prior.delta.iter().map(|d| d * lambda.powi(count)).collect(),
    };
    (aged.collect(), prior)
}

/// The largest condition number, weights and prior included, that a fit which forgets by `lambda` goes through: what a recursion
/// errs in an ill-conditioned stretch stays in its coefficients after pixels that mend the condition.
pub fn worst_condition(rows: &[Row], prior: &Prior, lambda: f64) -> f64 {
    let mut gram = DMatrix::from_diagonal(&DVector::from_column_slice(&prior.delta));
    let mut worst: f64 = 1.0;
    for row in rows {
        let z = DVector::from_column_slice(&row.z);
        gram *= lambda;
        gram.ger(row.weight, &z, &z, 1.0);
        // Elements of denormal regressors make nalgebra's iteration return NaN; they move no eigenvalue.
        let least = 1e-25 * gram.amax();
        let eigenvalues = gram
            .map(|v| if v.abs() < least { 0.0 } else { v })
            .symmetric_eigenvalues();
        worst = worst.max((eigenvalues.max() / eigenvalues.min()).sqrt());
    }
    worst
}
