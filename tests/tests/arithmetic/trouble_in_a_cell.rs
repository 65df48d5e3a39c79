//! Features that say nothing, and pixels that say hardly anything, take nothing away from what is there.

use linpred_core::{CELL, HALO, Params, PixelState, Quality, TILE, TILE_AREA};
use linpred_tests::cells::{Tile, denoise};
use linpred_tests::features::{Feature, Place, any_magnitude};
use linpred_tests::tolerance::{CONSTANT_CELL, close};
use linpred_tests::windows::Random;
use proptest::prelude::{ProptestConfig, Strategy, TestCaseError, any, prop_assert, proptest};
use proptest::sample::select;

/// Column and row of the pixel in the middle of a tile.
const MIDDLE: f32 = (TILE / 2) as f32;

/// A tile of one radiance, with such features.
#[derive(Clone, Debug)]
struct Case {
    seed: u64,
    features: Vec<Feature>,
    /// Of the pixels' mean, relative to its square; some pixels have the second.
    variances: [f32; 2],
    radiance: f32,
    /// Part of the pixels that are missing.
    missing: f64,
    params: Params,
}

fn cases() -> impl Strategy<Value = Case> {
    let variances = select(vec![0.0f32, 1e-6, 0.1, 1.0, 1e4, 1e20]);
    let params = [
        Params::new(Quality::Fast),
        Params::new(Quality::Balanced),
        Params::literal(),
        Params::wlr(),
    ];
    (
        any::<u64>(),
        proptest::collection::vec(any_magnitude(), 7),
        (variances.clone(), variances),
        select(vec![1.0f32, 0.3, 1e-8, 1e8]),
        select(vec![0.0, 0.0, 0.3, 0.99]),
        select(params.to_vec()),
    )
        .prop_map(
            |(seed, features, variances, radiance, missing, params)| Case {
                seed,
                features,
                variances: variances.into(),
                radiance,
                missing,
                params,
            },
        )
}

impl Case {
    fn tile(&self) -> Box<Tile> {
        let mut random = Random::new(self.seed);
        let odd_one = random.below(TILE_AREA);
        let mut tile = Box::new(Tile::EMPTY);
        for i in 0..TILE_AREA {
            let (x, y) = ((i % TILE) as f32, (i / TILE) as f32);
            let pixel = &mut tile.pixels[i];
            (pixel.features[0], pixel.features[1]) = (x, y);
            let place = Place {
                x: x / MIDDLE - 1.0,
                y: y / MIDDLE - 1.0,
                is_odd: i == odd_one,
            };
            for (k, feature) in self.features.iter().enumerate() {
                let before = pixel.features[k + 1];
                pixel.features[k + 2] = feature.value(place, before, &mut random);
            }
            let square = self.radiance * self.radiance;
            pixel.colour = [1.0, 0.5, 0.0].map(|tint| tint * self.radiance);
            pixel.weight = (0.1 + random.uniform()) as f32 / square;
            pixel.variance = (self.variances[random.below(2)] * square).min(1e30);
            pixel.tolerance = pixel.variance + 0.03 * square;
            pixel.state = PixelState::Noisy;
            if random.uniform() < self.missing {
                (pixel.colour, pixel.weight) = ([0.0; 3], 0.0);
                pixel.state = PixelState::Bad;
            }
        }
        tile
    }
}

/// Predictions of the radiance that every valid pixel has are that radiance.
fn stays_itself(tile: &Tile, params: &Params, radiance: f32) -> Result<(), TestCaseError> {
    let cell = denoise(tile, params);
    for (i, sum) in cell.predictions.sums.iter().enumerate() {
        prop_assert!(sum.confidence >= 0.0 && sum.confidence.is_finite());
        if sum.confidence > 0.0 {
            for (ours, tint) in sum.colour.iter().zip([1.0, 0.5, 0.0]) {
                let ours = f64::from(ours / sum.confidence / radiance);
                prop_assert!(close(ours, tint, CONSTANT_CELL), "{i}: {ours} of {tint}");
            }
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn one_radiance_stays_itself_whatever_the_features(case in cases()) {
        // Where no pixel of a 3 x 3 is valid, the papers' formulas have no error to go by.
        if case.missing == 0.0 || case.params != Params::literal() {
            stays_itself(&case.tile(), &case.params, case.radiance)?;
        }
    }

    #[test]
    fn one_valid_pixel_speaks_for_all_that_see_it(case in cases(), at in (0..CELL, 0..CELL)) {
        let mut tile = case.tile();
        let valid = (at.1 + HALO) * TILE + at.0 + HALO;
        for (i, pixel) in tile.pixels.iter_mut().enumerate() {
            pixel.colour = [0.0; 3];
            pixel.weight = 0.0;
            pixel.state = PixelState::Bad;
            if i == valid {
                pixel.colour = [1.0, 0.5, 0.0].map(|tint| tint * case.radiance);
                pixel.weight = 1.0 / (case.radiance * case.radiance);
                pixel.state = PixelState::Noisy;
            }
        }
        let params = Params::new(Quality::Balanced);
        stays_itself(&tile, &params, case.radiance)?;
        prop_assert!(denoise(&tile, &params).predictions.sums[valid].confidence > 0.0);
    }
}
