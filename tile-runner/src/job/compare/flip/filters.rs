//! The filters of FLIP, each along one direction: what the eye no longer tells apart, and where it sees edges and points.

use std::f64::consts::PI;

/// Pixels per degree of visual angle: a display 0.7 m wide, of 3840 pixels, seen from 0.7 m, the authors' default.
const PIXELS_PER_DEGREE: f64 = 0.7 * 3840.0 / 0.7 * PI / 180.0;
/// Pixels that the widest filter reaches to either side.
pub(super) const RADIUS: usize = 10;
/// Standard deviations that filters reach.
const REACH: f64 = 3.0;
/// Width in degrees of what counts as a feature; half of it is the standard deviation of its Gaussian (FLIP, section 5.2).
const FEATURE_WIDTH: f64 = 0.082;
/// A weight that changes no bit of a sum in single precision.
const NO_WEIGHT: f32 = 1e-9;

/// Contrast sensitivities as sums of Gaussians a sqrt(pi / b) exp(-pi^2 x^2 / b), x in degrees: the pairs a, b (FLIP, table 1).
const ACHROMATIC: [f64; 2] = [1.0, 0.0047];
const RED_GREEN: [f64; 2] = [1.0, 0.0053];
const BLUE_YELLOW: [[f64; 2]; 2] = [[34.1, 0.04], [13.5, 0.025]];

/// Weights along a row or a column, those of -radius..=radius.
#[derive(Clone, Debug)]
pub(super) struct Kernel {
    weights: Vec<f32>,
}

/// All of them.
#[derive(Clone, Debug)]
pub(super) struct Kernels {
    pub(super) achromatic: Kernel,
    pub(super) red_green: Kernel,
    /// Their squares along both directions sum up to the filter.
    pub(super) blue_yellow: [Kernel; 2],
    /// A Gaussian, and its first and second derivative.
    pub(super) gaussian: Kernel,
    pub(super) edge: Kernel,
    pub(super) point: Kernel,
}

impl Kernels {
    pub(super) fn new() -> Self {
        let [blue, yellow] = BLUE_YELLOW.map(|[a, b]| {
            // the root, for it is applied along both directions
            sensitivity([(a * (PI / b).sqrt()).sqrt(), b])
        });
        let sum = |weights: &[f64]| weights.iter().sum::<f64>();
        let both = sum(&blue).hypot(sum(&yellow));
        let achromatic = sensitivity(ACHROMATIC);
        let red_green = sensitivity(RED_GREEN);
        let [gaussian, edge, point] = features();
        Self {
            achromatic: Kernel::new(&achromatic, sum(&achromatic), sum(&achromatic)),
            red_green: Kernel::new(&red_green, sum(&red_green), sum(&red_green)),
            blue_yellow: [blue, yellow].map(|weights| Kernel::new(&weights, both, both)),
            gaussian: Kernel::new(&gaussian, sum(&gaussian), 1.0),
            edge: Kernel::balanced(&edge),
            point: Kernel::balanced(&point),
        }
    }
}

/// A factor a times the Gaussian of [`ACHROMATIC`] and the others.
fn sensitivity([a, b]: [f64; 2]) -> Vec<f64> {
    let radius = RADIUS as isize;
    let x = (-radius..=radius).map(|i| i as f64 / PIXELS_PER_DEGREE);
    x.map(|x| a * (-PI * PI * x * x / b).exp()).collect()
}

/// Standard deviation in pixels of the Gaussian that features are seen through.
fn feature_deviation() -> f64 {
    0.5 * FEATURE_WIDTH * PIXELS_PER_DEGREE
}

/// A Gaussian, and its first and second derivative but for a factor.
fn features() -> [Vec<f64>; 3] {
    let deviation = feature_deviation();
    let radius = (REACH * deviation).ceil() as isize;
    let x = || (-radius..=radius).map(|i| i as f64 / deviation);
    let gaussian = |x: f64| (-0.5 * x * x).exp();
    [
        x().map(gaussian).collect(),
        x().map(|x| -x * gaussian(x)).collect(),
        x().map(|x| (x * x - 1.0) * gaussian(x)).collect(),
    ]
}

