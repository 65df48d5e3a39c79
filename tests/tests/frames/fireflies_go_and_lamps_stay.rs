//! A pixel that one sample made far brighter than all around is predicted by its neighbours and counted; light that is there stays.

use linpred::VarianceKind;
use linpred_core::{Params, Quality};
use linpred_tests::frames::{Frame, Scene, sampled, scenes};
use linpred_tests::images::{self, noise};
use proptest::prelude::{ProptestConfig, any, prop_assert_eq, proptest};
use proptest::sample::select;

const SIDE: usize = 48;

fn exponential(x: usize, y: usize, i: usize) -> f32 {
    images::exponential(i as u32, y * SIDE + x)
}

/// A wall of radiance 1 under noise of standard deviation 0.25.
fn wall(variance: VarianceKind) -> Frame {
    sampled(SIDE, variance, 16, exponential)
}

const KINDS: [VarianceKind; 3] = [
    VarianceKind::OfMean,
    VarianceKind::OfHalves,
    VarianceKind::Estimated,
];

#[test]
fn a_lone_firefly_goes_and_is_counted() {
    for kind in KINDS {
        for value in [43.0, 1001.0, 1e6] {
            for quality in [Quality::Fast, Quality::High] {
                let mut frame = wall(kind);
                frame.add_firefly((24, 24), value);
                let output = frame.denoise(Params::new(quality));
                assert_eq!(output.report.counts.fireflies, 1);
                assert_eq!(output.report.counts.repaired, 0);
                let own = output.colours()[24 * SIDE + 24];
                assert!(
                    own.iter().all(|v| (v - 1.0).abs() < 0.5),
                    "{kind:?} {value}: {own:?}"
                );
            }
        }
    }
}

#[test]
fn in_a_picture_without_any_other_noise_too() {
    for kind in KINDS {
        let mut frame = sampled(SIDE, kind, 2, |_, _, _| 0.4);
        frame.add_firefly((24, 24), 43.0);
        let output = frame.denoise(Params::new(Quality::Balanced));
        assert_eq!(output.report.counts.fireflies, 1);
        let own = output.colours()[24 * SIDE + 24];
        assert!(own.iter().all(|v| (v - 0.4).abs() < 0.04), "{own:?}");
    }
}

#[test]
fn at_the_border_and_beside_a_pixel_that_is_not_a_number_too() {
    let last = SIDE - 1;
    for kind in KINDS {
        for (x, y) in [(0, 0), (last, 0), (0, last), (last, last), (0, 20), (30, 1)] {
            for beside in [false, true] {
                let mut frame = wall(kind);
                frame.add_firefly((x, y), 1001.0);
                if beside {
                    frame.rows[y].colour[1][x ^ 1] = f32::NAN;
                }
                let output = frame.denoise(Params::new(Quality::Fast));
                let counts = output.report.counts;
                assert_eq!(
                    (counts.fireflies, counts.repaired),
                    (1, u64::from(beside)),
                    "{x} {y}"
                );
                let own = output.colours()[y * SIDE + x];
                assert!(
                    own.iter().all(|v| (v - 1.0).abs() < 1.0),
                    "{kind:?} {x} {y}: {own:?}"
                );
            }
        }
    }
}

#[test]
fn two_side_by_side_go_where_their_variances_say_so() {
    for (kind, gone) in KINDS.into_iter().zip([2, 2, 0]) {
        for second in [(25, 24), (24, 25), (25, 25), (26, 23)] {
            let mut frame = wall(kind);
            frame.add_firefly((24, 24), 1001.0);
            frame.add_firefly(second, 700.0);
            let output = frame.denoise(Params::new(Quality::Fast));
            assert_eq!(output.report.counts.fireflies, gone, "{kind:?} {second:?}");
            let own = output.colours()[24 * SIDE + 24][0];
            assert!(gone == 0 || (own - 1.0).abs() < 1.0, "{own}");
        }
    }
}

/// Every sample finds the lamp, and is worth it within its noise.
fn lamp(radius: usize) -> Frame {
    sampled(SIDE, VarianceKind::OfMean, 64, |x, y, i| {
        let inside = x.abs_diff(24).max(y.abs_diff(24)) < radius;
        let radiance = if inside { 50.0 } else { 0.5 };
        radiance * exponential(x, y, i)
    })
}

#[test]
fn a_lamp_of_one_pixel_stays_where_its_variance_supports_it() {
    let frame = lamp(1);
    let output = frame.denoise(Params::new(Quality::Fast));
    assert_eq!(output.report.counts.fireflies, 0);
    let (came, goes) = (frame.rows[24].colour[0][24], output.rows[24].colour[0][24]);
    assert!((goes / came - 1.0).abs() < 0.1, "{goes} of {came}");
    // with the variance of a single sample it would have gone
    let mut firefly = frame;
    firefly.add_firefly((24, 24), came);
    assert_eq!(firefly.survey_on(1).counts.fireflies, 1);
}

#[test]
fn a_lamp_of_nine_pixels_stays() {
    for kind in KINDS {
        let mut frame = lamp(2);
        frame.layout.variance = kind;
        for y in 23..26 {
            for x in 23..26 {
                frame.add_firefly((x, y), 50.0);
            }
        }
        assert_eq!(frame.survey_on(1).counts.fireflies, 0, "{kind:?}");
    }
}

