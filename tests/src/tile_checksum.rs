//! The bits of the core's output on one tile of a real render, folded to a number: computed on the host by the tests and on a
//! bare Cortex-M7 by the firmware, which includes this file, so it knows neither allocation nor the standard library.

use half::f16;
use linpred_core::{
    BLOCK_HEIGHT, BLOCK_WIDTH, ColourBlock, FeatureGroup, FilteredGroup, NormalEquations,
    PREFILTER_HALO, Params, Pixel, PixelState, Predictions, Prior, Rls, Scratch, SymmetricEigen,
    TILE, Tile, WEIGHTS_HALO, WeightBlock, denoise_cell, prefilter, resolve, weigh_samples,
};

/// Pixels along a side of the tile.
const SIDE: usize = TILE;
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
static PLANES: [[[u16; SIDE]; SIDE]; 20] =
    bytemuck::must_cast(*include_bytes!("../firmware/tile.f16"));

fn value(plane: usize, x: usize, y: usize) -> f32 {
    match PLANES.get(plane).and_then(|rows| rows.get(y)?.get(x)) {
        Some(&half) => f16::from_bits(u16::from_le(half)).to_f32(),
        None => 0.0,
    }
}

/// The same at the nearest pixel of the tile, for a position that may lie around it.
fn nearest_value(plane: usize, x: isize, y: isize) -> f32 {
    let inside = |position: isize| position.clamp(0, SIDE as isize - 1) as usize;
    value(plane, inside(x), inside(y))
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

/// What the checksum works in: 200 KiB, for a static or the heap.
pub struct Memory {
    tile: Tile<FEATURES>,
    block: Block,
}

impl Memory {
    /// Memory for the checksum.
    pub const EMPTY: Self = Self {
        tile: Tile::EMPTY,
        block: Block::Nothing,
    };
}

/// A block and what becomes of it, one kind after another in the same place.
#[expect(
    clippy::large_enum_variant,
    reason = "its place is a static, or on the heap as a whole"
)]
enum Block {
    Nothing,
    Colours(ColourBlock, WeightBlock),
    Triple(FeatureGroup<3>, FilteredGroup<3>),
    Single(FeatureGroup<1>, FilteredGroup<1>),
    Cell(Scratch<FEATURES, 1>, Predictions),
}

/// What a checksum starts from.
pub const SEED: u32 = 0x811c_9dc5;

/// FNV-1a (Fowler, Noll, Vo) over the bits of every fitted value, leverage and ring-end model of the windows around nine centres.
pub fn checksum_of_fits(mut hash: u32) -> u32 {
    for y in [RADIUS, SIDE / 2, SIDE - 1 - RADIUS] {
        for x in [RADIUS, SIDE / 2, SIDE - 1 - RADIUS] {
            fold_window(x, y, &mut hash);
        }
    }
    hash
}

/// The same over the tile as it is prepared for the cell in its middle.
pub fn checksum_of_blocks(memory: &mut Memory, mut hash: u32) -> u32 {
    load_tile(memory);
    for (pixel, variance) in memory.tile.pixels.iter().zip(&memory.tile.feature_variance) {
        fold(&pixel.features, &mut hash);
        fold(variance, &mut hash);
        fold(&pixel.colour, &mut hash);
        fold(&[pixel.weight, pixel.variance, pixel.tolerance], &mut hash);
    }
    hash
}

/// The same over the models' number, and over the denoised cell and what its models say of its halo; after [`checksum_of_blocks`].
pub fn checksum_of_cell(memory: &mut Memory, mut hash: u32) -> u32 {
    let Memory { tile, block } = memory;
    *block = Block::Cell(Scratch::new(), Predictions::NONE);
    let Block::Cell(scratch, predictions) = block else {
        return 0;
    };
    let params = Params::default();
    let models = denoise_cell(tile, &params, &mut [], scratch, predictions);
    fold(&[models as f32], &mut hash);
    for (pixel, sum) in tile.pixels.iter().zip(&predictions.sums) {
        let denoised = resolve(pixel, sum, params.formulas);
        fold(&denoised.colour, &mut hash);
        fold(&[denoised.error, denoised.radius, denoised.rank], &mut hash);
    }
    hash
}

