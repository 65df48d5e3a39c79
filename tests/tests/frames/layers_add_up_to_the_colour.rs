//! Layers that sum to the colour still do when they are denoised with its models.

use linpred_core::{Params, Quality};
use linpred_tests::frames::{Frame, Scene, pixels};
use linpred_tests::tolerance::{LAYER_SUM, close};

fn sums_hold(frame: &Frame, params: Params) {
    let output = frame.denoise(params);
    assert!(output.is_finite());
    let colour = output.colours();
    let brightest = colour
        .as_flattened()
        .iter()
        .fold(0.0f32, |a, b| a.max(b.abs()));
    let layers: Vec<Vec<[f32; 3]>> = (0..frame.layout.layers)
        .map(|k| {
            output
                .rows
                .iter()
                .flat_map(|row| pixels(&row.layers[k]))
                .collect()
        })
        .collect();
    for (i, colour) in colour.iter().enumerate() {
        for c in 0..3 {
            let sum: f32 = layers.iter().map(|layer| layer[i][c]).sum();
            let error = f64::from((sum - colour[c]) / brightest);
            assert!(close(error, 0.0, LAYER_SUM), "{i}: {sum} {}", colour[c]);
        }
    }
    assert!(layers.iter().all(|layer| layer.iter().any(|v| v[0] != 0.0)));
}

fn scene() -> Frame {
    Scene {
        layers: 3,
        ..Scene::new(64, 47)
    }
    .render()
}

#[test]
fn with_any_formulas() {
    for params in [
        Params::new(Quality::Fast),
        Params::new(Quality::High),
        Params::literal(),
        Params::wlr(),
    ] {
        sums_hold(&scene(), params);
    }
}

/// An early version started the layers' fit around a bad pixel at what the layer held there: 1e30 beside 0.1 left nothing of the
/// neighbours.
#[test]
fn where_the_colour_or_its_layers_are_not_a_number() {
    let mut frame = scene();
    for (x, y) in [(5, 5), (6, 5), (30, 20), (63, 46)] {
        frame.rows[y].colour[1][x] = f32::NAN;
        frame.rows[y].layers[0][1][x] = f32::NAN;
        frame.rows[y].layers[1][1][x] = 1e30;
    }
    sums_hold(&frame, Params::new(Quality::Balanced));
}

#[test]
fn where_there_are_fireflies() {
    for variances in [true, false] {
        let mut frame = Scene {
            layers: 3,
            variances,
            ..Scene::new(64, 47)
        }
        .render();
        for at in [(5, 5), (18, 6), (63, 20), (30, 46)] {
            frame.add_firefly(at, 500.0);
            for (k, share) in [100.0, 150.0, 250.0].into_iter().enumerate() {
                let layer = frame.rows[at.1].layers[k].iter_mut();
                layer.for_each(|plane| plane[at.0] = share);
            }
        }
        assert_eq!(frame.survey_on(1).counts.fireflies, 4);
        sums_hold(&frame, Params::new(Quality::Balanced));
    }
}

#[test]
fn where_there_is_nothing_to_denoise() {
    let mut frame = scene();
    for row in &mut frame.rows {
        row.variance.iter_mut().flatten().for_each(|v| *v = 0.0);
    }
    sums_hold(&frame, Params::new(Quality::Balanced));
}
