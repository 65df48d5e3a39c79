//! What the stages after the blend promise of a whole frame: no specks, no light below 0 that was not there, and the light that came in.

use linpred::VarianceKind;
use linpred_core::{Params, Quality};
use linpred_tests::frames::{Frame, Output, Scene, sampled};
use linpred_tests::images::exponential;
use linpred_tests::tolerance::FRAME_ENERGY;

const QUALITIES: [Quality; 3] = [Quality::Fast, Quality::Balanced, Quality::High];

/// A frame under noise as strong as its light, of which pixels now and then came out all but black or ten times as bright.
fn rough(seed: u32) -> Frame {
    let mut frame = Scene {
        noise: 0.8,
        seed,
        ..Scene::new(83, 61)
    }
    .render();
    for (i, y) in (0..400).map(|i| (i, (i * 31) % 61)) {
        let row = &mut frame.rows[y];
        let (x, factor) = ((i * 53) % 83, if i % 2 == 0 { 0.01 } else { 10.0 });
        for plane in &mut row.colour {
            plane[x] = plane[x].abs() * factor;
        }
    }
    frame
}

/// Mean of the channels at (x, y).
fn level(output: &Output, x: usize, y: usize) -> f32 {
    output.rows[y]
        .colour
        .iter()
        .map(|plane| plane[x])
        .sum::<f32>()
        / 3.0
}

#[test]
fn no_pixel_is_below_a_quarter_of_its_whole_neighbourhood() {
    for (seed, quality) in (0..4).flat_map(|seed| QUALITIES.map(|quality| (seed, quality))) {
        let output = rough(seed).denoise(Params::new(quality));
        for (x, y) in (1..60).flat_map(|y| (1..82).map(move |x| (x, y))) {
            let around = (y - 1..=y + 1).flat_map(|j| (x - 1..=x + 1).map(move |i| (i, j)));
            let around = around.filter(|at| *at != (x, y));
            let darkest = around
                .map(|(i, j)| level(&output, i, j))
                .fold(f32::INFINITY, f32::min);
            let own = level(&output, x, y);
            assert!(
                darkest <= 0.0 || own >= 0.25 * darkest,
                "{quality:?} {x} {y}: {own} among {darkest}"
            );
        }
    }
}

#[test]
fn what_the_blend_leaves_positive_stays_so() {
    let mut frame = rough(1);
    for row in &mut frame.rows {
        for plane in &mut row.colour {
            plane.iter_mut().for_each(|v| *v = v.abs() + 0.5);
        }
    }
    let output = frame.denoise(Params::default());
    assert!(output.colours().as_flattened().iter().all(|v| *v >= 0.0));
}

/// Mean of a frame's radiance.
fn energy(pixels: impl Iterator<Item = [f32; 3]>) -> f64 {
    pixels.flatten().map(f64::from).sum()
}

#[test]
fn the_light_that_came_in_goes_out() {
    for seed in 0..4 {
        let frame = rough(seed);
        let came = frame.rows.iter().flat_map(|row| &row.colour).flatten();
        let came: f64 = came.copied().map(f64::from).sum();
        for quality in QUALITIES {
            let output = frame.denoise(Params::new(quality));
            let share = energy(output.colours().into_iter()) / came;
            assert!(FRAME_ENERGY.contains(&share), "{quality:?}: {share}");
        }
    }
}

/// A pixel whose channels nearly cancel has a level of nothing; scaled to its neighbours' it was 800 times as bright as any.
#[test]
fn channels_that_cancel_are_no_speck() {
    for (seed, quality) in (0..4).flat_map(|seed| QUALITIES.map(|quality| (seed, quality))) {
        let mut frame = rough(seed);
        let mut largest = 0.0f32;
        for row in &mut frame.rows {
            for value in row.colour.iter_mut().flatten() {
                *value -= 0.3;
                largest = largest.max(value.abs());
            }
        }
        let output = frame.denoise(Params::new(quality));
        for value in output.colours().as_flattened() {
            assert!(value.abs() <= largest, "{quality:?}: {value} of {largest}");
        }
    }
}

/// Beside a bright strip on a dark wall the light given back must not end in a step.
#[test]
fn no_square_of_light_ends_beside_a_bright_strip() {
    let strip = |y: usize| (40..43).contains(&y);
    let frame = sampled(90, VarianceKind::OfMean, 4, |x, y, i| {
        let light = if strip(y) { 5.0 } else { 0.02 };
        light * exponential(i as u32, y * 90 + x)
    });
    let output = frame.denoise(Params::new(Quality::High));
    let mean = |y: usize| (20..70).map(|x| level(&output, x, y)).sum::<f32>() / 50.0;
    for y in (50..65).chain(18..32) {
        let step = mean(y + 1) / mean(y) - 1.0;
        assert!(step.abs() < 0.05, "from row {y} to the next: {step}");
    }
}