impl Kernel {
    /// Positive weights over `positive`, negative ones over `negative`; those at the ends that are too small to matter left out.
    fn new(weights: &[f64], positive: f64, negative: f64) -> Self {
        let over = |weight: f64| weight / if weight > 0.0 { positive } else { negative };
        let mut weights: Vec<f32> = weights.iter().map(|&w| over(w) as f32).collect();
        let small = weights.iter().take_while(|w| w.abs() < NO_WEIGHT).count();
        weights.drain(..small);
        weights.truncate(weights.len() - small);
        Self { weights }
    }

    /// Positive weights that sum up to 1, negative ones that sum up to -1.
    fn balanced(weights: &[f64]) -> Self {
        let sum = |sign: f64| weights.iter().map(|&w| (sign * w).max(0.0)).sum();
        Self::new(weights, sum(1.0), sum(-1.0))
    }

    /// Writes to `output[i]` the sum of the weights times `source[i + k * stride]`, with k from 0 to twice [`RADIUS`]. `output` in whole [`LANES`].
    #[inline]
    pub(super) fn apply(&self, source: &[f32], stride: usize, output: &mut [f32]) {
        let skipped = RADIUS - self.weights.len() / 2;
        let source = &source[skipped * stride..];
        for (i, out) in output.as_chunks_mut::<LANES>().0.iter_mut().enumerate() {
            let mut sums = [0.0; LANES];
            for (k, weight) in self.weights.iter().enumerate() {
                let from = i * LANES + k * stride;
                for (sum, value) in sums.iter_mut().zip(&source[from..from + LANES]) {
                    *sum += weight * value;
                }
            }
            *out = sums;
        }
    }
}

/// Sums that are kept in registers side by side.
pub(super) const LANES: usize = 16;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_widest_filter_reaches_three_standard_deviations() {
        let widest = BLUE_YELLOW.map(|[_, b]| b).into_iter().fold(0.0, f64::max);
        let deviation = (widest / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE;
        assert_eq!((REACH * deviation).ceil() as usize, RADIUS);
        assert!((REACH * feature_deviation()).ceil() as usize <= RADIUS);
    }

    #[test]
    fn filters_keep_an_even_image_and_features_do_not_see_it() {
        let kernels = Kernels::new();
        let even = [0.7; LANES + 2 * RADIUS];
        let seen = |kernel: &Kernel| {
            let mut output = [0.0; LANES];
            kernel.apply(&even, 1, &mut output);
            assert!(output.iter().all(|value| *value == output[0]));
            output[0] / 0.7
        };
        let close = |value: f32, expected: f32| {
            assert!((value - expected).abs() < 1e-6, "{value} {expected}");
        };
        close(seen(&kernels.achromatic), 1.0);
        close(seen(&kernels.red_green), 1.0);
        close(seen(&kernels.gaussian), 1.0);
        close(seen(&kernels.edge), 0.0);
        close(seen(&kernels.point), 0.0);
        let [blue, yellow] = kernels.blue_yellow.each_ref().map(seen);
        close(blue * blue + yellow * yellow, 1.0);
    }

    #[test]
    fn weights_run_along_rows_and_columns_alike() {
        let kernel = Kernels::new().edge;
        let ramp = |stride: usize| {
            let values = (0..LANES + 2 * RADIUS * stride).map(|i| (i / stride) as f32);
            let source: Vec<f32> = values.collect();
            let mut output = [0.0; LANES];
            kernel.apply(&source, stride, &mut output);
            output[0]
        };
        // a ramp that rises: its derivative is seen with one sign, and as large along either
        assert!(ramp(1) < -1.0, "{}", ramp(1));
        assert_eq!(ramp(1), ramp(LANES));
    }
}
