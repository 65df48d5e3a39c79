//! How many cells are fitted side by side, which ones, and in which order, changes no bit of any of them.

use linpred_core::{LayerTile, Params, Quality};
use linpred_tests::cells::{Job, denoise_side_by_side, otherwise, tile};
use linpred_tests::images::noise;
use linpred_tests::strategies::any_finite;
use proptest::prelude::{Just, ProptestConfig, Strategy, any, prop_assert, prop_oneof, proptest};
use proptest::sample::select;

/// Tiles as renders have them, ones that a fit finds hard, and ones in which hardly a pixel is open: lanes fall out of step.
fn tiles(layers: usize) -> impl Strategy<Value = Job> {
    let value = prop_oneof![
        any_finite(),
        -1.0f32..1.0,
        select(vec![0.0f32, -0.0, 1e15, 1e-30, 1e-42, 1.0, 0.5])
    ];
    let values = prop_oneof![
        any::<u32>().prop_map(|seed| (0..997).map(|i| noise(seed, i)).collect::<Vec<f32>>()),
        proptest::collection::vec(value, 1..400),
    ];
    let states = prop_oneof![
        Just(vec![7]),
        Just((0..41).map(|i| if i == 20 { 7 } else { 2 }).collect()),
        Just(vec![2]),
        proptest::collection::vec(any::<u8>(), 1..60)
    ];
    (values, states, any::<u32>()).prop_map(move |(values, states, seed)| {
        let layer = |k: usize| {
            let mut layer = LayerTile::BLACK;
            for (i, value) in layer.colour.as_flattened_mut().iter_mut().enumerate() {
                *value = noise(seed.wrapping_add(k as u32), i);
            }
            // What was here before must be forgotten.
            layer.sums[0] = [f32::NAN; 3];
            layer
        };
        let mut job = Job::new(tile(&values, &states), (0..layers).map(layer).collect());
        if seed % 2 == 0 {
            job.otherwise = Some(otherwise(&job.tile, |value| 0.5 * value + 0.1));
        }
        job
    })
}

/// Several tiles, each with as many layers, and an order of them.
fn rows() -> impl Strategy<Value = (Vec<Job>, Vec<usize>)> {
    (select(vec![0usize, 0, 2]), 1usize..19).prop_flat_map(|(layers, count)| {
        let jobs = proptest::collection::vec(tiles(layers), count);
        (jobs, Just((0..count).collect::<Vec<_>>()).prop_shuffle())
    })
}

fn side_by_side<const L: usize>(
    jobs: &[Job],
    order: &[usize],
    params: &Params,
) -> Vec<(Option<u32>, Vec<u32>)> {
    let mut jobs = jobs.to_vec();
    denoise_side_by_side::<L>(&mut jobs, order, params);
    jobs.iter().map(Job::bits).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn in_any_order(
        (jobs, order) in rows(),
        params in select(vec![Params::new(Quality::Fast), Params::new(Quality::Balanced), Params::literal(), Params::wlr()]),
    ) {
        let alone: Vec<_> = jobs.iter().flat_map(|job| side_by_side::<1>(std::slice::from_ref(job), &[0], &params)).collect();
        prop_assert!(alone.iter().all(|(models, _)| models.is_some()));
        prop_assert!(side_by_side::<1>(&jobs, &order, &params) == alone, "one after the other");
        prop_assert!(side_by_side::<2>(&jobs, &order, &params) == alone, "two lanes");
        prop_assert!(side_by_side::<8>(&jobs, &order, &params) == alone, "eight lanes");
        prop_assert!(side_by_side::<16>(&jobs, &order, &params) == alone, "sixteen lanes");
    }
}

/// A scratch that has seen other cells is as good as a new one.
#[test]
fn after_any_other_cells() {
    let job = |seed: u32, state: u8| {
        let values: Vec<f32> = (0..997).map(|i| noise(seed, i)).collect();
        Job::new(tile(&values, &[state]), Vec::new())
    };
    let params = Params::default();
    let mut jobs = vec![job(1, 7), job(2, 1), job(3, 0), job(4, 7), job(1, 7)];
    denoise_side_by_side::<2>(&mut jobs, &[0, 1, 2, 3, 4], &params);
    assert_eq!(jobs[0].bits(), jobs[4].bits());
    assert_ne!(jobs[0].bits(), jobs[3].bits());
    assert_eq!(jobs[2].models, Some(0));
}
