//! What has one value all over a window is predicted as that value, without rounding: an opaque alpha stays opaque, a black layer black.

use linpred_core::{LayerTile, Params, PixelState, Quality};
use linpred_tests::cells::{Job, denoise_side_by_side, tile};
use linpred_tests::images::noise;

const VALUES: [f32; 3] = [1.0, 0.0, 0.1];

/// A cell with pixels that are bad or lie beyond the image, where a layer is 0, and an even layer beside one of noise.
fn cell(seed: u32) -> Job {
    let values: Vec<f32> = (0..997).map(|i| noise(seed, i)).collect();
    let states: Vec<u8> = (0..41).map(|i| if i < 3 { i } else { 7 }).collect();
    let tile = tile(&values, &states);
    let (mut even, mut noisy) = (LayerTile::BLACK, LayerTile::BLACK);
    for (i, pixel) in tile.pixels.iter().enumerate() {
        if matches!(pixel.state, PixelState::Noisy | PixelState::Clean) {
            even.colour[i] = VALUES;
            noisy.colour[i] = VALUES.map(|value| value + noise(seed + 1, i));
        }
    }
    Job::new(tile, vec![even, noisy])
}

fn check<const L: usize>(params: &Params) {
    let mut jobs: Vec<Job> = (0..L as u32).map(cell).collect();
    // a lane beside whose window nothing is even
    if L > 1 {
        jobs[1].layers[0] = jobs[1].layers[1].clone();
    }
    let order: Vec<usize> = (0..L).collect();
    denoise_side_by_side::<L>(&mut jobs, &order, params);
    for (n, job) in jobs.iter().enumerate().filter(|(n, _)| *n != 1) {
        let mut predicted = 0;
        let sums = job.predictions.sums.iter().zip(&job.layers[0].sums);
        for (i, (sum, layer)) in sums.enumerate() {
            predicted += usize::from(sum.confidence > 0.0);
            assert_eq!(
                layer[0].to_bits(),
                sum.confidence.to_bits(),
                "lane {n}, pixel {i}"
            );
            assert_eq!(layer[1], 0.0, "lane {n}, pixel {i}");
        }
        assert!(predicted > 300, "lane {n} predicts {predicted} pixels");
    }
    if L > 1 {
        let apart = |i: usize| jobs[1].layers[0].sums[i] != jobs[1].layers[1].sums[i];
        assert!(
            !(0..jobs[1].layers[0].sums.len()).any(apart),
            "a lane changed another"
        );
    }
}

#[test]
fn in_one_lane_and_beside_others() {
    for quality in [Quality::Fast, Quality::High] {
        check::<1>(&Params::new(quality));
        check::<8>(&Params::new(quality));
    }
    check::<1>(&Params::literal());
    check::<8>(&Params::wlr());
}
