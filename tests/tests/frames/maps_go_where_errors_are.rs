//! A map of samples gives each pixel what its error demands, and all of them together the budget.

use std::num::NonZeroUsize;
use std::ops::ControlFlow;

use linpred::sampling::{Goal, MeasuredRow, Measurement, SampleMap, Scratch, measure};
use linpred::{Error, ImageSize, InputRow, Options, RowLayout, RowSource, Sampler};
use linpred_core::{Params, Quality};
use linpred_tests::frames::{AnyRow, Frame, Scene, scenes};
use linpred_tests::images::noise;
use linpred_tests::tolerance::PREDICTED_ERROR;
use proptest::prelude::*;

/// A frame that says how many samples its pixels have, and insists on being read from the top to the bottom.
struct Sampled<'a> {
    frame: &'a Frame,
    samples: fn(usize, usize) -> f32,
    next: usize,
}

impl RowSource for Sampled<'_> {
    fn layout(&self) -> RowLayout {
        self.frame.layout.with_samples()
    }

    fn read_row(&mut self, y: usize, row: &mut InputRow) -> Result<(), Error> {
        assert_eq!(y, self.next % self.frame.height());
        self.next += 1;
        let mut samples = std::mem::take(&mut row.samples);
        for (x, own) in samples.iter_mut().enumerate() {
            *own = (self.samples)(x, y);
        }
        row.clone_from(&self.frame.rows[y]);
        row.samples = samples;
        Ok(())
    }
}

fn measured(frame: &Frame, samples: fn(usize, usize) -> f32, threads: usize) -> Measurement {
    let mut source = Sampled {
        frame,
        samples,
        next: 0,
    };
    let threads = NonZeroUsize::new(threads).unwrap();
    let options = Options::for_sampling().with_threads(threads);
    let progress = &mut |_| ControlFlow::Continue(());
    measure(&mut source, &options, &Scratch::Memory, progress).unwrap()
}

/// The samples of a map, row after row.
fn samples(map: &mut SampleMap) -> Vec<u32> {
    let (width, height) = (map.size().width(), map.size().height());
    let mut all = vec![0; width * height];
    for (y, row) in all.chunks_exact_mut(width).enumerate() {
        map.read_row(y, row).unwrap();
    }
    all
}

fn four(_: usize, _: usize) -> f32 {
    4.0
}

/// None, one, many, and what is no number.
fn uneven(x: usize, y: usize) -> f32 {
    [0.0, 1.0, 2.0, 4.0, 64.0, f32::NAN, -3.0][(x + 3 * y) % 7]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn a_budget_is_spent_to_the_last_sample(scene in scenes(), budget in 0.01f64..40.0, even in any::<bool>()) {
        let frame = scene.render();
        let mut measured = measured(&frame, if even { four } else { uneven }, 1);
        let mut map = measured.plan(Goal::budget(budget)?)?;
        let pixels = (frame.width() * frame.height()) as f64;
        let given: u64 = samples(&mut map).into_iter().map(u64::from).sum();
        let wanted = ((budget * pixels).round() as u64).max(1);
        prop_assert_eq!((given, map.summary().added), (wanted, wanted));
        prop_assert_eq!(u64::from(samples(&mut map).into_iter().max().unwrap()), u64::from(map.summary().most));
    }
}

#[test]
fn threads_change_no_sample() {
    let frame = Scene::new(90, 70).render();
    let map = |threads| {
        let mut map = measured(&frame, uneven, threads).plan(Goal::budget(3.3).unwrap());
        samples(map.as_mut().unwrap())
    };
    let one = map(1);
    assert!(one == map(2) && one == map(5));
}

