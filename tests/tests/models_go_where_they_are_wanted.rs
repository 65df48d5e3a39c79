//! Centres come pass after pass, ever closer together, and skip what enough models predict already (LPR section 5.1).

use linpred_core::{CELL, HALO, Params, PixelState, Quality, TILE};
use linpred_tests::cells::{Tile, denoise, tile};
use proptest::prelude::{ProptestConfig, Strategy, any, prop_assert_eq, proptest};

/// A tile of one radiance that is said to be noisy: every model predicts the whole of its window. Some pixels are open.
fn tiles() -> impl Strategy<Value = Box<Tile>> {
    proptest::collection::vec(any::<u8>(), 1..400).prop_map(|open| {
        let mut tile = tile(&[1.0], &[7]);
        for (pixel, open) in tile.pixels.iter_mut().zip(open.iter().cycle()) {
            pixel.state = if open % 3 == 0 {
                PixelState::Clean
            } else {
                PixelState::Noisy
            };
        }
        tile
    })
}

/// How many models predict each pixel of a tile, and how many there are, if each predicts the 19 x 19 around it.
fn placed(tile: &Tile, coverage: u32) -> (Vec<u32>, u32) {
    let mut predicted = vec![0; tile.pixels.len()];
    let mut models = 0;
    // A later pass comes back to centres of earlier ones, where the same model would be fitted again.
    let mut built = vec![false; tile.pixels.len()];
    for granularity in [19, 9, 4, 2, 1] {
        for y in (granularity / 2..CELL).step_by(granularity) {
            for x in (granularity / 2..CELL).step_by(granularity) {
                let centre = (y + HALO) * TILE + x + HALO;
                let open = tile.pixels[centre].state == PixelState::Noisy;
                if open && predicted[centre] < coverage && !built[centre] {
                    models += 1;
                    built[centre] = true;
                    for row in y..=y + 2 * HALO {
                        for column in x..=x + 2 * HALO {
                            predicted[row * TILE + column] += 1;
                        }
                    }
                }
            }
        }
    }
    (predicted, models)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn and_nowhere_else(tile in tiles(), coverage in 1u16..9) {
        let cell = denoise(&tile, &Params { coverage, ..Params::new(Quality::Fast) });
        let (predicted, models) = placed(&tile, u32::from(coverage));
        prop_assert_eq!(cell.models, models);
        // All predictions of one pixel weigh alike, for each agrees with it: their number is known by the weight of one.
        let weight = cell.predictions.sums.iter().zip(&predicted).find(|(_, count)| **count == 1).map(|(sum, _)| sum.weight);
        for (sum, count) in cell.predictions.sums.iter().zip(&predicted) {
            prop_assert_eq!(sum.weight > 0.0, *count > 0);
            if let Some(weight) = weight {
                prop_assert_eq!((sum.weight / weight).round() as u32, *count);
            }
            if sum.weight > 0.0 {
                prop_assert_eq!((sum.radius / sum.weight).round() as u32, 9);
            }
        }
    }
}
