//! Tiles of which one pixel is open, so that a single window is fitted.

use linpred_core::{CELL, Formulas, HALO, LayerTile, PixelState, TILE, TILE_AREA};
use proptest::prelude::{Strategy, any};
use proptest::sample::select;

use crate::cells::{Job, Tile};
use crate::windows::Random;

/// A tile of which one pixel is open, so that it takes one model.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    /// Of all that is random in it.
    pub seed: u64,
    /// The open pixel, of the cell.
    pub open: (usize, usize),
    /// Part of the pixels that are missing.
    pub missing: f64,
    /// Whether the centre is.
    pub centre_missing: bool,
    /// Features that are noise and say so.
    pub noisy_features: usize,
    /// Deviation of the radiance's noise.
    pub noise: f64,
    /// Strength of what no feature knows of: the larger, the smaller the window.
    pub unknown: f64,
    /// Of everything that is light.
    pub exposure: f32,
}

/// Of all kinds.
pub fn cases() -> impl Strategy<Value = Case> {
    (
        any::<u64>(),
        (0..CELL, 0..CELL),
        (select(vec![0.0, 0.1, 0.5]), any::<bool>()),
        select(vec![0usize, 0, 2, 5]),
        (
            select(vec![0.02, 0.2, 0.6]),
            select(vec![0.0, 0.05, 0.5, 3.0]),
        ),
        select(vec![1.0f32, 1e-3, 300.0]),
    )
        .prop_map(
            |(
                seed,
                open,
                (missing, centre_missing),
                noisy_features,
                (noise, unknown),
                exposure,
            )| {
                Case {
                    seed,
                    open,
                    missing,
                    centre_missing: centre_missing && missing > 0.0,
                    noisy_features,
                    noise,
                    unknown,
                    exposure,
                }
            },
        )
}

impl Case {
    /// The open pixel, of the tile.
    pub fn centre(&self) -> usize {
        (self.open.1 + HALO) * TILE + self.open.0 + HALO
    }

    /// Pixels that are not open are clean or, as the papers' formulas know of no clean ones, outside.
    pub fn job(&self, formulas: Formulas) -> Job {
        let mut random = Random::new(self.seed);
        let mut tile = Box::new(Tile::EMPTY);
        let mut layer = LayerTile::BLACK;
        let slopes: Vec<f64> = (0..18).map(|_| random.normal() / 3.0).collect();
        for position in 0..TILE_AREA {
            self.pixel(&mut tile, position, &slopes, &mut random);
            let pixel = &mut tile.pixels[position];
            pixel.state = match formulas {
                _ if position == self.centre() => PixelState::Noisy,
                _ if formulas.are_published() => PixelState::Outside,
                _ => PixelState::Clean,
            };
            let colour = pixel.colour;
            layer.colour[position] = colour.map(|v| v * random.uniform() as f32);
        }
        Job::new(tile, vec![layer])
    }

    fn pixel(&self, tile: &mut Tile, position: usize, slopes: &[f64], random: &mut Random) {
        let (x, y) = ((position % TILE) as f64, (position / TILE) as f64);
        let edge = f64::from(u8::from(2.0 * x - y > 17.0));
        let mut features = [x, y, edge, 0.0, 0.0, 0.0, 0.0, 0.7, 0.0];
        features[3] = (x * 0.31).sin();
        features[4] = (y * 0.43 + x * 0.1).cos();
        for k in (3..7).chain([8]) {
            features[k] += 0.3 * random.normal();
        }
        let deviation = 0.2;
        for k in [8, 5, 6, 3, 4].into_iter().take(self.noisy_features) {
            features[k] = deviation * random.normal();
            tile.feature_variance[position][k] = (deviation * deviation) as f32;
        }
        let shadow = self.unknown * ((x * 0.9).sin() * (y * 0.7).cos());
        let pixel = &mut tile.pixels[position];
        pixel.features = features.map(|v| v as f32);
        for c in 0..3 {
            let known: f64 = (2..7).map(|k| slopes[6 * c + k - 2] * features[k]).sum();
            let value = 2.0 + 0.02 * x + known + shadow + self.noise * random.normal();
            pixel.colour[c] = self.exposure * value as f32;
        }
        let square = self.exposure * self.exposure;
        pixel.weight = (0.05 + random.uniform()) as f32 / square;
        let variance = 3.0 * self.noise * self.noise * (0.5 + random.uniform());
        pixel.variance = variance as f32 * square;
        pixel.tolerance = (variance * (1.0 + random.uniform()) + 1e-3) as f32 * square;
        let centre = position == self.centre();
        let missing = random.uniform() < self.missing;
        if if centre { self.centre_missing } else { missing } {
            pixel.weight = 0.0;
            pixel.colour = [0.0; 3];
            // What lies far from all others is predicted as if it lay near.
            pixel.features[4] *= 40.0;
        }
    }
}