#[test]
fn maps_of_other_passes_round_other_pixels_up() {
    let mut frame = Scene::new(60, 40).render();
    frame.calm(0..60, 0..40);
    let map = |counts: fn(usize, usize) -> f32| {
        let mut map = measured(&frame, counts, 1).plan(Goal::budget(0.5).unwrap());
        samples(map.as_mut().unwrap())
    };
    // all get half a sample, so that the hash alone decides
    let (first, second) = (map(|_, _| 4.0), map(|_, _| 5.0));
    let both = first
        .iter()
        .zip(&second)
        .filter(|(a, b)| **a > 0 && **b > 0);
    let share = both.count() as f64 / first.iter().filter(|n| **n > 0).count() as f64;
    assert!((0.45..0.55).contains(&share), "{share}");
}

#[test]
fn where_nothing_is_noisy_nothing_is_given() {
    let mut frame = Scene::new(90, 70).render();
    frame.calm(0..45, 0..70);
    let mut map = measured(&frame, four, 1)
        .plan(Goal::budget(8.0).unwrap())
        .unwrap();
    let given = samples(&mut map);
    let left = (0..70).flat_map(|y| given[90 * y..90 * y + 30].iter());
    assert_eq!(left.copied().max(), Some(0));
    let right = (0..70).flat_map(|y| given[90 * y + 50..90 * (y + 1)].iter());
    assert!(right.copied().min().unwrap() > 0);
}

/// None in a square of 12 x 12.
fn with_a_hole(x: usize, y: usize) -> f32 {
    let inside = (40..52).contains(&x) && (30..42).contains(&y);
    if inside { 0.0 } else { 4.0 }
}

/// The mean of a map over the innermost 4 x 4 of them.
fn mean_within(given: &[u32]) -> f64 {
    let rows = (34..38).map(|y| &given[90 * y + 44..90 * y + 48]);
    rows.flatten().copied().map(f64::from).sum::<f64>() / 16.0
}

#[test]
fn pixels_without_samples_get_their_share() {
    let mut frame = Scene::new(90, 70).render();
    for (y, row) in frame.rows.iter_mut().enumerate() {
        for x in (0..90).filter(|x| with_a_hole(*x, y) == 0.0) {
            let planes = row.colour.iter_mut().chain(&mut row.variance);
            let planes = planes.chain(&mut row.features);
            planes
                .chain(&mut row.feature_variances)
                // a feature that the frame lacks has no columns
                .filter_map(|plane| plane.get_mut(x))
                .for_each(|value| *value = 0.0);
        }
    }
    let mut map = measured(&frame, with_a_hole, 1)
        .plan(Goal::budget(8.0).unwrap())
        .unwrap();
    // 12 are there in all, on average
    let hole = mean_within(&samples(&mut map));
    assert!(hole > 6.0, "{hole}");
}

#[test]
fn an_image_without_noise_gets_the_budget_evenly() {
    let mut frame = Scene::new(30, 20).render();
    frame.calm(0..30, 0..20);
    let mut map = measured(&frame, four, 1)
        .plan(Goal::budget(2.5).unwrap())
        .unwrap();
    let given = samples(&mut map);
    assert!(given.iter().all(|n| (2..=3).contains(n)));
    assert_eq!(given.iter().sum::<u32>(), 30 * 20 * 5 / 2);
}