/// The tile with its weights and its filtered features, as if it were an image of its own.
fn load_tile(memory: &mut Memory) {
    let Memory { tile, block } = memory;
    for (i, pixel) in tile.pixels.iter_mut().enumerate() {
        let (x, y) = (i % TILE, i / TILE);
        pixel.features[0] = x as f32;
        pixel.features[1] = y as f32;
        pixel.colour = radiance(x, y);
    }
    for y in (0..TILE).step_by(BLOCK_HEIGHT) {
        for x in (0..TILE).step_by(BLOCK_WIDTH) {
            *block = Block::Colours(ColourBlock::BLACK, WeightBlock::EMPTY);
            if let Block::Colours(input, output) = block {
                load_colours(input, x, y);
                weigh_samples(input, output);
                store_prepared(output, tile, x, y);
            }
            for (plane, feature) in [(6, 2), (12, 5)] {
                *block = Block::Triple(FeatureGroup::ZERO, FilteredGroup::ZERO);
                if let Block::Triple(input, output) = block {
                    filter_group(input, output, plane, tile, feature, x, y);
                }
            }
            *block = Block::Single(FeatureGroup::ZERO, FilteredGroup::ZERO);
            if let Block::Single(input, output) = block {
                filter_group(input, output, 18, tile, 8, x, y);
            }
        }
    }
}

fn load_colours(block: &mut ColourBlock, x: usize, y: usize) {
    for row in 0..ColourBlock::HEIGHT {
        for column in 0..ColourBlock::WIDTH {
            let x = (x + column) as isize - WEIGHTS_HALO as isize;
            let y = (y + row) as isize - WEIGHTS_HALO as isize;
            let [r, g, b] = [0, 1, 2].map(|plane| nearest_value(plane, x, y).abs() / 3.0);
            block.luminance[row][column] = r + g + b;
            let [r, g, b] = [3, 4, 5].map(|plane| nearest_value(plane, x, y));
            block.variance[row][column] = r + g + b;
            block.good[row][column] = 1.0;
        }
    }
}

/// Calls for the pixels of the tile that lie in the block at (x, y), with the variances of their features and their row and column of the block.
fn for_block(
    tile: &mut Tile<FEATURES>,
    x: usize,
    y: usize,
    mut pixel: impl FnMut(&mut Pixel<FEATURES>, &mut [f32; FEATURES], usize, usize),
) {
    let variances = tile.feature_variance.chunks_exact_mut(TILE);
    let rows = tile.pixels.chunks_exact_mut(TILE).zip(variances).skip(y);
    for (row, (pixels, variances)) in rows.enumerate().take(BLOCK_HEIGHT) {
        let pixels = pixels.iter_mut().zip(variances).skip(x);
        for (column, (own, variance)) in pixels.enumerate().take(BLOCK_WIDTH) {
            pixel(own, variance, row, column);
        }
    }
}

fn store_prepared(block: &WeightBlock, tile: &mut Tile<FEATURES>, x: usize, y: usize) {
    for_block(tile, x, y, |pixel, _, row, column| {
        pixel.weight = block.weight[row][column];
        pixel.variance = block.variance[row][column];
        pixel.tolerance = block.tolerance[row][column];
        pixel.state = if pixel.variance == 0.0 {
            PixelState::Clean
        } else {
            PixelState::Noisy
        };
    });
}

/// The `N` features whose planes begin with `plane` and whose variances follow them, to the tile's from `feature` on.
fn filter_group<const N: usize>(
    input: &mut FeatureGroup<N>,
    output: &mut FilteredGroup<N>,
    plane: usize,
    tile: &mut Tile<FEATURES>,
    feature: usize,
    x: usize,
    y: usize,
) {
    for c in 0..N {
        for row in 0..FeatureGroup::<N>::HEIGHT {
            for column in 0..FeatureGroup::<N>::WIDTH {
                let x = (x + column) as isize - PREFILTER_HALO as isize;
                let y = (y + row) as isize - PREFILTER_HALO as isize;
                input.value[c][row][column] = nearest_value(plane + c, x, y);
                input.variance[c][row][column] = nearest_value(plane + N + c, x, y);
            }
        }
    }
    prefilter(input, output, None);
    for_block(tile, x, y, |pixel, variance, row, column| {
        let own = pixel.features.iter_mut().zip(variance);
        for (c, (value, variance)) in own.skip(feature).take(N).enumerate() {
            *value = output.value[c][row][column];
            *variance = output.variance[c][row][column];
        }
    });
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
