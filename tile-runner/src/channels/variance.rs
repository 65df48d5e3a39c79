//! Where the variance of the mean comes from, and how what a renderer writes becomes it.

use std::fmt;

use crate::channels::names::ChannelRef;

/// What the numbers in a variance layer are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Meaning {
    /// Variance of the pixel's mean.
    OfMean,
    /// Variance of one sample: divide by the samples.
    OfSample,
    /// Mean of the squared samples.
    SecondMoment,
}

impl Meaning {
    /// Whether the variance of the mean cannot be had without the number of samples.
    pub const fn needs_count(self) -> bool {
        !matches!(self, Self::OfMean)
    }

    /// What is stored, in words.
    pub const fn stored(self) -> &'static str {
        match self {
            Self::OfMean => "variance of the mean",
            Self::OfSample => "variance of one sample",
            Self::SecondMoment => "second moment",
        }
    }
}

impl fmt::Display for Meaning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::OfMean => "variance of the mean",
            Self::OfSample => "variance of one sample, divided by the number of samples",
            Self::SecondMoment => "second moment, less the squared mean, by the number of samples",
        })
    }
}

/// Samples per pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Count {
    /// The same everywhere.
    Fixed(f32),
    /// A channel, times a factor (Blender writes fractions of the total).
    Channel {
        /// Which channel.
        at: ChannelRef,
        /// What its values are multiplied by.
        scale: f32,
    },
}

/// Where the variance of some channels comes from, of each in their order.
#[derive(Clone, Debug, PartialEq)]
pub enum Variance {
    /// Channels of the file.
    Given {
        /// What they hold.
        meaning: Meaning,
        /// Which they are.
        channels: Vec<ChannelRef>,
        /// Samples per pixel; `None` only where the meaning does not need them.
        count: Option<Count>,
    },
    /// Half the difference of two half buffers, squared.
    Halves {
        /// One half of the samples.
        a: Vec<ChannelRef>,
        /// The other half.
        b: Vec<ChannelRef>,
    },
    /// The same channels in the image of the other half of the samples: the mean is that of the two images, and half their
    /// difference, squared, its variance.
    OtherFile(Vec<ChannelRef>),
    /// Nothing: it is estimated from the picture.
    None,
}

impl Variance {
    /// Whether there is any.
    pub fn is_known(&self) -> bool {
        !matches!(self, Self::None)
    }

    /// Every channel that it is read from.
    pub fn channels(&self) -> Vec<ChannelRef> {
        match self {
            Self::Given {
                channels, count, ..
            } => {
                let mut all = channels.clone();
                if let Some(Count::Channel { at, .. }) = count {
                    all.push(*at);
                }
                all
            }
            Self::Halves { a, b } => a.iter().chain(b).copied().collect(),
            Self::OtherFile(twins) => twins.clone(),
            Self::None => Vec::new(),
        }
    }
}

/// Below this many units in the last place of the second moment a difference to the squared mean is rounding.
const MOMENT_ROUNDING: f64 = 4.0;

/// Turns one row of a variance layer into variances of the mean, in place. `mean` is the row of the quantity itself, `count`
/// the samples of each pixel (ignored for [`Meaning::OfMean`]). Fewer than two samples, and values that are no numbers,
/// leave no variance to know: the result is infinite there, which a fit treats as a pixel of no weight.
pub(crate) fn to_variance_of_mean(
    meaning: Meaning,
    values: &mut [f32],
    mean: &[f32],
    count: &[f32],
) {
    match meaning {
        Meaning::OfMean => values.iter_mut().for_each(|v| *v = not_negative(*v)),
        Meaning::OfSample => {
            for (value, &count) in values.iter_mut().zip(count) {
                *value = if count >= 2.0 {
                    not_negative(*value) / count
                } else {
                    f32::INFINITY
                };
            }
        }
        Meaning::SecondMoment => {
            for ((value, &mean), &count) in values.iter_mut().zip(mean).zip(count) {
                *value = variance_from_moment(*value, mean, count);
            }
        }
    }
}

/// A number below 0 is no variance: nothing is known. A NaN stays one.
fn not_negative(value: f32) -> f32 {
    if value < 0.0 { f32::NAN } else { value }
}

/// (E[x^2] - E[x]^2) n / (n - 1) is the unbiased variance of a sample; over n, that of the mean.
fn variance_from_moment(moment: f32, mean: f32, count: f32) -> f32 {
    if count < 2.0 {
        return f32::INFINITY;
    }
    let (moment, mean) = (f64::from(moment), f64::from(mean));
    let difference = moment - mean * mean;
    let rounding = MOMENT_ROUNDING * f64::from(f32::EPSILON) * moment.abs();
    if !difference.is_finite() {
        return f32::INFINITY;
    }
    // a constant pixel must come out as exactly 0: its difference is nothing but the rounding of the two stored numbers
    if difference <= rounding {
        0.0
    } else {
        (difference / (f64::from(count) - 1.0)) as f32
    }
}

/// Turns `a` into ((a - b) / 2)^2, in place: with a and b the means of half the samples each, an unbiased estimate of the
/// variance of their mean.
pub(crate) fn variance_from_halves(a: &mut [f32], b: &[f32]) {
    for (a, &b) in a.iter_mut().zip(b) {
        let half_difference = 0.5 * (*a - b);
        *a = half_difference * half_difference;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn second_moments_give_the_variance_of_the_mean_of_the_samples_they_came_from() {
        let samples = [0.25_f64, 1.5, 0.75, 3.0];
        let n = samples.len() as f64;
        let mean = samples.iter().sum::<f64>() / n;
        let moment = samples.iter().map(|x| x * x).sum::<f64>() / n;
        let expected = samples.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / (n - 1.0) / n;
        let mut row = [moment as f32];
        to_variance_of_mean(Meaning::SecondMoment, &mut row, &[mean as f32], &[n as f32]);
        assert!(
            (f64::from(row[0]) - expected).abs() < 1e-6 * expected,
            "{} {expected}",
            row[0]
        );
    }

    #[test]
    fn a_constant_pixel_has_no_variance_whatever_its_rounding() {
        for value in [0.1_f32, 0.3, 7.7, 1234.5] {
            let mut row = [value * value];
            to_variance_of_mean(Meaning::SecondMoment, &mut row, &[value], &[16.0]);
            assert_eq!(row, [0.0], "{value}");
        }
    }

    #[test]
    fn sample_variance_is_divided_by_the_samples() {
        let mut row = [8.0, -1.0, 2.0, 0.0];
        to_variance_of_mean(
            Meaning::OfSample,
            &mut row,
            &[0.0; 4],
            &[4.0, 4.0, 0.0, 1.0],
        );
        // One sample says nothing of its noise, whatever number stands there.
        assert_eq!(
            (row[0], row[2], row[3]),
            (2.0, f32::INFINITY, f32::INFINITY)
        );
        // A negative one is none.
        assert!(row[1].is_nan());
    }

    #[test]
    fn a_value_that_is_no_number_never_becomes_a_variance_of_zero() {
        for meaning in [Meaning::OfMean, Meaning::OfSample, Meaning::SecondMoment] {
            let mut row = [f32::NAN, f32::INFINITY, f32::INFINITY];
            to_variance_of_mean(meaning, &mut row, &[1.0, 1.0, f32::INFINITY], &[4.0; 3]);
            assert!(row.iter().all(|v| !v.is_finite()), "{meaning:?}: {row:?}");
        }
    }
}
