//! A row of cells: tiles in, predictions out, added up in the order of the cells.

use linpred_core::{CELL, HALO, Params, Pixel, PixelState, Predictions, Scratch, Sum, TILE, Tile};
use rayon::prelude::*;

use crate::blocks::PreparedRows;
use crate::dispatch::{Level, TILE_FEATURES};
use crate::geometry::ImageSize;
use crate::held_rows::HeldRows;

/// The prepared rows that a row of cells reads: the one above, its own, the one below.
pub(crate) struct Neighbourhood<'a> {
    pub(crate) size: ImageSize,
    pub(crate) band: &'a HeldRows,
    /// Prepared rows of cell rows `row - 1`, `row`, `row + 1`.
    pub(crate) prepared: [&'a PreparedRows; 3],
    pub(crate) row: usize,
}

impl Neighbourhood<'_> {
    /// The pixel at (x, y) of the image.
    pub(crate) fn pixel(&self, x: usize, y: usize) -> Pixel<TILE_FEATURES> {
        let rows = self.prepared[y / CELL + 1 - self.row];
        let index = y % CELL * self.size.width() + x;
        let band = self.band.row(y as isize);
        let mut pixel = Pixel::OUTSIDE;
        for (k, (value, variance)) in rows
            .features
            .iter()
            .zip(&rows.feature_variances)
            .enumerate()
        {
            pixel.features[k + 2] = value[index];
            pixel.feature_variance[k + 2] = variance[index];
        }
        pixel.colour = std::array::from_fn(|c| band.colour[c][x]);
        pixel.weight = rows.weight[index];
        pixel.variance = rows.variance[index];
        pixel.tolerance = rows.tolerance[index];
        pixel.state = if band.good[x] == 0.0 {
            PixelState::Bad
        } else if pixel.variance == 0.0 {
            PixelState::Clean
        } else {
            PixelState::Noisy
        };
        pixel
    }

    fn load(&self, tile: &mut Tile<TILE_FEATURES>, column: usize) {
        for ty in 0..TILE {
            let y = (self.row * CELL + ty)
                .checked_sub(HALO)
                .filter(|y| *y < self.size.height());
            for tx in 0..TILE {
                let x = (column * CELL + tx)
                    .checked_sub(HALO)
                    .filter(|x| *x < self.size.width());
                let mut pixel = match (x, y) {
                    (Some(x), Some(y)) => self.pixel(x, y),
                    _ => Pixel::OUTSIDE,
                };
                pixel.features[0] = tx as f32;
                pixel.features[1] = ty as f32;
                tile.pixels[ty * TILE + tx] = pixel;
            }
        }
    }
}

/// Working memory of a thread.
struct Bench {
    tile: Tile<TILE_FEATURES>,
    scratch: Scratch,
}

/// Sums of predictions of the rows that a row of cells can reach.
pub(crate) struct SumRows {
    width: usize,
    /// The first row held.
    first: isize,
    sums: Vec<Sum>,
}

impl SumRows {
    /// Sums for the first row of cells.
    pub(crate) fn new(size: ImageSize) -> Self {
        Self {
            width: size.width(),
            first: -(HALO as isize),
            sums: vec![Sum::NONE; size.width() * TILE],
        }
    }

    /// The sums of row `y`.
    pub(crate) fn row(&self, y: usize) -> &[Sum] {
        let start = (y as isize - self.first) as usize * self.width;
        &self.sums[start..start + self.width]
    }

    /// Moves on by a row of cells: the rows that no later cell reaches are let go.
    pub(crate) fn advance(&mut self) {
        self.sums.copy_within(CELL * self.width.., 0);
        let kept = (TILE - CELL) * self.width;
        self.sums[kept..].fill(Sum::NONE);
        self.first += CELL as isize;
    }

    /// Denoises a row of cells and adds up their predictions; returns how many models that took.
    pub(crate) fn predict(&mut self, around: &Neighbourhood, params: &Params, level: Level) -> u64 {
        let columns: Vec<usize> = (0..around.size.width().div_ceil(CELL)).collect();
        let mut models = 0;
        for columns in columns.chunks(4 * rayon::current_num_threads()) {
            let results: Vec<(u32, Box<Predictions>)> = columns
                .par_iter()
                .map_init(bench, |bench, &column| {
                    let mut predictions = Box::new(Predictions::NONE);
                    around.load(&mut bench.tile, column);
                    let models = level.denoise_cell(
                        &bench.tile,
                        params,
                        &mut bench.scratch,
                        &mut predictions,
                    );
                    (models, predictions)
                })
                .collect();
            for ((count, predictions), &column) in results.iter().zip(columns) {
                models += u64::from(*count);
                self.add(predictions, column);
            }
        }
        models
    }

    fn add(&mut self, predictions: &Predictions, column: usize) {
        for (ty, row) in predictions.sums.chunks_exact(TILE).enumerate() {
            for (tx, sum) in row.iter().enumerate() {
                let x = (column * CELL + tx)
                    .checked_sub(HALO)
                    .filter(|x| *x < self.width);
                if let Some(x) = x {
                    self.sums[ty * self.width + x].add(sum);
                }
            }
        }
    }
}

fn bench() -> Box<Bench> {
    Box::new(Bench {
        tile: Tile::EMPTY,
        scratch: Scratch::new(),
    })
}
