//! Models are shared out over sets of features, where there are any that differ and the parameters say so.

use linpred_core::{Params, Quality};
use linpred_tests::cells::{Job, Tile, denoise_side_by_side, otherwise, tile};
use proptest::prelude::{ProptestConfig, Strategy, any, prop_assert, proptest};

fn tiles() -> impl Strategy<Value = Box<Tile>> {
    let values = proptest::collection::vec(0.1f32..4.0, 40..200);
    values.prop_map(|values| {
        let mut tile = tile(&values, &[7]);
        // Clean ones, or no model would look at them.
        tile.feature_variance.as_flattened_mut().fill(0.0);
        tile
    })
}

/// What comes of a tile whose other sets of features are its own, changed.
fn bits(tile: &Tile, change: Option<fn(f32) -> f32>, params: &Params) -> (Option<u32>, Vec<u32>) {
    let mut jobs = [Job::new(Box::new(tile.clone()), Vec::new())];
    jobs[0].otherwise = change.map(|change| otherwise(tile, change));
    denoise_side_by_side::<1>(&mut jobs, &[0], params);
    jobs[0].bits()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn sets_that_are_equal_change_no_bit(tile in tiles(), high in any::<bool>()) {
        let params = Params::new(if high { Quality::High } else { Quality::Balanced });
        prop_assert!(bits(&tile, Some(|v| v), &params) == bits(&tile, None, &params));
    }

    #[test]
    fn and_those_that_differ_are_seen_by_models_that_vary_and_by_no_others(tile in tiles()) {
        let params = Params::new(Quality::High);
        let changed: fn(f32) -> f32 = |v| v * v - 0.3 * v;
        let plain = bits(&tile, None, &params);
        prop_assert!(bits(&tile, Some(changed), &params) != plain);
        prop_assert!(bits(&tile, Some(changed), &params.with_vary_features(false)) == plain);
        let fast = Params::new(Quality::Fast);
        prop_assert!(bits(&tile, Some(changed), &fast) == bits(&tile, None, &fast));
    }
}
