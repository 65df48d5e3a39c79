//! Rows of cells, shared by threads: tiles in, predictions out.
//!
//! A thread works on as many cells as there are lanes, and takes the next when one is done: at the end, lanes have nothing to do. So several rows of cells are worked on together where one has
//! few columns for the lanes of all threads (see [`best_rows`]).

use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use linpred_core::{
    CELL, Cells, FeatureSet, Formulas, LayerTile, OtherFeatures, Params, Predictions, SETS,
    Scratch, TILE_FEATURES, Tile, WIDE_TILE_FEATURES,
};
use linpred_dispatch::{InstructionSet, LANES};
use rayon::prelude::*;

use crate::row::RowLayout;
use crate::stream::neighbourhood::{CellAt, Neighbourhood};
use crate::stream::sum_rows::{Adding, SumRows};

/// Rows of cells that are best worked on together: each lane has some eight cells then. Part of the lanes of two threads that are busy, counted from the models of every cell (`balanced`): at 512 columns with one row .71,
/// with two, four, eight .83, .91, .95; at 1920 .90, .95, .97, .98.
pub(crate) fn best_rows(layout: &RowLayout, threads: NonZeroUsize) -> NonZeroUsize {
    let columns = layout.size.width().div_ceil(CELL);
    let all = layout.size.height().div_ceil(CELL);
    let cells = threads.get().saturating_mul(CELLS_PER_LANE * LANES);
    let rows = cells.div_ceil(columns).min(all);
    NonZeroUsize::new(rows).unwrap_or(NonZeroUsize::MIN)
}

/// Cells that a lane works on one after the other, if there are enough.
const CELLS_PER_LANE: usize = 8;

/// Where rows of cells are denoised, some after others.
pub(crate) struct CellBenches {
    benches: Benches,
    /// Columns of cells.
    columns: usize,
}

/// A bench for each thread, as wide as the image's features ask for.
enum Benches {
    /// For the features that are known by their names: tiles that have no room for more take half the memory and less time.
    Known(Vec<Bench<TILE_FEATURES>>),
    /// For further ones, too.
    Wide(Vec<Bench<WIDE_TILE_FEATURES>>),
}

/// What rows of cells took.
pub(crate) struct Predicted {
    pub(crate) models: u64,
    pub(crate) cells: u64,
    /// Cells without noise.
    pub(crate) skipped: u64,
    /// Of all threads together, in the other cells.
    pub(crate) time: Duration,
}

impl CellBenches {
    /// A bench for each thread; models may `vary` in what they see.
    pub(crate) fn new(layout: &RowLayout, threads: NonZeroUsize, vary: bool) -> Self {
        let (layers, threads) = (layout.followers(), 0..threads.get());
        Self {
            benches: match layout.is_wide() {
                false => Benches::Known(threads.map(|_| Bench::new(layers, vary)).collect()),
                true => Benches::Wide(threads.map(|_| Bench::new(layers, vary)).collect()),
            },
            columns: layout.size.width().div_ceil(CELL),
        }
    }

    /// Bytes of the benches for `threads` threads.
    pub(crate) fn bytes(layout: &RowLayout, threads: u64, vary: bool) -> u64 {
        let bytes = match layout.is_wide() {
            false => Bench::<TILE_FEATURES>::bytes(layout.followers(), vary),
            true => Bench::<WIDE_TILE_FEATURES>::bytes(layout.followers(), vary),
        };
        threads.saturating_mul(bytes as u64)
    }

    /// Denoises rows of cells and adds their predictions to `sums`; counts what that took.
    pub(crate) fn predict(
        &mut self,
        around: &Neighbourhood,
        params: &Params,
        instruction_set: InstructionSet,
        sums: &mut SumRows,
    ) -> Predicted {
        let rows = RowsOfCells {
            around,
            formulas: params.formulas,
            columns: self.columns,
            next: AtomicUsize::new(0),
            models: AtomicU64::new(0),
            skipped: AtomicU64::new(0),
            sums: sums.adding(),
        };
        let time = match &mut self.benches {
            Benches::Known(benches) => rows.share_out(benches, |share, scratch| {
                instruction_set.denoise_cells(share, params, scratch);
            }),
            Benches::Wide(benches) => rows.share_out(benches, |share, scratch| {
                instruction_set.denoise_wide_cells(share, params, scratch);
            }),
        };
        Predicted {
            models: rows.models.into_inner(),
            cells: (self.columns * around.cells.len()) as u64,
            skipped: rows.skipped.into_inner(),
            time,
        }
    }
}

