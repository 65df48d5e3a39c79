//! Light that follows what no normal, albedo or depth shows is predicted from a further feature, whatever that is.

use linpred::{
    Error, FURTHER, Feature, ImageSize, InputRow, Params, Quality, RowLayout, VarianceKind,
};
use linpred_tests::frames::{Frame, Output};
use linpred_tests::images::noise;

const SIDE: usize = 76;

/// How a further feature comes.
#[derive(Clone, Copy, PartialEq)]
enum Noise {
    /// Without, and so it is stated.
    None,
    /// With noise, and what its variance is.
    Stated,
    /// With noise that nothing tells of.
    Untold,
}

/// Uniform noise of mean 0 and variance 1.
fn uniform(stream: u32, x: usize, y: usize) -> f32 {
    12f32.sqrt() * (noise(stream, y * 4096 + x) - 0.5)
}

/// A pattern that is neither smooth nor straight, from 0 to 1.
fn pattern(x: usize, y: usize) -> f32 {
    let (u, v) = (x as f32, y as f32);
    (0.5 + 0.5 * ((0.05 * u * u + 1.1 * v).sin() * (0.9 * u - 0.03 * v * v).cos())).round() * 0.5
        + 0.25 * (1.0 + (0.8 * u).sin())
}

/// A wall whose light is that of `pattern`; its normal is the same everywhere. With `channels` of further features, the first of which is the pattern.
fn wall(channels: &[usize], kind: Noise) -> Frame {
    let size = ImageSize::new(SIDE, SIDE).unwrap();
    let mut layout = RowLayout::new(size, VarianceKind::OfMean).with_feature(Feature::Normal);
    for channels in channels {
        layout = match kind {
            Noise::None | Noise::Stated => layout.with_further_feature_and_variance(*channels),
            Noise::Untold => layout.with_further_feature(*channels),
        }
        .unwrap();
    }
    let mut frame = Frame {
        layout,
        rows: vec![InputRow::new(&layout); SIDE],
        truth: Vec::new(),
    };
    let deviation = if kind == Noise::None { 0.0 } else { 0.1 };
    for (y, row) in frame.rows.iter_mut().enumerate() {
        row.features[2].fill(1.0);
        for x in 0..SIDE {
            let truth = 0.2 + 0.8 * pattern(x, y);
            frame.truth.push([truth; 3]);
            for c in 0..3 {
                row.colour[c][x] = truth + 0.3 * truth * uniform(c as u32, x, y);
                row.variance[c][x] = (0.3 * truth).powi(2);
            }
            for k in layout.further_features().flatten() {
                let mean = if k == 7 { pattern(x, y) } else { 0.0 };
                row.features[k][x] = mean + deviation * uniform(10 + k as u32, x, y);
                if kind == Noise::Stated {
                    row.feature_variances[k][x] = deviation * deviation;
                }
            }
        }
    }
    frame
}

fn params() -> Params {
    Params::new(Quality::Balanced)
}

/// Mean squared error of the first channel.
fn error(frame: &Frame, output: &Output) -> f64 {
    let pixels = output.colours().into_iter().zip(&frame.truth);
    let squares = pixels.map(|(own, truth)| f64::from(own[0] - truth[0]).powi(2));
    squares.sum::<f64>() / frame.truth.len() as f64
}

fn error_of(channels: &[usize], kind: Noise) -> f64 {
    let frame = wall(channels, kind);
    error(&frame, &frame.denoise(params()))
}

#[test]
fn a_feature_that_the_light_follows_takes_most_of_the_error_away() {
    let without = error_of(&[], Noise::None);
    for channels in [1, 2, 3] {
        let with = error_of(&[channels], Noise::None);
        assert!(with < 0.25 * without, "{channels}: {with} of {without}");
    }
}

#[test]
fn a_noisy_feature_is_filtered_before_anything_is_fitted_to_it() {
    let without = error_of(&[], Noise::None);
    // the pattern is hardly coarser than noise: what is untold is thought to be more than there is
    for (kind, part) in [(Noise::Stated, 0.3), (Noise::Untold, 0.75)] {
        let with = error_of(&[1], kind);
        assert!(with < part * without, "{with} of {without}");
    }
    // told of as exact, its noise is printed into the picture
    let mut frame = wall(&[1], Noise::Stated);
    let known = error(&frame, &frame.denoise(params()));
    for row in &mut frame.rows {
        row.feature_variances[7].fill(0.0);
    }
    let printed = error(&frame, &frame.denoise(params()));
    assert!(known < printed, "{known} {printed}");
}

#[test]
fn features_that_say_nothing_cost_little() {
    let alone = error_of(&[1], Noise::Stated);
    let beside = error_of(&[1, 3, 2], Noise::Stated);
    assert!(beside < 1.2 * alone, "{beside} {alone}");
}

#[test]
fn a_constant_feature_changes_no_pixel() {
    let mut frame = wall(&[1], Noise::None);
    for row in &mut frame.rows {
        row.features[7].fill(3.0);
    }
    let (with, without) = (
        frame.denoise(params()),
        wall(&[], Noise::None).denoise(params()),
    );
    // wider tiles add the same numbers up, and zeros beside them
    for (with, without) in with.colours().iter().zip(without.colours()) {
        assert!(
            (with[0] - without[0]).abs() <= 1e-5 * without[0].abs(),
            "{with:?} {without:?}"
        );
    }
}

#[test]
fn threads_change_no_bit() {
    let mut frame = wall(&[2, 1], Noise::Untold);
    let output = frame.denoise(params());
    for threads in [2, 5] {
        assert!(frame.denoise_on(threads, params()).all_bits() == output.all_bits());
    }
    // and every channel counts
    frame.rows[SIDE - 1].features[8].fill(7.0);
    let changed = frame.denoise(params());
    assert!(changed.all_bits() != output.all_bits());
}

#[test]
fn a_feature_that_is_not_finite_does_no_harm() {
    let frame = wall(&[3], Noise::Stated);
    let clean = error(&frame, &frame.denoise(params()));
    let values = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e10, f32::MAX];
    let mut holes = frame.clone();
    for (n, value) in values.into_iter().enumerate() {
        let row = &mut holes.rows[7 * n + 5];
        row.features[7][11 + n] = value;
        row.features[9][30 + n] = value;
        row.feature_variances[8][50] = value;
    }
    let output = holes.denoise(params());
    assert!(output.is_finite());
    let with = error(&frame, &output);
    assert!(with < 1.1 * clean, "{with} {clean}");
}

#[test]
fn what_lies_beyond_the_scene_is_endlessly_far_and_no_noise() {
    let mut endless = wall(&[3], Noise::Untold);
    let mut zero = endless.clone();
    for (a, b) in endless.rows.iter_mut().zip(&mut zero.rows) {
        for k in 7..10 {
            a.features[k][..30].fill([1e10, f32::INFINITY, -2e9][k - 7]);
            b.features[k][..30].fill(0.0);
        }
    }
    assert!(endless.denoise(params()).all_bits() == zero.denoise(params()).all_bits());
}

#[test]
fn more_channels_than_there_is_room_for_are_refused() {
    let size = ImageSize::new(4, 4).unwrap();
    let layout = RowLayout::new(size, VarianceKind::OfMean);
    let full = layout
        .with_further_feature(3)
        .unwrap()
        .with_further_feature(3)
        .unwrap();
    assert_eq!(full.further_features().flatten().count(), FURTHER);
    for refused in [
        full.with_further_feature(1),
        layout.with_further_feature(0),
        layout.with_further_feature(4),
    ] {
        assert!(matches!(refused, Err(Error::Usage(_))), "{refused:?}");
    }
}