/// By sorting, and over the whole image at once: what `share` a pixel should have.
fn shares(size: (usize, usize), planes: &[Vec<f64>; 3], budget: f64) -> Vec<f64> {
    let (width, height) = size;
    let sampler = Sampler::default();
    let cut = |errors: &[f64]| -> Vec<f64> {
        let mut sorted: Vec<f64> = errors.iter().copied().filter(|e| *e > 0.0).collect();
        sorted.sort_by(f64::total_cmp);
        let place = 0.99 * (sorted.len() - 1) as f64;
        let (low, high) = (
            sorted[place.floor() as usize],
            sorted[place.ceil() as usize],
        );
        let ceiling = low + (high - low) * place.fract();
        errors.iter().map(|error| error.min(ceiling)).collect()
    };
    let around = |x: usize, y: usize, radius: usize| {
        let columns = x.saturating_sub(radius)..width.min(x + radius + 1);
        let rows = y.saturating_sub(radius)..height.min(y + radius + 1);
        let places = rows.flat_map(move |y| columns.clone().map(move |x| y * width + x));
        places.collect::<Vec<usize>>()
    };
    let [claimed, seen, samples] = planes;
    let (claimed, seen) = (cut(claimed), cut(seen));
    let some: Vec<usize> = (0..samples.len()).filter(|i| samples[*i] > 0.0).collect();
    let mean =
        |of: &dyn Fn(usize) -> f64| some.iter().map(|i| of(*i)).sum::<f64>() / some.len() as f64;
    let usual = mean(&|i| samples[i]);
    let usual_error = mean(&|i| (claimed[i] * seen[i]).sqrt());
    let demand = |x: usize, y: usize| {
        let near = around(x, y, 2);
        let mean = |of: &[f64]| near.iter().map(|i| of[*i]).sum::<f64>() / near.len() as f64;
        let noisy = around(x, y, 1).iter().any(|i| claimed[*i] > 0.0);
        let error = (mean(&claimed) * mean(&seen)).sqrt();
        let own = samples[y * width + x];
        noisy.then(|| match own > 0.0 {
            true => sampler.demand(error, own),
            false => sampler.demand(error.max(usual_error), usual),
        })
    };
    let demands: Vec<Option<f64>> = (0..height)
        .flat_map(|y| (0..width).map(move |x| (x, y)))
        .map(|(x, y)| demand(x, y))
        .collect();
    let noisy = demands.iter().flatten().count() as f64;
    let lacking = |level: f64| -> Vec<f64> {
        let pixels = demands.iter().zip(samples);
        pixels
            .map(|(w, n)| w.map_or(0.0, |w| (level * w - n).max(0.0)))
            .collect()
    };
    let (mut low, mut high) = (0.0, 1e9);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        match lacking(middle).iter().sum::<f64>() < 0.75 * budget {
            true => low = middle,
            false => high = middle,
        }
    }
    let even = demands
        .iter()
        .map(|w| w.map_or(0.0, |_| 0.25 * budget / noisy));
    lacking(low).iter().zip(even).map(|(a, b)| a + b).collect()
}

#[test]
fn every_pixel_gets_its_share_by_the_definition_rounded_up_or_down() {
    let size = (37, 23);
    let pixels = size.0 * size.1;
    let error = |seed: u32, i: usize| match i % size.0 > 25 {
        true => 0.0,
        false => f64::from(noise(seed, i).powi(6)) + 1e-4,
    };
    let claimed: Vec<f64> = (0..pixels).map(|i| error(1, i)).collect();
    let seen: Vec<f64> = (0..pixels).map(|i| error(2, i)).collect();
    let counts: Vec<f64> = (0..pixels)
        .map(|i| (noise(3, i) * 9.0).floor().into())
        .collect();
    // of a black image, whose errors are relative to 0.003 alone
    let mut measured = Measurement::new(ImageSize::new(size.0, size.1).unwrap(), Scratch::Memory);
    let float =
        |of: &[f64], scale: f64| -> Vec<f32> { of.iter().map(|v| (v * scale) as f32).collect() };
    let black = vec![0.0; size.0];
    for y in 0..size.1 {
        let own = size.0 * y..size.0 * (y + 1);
        let off: Vec<f32> = float(&seen[own.clone()], 0.003)
            .iter()
            .map(|v| v.sqrt())
            .collect();
        measured
            .push(&MeasuredRow {
                colour: [&black; 3],
                error: &float(&claimed[own.clone()], 0.003),
                second: Some([&off; 3]),
                samples: &float(&counts[own], 1.0),
            })
            .unwrap();
    }
    let budget = 6.0 * pixels as f64;
    let mut map = measured.plan(Goal::budget(6.0).unwrap()).unwrap();
    let shares = shares(size, &[claimed, seen, counts], budget);
    for (i, (given, share)) in samples(&mut map).into_iter().zip(shares).enumerate() {
        let off = f64::from(given) - share;
        assert!(
            off.abs() < 1.0 + 1e-3 * share,
            "pixel {i}: {given}, {share}"
        );
    }
}

