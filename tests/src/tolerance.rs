//! The one table of tolerances, and the two-sided comparison that uses it.

/// Prediction of the f32 recursive fit against f64 QR, in `Fit::prediction_unit` (the window's largest radiance where weights are
/// equal), for prior strengths of 1e-3 and more: the bar of the stability study. Seen: 2e-5; two million of the strategies' windows pass.
pub const RECURSIVE_PREDICTION: f64 = 1e-4;

/// Coefficients of the f32 recursive fit, in units of the largest radiance times `max(1, sqrt(P_jj))`: between nearly
/// collinear regressors rounding drifts along the direction that no pixel and only the prior determines, which no
/// prediction sees. Seen: 1.2e-2.
pub const RECURSIVE_COEFFICIENTS: f64 = 5e-2;

/// Entries of P of the f32 recursive fit relative to `sqrt(P_ii P_jj)`, for the same reason. Seen: 2e-4.
pub const RECURSIVE_COVARIANCE: f64 = 2e-3;

/// `z^T P z` at the window's own pixels, relative: 361 updates of rounding, unamplified. Seen: 3e-5.
pub const RECURSIVE_LEVERAGE: f64 = 3e-4;

/// A recursive tolerance for sequences that a fuzzer has searched, which makes regressors collinear, repeats them and spreads weights
/// over four decades: as it is, or two units in the last place amplified by the worst condition number on the way, where
/// that is more. Found: predictions off by 1.7e-4 in `Fit::prediction_unit` and leverages by 3.02e-4, at conditions of
/// some thousands.
pub fn searched(tolerance: f64, condition: f64) -> f64 {
    tolerance.max(2.0 * f64::from(f32::EPSILON) * condition)
}

/// Fitted values of the f64 normal equations against f64 QR, relative to the largest radiance: coefficients are
/// rounded to f32 and multiplied by regressors in f32. Seen: 7e-7.
pub const NORMAL_PREDICTION: f64 = 5e-6;

/// Coefficients of the f64 normal equations, in the unit of the recursive ones: rounded to f32. Seen: 2e-7.
pub const NORMAL_COEFFICIENTS: f64 = 2e-6;

/// Leverage of the f64 normal equations, relative: their factor is rounded to f32. Seen: 3e-6.
pub const NORMAL_LEVERAGE: f64 = 3e-5;

/// Degrees of freedom and Stein's penalty against the sum of the oracle's leverages, relative: as above.
pub const TRACE: f64 = 3e-5;

/// Sums of squared ring errors of the recursive fit against refits, relative to the ring's pixels times the squared largest
/// radiance: twice the prediction's.
pub const RING_ERROR: f64 = 2.0 * RECURSIVE_PREDICTION;

/// Residual sums of the normal equations, relative to `sum w (|y| + sum_j |beta_j z_j|)^2`, beside the rounding of the result to
/// f32: a difference of f64 sums over 361 pixels.
pub const RESIDUAL_SQUARES: f64 = 1e-13;

/// Jacobi eigenvalues relative to the largest: 16 rows of rounding (D units in the last place).
pub const EIGENVALUE: f64 = 16.0 * f32::EPSILON as f64;

/// `V^T V` against the identity: some 500 rotations of rounding, each half a unit in the last place at random.
pub const ORTHONORMALITY: f64 = 64.0 * f32::EPSILON as f64;

/// `V diag(s) V^T` against the matrix, relative to the largest eigenvalue: both of the above.
pub const RECONSTRUCTION: f64 = 64.0 * f32::EPSILON as f64;

/// Means of merged passes, relative: those of the passes are rounded to f32, and so is the result; half a unit in the last place each.
pub const MERGED_MEAN: f64 = 1.2e-7;

/// Variances of merged passes, relative, of samples whose deviation is a hundredth of their mean and more: a mean that is off by half a unit in the last place is off by 6e-6 of
/// the deviation, and its square by twice that. Seen: 4e-6.
pub const MERGED_VARIANCE: f64 = 2e-5;

/// Weights, variances, tolerances and filtered features of a block, relative: polynomials within 5e-7 of logarithms and powers, reciprocals
/// within 3e-7, sums of some fifty floats.
pub const BLOCK: f64 = 1e-5;

/// Smoothed pixels, cleared pixels and factors of light, relative: eighth powers of sums of some twenty products, and sums of a thousand floats.
pub const FINISH: f64 = 2e-5;