/// Cells that a thread works on side by side, and its working memory.
struct Bench<const D: usize> {
    lanes: Vec<Lane<D>>,
    scratch: Box<Scratch<D, LANES>>,
}

/// A cell in work.
struct Lane<const D: usize> {
    at: CellAt,
    tile: Tile<D>,
    /// Other features, where models vary in what they see.
    otherwise: Option<Box<OtherFeatures<D>>>,
    /// Whether they are those of the tile.
    differs: bool,
    predictions: Predictions,
    layers: Vec<LayerTile>,
}

impl<const D: usize> Bench<D> {
    fn new(layers: usize, vary: bool) -> Self {
        let lane = || Lane {
            at: CellAt::default(),
            tile: Tile::EMPTY,
            otherwise: vary.then(|| Box::new([const { FeatureSet::EMPTY }; SETS - 1])),
            differs: false,
            predictions: Predictions::NONE,
            layers: vec![LayerTile::BLACK; layers],
        };
        Self {
            lanes: (0..LANES).map(|_| lane()).collect(),
            scratch: Box::new(Scratch::new()),
        }
    }

    fn bytes(layers: usize, vary: bool) -> usize {
        let otherwise = usize::from(vary) * size_of::<OtherFeatures<D>>();
        let lane = size_of::<Lane<D>>() + otherwise + layers * size_of::<LayerTile>();
        LANES * lane + size_of::<Scratch<D, LANES>>()
    }
}

/// Rows of cells while they are denoised.
struct RowsOfCells<'a> {
    around: &'a Neighbourhood<'a>,
    formulas: Formulas,
    columns: usize,
    /// The next cell that no thread has taken, row by row.
    next: AtomicUsize,
    models: AtomicU64,
    skipped: AtomicU64,
    /// By the rows.
    sums: Vec<Adding<'a>>,
}

impl RowsOfCells<'_> {
    /// Has its cells denoised, each thread at a bench of its own, and returns how long all of them took together.
    fn share_out<const D: usize>(
        &self,
        benches: &mut [Bench<D>],
        denoise: impl Fn(&mut Share<'_, '_, D>, &mut Scratch<D, LANES>) + Sync,
    ) -> Duration {
        let times = benches.par_iter_mut().map(|bench| {
            let mut share = Share {
                rows: self,
                lanes: &mut bench.lanes,
            };
            let started = Instant::now();
            denoise(&mut share, &mut bench.scratch);
            started.elapsed()
        });
        times.sum()
    }
}

/// What a thread sees of them.
struct Share<'a, 'b, const D: usize> {
    rows: &'a RowsOfCells<'b>,
    lanes: &'a mut [Lane<D>],
}

impl<const D: usize> Cells<D> for Share<'_, '_, D> {
    fn next(&mut self, lane: usize) -> bool {
        let (around, columns) = (self.rows.around, self.rows.columns);
        let at = loop {
            let next = self.rows.next.fetch_add(1, Ordering::Relaxed);
            let at = CellAt {
                row: around.cells.start + next / columns,
                column: next % columns,
            };
            if !around.cells.contains(&at.row) {
                return false;
            }
            if around.needs_models(at, self.rows.formulas) {
                break at;
            }
            self.rows.skipped.fetch_add(1, Ordering::Relaxed);
        };
        let lane = &mut self.lanes[lane];
        lane.at = at;
        around.load(&mut lane.tile, at);
        let otherwise = lane.otherwise.as_deref_mut();
        lane.differs = otherwise.is_some_and(|other| around.load_otherwise(other, at));
        for (layer, tile) in lane.layers.iter_mut().enumerate() {
            around.load_layer(tile, layer, at);
            tile.clear();
        }
        true
    }

    fn tile(&self, lane: usize) -> &Tile<D> {
        &self.lanes[lane].tile
    }

    fn otherwise(&self, lane: usize) -> Option<&OtherFeatures<D>> {
        let lane = &self.lanes[lane];
        lane.otherwise.as_deref().filter(|_| lane.differs)
    }

    fn results(&mut self, lane: usize) -> (&mut Predictions, &mut [LayerTile]) {
        let lane = &mut self.lanes[lane];
        (&mut lane.predictions, &mut lane.layers)
    }

    fn done(&mut self, lane: usize, models: u32) {
        let models = u64::from(models);
        self.rows.models.fetch_add(models, Ordering::Relaxed);
        let lane = &self.lanes[lane];
        let (predictions, layers) = (&lane.predictions, &lane.layers);
        if let Some(sums) = (self.rows.sums).get(lane.at.row - self.rows.around.cells.start) {
            sums.add(lane.at.column, predictions, layers);
        }
    }
}
