//! Centres come pass after pass, ever closer together (LPR section 5.1), and skip what is predicted well enough already.

use linpred_core::{CELL, HALO, Params, PixelState, Quality, RADIUS, TILE};
use linpred_tests::cells::{Tile, denoise, tile};
use proptest::prelude::{ProptestConfig, Strategy, any, prop_assert, prop_assert_eq, proptest};

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

/// Confidence in a prediction without error so many rings from its model's centre: 0.7 of it would be gone one ring beyond the window.
fn confidence(ring: usize) -> f32 {
    let part = ring as f32 / (RADIUS + 1) as f32;
    0.5f32.powf(-1.5) * (1.0 - 0.7 * part * part)
}

/// The confidences in the predictions of each pixel of a tile, added up, and how many models there are, if each predicts the 19 x 19 around it.
fn placed(tile: &Tile, coverage: u16) -> (Vec<f32>, u32) {
    let mut confidences = vec![0.0; tile.pixels.len()];
    let mut models = 0;
    // A later pass comes back to centres of earlier ones, where the same model would be fitted again.
    let mut built = vec![false; tile.pixels.len()];
    for granularity in [19, 9, 4, 2, 1] {
        for y in (granularity / 2..CELL).step_by(granularity) {
            for x in (granularity / 2..CELL).step_by(granularity) {
                let centre = (y + HALO) * TILE + x + HALO;
                let open = tile.pixels[centre].state == PixelState::Noisy;
                if open && confidences[centre] < f32::from(coverage) && !built[centre] {
                    models += 1;
                    built[centre] = true;
                    for row in y..=y + 2 * HALO {
                        for column in x..=x + 2 * HALO {
                            let (down, across) =
                                (row.abs_diff(y + HALO), column.abs_diff(x + HALO));
                            confidences[row * TILE + column] += confidence(down.max(across));
                        }
                    }
                }
            }
        }
    }
    (confidences, models)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn and_nowhere_else(tile in tiles(), coverage in 1u16..25) {
        let cell = denoise(&tile, &Params::new(Quality::Fast).with_coverage(coverage));
        let (confidences, models) = placed(&tile, coverage);
        prop_assert_eq!(cell.models, models);
        for (sum, expected) in cell.predictions.sums.iter().zip(confidences) {
            prop_assert!((sum.confidence - expected).abs() <= 1e-5 * expected, "{} {}", sum.confidence, expected);
            if sum.confidence > 0.0 {
                prop_assert_eq!((sum.radius / sum.confidence).round() as u32, 9);
            }
        }
    }
}
