//! A row of cells: tiles in, predictions out, added up in the order of the cells.

use linpred_core::{
    CELL, HALO, LayerTile, Params, Pixel, PixelState, Predictions, Scratch, Sum, TILE, TILE_AREA,
    Tile,
};
use rayon::prelude::*;

use crate::blocks::PreparedRows;
use crate::dispatch::{Level, TILE_FEATURES};
use crate::geometry::{ImageSize, plane_bytes};
use crate::held_rows::HeldRows;
use crate::row::RowLayout;

/// What a row of cells reads.
pub(crate) struct Neighbourhood<'a> {
    pub(crate) size: ImageSize,
    pub(crate) band: &'a HeldRows,
    /// From the halo above the cells to the middle row of pixels, and from there to the halo below (see [`prepared_from`]).
    pub(crate) prepared: &'a [PreparedRows; 2],
    pub(crate) row: usize,
}

/// The first row of the `piece`-th prepared rows. They are cut at the edges of halos, so that a row of cells with its halo lies in
/// two pieces.
pub(crate) fn prepared_from(piece: usize) -> isize {
    (piece * CELL) as isize - PREPARED_ABOVE as isize
}

/// Rows of the first piece above the image.
const PREPARED_ABOVE: usize = CELL - HALO;
const _: () = assert!(HALO <= PREPARED_ABOVE && CELL + HALO <= 2 * CELL - PREPARED_ABOVE);

