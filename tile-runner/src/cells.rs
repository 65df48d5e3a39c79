//! A row of cells: tiles in, predictions out, added up in an order that the cells' own does not change.

use std::num::NonZeroUsize;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use linpred_core::{
    CELL, Cells, Formulas, HALO, LayerTile, Params, Pixel, PixelState, Predictions, Scratch, Sum,
    TILE, TILE_AREA, Tile,
};
use rayon::prelude::*;

use crate::blocks::PreparedRows;
use crate::dispatch::{LANES, Level, TILE_FEATURES};
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
    /// The pixel at (x, y) of the image, without its features.
    pub(crate) fn pixel<const D: usize>(&self, x: usize, y: usize) -> Pixel<D> {
        let (rows, start) = self.prepared(y);
        let index = start + x;
        let band = self.band.colours(y as isize);
        let variance = rows.variance[index];
        Pixel {
            colour: std::array::from_fn(|c| band.colour[c][x]),
            weight: rows.weight[index],
            variance,
            tolerance: rows.tolerance[index],
            state: if band.good[x] == 0.0 {
                PixelState::Bad
            } else if variance == 0.0 {
                PixelState::Clean
            } else {
                PixelState::Noisy
            },
            ..Pixel::OUTSIDE
        }
    }

    /// The prepared rows that hold row `y` of the image, and where that begins in their planes.
    fn prepared(&self, y: usize) -> (&PreparedRows, usize) {
        let rows = &self.prepared[(y + PREPARED_ABOVE) / CELL - self.row];
        (rows, (y + PREPARED_ABOVE) % CELL * self.size.width())
    }

    /// Whether a cell is worked on, or skipped because no model is needed in it. The papers' formulas know of no such cells.
    pub(crate) fn needs_models(&self, column: usize, formulas: Formulas) -> bool {
        formulas == Formulas::Literal || !self.is_clean(column)
    }

    /// Whether every pixel of a cell passes through.
    fn is_clean(&self, column: usize) -> bool {
        let columns = column * CELL..self.size.width().min((column + 1) * CELL);
        (self.row * CELL..self.size.height().min((self.row + 1) * CELL)).all(|y| {
            let (rows, start) = self.prepared(y);
            let good = &self.band.colours(y as isize).good[columns.clone()];
            let variance = &rows.variance[start + columns.start..start + columns.end];
            variance.iter().all(|v| *v == 0.0) && good.iter().all(|v| *v != 0.0)
        })
    }

    fn load(&self, tile: &mut Tile<TILE_FEATURES>, column: usize) {
        let from = (column * CELL).saturating_sub(HALO);
        let columns = from..self.size.width().min((column + 1) * CELL + HALO);
        // of the tile, where the image begins
        let first = columns.start + HALO - column * CELL;
        for ty in 0..TILE {
            let row = ty * TILE..(ty + 1) * TILE;
            let (pixels, variances) = (
                &mut tile.pixels[row.clone()],
                &mut tile.feature_variance[row],
            );
            pixels.fill(Pixel::OUTSIDE);
            variances.fill([0.0; TILE_FEATURES]);
            for (tx, pixel) in pixels.iter_mut().enumerate() {
                pixel.features[0] = tx as f32;
                pixel.features[1] = ty as f32;
            }
            let y = (self.row * CELL + ty).checked_sub(HALO);
            if let Some(y) = y.filter(|y| *y < self.size.height()) {
                self.load_row(
                    &mut pixels[first..],
                    &mut variances[first..],
                    y,
                    columns.clone(),
                );
            }
        }
    }

    /// The pixels of `columns` of row `y`, but for their positions.
    fn load_row(
        &self,
        pixels: &mut [Pixel<TILE_FEATURES>],
        variances: &mut [[f32; TILE_FEATURES]],
        y: usize,
        columns: Range<usize>,
    ) {
        for (pixel, x) in pixels.iter_mut().zip(columns.clone()) {
            *pixel = Pixel {
                features: pixel.features,
                ..self.pixel(x, y)
            };
        }
        let (rows, start) = self.prepared(y);
        let planes = rows.features.iter().zip(&rows.feature_variances);
        for (k, (values, noise)) in planes.enumerate() {
            if !values.is_empty() {
                let own = start + columns.start..start + columns.end;
                for (pixel, value) in pixels.iter_mut().zip(&values[own.clone()]) {
                    pixel.features[k + 2] = *value;
                }
                for (variance, value) in variances.iter_mut().zip(&noise[own]) {
                    variance[k + 2] = *value;
                }
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

/// Cells that a thread works on side by side, and its working memory.
struct Bench {
    lanes: Vec<Lane>,
    scratch: Box<Scratch<TILE_FEATURES, LANES>>,
}

/// A cell in work.
struct Lane {
    column: usize,
    tile: Tile<TILE_FEATURES>,
    predictions: Predictions,
    layers: Vec<LayerTile>,
}

impl Bench {
    fn new(layers: usize) -> Self {
        let lane = || Lane {
            column: 0,
            tile: Tile::EMPTY,
            predictions: Predictions::NONE,
            layers: vec![LayerTile::BLACK; layers],
        };
        Self {
            lanes: (0..LANES).map(|_| lane()).collect(),
            scratch: Box::new(Scratch::new()),
        }
    }

    fn bytes(layers: usize) -> usize {
        let lane = size_of::<Lane>() + layers * size_of::<LayerTile>();
        LANES * lane + size_of::<Scratch<TILE_FEATURES, LANES>>()
    }
}

/// A row of cells while it is denoised.
struct RowOfCells<'a> {
    around: &'a Neighbourhood<'a>,
    columns: usize,
    formulas: Formulas,
    /// The next column that no thread has taken.
    next: AtomicUsize,
    models: &'a AtomicUsize,
    skipped: &'a AtomicUsize,
    sums: Mutex<&'a mut Sums>,
}

/// What a thread sees of it.
struct Share<'a> {
    row: &'a RowOfCells<'a>,
    lanes: &'a mut [Lane],
}

impl Cells<TILE_FEATURES> for Share<'_> {
    fn next(&mut self, lane: usize) -> bool {
        let column = loop {
            let column = self.row.next.fetch_add(1, Ordering::Relaxed);
            if column >= self.row.columns {
                return false;
            }
            if self.row.around.needs_models(column, self.row.formulas) {
                break column;
            }
            self.row.skipped.fetch_add(1, Ordering::Relaxed);
        };
        let lane = &mut self.lanes[lane];
        lane.column = column;
        self.row.around.load(&mut lane.tile, column);
        for (layer, tile) in lane.layers.iter_mut().enumerate() {
            self.row.around.load_layer(tile, layer, column);
            tile.clear();
        }
        true
    }

    fn tile(&self, lane: usize) -> &Tile<TILE_FEATURES> {
        &self.lanes[lane].tile
    }

    fn results(&mut self, lane: usize) -> (&mut Predictions, &mut [LayerTile]) {
        let lane = &mut self.lanes[lane];
        (&mut lane.predictions, &mut lane.layers)
    }

    fn done(&mut self, lane: usize, models: u32) {
        self.row
            .models
            .fetch_add(models as usize, Ordering::Relaxed);
        // A thread that panicked takes the run down with it; the sums are of no use then.
        let mut sums = self.row.sums.lock().unwrap_or_else(PoisonError::into_inner);
        sums.add(&self.lanes[lane]);
    }
}

