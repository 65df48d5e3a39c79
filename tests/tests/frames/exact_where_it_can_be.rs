//! Where the truth is in the input, it is in the output.

use linpred_core::{Params, Quality};
use linpred_tests::frames::{Frame, Scene};
use linpred_tests::tolerance::{AFFINE_FRAME, SHRUNK_AFFINE_FRAME, close};

/// An affine function of clean features, said to be as noisy as `deviation` times its radiance.
fn affine(deviation: f32) -> Frame {
    let mut frame = Scene {
        feature_noise: 0.0,
        noise: 0.0,
        ..Scene::new(67, 45)
    }
    .render();
    for row in &mut frame.rows {
        for x in 0..row.colour[0].len() {
            for c in 0..3 {
                let f = |k: usize| row.features[k][x];
                let y = 1.0 + 0.3 * f(0) - 0.2 * f(1) + 0.5 * f(3 + c) + 0.1 * f(6) + 0.2 * f(2);
                row.colour[c][x] = y;
                row.variance[c][x] = (deviation * y).powi(2);
            }
        }
    }
    frame
}

/// Largest error, relative to the brightest pixel.
fn largest_change(frame: &Frame, params: Params) -> f64 {
    let output = frame.denoise(params);
    let mut largest = 0.0f32;
    for (row, denoised) in frame.rows.iter().zip(&output.rows) {
        for (y, z) in row
            .colour
            .iter()
            .flatten()
            .zip(denoised.colour.iter().flatten())
        {
            assert!(z.is_finite());
            largest = largest.max((y - z).abs());
        }
    }
    let brightest = frame
        .rows
        .iter()
        .flat_map(|row| row.colour.iter().flatten());
    f64::from(largest / brightest.fold(0.0f32, |a, b| a.max(b.abs())))
}

#[test]
fn an_affine_function_of_the_features_stays_itself() {
    for deviation in [0.01, 0.3, 1.0] {
        let pulled = Params::new(Quality::Balanced);
        let free = pulled
            .with_gradient_strength(0.0)
            .with_intercept_strength(0.0);
        let (free, pulled) = (
            largest_change(&affine(deviation), free),
            largest_change(&affine(deviation), pulled),
        );
        assert!(close(free, 0.0, AFFINE_FRAME), "{deviation}: {free}");
        assert!(
            close(pulled, 0.0, SHRUNK_AFFINE_FRAME),
            "{deviation}: {pulled}"
        );
    }
}

#[test]
fn pixels_without_variance_among_such_pass_through_to_the_bit() {
    let mut frame = Scene {
        noise: 0.5,
        ..Scene::new(70, 50)
    }
    .render();
    let right = |x: usize, y: usize| (20..45).contains(&x) && (11..38).contains(&y);
    for (y, row) in frame.rows.iter_mut().enumerate() {
        for x in (0..70).filter(|&x| right(x, y)) {
            row.variance.iter_mut().for_each(|plane| plane[x] = 0.0);
        }
    }
    for params in [
        Params::new(Quality::Fast),
        Params::new(Quality::High),
        Params::literal(),
    ] {
        let output = frame.denoise(params);
        for (y, (row, denoised)) in frame.rows.iter().zip(&output.rows).enumerate() {
            for x in (0..70).filter(|&x| right(x, y)) {
                let inside = right(x - 1, y - 1) && right(x + 1, y + 1);
                for c in 0..3 {
                    let same = row.colour[c][x].to_bits() == denoised.colour[c][x].to_bits();
                    assert!(same || !inside, "{x} {y}");
                }
            }
        }
        assert_eq!(output.report.counts.passed_through, 23 * 25);
    }
}

#[test]
fn the_output_goes_to_the_input_as_the_variance_goes_to_0() {
    let noisy = Scene::new(57, 40).render();
    let mut last = f64::INFINITY;
    for exponent in 0..=8 {
        let mut frame = noisy.clone();
        let scale = 0.1f32.powi(exponent);
        for row in &mut frame.rows {
            row.variance.iter_mut().flatten().for_each(|v| *v *= scale);
        }
        let change = largest_change(&frame, Params::new(Quality::Balanced));
        assert!(change <= last, "{scale}: {change} after {last}");
        last = change;
    }
    assert!(last < 1e-3, "{last}");
}
