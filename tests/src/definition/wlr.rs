//! Weighted local regression at one pixel from its formulas (WLR): every fit a least-squares problem of its own, nothing carried from one to the next.

use linpred_core::{LayerTile, Params};
use nalgebra::{DMatrix, DVector};

use super::Window;

/// Shared bandwidths of section 7.
const TRIED: [f64; 5] = [0.2, 0.4, 0.6, 0.8, 1.0];

/// What WLR makes of the window's centre.
#[derive(Clone, Debug)]
pub struct Regression<'a> {
    window: &'a Window,
    params: Params,
    /// b_j of each local feature (section 5.2).
    pub bandwidths: Vec<f64>,
    /// h_opt (section 5.3).
    pub shared: f64,
    /// Radiance.
    pub colour: [f64; 3],
    /// The mean squared error that the curves tell, mean over the channels.
    pub error: f64,
}

impl Window {
    /// Algorithm 1 at the window's centre, but for the sampling.
    pub fn regression(&self) -> Regression<'_> {
        let mut found = Regression {
            window: self,
            params: self.params,
            bandwidths: Vec::new(),
            shared: 0.0,
            colour: [0.0; 3],
            error: 0.0,
        };
        found.bandwidths = found.feature_bandwidths();
        let error;
        (found.shared, error) = found.shared_bandwidth();
        let unit = self.radiance_scale;
        found.error = error / (unit * unit) / 3.0;
        found.colour = found.at(&self.own()).map(|v| v / unit);
        found
    }
}