/// Sums of predictions over some rows.
struct Sums {
    width: usize,
    beauty: Vec<Sum>,
    /// Of each layer, red green blue.
    layers: Vec<Vec<[f32; 3]>>,
}

impl Sums {
    fn new(layout: &RowLayout, rows: usize) -> Self {
        let pixels = layout.size.width() * rows;
        Self {
            width: layout.size.width(),
            beauty: vec![Sum::NONE; pixels],
            layers: vec![vec![[0.0; 3]; pixels]; layout.layers],
        }
    }

    fn bytes(layout: &RowLayout, rows: usize) -> u64 {
        let planes = size_of::<Sum>() / size_of::<f32>() + 3 * layout.layers;
        plane_bytes(layout.size, rows, planes)
    }

    /// Adds a cell of the row whose halo begins with the first row. No pixel is reached by more than two cells of a row,
    /// and the sum of two floats does not depend on their order.
    fn add(&mut self, lane: &Lane) {
        const { assert!(2 * HALO < CELL) };
        let columns = lane.column * CELL..self.width.min(lane.column * CELL + TILE - HALO) + HALO;
        for ty in 0..TILE {
            for (tx, x) in columns.clone().enumerate() {
                let Some(x) = x.checked_sub(HALO) else {
                    continue;
                };
                let (from, to) = (ty * TILE + tx, ty * self.width + x);
                self.beauty[to].add(&lane.predictions.sums[from]);
                for (sums, layer) in self.layers.iter_mut().zip(&lane.layers) {
                    add_colour(&mut sums[to], &layer.sums[from]);
                }
            }
        }
    }
}

