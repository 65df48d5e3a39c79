//! One tile of arbitrary values through the core: no panic, nothing that is not finite, no negative weight, and no pixel beyond a
//! bound of what went in.
//!
//! The first byte chooses the parameters, the second how long the pattern of states is; the pattern and then the values follow, both
//! repeated over the tile.

#![no_main]

use libfuzzer_sys::fuzz_target;
use linpred_core::{Formulas, Params, PixelState, Quality, RADIUS, TILE};
use linpred_tests::cells::{Tile, denoise, tile};

/// A model of least squares predicts a pixel that it was fitted on within the square root of what all pixels' squared values
/// weigh together; 4 for the prior's part and for rounding.
const BOUND: f64 = 4.0 * (2 * RADIUS + 1) as f64;

/// Part of the largest radiance that a pixel without weight can leave.
const ROUNDING: f64 = 1e-6;

fuzz_target!(|data: &[u8]| {
    let Some((&[choice, length], rest)) = data.split_first_chunk::<2>() else {
        return;
    };
    let Some((states, rest)) = rest.split_at_checked(usize::from(length % 64) + 1) else {
        return;
    };
    let values: Vec<f32> = if choice & 1 == 0 {
        rest.iter().map(|&byte| from_palette(byte)).collect()
    } else {
        bytemuck::pod_collect_to_vec(rest)
    };
    if values.is_empty() {
        return;
    }
    let params = match (choice >> 1) % 4 {
        0 => Params::new(Quality::Fast),
        1 => Params::new(Quality::Balanced),
        2 => Params::literal(),
        _ => Params::wlr(),
    };
    check(&tile(&values, states), &params);
});

/// Values that a renderer could send, and those at the ends of what a float holds.
fn from_palette(byte: u8) -> f32 {
    match byte {
        255 => 1e15,
        254 => 1e-30,
        253 => 1e-42,
        252 => -0.0,
        251 => 1e6,
        250 => 0.5f32.next_up(),
        249 => 0.5,
        byte => f32::from(byte) / 100.0 - 0.4,
    }
}

fn check(tile: &Tile, params: &Params) {
    let cell = denoise(tile, params);
    for (i, (sum, pixel)) in cell.predictions.sums.iter().zip(&cell.pixels).enumerate() {
        assert!(sum.confidence >= 0.0 && sum.confidence.is_finite(), "{i} {sum:?}");
        assert!(sum.error >= 0.0 && sum.error.is_finite(), "{i} {sum:?}");
        assert!(pixel.colour.iter().all(|v| v.is_finite()), "{i} {pixel:?}");
        assert!(
            pixel.error >= 0.0 && pixel.error.is_finite(),
            "{i} {pixel:?}"
        );
        let own = &tile.pixels[i];
        // Within few pixels of a kernel a plane may be as steep as it likes.
        let bounded = params.formulas != Formulas::Wlr;
        if bounded && own.state == PixelState::Noisy && own.weight > 0.0 {
            // The literal formulas weigh all pixels alike.
            let weigh = |weight: f32| match params.formulas {
                Formulas::Robust => f64::from(weight).sqrt(),
                Formulas::Literal => f64::from(u8::from(weight > 0.0)),
                other => panic!("{other:?} has no definition"),
            };
            // A fit starts from its centre, whatever that weighs, and leaves rounding of it.
            let bound = BOUND * largest_weighted(tile, i, weigh) / weigh(own.weight)
                + ROUNDING * largest_weighted(tile, i, |_| 1.0);
            let worst = pixel.colour.iter().fold(0.0f32, |a, b| a.max(b.abs()));
            assert!(f64::from(worst) <= bound, "{i}: {worst} beyond {bound}");
        }
    }
}

/// The largest radiance times the root of its weight within the reach of the windows that predict a pixel.
fn largest_weighted(tile: &Tile, i: usize, weigh: impl Fn(f32) -> f64) -> f64 {
    let near = |j: usize| {
        (i % TILE)
            .abs_diff(j % TILE)
            .max((i / TILE).abs_diff(j / TILE))
            <= 2 * RADIUS
    };
    let pixels = tile.pixels.iter().enumerate().filter(|(j, _)| near(*j));
    let weighted = pixels.map(|(_, pixel)| {
        let largest = pixel.colour.iter().fold(0.0f32, |a, b| a.max(b.abs()));
        f64::from(largest) * weigh(pixel.weight)
    });
    weighted.fold(0.0, f64::max)
}