/// Of the light of pixels that a sample in `1 / p` finds, over an even one, what share is taken for fireflies.
fn share_of_light_taken(kind: VarianceKind, p: f32, even: f32) -> f64 {
    let frame = sampled(SIDE, kind, 4, |x, y, i| {
        let found = noise(i as u32 + 9, y * SIDE + x) < p;
        let strength = 0.5 + noise(i as u32 + 90, y * SIDE + x);
        even * exponential(x, y, i) + if found { strength / p } else { 0.0 }
    });
    let light = |x: usize, y: usize| f64::from(frame.rows[y].colour[0][x]);
    let places = (0..SIDE * SIDE).map(|i| (i % SIDE, i / SIDE));
    let fireflies = frame.fireflies();
    let (mut taken, mut all, mut count) = (0.0, 0.0, 0);
    for ((x, y), is_firefly) in places.zip(fireflies) {
        all += light(x, y);
        taken += if is_firefly { light(x, y) } else { 0.0 };
        count += u64::from(is_firefly);
    }
    assert_eq!(frame.survey_on(1).counts.fireflies, count);
    taken / all
}

#[test]
fn sparse_light_stays() {
    for kind in KINDS {
        for (p, even) in [
            (0.1, 0.0),
            (0.1, 0.01),
            (0.05, 0.0),
            (0.05, 0.01),
            (0.02, 0.0),
            (0.02, 0.01),
            (0.002, 0.0),
        ] {
            let share = share_of_light_taken(kind, p, even);
            assert!(share < 0.05, "{kind:?} {p} {even}: {share}");
        }
    }
}

#[test]
fn a_lone_pixel_in_the_dark_stays() {
    for kind in KINDS {
        for variance in [0.0, 25.0] {
            let mut frame = sampled(
                SIDE,
                kind,
                2,
                |x, y, _| {
                    if (x, y) == (24, 24) { 5.0 } else { 0.0 }
                },
            );
            if kind != VarianceKind::Estimated {
                let planes = frame.rows[24].variance.iter_mut();
                planes.for_each(|plane| plane[24] = variance);
            }
            assert_eq!(
                frame.survey_on(1).counts.fireflies,
                0,
                "{kind:?} {variance}"
            );
        }
    }
}

#[test]
fn the_papers_formulas_know_no_fireflies() {
    let mut frame = wall(VarianceKind::OfMean);
    frame.add_firefly((24, 24), 1001.0);
    for params in [Params::literal(), Params::wlr()] {
        let output = frame.denoise(params);
        assert_eq!(output.report.counts.fireflies, 0);
    }
}

/// A scene with spikes all over, of which many are nearly a firefly, and some pixels that are not numbers.
fn spiked(scene: Scene, spikes: u32) -> Frame {
    let mut frame = scene.render();
    let (width, height) = scene.size;
    for i in 0..width * height {
        let at = (i % width, i / width);
        let [chance, size, sort] = [70, 71, 72].map(|stream| noise(scene.seed + stream, i));
        if chance * 100.0 < spikes as f32 {
            frame.add_firefly(at, 10f32.powf(4.0 * size - 2.0));
            let row = &mut frame.rows[at.1];
            match (sort * 5.0) as u32 {
                0 => row.colour[1][at.0] = f32::INFINITY,
                1 => row.variance.iter_mut().for_each(|plane| plane[at.0] *= 0.1),
                _ => {}
            }
        }
    }
    frame
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn fireflies_are_those_of_the_definition(scene in scenes(), spikes in select(vec![1u32, 3, 10, 50])) {
        let frame = spiked(scene, spikes);
        let expected = frame.fireflies();
        let survey = frame.survey_on(1);
        prop_assert_eq!(survey.counts.fireflies, expected.iter().filter(|v| **v).count() as u64);
        let first = expected.iter().position(|v| *v);
        prop_assert_eq!(survey.first_firefly, first.map(|i| [i % scene.size.0, i / scene.size.0]));
    }

    #[test]
    fn exposure_by_a_power_of_two_changes_no_bit_around_them(seed in any::<u16>(), variances in any::<bool>(), power in -20i32..20) {
        let scene = Scene { seed: u32::from(seed), variances, ..Scene::new(40, 23) };
        let frame = spiked(scene, 3);
        let by = 2f32.powi(power);
        let mut exposed = frame.clone();
        for row in &mut exposed.rows {
            row.colour.iter_mut().flatten().for_each(|v| *v *= by);
            row.variance.iter_mut().flatten().for_each(|v| *v *= by * by);
        }
        let (plain, exposed) = [&frame, &exposed].map(|frame| frame.denoise(Params::new(Quality::Fast))).into();
        prop_assert_eq!(plain.report.counts, exposed.report.counts);
        for (plain, exposed) in plain.colours().iter().zip(exposed.colours()) {
            prop_assert_eq!(plain.map(|v| v * by), exposed);
        }
    }
}

/// Pixels of exactly 8 times what is around are none; added up in the order of the channels, some would seem brighter by rounding.
#[test]
fn the_order_of_the_channels_decides_nothing() {
    const ORDERS: [[usize; 3]; 6] = [
        [0, 1, 2],
        [0, 2, 1],
        [1, 0, 2],
        [1, 2, 0],
        [2, 0, 1],
        [2, 1, 0],
    ];
    for seed in 0..40 {
        let colour = [0, 1, 2].map(|c| noise(seed, c));
        for order in ORDERS {
            let mut frame = sampled(SIDE, VarianceKind::OfMean, 2, |_, _, _| 0.0);
            for (c, channel) in order.into_iter().enumerate() {
                for row in &mut frame.rows {
                    row.colour[c].fill(colour[c]);
                    row.variance[c].fill(1.0);
                }
                frame.rows[24].colour[c][24] = 8.0 * colour[channel];
                frame.rows[24].variance[c][24] = 64.0;
            }
            assert_eq!(frame.survey_on(1).counts.fireflies, 0, "{colour:?}");
        }
    }
}
