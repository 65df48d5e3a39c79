//! The light of a noisy image is that of the denoised one, however its noise is distributed, and what the features do not show stays.

use linpred::VarianceKind;
use linpred_core::{Params, Quality};
use linpred_tests::frames::{Frame, Output, sampled, scenes};
use linpred_tests::images::{exponential, noise};
use linpred_tests::tolerance::{LAMP, MEAN_ERRORS, MEAN_SHARE};
use proptest::prelude::{Just, ProptestConfig, Strategy, any, prop_assert, prop_oneof, proptest};
use proptest::sample::select;

const SIDE: usize = 64;

/// How samples of mean 1 are distributed: as those of light that paths seldom find.
#[derive(Clone, Copy, Debug)]
enum Skew {
    /// Found or not, with this chance.
    Sparse(f32),
    /// A normal number's exponential, with this standard deviation of the number.
    LogNormal(f32),
    /// Products of directions and distances.
    Exponential,
}

impl Skew {
    /// Sample `i` of a pixel.
    fn sample(self, seed: u32, (x, y): (usize, usize), i: usize) -> f32 {
        let uniform = |k: usize| noise(seed + (16 * i + k) as u32, y * SIDE + x);
        match self {
            Self::Sparse(chance) => f32::from(u8::from(uniform(0) < chance)) / chance,
            Self::LogNormal(deviation) => {
                let normal = (0..12).map(uniform).sum::<f32>() - 6.0;
                (deviation * normal - deviation * deviation / 2.0).exp()
            }
            Self::Exponential => exponential(seed + 16 * i as u32, y * SIDE + x),
        }
    }
}

fn skews() -> impl Strategy<Value = Skew> {
    prop_oneof![
        (0.05f32..0.5).prop_map(Skew::Sparse),
        (0.3f32..1.2).prop_map(Skew::LogNormal),
        Just(Skew::Exponential),
    ]
}

/// A wall whose light grows from left to right, and a faint constant that every sample finds.
fn wall(skew: Skew, samples: usize, seed: u32, faint: f32) -> Frame {
    sampled(SIDE, VarianceKind::OfMean, samples, |x, y, i| {
        let light = 0.5 + x as f32 / SIDE as f32;
        light * (faint + (1.0 - faint) * skew.sample(seed, (x, y), i))
    })
}

/// Mean radiance that came in, and its standard deviation by the variances that came with it.
fn mean_in(frame: &Frame) -> (f64, f64) {
    let pixels = (3 * frame.width() * frame.height()) as f64;
    let sum = |planes: &dyn Fn(usize) -> f64| (0..frame.height()).map(planes).sum::<f64>();
    let plane = |plane: &Vec<f32>| plane.iter().copied().map(f64::from).sum::<f64>();
    let light = sum(&|y| frame.rows[y].colour.iter().map(plane).sum());
    let variance = sum(&|y| frame.rows[y].variance.iter().map(plane).sum());
    // The channels are equal.
    (light / pixels, (3.0 * variance).sqrt() / pixels)
}

fn mean_out(output: &Output) -> f64 {
    let colours = output.colours();
    let values = colours.as_flattened();
    values.iter().copied().map(f64::from).sum::<f64>() / values.len() as f64
}

const QUALITIES: [Quality; 3] = [Quality::Fast, Quality::Balanced, Quality::High];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn of_skewed_noise_within_what_the_mean_may_be_off(
        skew in skews(),
        samples in 4usize..17,
        seed in any::<u16>(),
        faint in 0.05f32..0.5,
        quality in select(&QUALITIES[..]),
    ) {
        let frame = wall(skew, samples, 1000 * u32::from(seed), faint);
        let (came, deviation) = mean_in(&frame);
        let went = mean_out(&frame.denoise(Params::new(quality)));
        let allowed = MEAN_ERRORS * deviation + MEAN_SHARE * came;
        prop_assert!((went - came).abs() <= allowed, "{} of {}, which may be off by {}", went, came, deviation);
    }

    #[test]
    fn and_what_was_nowhere_negative_stays_so(scene in scenes(), quality in select(&QUALITIES[..])) {
        let mut frame = scene.render();
        for row in &mut frame.rows {
            row.colour.iter_mut().flatten().for_each(|v| *v = v.abs());
        }
        let output = frame.denoise(Params::new(quality));
        prop_assert!(output.colours().as_flattened().iter().all(|v| *v >= 0.0));
    }
}

#[test]
fn in_a_small_lamp_that_no_feature_shows() {
    for (side, quality) in [4, 6, 12]
        .into_iter()
        .flat_map(|side| QUALITIES.map(|q| (side, q)))
    {
        for skew in [Skew::Exponential, Skew::LogNormal(1.0)] {
            let within =
                |x: usize, y: usize| (20..20 + side).contains(&x) && (30..30 + side).contains(&y);
            let frame = sampled(SIDE, VarianceKind::OfMean, 64, |x, y, i| {
                let light = if within(x, y) { 3.9 } else { 0.4 };
                light * skew.sample(7, (x, y), i)
            });
            let output = frame.denoise(Params::new(quality));
            let pixels = output.colours();
            let lamp = (0..SIDE * SIDE)
                .filter(|i| within(i % SIDE, i / SIDE))
                .map(|i| pixels[i][1]);
            let mean = lamp.sum::<f32>() / (side * side) as f32;
            assert!(
                (mean / 3.9 - 1.0).abs() <= LAMP,
                "{quality:?} {side} {skew:?}: {mean}"
            );
        }
    }
}