impl Neighbourhood<'_> {
    /// The pixel at (x, y) of the image.
    pub(crate) fn pixel(&self, x: usize, y: usize) -> Pixel<TILE_FEATURES> {
        let rows = &self.prepared[(y + PREPARED_ABOVE) / CELL - self.row];
        let index = (y + PREPARED_ABOVE) % CELL * self.size.width() + x;
        let band = self.band.colours(y as isize);
        let mut pixel = Pixel::OUTSIDE;
        for (k, (value, variance)) in rows
            .features
            .iter()
            .zip(&rows.feature_variances)
            .enumerate()
        {
            if !value.is_empty() {
                pixel.features[k + 2] = value[index];
                pixel.feature_variance[k + 2] = variance[index];
            }
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

    fn load_layer(&self, tile: &mut LayerTile, layer: usize, column: usize) {
        tile.colour = [[0.0; 3]; TILE_AREA];
        for ty in 0..TILE {
            let y = (self.row * CELL + ty)
                .checked_sub(HALO)
                .filter(|y| *y < self.size.height());
            let Some(y) = y else { continue };
            let planes = &self.band.colours(y as isize).layers[layer];
            for tx in 0..TILE {
                let x = (column * CELL + tx)
                    .checked_sub(HALO)
                    .filter(|x| *x < self.size.width());
                if let Some(x) = x {
                    tile.colour[ty * TILE + tx] = std::array::from_fn(|c| planes[c][x]);
                }
            }
        }
    }
}

/// What became of one cell.
struct Outcome {
    models: u32,
    predictions: Box<Predictions>,
    layers: Vec<LayerTile>,
}

/// Working memory of a thread.
struct Bench {
    tile: Tile<TILE_FEATURES>,
    scratch: Scratch,
}

/// Cells that each thread denoises before their predictions are added up.
const CELLS_PER_THREAD: usize = 4;

/// Sums of predictions of the rows that a row of cells can reach.
pub(crate) struct SumRows {
    width: usize,
    /// The first row held.
    first: isize,
    sums: Vec<Sum>,
    /// Sums of each layer, red green blue.
    layers: Vec<Vec<[f32; 3]>>,
}

impl SumRows {
    /// Sums for the first row of cells.
    pub(crate) fn new(layout: &RowLayout) -> Self {
        let pixels = layout.size.width() * TILE;
        Self {
            width: layout.size.width(),
            first: -(HALO as isize),
            sums: vec![Sum::NONE; pixels],
            layers: vec![vec![[0.0; 3]; pixels]; layout.layers],
        }
    }

    /// Bytes of the sums.
    pub(crate) fn bytes(layout: &RowLayout) -> u64 {
        let planes = size_of::<Sum>() / size_of::<f32>() + 3 * layout.layers;
        plane_bytes(layout.size, TILE, planes)
    }

    /// Bytes that predicting takes, on `threads` threads.
    pub(crate) fn working_bytes(layout: &RowLayout, threads: u64) -> u64 {
        let outcome = size_of::<Predictions>() + layout.layers * size_of::<LayerTile>();
        threads * (size_of::<Bench>() + CELLS_PER_THREAD * outcome) as u64
    }

    /// The sums of row `y`.
    pub(crate) fn row(&self, y: usize) -> &[Sum] {
        let start = (y as isize - self.first) as usize * self.width;
        &self.sums[start..start + self.width]
    }

    /// The sums of row `y` of a layer.
    pub(crate) fn layer_row(&self, layer: usize, y: usize) -> &[[f32; 3]] {
        let start = (y as isize - self.first) as usize * self.width;
        &self.layers[layer][start..start + self.width]
    }

    /// Moves on by a row of cells: the rows that no later cell reaches are let go.
    pub(crate) fn advance(&mut self) {
        self.sums.copy_within(CELL * self.width.., 0);
        let kept = (TILE - CELL) * self.width;
        self.sums[kept..].fill(Sum::NONE);
        for sums in &mut self.layers {
            sums.copy_within(CELL * self.width.., 0);
            sums[kept..].fill([0.0; 3]);
        }
        self.first += CELL as isize;
    }

    /// Denoises a row of cells and adds up their predictions; returns how many models that took.
    pub(crate) fn predict(&mut self, around: &Neighbourhood, params: &Params, level: Level) -> u64 {
        let columns: Vec<usize> = (0..around.size.width().div_ceil(CELL)).collect();
        let mut models = 0;
        for columns in columns.chunks(CELLS_PER_THREAD * rayon::current_num_threads()) {
            let outcomes: Vec<Outcome> = columns
                .par_iter()
                .map_init(bench, |bench, &column| {
                    bench.denoise(around, column, params, level, self.layers.len())
                })
                .collect();
            for (outcome, &column) in outcomes.iter().zip(columns) {
                models += u64::from(outcome.models);
                self.add(outcome, column);
            }
        }
        models
    }

    fn add(&mut self, outcome: &Outcome, column: usize) {
        let columns = column * CELL..self.width.min(column * CELL + TILE - HALO) + HALO;
        for ty in 0..TILE {
            for (tx, x) in columns.clone().enumerate() {
                let Some(x) = x.checked_sub(HALO) else {
                    continue;
                };
                let (from, to) = (ty * TILE + tx, ty * self.width + x);
                self.sums[to].add(&outcome.predictions.sums[from]);
                for (sums, layer) in self.layers.iter_mut().zip(&outcome.layers) {
                    for (sum, value) in sums[to].iter_mut().zip(layer.sums[from]) {
                        *sum += value;
                    }
                }
            }
        }
    }
}

impl Bench {
    fn denoise(
        &mut self,
        around: &Neighbourhood,
        column: usize,
        params: &Params,
        level: Level,
        layers: usize,
    ) -> Outcome {
        around.load(&mut self.tile, column);
        let mut outcome = Outcome {
            models: 0,
            predictions: Box::new(Predictions::NONE),
            layers: vec![LayerTile::BLACK; layers],
        };
        for (layer, tile) in outcome.layers.iter_mut().enumerate() {
            around.load_layer(tile, layer, column);
        }
        let Outcome {
            predictions,
            layers,
            ..
        } = &mut outcome;
        outcome.models =
            level.denoise_cell(&self.tile, params, layers, &mut self.scratch, predictions);
        outcome
    }
}

fn bench() -> Box<Bench> {
    Box::new(Bench {
        tile: Tile::EMPTY,
        scratch: Scratch::new(),
    })
}