#[test]
fn a_target_is_met_with_no_more_samples_than_it_takes() {
    let frame = Scene {
        noise: 1.0,
        ..Scene::new(90, 70)
    }
    .render();
    let mut measured = measured(&frame, four, 1);
    let now = measured
        .plan(Goal::budget(1.0).unwrap())
        .unwrap()
        .summary()
        .error;
    for part in [0.9, 0.5, 0.1] {
        let found = measured
            .plan(Goal::error(part * now).unwrap())
            .unwrap()
            .summary();
        assert!(found.error_then <= part * now, "{part}: {found:?}");
        let fewer = 0.97 * found.added as f64 / found.pixels as f64;
        let fewer = measured
            .plan(Goal::budget(fewer).unwrap())
            .unwrap()
            .summary();
        assert!(fewer.error_then > part * now, "{part}: {found:?} {fewer:?}");
    }
    let reached = measured
        .plan(Goal::error(1.01 * now).unwrap())
        .unwrap()
        .summary();
    assert_eq!((reached.added, reached.most), (0, 0));
    let limited = Goal::error(0.01 * now).unwrap().at_most(2.0).unwrap();
    assert_eq!(measured.plan(limited).unwrap().summary().added, 2 * 90 * 70);
}

#[test]
fn the_predicted_error_is_near_the_true_one() {
    for noise in [0.1, 0.3, 1.0] {
        for variances in [true, false] {
            let frame = Scene {
                noise,
                variances,
                ..Scene::new(90, 70)
            }
            .render();
            let predicted = measured(&frame, four, 1)
                .plan(Goal::budget(1.0).unwrap())
                .unwrap()
                .summary()
                .error;
            let clean = frame.denoise(Params::new(Quality::Fast)).colours();
            let error = |(ours, truth): (&[f32; 3], &[f32; 3])| {
                let squares = ours
                    .iter()
                    .zip(truth)
                    .map(|(a, b)| f64::from(a - b).powi(2));
                let light = truth.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>();
                squares.sum::<f64>() / (light + 3.0 * 0.003)
            };
            let errors = clean.iter().zip(&frame.truth).map(error);
            let ratio = predicted / (errors.sum::<f64>() / clean.len() as f64);
            assert!(
                PREDICTED_ERROR.contains(&ratio),
                "{noise} {variances}: {ratio}"
            );
        }
    }
}

#[test]
fn what_is_asked_in_vain_is_told() {
    for goal in [
        Goal::budget(0.0),
        Goal::budget(f64::NAN),
        Goal::budget(1e9),
        Goal::error(-1.0),
        Goal::error(f64::INFINITY),
        Goal::of(None, None),
    ] {
        assert!(matches!(goal, Err(Error::Usage(_))), "{goal:?}");
    }
    let mut none = Measurement::new(ImageSize::new(3, 2).unwrap(), Scratch::Memory);
    let error = none
        .plan(Goal::budget(1.0).unwrap())
        .unwrap_err()
        .to_string();
    assert!(error.contains("0 of the image's 2 rows"), "{error}");
    let mut frame = Scene::new(5, 4).render();
    let frame = linpred_tests::frames::Frame {
        truth: Vec::new(),
        rows: std::mem::take(&mut frame.rows),
        ..frame
    };
    let mut silent = AnyRow(&frame);
    let go_on = &mut |_| ControlFlow::Continue(());
    let error = measure(
        &mut silent,
        &Options::for_sampling(),
        &Scratch::Memory,
        go_on,
    )
    .unwrap_err();
    assert!(error.to_string().contains("how many samples"), "{error}");
}
