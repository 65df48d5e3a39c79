//! The bits of the core's output on one tile of a real render, folded to a number: computed on the host by the tests and on a
//! bare Cortex-M7 by the firmware, which includes this file, so it knows neither allocation nor the standard library.

use half::f16;
use linpred_core::{NormalEquations, Prior, Rls, SymmetricEigen};

/// Pixels along a side of the tile.
const SIDE: usize = 37;
/// Half-width of the window.
const RADIUS: usize = 9;
/// Features: position, albedo, normal, depth.
const FEATURES: usize = 9;
/// Terms of the model: the intercept and the four strongest local features.
const TERMS: usize = 5;
/// Planes of features in the tile, from depth back to albedo.
const FEATURE_PLANES: [usize; 7] = [6, 7, 8, 12, 13, 14, 18];

/// 37 x 37 pixels of courtyard at 16 samples from (104, 88), path traced with Mitsuba 3.9.1; `make_tile.py` beside it
/// says which plane is what.
static TILE: &[u8; 2 * 20 * SIDE * SIDE] = include_bytes!("../firmware/tile.f16");

fn value(plane: usize, x: usize, y: usize) -> f32 {
    let at = 2 * ((plane * SIDE + y) * SIDE + x);
    match TILE.get(at..at + 2) {
        Some(&[low, high]) => f16::from_le_bytes([low, high]).to_f32(),
        _ => 0.0,
    }
}

fn radiance(x: usize, y: usize) -> [f32; 3] {
    [0, 1, 2].map(|channel| value(channel, x, y))
}

fn features(x: usize, y: usize) -> [f32; FEATURES] {
    let mut features = [0.0; FEATURES];
    features[0] = x as f32 / RADIUS as f32;
    features[1] = y as f32 / RADIUS as f32;
    for (feature, plane) in features.iter_mut().skip(2).zip(FEATURE_PLANES) {
        *feature = value(plane, x, y);
    }
    features
}

/// FNV-1a (Fowler, Noll, Vo) over the bits of every fitted value, leverage and ring-end model of the windows around nine centres.
pub fn checksum_of_tile() -> u32 {
    let mut hash = 0x811c_9dc5;
    for y in [RADIUS, SIDE / 2, SIDE - 1 - RADIUS] {
        for x in [RADIUS, SIDE / 2, SIDE - 1 - RADIUS] {
            fold_window(x, y, &mut hash);
        }
    }
    hash
}

fn fold(values: &[f32], hash: &mut u32) {
    for byte in values.iter().flat_map(|v| v.to_bits().to_le_bytes()) {
        *hash = (*hash ^ u32::from(byte)).wrapping_mul(0x0100_0193);
    }
}

fn fold_window(x: usize, y: usize, hash: &mut u32) {
    let Some(space) = SymmetricEigen::new(&gramian(x, y)) else {
        return;
    };
    fold(&space.values, hash);
    let centre = features(x, y);
    let prior = Prior::at_centre(&radiance(x, y), 1e-3, 0.1);
    let mut rls = Rls::<TERMS>::new(&prior);
    let mut sums = NormalEquations::<TERMS>::new();
    for radius in 0..=RADIUS {
        for_ring(x, y, radius, |x, y| {
            let z = local_features(&space, &centre, &features(x, y));
            fold(&rls.predict(&z), hash);
            fold(&[rls.leverage(&z)], hash);
            let _ = rls.update(&z, &radiance(x, y), 1.0);
            sums.add(&z, &radiance(x, y), 1.0);
        });
        if let Ok(solution) = sums.solve(&prior) {
            fold(solution.coefficients().as_flattened(), hash);
            fold(&sums.residual_squares(solution.coefficients()), hash);
        }
    }
}

/// Calls for the pixels at Chebyshev distance `radius`, in raster order.
fn for_ring(x: usize, y: usize, radius: usize, mut pixel: impl FnMut(usize, usize)) {
    for j in y - radius..=y + radius {
        for i in x - radius..=x + radius {
            if i.abs_diff(x).max(j.abs_diff(y)) == radius {
                pixel(i, j);
            }
        }
    }
}

fn gramian(x: usize, y: usize) -> [[f32; FEATURES]; FEATURES] {
    let centre = features(x, y);
    let mut gramian = [[0.0; FEATURES]; FEATURES];
    for radius in 0..=RADIUS {
        for_ring(x, y, radius, |x, y| {
            let features = features(x, y);
            for i in 0..FEATURES {
                for j in i..FEATURES {
                    gramian[i][j] += (features[i] - centre[i]) * (features[j] - centre[j]);
                }
            }
        });
    }
    gramian
}

fn local_features(
    space: &SymmetricEigen<FEATURES>,
    centre: &[f32; FEATURES],
    features: &[f32; FEATURES],
) -> [f32; TERMS] {
    let mut z = [1.0; TERMS];
    for (z, vector) in z.iter_mut().skip(1).zip(&space.vectors) {
        *z = 0.0;
        for j in 0..FEATURES {
            *z += vector[j] * (features[j] - centre[j]);
        }
    }
    z
}