impl Regression<'_> {
    fn rank(&self) -> usize {
        self.window.rank
    }

    /// A layer by the colour's bandwidths, from what each frame has of it.
    pub fn follow(&self, layers: &[&LayerTile]) -> [f64; 3] {
        let samples = &self.window.samples;
        let y: Vec<[f64; 3]> = samples
            .iter()
            .map(|sample| layers[sample.frame].colour[sample.position].map(f64::from))
            .collect();
        self.at(&y)
    }

    fn at(&self, y: &[[f64; 3]]) -> [f64; 3] {
        self.linear(self.shared, y).map(|beta| beta[0])
    }

    /// Section 8: one over the variance of the mean, of which a thousandth of the window's mean is a floor.
    fn guards(&self) -> Vec<f64> {
        let samples = &self.window.samples;
        let valid = self.window.valid();
        let mean = valid.iter().map(|&i| samples[i].variance).sum::<f64>() / valid.len() as f64;
        samples
            .iter()
            .map(|sample| match (sample.valid(), mean > 0.0) {
                (false, _) => 0.0,
                (true, false) => 1.0,
                (true, true) => mean / (sample.variance + 1e-3 * mean),
            })
            .collect()
    }

    /// Epanechnikov's kernel over the local features, each with its bandwidth (Eq. 3), times the guards.
    fn weights(&self, bandwidths: &[f64]) -> Vec<f64> {
        let guards = self.guards();
        let kernel = |z: &Vec<f64>| -> f64 {
            z[1..]
                .iter()
                .zip(bandwidths)
                .map(|(z, b)| 0.75 * (1.0 - (z / b) * (z / b)).max(0.0))
                .product()
        };
        let weights: Vec<f64> = self
            .window
            .z
            .iter()
            .zip(&guards)
            .map(|(z, guard)| kernel(z) * guard)
            .collect();
        if weights.iter().any(|w| *w > 0.0) {
            weights
        } else {
            guards
        }
    }

    /// `(X^T W X)^-1 X^T W` (Eq. 4), each term but the first with a small part of an average weight on it.
    fn smoother(&self, rows: &[Vec<f64>], weights: &[f64]) -> DMatrix<f64> {
        let terms = rows[0].len();
        let x = DMatrix::from_fn(rows.len(), terms, |i, t| rows[i][t]);
        let w = DMatrix::from_diagonal(&DVector::from_column_slice(weights));
        let counted = weights.iter().filter(|w| **w > 0.0).count() as f64;
        let share = weights.iter().sum::<f64>() / counted;
        let mut normal = x.transpose() * &w * &x;
        for t in 1..terms {
            normal[(t, t)] += f64::from(self.params.gradient_strength) * share;
        }
        let right = x.transpose() * w;
        normal
            .cholesky()
            .expect("a prior on every term but the intercept, and a pixel that counts")
            .solve(&right)
    }

    /// Coefficients of the linear fit within the bandwidths `h b_j` (Eq. 6).
    fn linear(&self, h: f64, y: &[[f64; 3]]) -> [DVector<f64>; 3] {
        let smoother = self.linear_smoother(h);
        [0, 1, 2].map(|c| &smoother * DVector::from_iterator(y.len(), y.iter().map(|y| y[c])))
    }

    fn linear_smoother(&self, h: f64) -> DMatrix<f64> {
        let bandwidths: Vec<f64> = self.bandwidths.iter().map(|b| h * b).collect();
        self.smoother(&self.window.z, &self.weights(&bandwidths))
    }

    /// `|d^2 f / d z_j^2|^(-1/2)` by a quadratic fit without cross terms of bandwidth 1 (Eq. 9), root mean square over the channels.
    fn feature_bandwidths(&self) -> Vec<f64> {
        let rank = self.rank();
        let rows: Vec<Vec<f64>> = self
            .window
            .z
            .iter()
            .map(|z| {
                z.iter()
                    .copied()
                    .chain(z[1..].iter().map(|z| z * z))
                    .collect()
            })
            .collect();
        let smoother = self.smoother(&rows, &self.weights(&vec![1.0; rank]));
        let y = self.window.own();
        let mut squares = vec![0.0; rank];
        for c in 0..3 {
            let fitted = &smoother * DVector::from_iterator(y.len(), y.iter().map(|y| y[c]));
            for (j, sum) in squares.iter_mut().enumerate() {
                let second = 2.0 * fitted[1 + rank + j] / self.window.radiance_scale;
                *sum += second * second / 3.0;
            }
        }
        let curvature = squares.iter().map(|square| square.sqrt().max(1e-6));
        curvature
            .map(|curvature| curvature.sqrt().recip())
            .collect()
    }

    /// h_opt and the squared bias and variance there, by curves through those of five fits (Eq. 10 to 13).
    fn shared_bandwidth(&self) -> (f64, f64) {
        let (rank, y) = (self.rank() as f64, self.window.own());
        let samples = &self.window.samples;
        let centre = &samples[0];
        let (mut biases, mut variances) = ([[0.0; 5]; 3], [0.0; 5]);
        for (place, h) in TRIED.into_iter().enumerate() {
            let weights = self.linear_smoother(h).row(0).into_owned();
            for (c, biases) in biases.iter_mut().enumerate() {
                let fitted: f64 = weights.iter().zip(&y).map(|(l, y)| l * y[c]).sum();
                biases[place] = fitted - y[0][c];
            }
            let of_pixel = weights.iter().zip(samples);
            variances[place] = of_pixel.map(|(l, sample)| l * l * sample.variance).sum();
        }
        let squares = TRIED.map(|h| h * h);
        let falls = TRIED.map(|h| h.powf(-rank));
        let (c0, c1) = line(&falls, &variances);
        let lines = biases.map(|biases| match centre.valid() {
            true => line(&squares, &biases),
            false => (0.0, 0.0),
        });
        let curvature: f64 = lines.iter().map(|(_, a1)| a1 * a1).sum();
        let h = if rank == 0.0 || curvature == 0.0 {
            1.0
        } else if c1 > 0.0 {
            let balance = rank * c1 / (4.0 * curvature);
            balance.powf(1.0 / (rank + 4.0)).clamp(0.2, 1.0)
        } else {
            0.2
        };
        let bias: f64 = lines.iter().map(|(a0, a1)| (a0 + a1 * h * h).powi(2)).sum();
        (h, bias + (c0 + c1 * h.powf(-rank)).max(0.0))
    }
}

/// Intercept and slope by ordinary least squares.
fn line(x: &[f64; 5], y: &[f64; 5]) -> (f64, f64) {
    let design = DMatrix::from_fn(5, 2, |i, t| if t == 0 { 1.0 } else { x[i] });
    if x.iter().all(|v| v == &x[0]) {
        return (y.iter().sum::<f64>() / 5.0, 0.0);
    }
    let solution = design
        .svd(true, true)
        .solve(&DVector::from_column_slice(y), 0.0)
        .expect("both factors were asked for");
    (solution[0], solution[1])
}
