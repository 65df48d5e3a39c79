//! The statistics of all samples of a pixel from those of its passes.

/// How much of what there would be to know of a variance must be known, at least.
const LEAST_KNOWN: f64 = 0.5;

/// One channel of one pixel, over the passes that have been added so far: in `f64`, so that adding in another order, or in stages, differs by its rounding alone.
///
/// Pass k has n_k samples of mean m_k and variance s_k^2. With N = sum n_k the mean of all samples is M = sum n_k m_k / N, and their variance
///
/// ```text
/// s^2 = (sum (n_k - 1) s_k^2 + sum n_k (m_k - M)^2) / (N - 1)
/// ```
///
/// of which the second sum is gathered pass by pass (Chan, Golub and LeVeque 1979, Eq. 2.1): nothing cancels, and passes of equal means have exactly none. Where a pass's own
/// variance is not known its (n_k - 1) degrees of freedom are missing below, too: what is left is an estimate of the same variance from fewer of them.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pool {
    /// N.
    samples: f64,
    /// M.
    mean: f64,
    /// The two sums, as far as they are known.
    squares: f64,
    /// Degrees of freedom in them.
    known: f64,
    /// Degrees of freedom that there are.
    all: f64,
}

impl Pool {
    /// Adds a pass of so many samples, more than 0, with this finite mean. `variance` is that of one sample; a negative or not finite one is not known.
    pub(super) fn add(&mut self, samples: f64, mean: f64, variance: f64) {
        let total = self.samples + samples;
        let difference = mean - self.mean;
        if self.samples > 0.0 {
            self.squares += difference * difference * (samples * self.samples / total);
            self.known += 1.0;
            self.all += 1.0;
        }
        let within = (samples - 1.0).max(0.0);
        self.all += within;
        if within > 0.0 && variance.is_finite() && variance >= 0.0 {
            self.squares += within * variance;
            self.known += within;
        }
        // the first pass's mean is not rounded on its way
        self.mean = match self.samples > 0.0 {
            true => self.mean + difference * (samples / total),
            false => mean,
        };
        self.samples = total;
    }

    /// N: 0 before a pass has been added.
    pub(super) fn samples(&self) -> f64 {
        self.samples
    }

    /// The mean of all samples; 0 of none.
    pub(super) fn mean(&self) -> f64 {
        self.mean
    }

    /// The variance of one sample. NaN with fewer than two samples, and where less than half of the degrees of freedom are known.
    pub(super) fn variance_of_sample(&self) -> f64 {
        match self.all > 0.0 && self.known >= LEAST_KNOWN * self.all {
            true => self.squares / self.known,
            false => f64::NAN,
        }
    }

    /// The variance of the mean; NaN as for one sample.
    pub(super) fn variance_of_mean(&self) -> f64 {
        self.variance_of_sample() / self.samples
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Samples of mean 3, skewed as radiance is.
    fn sample(i: usize) -> f64 {
        let x = (i as f64 * 0.754_877_666).fract();
        -3.0 * (1.0 - x).ln()
    }

    /// Count, mean and variance of one sample, by their definitions.
    fn statistics(samples: &[f64]) -> (f64, f64, f64) {
        let n = samples.len() as f64;
        let mean = samples.iter().sum::<f64>() / n;
        let squares: f64 = samples.iter().map(|x| (x - mean) * (x - mean)).sum();
        (n, mean, squares / (n - 1.0))
    }

    fn pool<'a>(passes: impl IntoIterator<Item = &'a [f64]>) -> Pool {
        let mut pool = Pool::default();
        for samples in passes {
            let (n, mean, variance) = statistics(samples);
            pool.add(n, mean, variance);
        }
        pool
    }

    #[track_caller]
    fn same(a: f64, b: f64) {
        assert!((a - b).abs() <= 1e-13 * b.abs(), "{a} {b}");
    }

    #[test]
    fn passes_give_the_statistics_of_all_their_samples_however_they_are_split() {
        let samples: Vec<f64> = (0..100).map(sample).collect();
        let (n, mean, variance) = statistics(&samples);
        for cuts in [
            vec![],
            vec![50],
            vec![1, 2, 3],
            vec![1, 40, 41, 99],
            (1..100).collect(),
        ] {
            let ends = cuts.iter().copied().chain([100]);
            let starts = [0].into_iter().chain(cuts.iter().copied());
            let passes = starts.zip(ends).map(|(start, end)| &samples[start..end]);
            let pool = pool(passes);
            assert_eq!(pool.samples(), n);
            same(pool.mean(), mean);
            same(pool.variance_of_sample(), variance);
            same(pool.variance_of_mean(), variance / n);
        }
    }

    #[test]
    fn one_sample_or_none_has_no_variance_and_two_of_one_each_have_one() {
        let mut pool = Pool::default();
        assert_eq!((pool.samples(), pool.mean()), (0.0, 0.0));
        assert!(pool.variance_of_mean().is_nan());
        pool.add(1.0, 0.1, 5.0);
        assert_eq!(pool.mean(), 0.1);
        assert!(pool.variance_of_mean().is_nan());
        pool.add(1.0, 0.3, f64::NAN);
        same(pool.variance_of_sample(), 0.02);
    }

    #[test]
    fn passes_that_are_alike_have_no_noise_at_all() {
        let mut pool = Pool::default();
        for n in [3.0, 1.0, 7.0] {
            pool.add(n, f64::from(0.1_f32), 0.0);
        }
        assert_eq!(pool.mean(), f64::from(0.1_f32));
        assert_eq!(pool.variance_of_mean(), 0.0);
    }

    #[test]
    fn a_variance_that_is_not_known_is_left_out_and_not_taken_for_none() {
        let unknown = [f64::NAN, -1.0, f64::INFINITY];
        for variance in unknown {
            let mut pool = Pool::default();
            pool.add(8.0, 1.0, 4.0);
            pool.add(4.0, 1.0, variance);
            // 7 of 11 degrees of freedom, and 1 between the passes, whose means are equal
            same(pool.variance_of_sample(), 28.0 / 8.0);
            pool.add(8.0, 1.0, variance);
            // 9 of 19: too few
            assert!(pool.variance_of_sample().is_nan());
        }
    }
}