/// A denoised frame at an exposure that is no power of two, relative to its brightest pixel: radiances are rounded, and so is the local
/// level, a mean of logarithms. Seen: 4.4e-7.
pub const EXPOSURE: f64 = 4e-6;

/// A denoised frame whose features are in another unit that is no power of two, relative to its brightest pixel: features are
/// rounded, and the local feature space turns by the condition number times that. Seen: 1.6e-5.
pub const FEATURE_UNITS: f64 = 1e-4;

/// A denoised frame with its channels in another order, relative to its brightest pixel: sums over the channels. Seen: 1.9e-7.
pub const CHANNEL_ORDER: f64 = 2e-6;

/// Denoised layers' sum against the denoised colour, relative to its brightest pixel: rounding of sums in another order.
pub const LAYER_SUM: f64 = 1e-5;

/// Predictions of a cell that is an affine function of its features, without a prior, relative to its brightest pixel: rounding. Seen: 3.6e-7.
pub const AFFINE_FRAME: f64 = 3e-6;

/// The same with the default prior, which pulls gradients to 0 with the strength of 0.01 of a window's up to 361 pixels. Seen: 1.0e-3.
pub const SHRUNK_AFFINE_FRAME: f64 = 3e-3;

/// A frame that is an affine function of its features, in standard deviations that it states: noise that is not there is smoothed no further.
pub const WITHIN_ERROR: f32 = 2.0;

/// Predictions of one model of a tile against its formulas in f64, relative to the window's largest radiance: the bar of the stability study.
pub const MODEL_PREDICTION: f64 = 1e-4;

/// The same of the papers' formulas, whose f32 recursion also predicts missing pixels, which it was not fitted to. Seen: 2e-4.
pub const LITERAL_PREDICTION: f64 = 1e-3;

/// WLR's prediction against its formulas in f64, relative to the window's largest radiance: directions of features are found in f32, and a bandwidth is a root
/// of what a fit finds along them.
pub const WLR_PREDICTION: f64 = 1e-3;

/// WLR's mean squared error, relative to that and a thousandth of the largest radiance squared: squares of small differences of the above.
pub const WLR_ERROR: f64 = 2e-2;

/// Risk of the radius that was chosen above the least, relative: radii whose risks are within rounding of each other are alike.
pub const MODEL_RISK: f64 = 1e-3;

/// Weights and errors of one model's predictions, relative: squares of predictions' distances to their pixels, in units of the variance.
pub const MODEL_WEIGHT: f64 = 1e-2;

/// A resolved pixel against its mean in f64, relative to the largest value: forty sums.
pub const RESOLVED: f64 = 1e-5;

/// Predictions of a cell all of whose valid pixels have one radiance, relative to that: rounding.
pub const CONSTANT_CELL: f64 = 1e-5;

/// Mean of the estimated error over a frame, over the mean squared error: it is to err to the safe side, because it averages the errors of
/// models whose mean is better than each. Seen: 1.9 to 3.3 for noise of a tenth or a third of the radiance, 2.7 to 5.2 for as much as the
/// radiance; over the renders that the benchmark uses, 0.6 to 1.5.
pub const ERROR_ESTIMATE: std::ops::RangeInclusive<f64> = 1.0..=7.0;

/// The error that a map of samples predicts, over the mean squared relative error: it errs to the safe side on these frames, as the estimate it is made of does. Seen: 1.9 to 4.5;
/// over the renders that the benchmark uses, 0.65 to 1.4.
pub const PREDICTED_ERROR: std::ops::RangeInclusive<f64> = 1.0..=6.0;

/// Light of a denoised frame over that of its input, under noise as strong as the light: the noise of five thousand pixels' mean is 0.007 of
/// it, and what the last stage gives back is a fraction of what is lost.
pub const FRAME_ENERGY: std::ops::RangeInclusive<f64> = 0.97..=1.03;

/// Mean radiance of a denoised image against that of the noisy one: this many standard deviations of the latter and this share of it.
pub const MEAN_ERRORS: f64 = 2.0;
/// See [`MEAN_ERRORS`].
pub const MEAN_SHARE: f64 = 0.01;

/// Mean radiance of a lamp that no feature shows, with 64 samples per pixel, relative.
pub const LAMP: f32 = 0.1;

/// Whether two numbers are within `tolerance` of each other; never if one is NaN.
pub fn close(a: f64, b: f64, tolerance: f64) -> bool {
    (a - b).abs() <= tolerance
}
