//! Where the truth is in the input, it is in the output.

use linpred_core::{
    CELL, Params, PixelState, Predictions, Quality, Scratch, TILE, TILE_FEATURES, Tile,
    denoise_cell,
};
use linpred_tests::frames::{Frame, Scene};
use linpred_tests::tolerance::{AFFINE_FRAME, SHRUNK_AFFINE_FRAME, WITHIN_ERROR, close};

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

/// Pixels of the frame as a tile, their features as they came.
fn tile(frame: &Frame) -> Box<Tile<TILE_FEATURES>> {
    let mut tile = Box::new(Tile::EMPTY);
    for (i, pixel) in tile.pixels.iter_mut().enumerate() {
        let (x, y) = (i % TILE, i / TILE);
        let row = &frame.rows[y + 4];
        let column = x + 4;
        (pixel.features[0], pixel.features[1]) = (x as f32, y as f32);
        for (own, plane) in pixel.features[2..].iter_mut().zip(&row.features) {
            *own = plane[column];
        }
        pixel.colour = row.colour.each_ref().map(|plane| plane[column]);
        pixel.variance = row.variance.iter().map(|plane| plane[column]).sum();
        (pixel.weight, pixel.tolerance) = (0.25, pixel.variance);
        pixel.state = PixelState::Noisy;
    }
    tile
}

#[test]
fn models_predict_an_affine_function_of_the_features_whatever_noise_is_stated() {
    for deviation in [0.01, 0.3, 1.0] {
        let tile = tile(&affine(deviation));
        let pulled = Params::new(Quality::Balanced);
        let free = pulled
            .with_gradient_strength(0.0)
            .with_intercept_strength(0.0);
        for (params, tolerance) in [(free, AFFINE_FRAME), (pulled, SHRUNK_AFFINE_FRAME)] {
            let mut predictions = Box::new(Predictions::NONE);
            let mut scratch = Box::new(Scratch::<TILE_FEATURES, 1>::new());
            denoise_cell(&tile, &params, &mut [], &mut scratch, &mut predictions);
            let colours = || tile.pixels.iter().map(|pixel| pixel.colour);
            let brightest = colours().flatten().fold(0.0f32, f32::max);
            let mut predicted = 0;
            for (sum, colour) in predictions.sums.iter().zip(colours()) {
                predicted += usize::from(sum.confidence > 0.0);
                for (ours, exact) in sum.colour.iter().zip(colour) {
                    let error = (ours - exact * sum.confidence) / brightest;
                    let allowed = tolerance * f64::from(sum.confidence);
                    assert!(
                        close(f64::from(error), 0.0, allowed),
                        "{deviation}: {error}"
                    );
                }
            }
            assert!(predicted >= CELL * CELL);
        }
    }
}

/// What is smoothed after the blend is no more than what the models may be off by.
#[test]
fn an_affine_function_of_the_features_stays_itself_within_its_stated_error() {
    for deviation in [0.01, 0.3, 1.0] {
        let frame = affine(deviation);
        let output = frame.denoise(Params::new(Quality::Balanced));
        for (row, denoised) in frame.rows.iter().zip(&output.rows) {
            for (y, z) in row.colour.iter().zip(&denoised.colour) {
                for ((y, z), error) in y.iter().zip(z).zip(&denoised.error) {
                    let off = (z - y).abs() / error.sqrt();
                    assert!(off <= WITHIN_ERROR, "{deviation}: {y} {z} {error}");
                }
            }
        }
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
        Params::wlr(),
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
