//! Windows that aim at trouble: what renderers, and rounding, put into features and radiance.

use crate::features::{Feature, Place, within_one};
use crate::oracle::{self, BatchFit, Row};
use crate::windows::{RADIUS, Random, pixels_within, ring_order};
use linpred_core::Prior;
use proptest::prelude::{Strategy, any};
use proptest::sample::select;

/// How radiance varies over a window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Radiance {
    /// An affine function of the features with noise.
    Affine,
    /// Noise alone, of mean 1.
    Noise,
    /// Noise and one pixel a million times brighter.
    Firefly,
    /// 0, and -0 here and there.
    Black,
    /// Noise of 1e-30.
    Tiny,
    /// Noise of 1e30.
    Huge,
}

const RADIANCES: [Radiance; 6] = [
    Radiance::Affine,
    Radiance::Noise,
    Radiance::Firefly,
    Radiance::Black,
    Radiance::Tiny,
    Radiance::Huge,
];

/// How pixels are weighted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weights {
    /// All 1.
    Equal,
    /// Four decades about 1.
    Spread,
    /// 1, and 1e-20 where a variance is 1e20.
    WorthlessPixels,
    /// One pixel of weight 1e4 (variance near 0) among pixels of weight 1.
    OneCertain,
}

const WEIGHTS: [Weights; 4] = [
    Weights::Equal,
    Weights::Spread,
    Weights::WorthlessPixels,
    Weights::OneCertain,
];

/// One pixel as a fit is given it.
#[derive(Clone, Copy, Debug)]
pub struct Pixel<const T: usize> {
    /// Regressors, 1 first.
    pub z: [f32; T],
    /// Radiance.
    pub y: [f32; 3],
    /// Weight of the squared residual.
    pub weight: f32,
}

/// The pixels of a window of some radius in the order in which they enter a fit, and the fit's prior.
#[derive(Clone, Debug)]
pub struct Fit<const T: usize> {
    /// At least one pixel; missing ones are left out.
    pub pixels: Vec<Pixel<T>>,
    /// Radiance of the first pixel, and strengths of their own for the intercept and the gradients.
    pub prior: Prior<T>,
}

impl<const T: usize> Fit<T> {
    /// The pixels as the oracle takes them.
    pub fn rows(&self) -> Vec<Row> {
        let pixels = self.pixels.iter();
        pixels
            .map(|p| Row::from_f32(&p.z, &p.y, p.weight))
            .collect()
    }

    /// The oracle's solution.
    pub fn batch(&self) -> BatchFit {
        BatchFit::new(&self.rows(), &oracle::Prior::from_f32(&self.prior))
    }

    /// The largest radiance of the window, the unit of prediction errors; 1e-37 if all is black.
    pub fn largest_radiance(&self) -> f64 {
        let all = self.pixels.iter().flat_map(|pixel| pixel.y);
        all.fold(1e-37, |largest: f64, v| largest.max(f64::from(v.abs())))
    }

    /// The unit of the recursive fit's prediction error at one of its pixels: the largest radiance, times how much
    /// less than the heaviest pixel this one weighs (at most four decades), because rounding is relative to the rows
    /// `sqrt(w) (z, y)` that are fitted.
    pub fn prediction_unit(&self, pixel: &Pixel<T>) -> f64 {
        let heaviest = self
            .pixels
            .iter()
            .map(|p| f64::from(p.weight))
            .fold(0.0, f64::max);
        let lighter = (heaviest / f64::from(pixel.weight)).clamp(1.0, 1e4);
        self.largest_radiance() * lighter.sqrt()
    }
}

/// Fits on windows of every radius from 1 pixel to 19 x 19, rings in order or pixels shuffled, some pixels missing.
pub fn fits<const T: usize>() -> impl Strategy<Value = Fit<T>> {
    (
        0usize..=9,
        proptest::collection::vec(within_one(), T - 1),
        select(&RADIANCES[..]),
        select(&WEIGHTS[..]),
        (any::<bool>(), select(&[0.0, 0.0, 0.3, 0.98][..])),
        (-3.0f32..1.0, -3.0f32..1.0),
        any::<u64>(),
    )
        .prop_map(
            |(radius, features, radiance, weights, order, strengths, seed)| {
                let mut random = Random::new(seed);
                let offsets = chosen_offsets(radius, order, &mut random);
                let z = regressors::<T>(&offsets, &features, &mut random);
                let y = responses(&z, radiance, &mut random);
                let weights = pixel_weights(z.len(), weights, &mut random);
                let pixels = z.iter().zip(&y).zip(&weights);
                Fit {
                    pixels: pixels
                        .map(|((&z, &y), &weight)| Pixel { z, y, weight })
                        .collect(),
                    prior: Prior::at_centre(
                        &y[0],
                        10f32.powf(strengths.0),
                        10f32.powf(strengths.1),
                    ),
                }
            },
        )
}

