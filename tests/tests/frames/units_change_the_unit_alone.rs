//! The unit of an image and the order of its channels change those of the output, and nothing else.

use linpred::InputRow;
use linpred_core::{Params, Quality};
use linpred_tests::frames::{Frame, Output, Scene};
use linpred_tests::tolerance::{CHANNEL_ORDER, EXPOSURE, FEATURE_UNITS, close};

fn mapped(frame: &Frame, change: impl Fn(&mut InputRow)) -> Output {
    let mut frame = frame.clone();
    frame.rows.iter_mut().for_each(change);
    frame.denoise(Params::new(Quality::Balanced))
}

fn scale<'a>(planes: impl IntoIterator<Item = &'a mut Vec<f32>>, by: f32) {
    planes.into_iter().flatten().for_each(|v| *v *= by);
}

fn exposed(frame: &Frame, by: f32) -> Output {
    mapped(frame, |row| {
        scale(&mut row.colour, by);
        scale(&mut row.variance, by * by);
    })
}

/// Largest distance between `a * unit` and `b`, over the largest of the former.
fn distance(a: &Output, b: &Output, unit: f32) -> f64 {
    let (a, b) = (a.colours(), b.colours());
    let (mut largest, mut brightest) = (0.0f32, 0.0f32);
    for (a, b) in a.as_flattened().iter().zip(b.as_flattened()) {
        let difference = (a * unit - b).abs();
        largest = largest.max(if difference.is_nan() {
            f32::INFINITY
        } else {
            difference
        });
        brightest = brightest.max((a * unit).abs());
    }
    f64::from(largest / brightest)
}

#[test]
fn exposure_scales_the_output() {
    for variances in [true, false] {
        let frame = Scene {
            variances,
            ..Scene::new(61, 44)
        }
        .render();
        let plain = mapped(&frame, |_| {});
        // A power of two is exact.
        let exact = [0.25, 1024.0, 2f32.powi(-20), 2f32.powi(30)].map(|by| (by, 0.0));
        let rounded = [3.7, 1e6, 1e-6].map(|by| (by, EXPOSURE));
        for (by, tolerance) in exact.into_iter().chain(rounded) {
            let distance = distance(&plain, &exposed(&frame, by), by);
            assert!(close(distance, 0.0, tolerance), "{by}: {distance}");
        }
    }
}

/// Largest change of a frame's output when the features from `first` on are in a unit `by` times smaller.
fn change_by_unit(params: Params, first: usize, by: f32) -> f64 {
    let frame = Scene::new(61, 44).render();
    let mut other = frame.clone();
    for row in &mut other.rows {
        scale(&mut row.features[first..], by);
        scale(&mut row.feature_variances[first..], by * by);
    }
    distance(&frame.denoise(params), &other.denoise(params), 1.0)
}

/// A power of two is exact.
const UNITS: [(f32, f64); 5] = [
    (1024.0, 0.0),
    (1.0 / 1_048_576.0, 0.0),
    (1000.0, FEATURE_UNITS),
    (1e-3, FEATURE_UNITS),
    (0.3048, FEATURE_UNITS),
];

#[test]
fn depth_in_metres_or_millimetres_is_the_same_depth() {
    for (by, tolerance) in UNITS {
        let change = change_by_unit(Params::new(Quality::Balanced), 6, by);
        assert!(close(change, 0.0, tolerance), "{by}: {change}");
    }
}

/// The stages after the blend know that a normal has length 1 and an albedo is a part of the light; what is before them does not, and the
/// papers' formulas have nothing else.
#[test]
fn models_know_no_unit_of_any_feature() {
    for (by, tolerance) in UNITS {
        let change = change_by_unit(Params::literal(), 0, by);
        assert!(close(change, 0.0, tolerance), "{by}: {change}");
    }
}

#[test]
fn channels_in_another_order_come_out_in_that_order() {
    let frame = Scene::new(61, 44).render();
    let mut plain = mapped(&frame, |_| {});
    let turned = mapped(&frame, |row| {
        row.colour.rotate_left(1);
        row.variance.rotate_left(1);
    });
    for row in &mut plain.rows {
        row.colour.rotate_left(1);
    }
    let distance = distance(&plain, &turned, 1.0);
    assert!(close(distance, 0.0, CHANNEL_ORDER), "{distance}");
}
