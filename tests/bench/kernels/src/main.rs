//! A small fixed workload for each of the core's kernels, for `regress.sh` to count instructions in.
//!
//! `kernels denoise_cells|prefilter|weigh_samples`. What is counted runs in [`counted`] alone; the images are made outside it. No
//! instruction set beyond the target's own is used.

use std::hint::black_box;

use anyhow::{Result, bail};
use linpred_core::{
    Cells, ColourBlock, FeatureGroup, FilteredGroup, LayerTile, Params, Pixel, PixelState,
    Predictions, Scratch, TILE, Tile, WeightBlock, denoise_cells, prefilter, weigh_samples,
};

/// Position, normal, albedo and depth, as in the pipeline.
const FEATURES: usize = 9;

/// Cells side by side, as in the pipeline.
const LANES: usize = 8;

/// Instructions of calls to this function are counted, by its name.
#[inline(never)]
fn counted(work: &mut dyn FnMut()) {
    work();
}

fn main() -> Result<()> {
    let name = std::env::args().nth(1).unwrap_or_default();
    match name.as_str() {
        "denoise_cells" => cells(),
        "prefilter" => filtered_groups(),
        "weigh_samples" => prepared_blocks(),
        _ => bail!("kernels denoise_cells|prefilter|weigh_samples"),
    }
    Ok(())
}

/// Numbers from -1 to 1 that are the same everywhere.
struct Noise(u32);

impl Noise {
    fn next(&mut self) -> f32 {
        // xorshift32 (Marsaglia 2003)
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        (self.0 >> 8) as f32 / 8_388_608.0 - 1.0
    }
}

/// Cells of three ranks, twice as many as lanes: a plain wall, an edge, and textured noise.
fn cells() {
    let mut row = Row {
        tiles: (0..2 * LANES).map(|i| tile(i % 3)).collect(),
        lanes: [0; LANES],
        next: 0,
        predictions: (0..LANES).map(|_| Predictions::NONE).collect(),
        models: 0,
    };
    let mut scratch = Box::new(Scratch::<FEATURES, LANES>::new());
    counted(&mut || denoise_cells(&mut row, &Params::default(), &mut scratch));
    black_box(&row.predictions);
    println!("{} models", row.models);
}

struct Row {
    tiles: Vec<Box<Tile<FEATURES>>>,
    /// Which tile each lane has.
    lanes: [usize; LANES],
    next: usize,
    predictions: Vec<Predictions>,
    models: u32,
}

impl Cells<FEATURES> for Row {
    fn next(&mut self, lane: usize) -> bool {
        if self.next == self.tiles.len() {
            return false;
        }
        self.lanes[lane] = self.next;
        self.next += 1;
        true
    }

    fn tile(&self, lane: usize) -> &Tile<FEATURES> {
        &self.tiles[self.lanes[lane]]
    }

    fn results(&mut self, lane: usize) -> (&mut Predictions, &mut [LayerTile]) {
        (&mut self.predictions[lane], &mut [])
    }

    fn done(&mut self, _: usize, models: u32) {
        self.models += models;
    }
}

fn tile(kind: usize) -> Box<Tile<FEATURES>> {
    let mut noise = Noise(7 + kind as u32);
    let mut tile = Box::new(Tile::EMPTY);
    for y in 0..TILE {
        for x in 0..TILE {
            let at = y * TILE + x;
            (tile.pixels[at], tile.feature_variance[at]) = pixel(kind, x, y, &mut noise);
        }
    }
    tile
}

/// A pixel and the variances of its features.
fn pixel(kind: usize, x: usize, y: usize, noise: &mut Noise) -> (Pixel<FEATURES>, [f32; FEATURES]) {
    let (across, down) = (x as f32, y as f32);
    let edge = if kind > 0 && 2 * x + y > 52 { 1.0 } else { 0.0 };
    let texture = if kind > 1 { 0.3 } else { 0.0 };
    let mut features = [
        across,
        down,
        edge,
        0.3 * edge,
        1.0 - edge,
        0.5,
        0.4,
        0.3,
        5.0 + 0.02 * down,
    ];
    let mut feature_variance = [0.0; FEATURES];
    for k in 2..FEATURES {
        features[k] += texture * noise.next();
        feature_variance[k] = 1e-4 * texture;
    }
    let level = 0.5 + 0.5 * edge + 0.01 * across + 0.4 * (features[5] - 0.5);
    let pixel = Pixel {
        features,
        colour: [1.0, 0.8, 0.6].map(|tint| tint * level + 0.2 * noise.next()),
        weight: 1.0 / (level * level + 0.3),
        variance: 0.04,
        tolerance: 0.06,
        state: PixelState::Noisy,
    };
    (pixel, feature_variance)
}

/// A group of three noisy features.
fn filtered_groups() {
    let mut noise = Noise(11);
    let mut group = Box::new(FeatureGroup::<3>::ZERO);
    for plane in 0..3 {
        for y in 0..FeatureGroup::<3>::HEIGHT {
            for x in 0..FeatureGroup::<3>::WIDTH {
                let edge = if x > 20 + plane { 0.8 } else { 0.1 };
                group.value[plane][y][x] = edge + 0.1 * noise.next();
                group.variance[plane][y][x] = 3e-3;
            }
        }
    }
    let mut filtered = Box::new(FilteredGroup::ZERO);
    counted(&mut || {
        black_box(prefilter(&group, &mut filtered, None));
    });
    black_box(&filtered);
}

/// A block with a bright corner and a black one.
fn prepared_blocks() {
    let mut noise = Noise(13);
    let mut block = Box::new(ColourBlock::BLACK);
    for y in 0..ColourBlock::HEIGHT {
        for x in 0..ColourBlock::WIDTH {
            let level = ((x * y) as f32 / 100.0 - 1.0).max(0.0);
            block.luminance[y][x] = level * (1.0 + 0.5 * noise.next());
            block.variance[y][x] = 0.1 * level * level;
            block.good[y][x] = 1.0;
        }
    }
    let mut prepared = Box::new(WeightBlock::EMPTY);
    counted(&mut || weigh_samples(&block, &mut prepared));
    black_box(&prepared);
}
