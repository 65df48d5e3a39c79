//! One cell alone, for callers with a single tile in memory.

use crate::blend::{LayerTile, Predictions};
use crate::cell::denoise_cells;
use crate::cell::lent::{Cells, Scratch};
use crate::params::Params;
use crate::tile::Tile;

/// Predicts one cell into `predictions` and the layers' sums, and returns how many models that took: [`denoise_cells`] for one.
///
/// Overwrites what `predictions` and the sums held. All models see the features of the tile: to have them vary, implement [`Cells::otherwise`].
#[inline(always)]
pub fn denoise_cell<const D: usize>(
    tile: &Tile<D>,
    params: &Params,
    layers: &mut [LayerTile],
    scratch: &mut Scratch<D, 1>,
    predictions: &mut Predictions,
) -> u32 {
    for layer in layers.iter_mut() {
        layer.clear();
    }
    let mut cell = OneCell {
        tile,
        layers,
        predictions,
        left: true,
        models: 0,
    };
    denoise_cells(&mut cell, params, scratch);
    cell.models
}

struct OneCell<'a, const D: usize> {
    tile: &'a Tile<D>,
    layers: &'a mut [LayerTile],
    predictions: &'a mut Predictions,
    left: bool,
    models: u32,
}

impl<const D: usize> Cells<D> for OneCell<'_, D> {
    fn next(&mut self, _: usize) -> bool {
        core::mem::take(&mut self.left)
    }

    fn tile(&self, _: usize) -> &Tile<D> {
        self.tile
    }

    fn results(&mut self, _: usize) -> (&mut Predictions, &mut [LayerTile]) {
        (self.predictions, self.layers)
    }

    fn done(&mut self, _: usize, models: u32) {
        self.models = models;
    }
}
