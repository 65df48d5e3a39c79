//! No pixel that asks for a prediction goes without one, whatever a tile holds.

use linpred_core::{CELL, HALO, Params, PixelState, Quality, TILE};
use linpred_tests::cells::{Tile, denoise, tile};
use linpred_tests::strategies::any_finite;
use proptest::prelude::{ProptestConfig, Strategy, any, prop_assert, prop_oneof, proptest};
use proptest::sample::select;

fn tiles() -> impl Strategy<Value = Box<Tile>> {
    let value = prop_oneof![
        any_finite(),
        -1.0f32..1.0,
        select(vec![0.0f32, -0.0, 1e15, 1e-30, 1e-42, 1.0, 0.5])
    ];
    let values = proptest::collection::vec(value, 1..400);
    let states = prop_oneof![
        proptest::collection::vec(3u8..8, 1..2),
        proptest::collection::vec(any::<u8>(), 1..60)
    ];
    (values, states).prop_map(|(values, states)| tile(&values, &states))
}

fn of_the_cell() -> impl Iterator<Item = usize> {
    (HALO..HALO + CELL).flat_map(|y| (HALO..HALO + CELL).map(move |x| y * TILE + x))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn and_says_nothing_that_is_not_finite(tile in tiles(), params in select(vec![Params::new(Quality::Fast), Params::new(Quality::Balanced), Params::literal(), Params::wlr()])) {
        let cell = denoise(&tile, &params);
        let open = of_the_cell().filter(|&i| match tile.pixels[i].state {
            PixelState::Outside => false,
            PixelState::Clean => params.formulas.are_published(),
            PixelState::Noisy | PixelState::Bad => true,
        });
        prop_assert!(cell.models <= open.count() as u32 * 3);
        for (i, sum) in cell.predictions.sums.iter().enumerate() {
            prop_assert!(sum.confidence >= 0.0 && sum.confidence.is_finite(), "{} {:?}", i, sum);
            prop_assert!(sum.error >= 0.0 && sum.error.is_finite(), "{} {:?}", i, sum);
            prop_assert!(sum.colour.iter().all(|v| v.is_finite()), "{} {:?}", i, sum);
        }
        for (pixel, before) in cell.pixels.iter().zip(&tile.pixels) {
            prop_assert!(pixel.colour.iter().all(|v| v.is_finite()), "{:?} {:?}", pixel, before);
            prop_assert!(pixel.error >= 0.0 && pixel.error.is_finite(), "{:?} {:?}", pixel, before);
            prop_assert!((0.0..=9.0001).contains(&pixel.radius) && (0.0..=9.0001).contains(&pixel.rank), "{:?}", pixel);
            if before.state == PixelState::Clean {
                prop_assert!(pixel.colour.map(f32::to_bits) == before.colour.map(f32::to_bits));
            }
        }
    }

    #[test]
    fn or_leaves_it_as_it_is(tile in tiles(), coverage in 1u16..6) {
        // With the literal formulas every prediction weighs 1, so that weights count.
        let params = Params::literal().with_coverage(coverage);
        let cell = denoise(&tile, &params);
        for i in of_the_cell() {
            let (pixel, weight) = (&tile.pixels[i], cell.predictions.sums[i].confidence);
            prop_assert!(weight.fract() == 0.0);
            // Predictions that would leave f32, which only a weight that contradicts the radiance can cause, are dropped.
            let kept = cell.pixels[i].colour.map(f32::to_bits) == pixel.colour.map(f32::to_bits);
            if pixel.state == PixelState::Noisy {
                prop_assert!(weight >= 1.0 || kept, "{} {}", i, weight);
            }
        }
    }
}

/// On a tile that a render could hold no prediction is dropped. Beyond a few models per pixel the wanted number is where building stops, not
/// what every pixel gets: after the last pass there is a model at each pixel that is short, and no other to be had for it.
#[test]
fn as_often_as_asked_where_few_are_asked_for() {
    let values: Vec<f32> = (0..997)
        .map(|i| 0.3 + linpred_tests::images::noise(7, i))
        .collect();
    let tile = tile(&values, &[7]);
    for coverage in [1, 4] {
        let cell = denoise(&tile, &Params::literal().with_coverage(coverage));
        let least = of_the_cell()
            .map(|i| cell.predictions.sums[i].confidence)
            .fold(f32::MAX, f32::min);
        assert!(least >= f32::from(coverage), "{coverage}: {least}");
    }
}