fn add_colour(sum: &mut [f32; 3], other: &[f32; 3]) {
    for (sum, value) in sum.iter_mut().zip(other) {
        *sum += value;
    }
}

/// Sums of predictions of the rows that a row of cells can reach.
pub(crate) struct SumRows {
    /// The first row held.
    first: isize,
    /// Of the row of cells; where it overlaps the one before, of both once both are predicted.
    own: Sums,
    /// What the row of cells before has left in its halo.
    before: Sums,
    benches: Vec<Bench>,
}

/// What a row of cells took.
pub(crate) struct Predicted {
    pub(crate) models: u64,
    pub(crate) cells: u64,
    /// Cells without noise.
    pub(crate) skipped: u64,
    /// Of all threads together, in the other cells.
    pub(crate) time: Duration,
}

/// Rows that two rows of cells reach.
const OVERLAP: usize = TILE - CELL;

impl SumRows {
    /// Sums for the first row of cells.
    pub(crate) fn new(layout: &RowLayout, threads: NonZeroUsize) -> Self {
        Self {
            first: -(HALO as isize),
            own: Sums::new(layout, TILE),
            before: Sums::new(layout, OVERLAP),
            benches: (0..threads.get())
                .map(|_| Bench::new(layout.layers))
                .collect(),
        }
    }

    /// Bytes of the sums and of what predicting takes, on `threads` threads.
    pub(crate) fn bytes(layout: &RowLayout, threads: u64) -> u64 {
        let benches = threads.saturating_mul(Bench::bytes(layout.layers) as u64);
        Sums::bytes(layout, TILE + OVERLAP).saturating_add(benches)
    }

    /// The sums of row `y`.
    pub(crate) fn row(&self, y: usize) -> &[Sum] {
        let start = self.start(y);
        &self.own.beauty[start..start + self.own.width]
    }

    /// The sums of row `y` of a layer.
    pub(crate) fn layer_row(&self, layer: usize, y: usize) -> &[[f32; 3]] {
        let start = self.start(y);
        &self.own.layers[layer][start..start + self.own.width]
    }

    fn start(&self, y: usize) -> usize {
        (y as isize - self.first) as usize * self.own.width
    }

    /// Moves on by a row of cells: the rows that no later cell reaches are let go.
    pub(crate) fn advance(&mut self) {
        let left = CELL * self.own.width;
        self.before.beauty.copy_from_slice(&self.own.beauty[left..]);
        self.own.beauty.fill(Sum::NONE);
        for (before, own) in self.before.layers.iter_mut().zip(&mut self.own.layers) {
            before.copy_from_slice(&own[left..]);
            own.fill([0.0; 3]);
        }
        self.first += CELL as isize;
    }

    /// Denoises a row of cells and adds up their predictions; counts what that took.
    pub(crate) fn predict(
        &mut self,
        around: &Neighbourhood,
        params: &Params,
        level: Level,
    ) -> Predicted {
        let (models, skipped) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let columns = around.size.width().div_ceil(CELL);
        let row = RowOfCells {
            around,
            columns,
            formulas: params.formulas,
            next: AtomicUsize::new(0),
            models: &models,
            skipped: &skipped,
            sums: Mutex::new(&mut self.own),
        };
        let times = self.benches.par_iter_mut().map(|bench| {
            let mut share = Share {
                row: &row,
                lanes: &mut bench.lanes,
            };
            let started = Instant::now();
            level.denoise_cells(&mut share, params, &mut bench.scratch);
            started.elapsed()
        });
        let time = times.sum();
        self.add_before();
        Predicted {
            models: models.into_inner() as u64,
            cells: columns as u64,
            skipped: skipped.into_inner() as u64,
            time,
        }
    }

    /// Adds what the row of cells before has left.
    fn add_before(&mut self) {
        for (own, before) in self.own.beauty.iter_mut().zip(&self.before.beauty) {
            own.add(before);
        }
        for (own, before) in self.own.layers.iter_mut().zip(&self.before.layers) {
            for (own, before) in own.iter_mut().zip(before) {
                add_colour(own, before);
            }
        }
    }
}