/// The same fits with a forgetting factor, cut short where a tenth of the prior is left: without it collinear
/// features have no unique coefficients to compare.
pub fn fits_with_forgetting<const T: usize>() -> impl Strategy<Value = (Fit<T>, f32)> {
    let lambdas = select(&[1.0f32, 0.999, 0.98, 0.9][..]);
    (fits(), lambdas).prop_map(|(mut fit, lambda)| {
        if lambda < 1.0 {
            fit.pixels.truncate((0.1f32.ln() / lambda.ln()) as usize);
        }
        (fit, lambda)
    })
}

/// Any float at all, infinities and NaN among them.
pub fn any_bits() -> impl Strategy<Value = f32> {
    any::<u32>().prop_map(f32::from_bits)
}

/// Any finite float, all exponents alike.
pub fn any_finite() -> impl Strategy<Value = f32> {
    any_bits().prop_map(|v| {
        if v.is_finite() {
            v
        } else {
            f32::from_bits(v.to_bits() ^ (1 << 30))
        }
    })
}

fn chosen_offsets(radius: usize, order: (bool, f64), random: &mut Random) -> Vec<(i32, i32)> {
    let (shuffled, missing) = order;
    let mut offsets = ring_order()[..pixels_within(radius)].to_vec();
    if shuffled {
        for last in (1..offsets.len()).rev() {
            offsets.swap(last, random.below(last + 1));
        }
    }
    let mut first = true;
    offsets.retain(|_| std::mem::take(&mut first) || random.uniform() >= missing);
    offsets
}

fn regressors<const T: usize>(
    offsets: &[(i32, i32)],
    features: &[Feature],
    random: &mut Random,
) -> Vec<[f32; T]> {
    let mut z = vec![[1.0; T]; offsets.len()];
    for (column, &feature) in features.iter().enumerate() {
        let odd_one = random.below(offsets.len());
        for (i, &(x, y)) in offsets.iter().enumerate() {
            let before = z[i][column];
            let place = Place {
                x: x as f32 / RADIUS as f32,
                y: y as f32 / RADIUS as f32,
                is_odd: i == odd_one,
            };
            z[i][column + 1] = feature.value(place, before, random);
        }
    }
    z
}

fn responses<const T: usize>(
    z: &[[f32; T]],
    radiance: Radiance,
    random: &mut Random,
) -> Vec<[f32; 3]> {
    let slopes: [[f32; 3]; T] = [[(); 3]; T].map(|term| term.map(|()| random.normal() as f32));
    let brightest = random.below(z.len());
    let mut y = Vec::with_capacity(z.len());
    for (i, z) in z.iter().enumerate() {
        y.push([0, 1, 2].map(|c| {
            let noise = random.normal() as f32;
            let affine: f32 = (0..T).map(|j| slopes[j][c] * z[j]).sum();
            match radiance {
                Radiance::Affine => affine + 0.1 * noise,
                Radiance::Noise => 1.0 + noise,
                Radiance::Firefly if i == brightest => 1e6,
                Radiance::Firefly => 1.0 + noise,
                Radiance::Black => 0.0f32.copysign(noise),
                Radiance::Tiny => 1e-30 * noise,
                Radiance::Huge => 1e30 * noise,
            }
        }));
    }
    y
}

fn pixel_weights(count: usize, weights: Weights, random: &mut Random) -> Vec<f32> {
    let certain = random.below(count);
    (0..count)
        .map(|i| match weights {
            Weights::Equal => 1.0,
            Weights::Spread => 10f64.powf(4.0 * random.uniform() - 2.0) as f32,
            Weights::WorthlessPixels if random.uniform() < 0.3 => 1e-20,
            Weights::OneCertain if i == certain => 1e4,
            Weights::WorthlessPixels | Weights::OneCertain => 1.0,
        })
        .collect()
}
