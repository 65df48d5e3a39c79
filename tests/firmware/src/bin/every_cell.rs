//! Denoises a cell of which the optimiser knows nothing, with a layer and by formulas that it cannot know either. That this links
//! without allocator and without panic is the test; it is not run.

#![no_std]
#![no_main]

#[path = "../no_panic.rs"]
mod no_panic;

use core::hint::black_box;

use cortex_m_rt::entry;
use linpred_core::{
    LayerTile, Params, Predictions, Scratch, Tile, denoise_cell, resolve, resolve_layer,
};

fn cell(
    tile: &Tile<9>,
    layers: &mut [LayerTile; 1],
    scratch: &mut Scratch<9, 1>,
    predictions: &mut Predictions,
) {
    let params = black_box(Params::default());
    black_box(denoise_cell(
        black_box(tile),
        &params,
        black_box(&mut layers[..]),
        black_box(scratch),
        black_box(predictions),
    ));
    for (pixel, sum) in tile.pixels.iter().zip(&predictions.sums) {
        black_box(resolve(pixel, sum, params.formulas));
        black_box(resolve_layer(
            pixel,
            sum,
            params.formulas,
            &black_box([1.0; 3]),
            &[1.0; 3],
        ));
    }
}

#[entry]
fn main() -> ! {
    // `entry` makes statics of a function that is called once references to them.
    static mut TILE: Tile<9> = Tile::EMPTY;
    static mut LAYERS: [LayerTile; 1] = [LayerTile::BLACK];
    static mut SCRATCH: Scratch<9, 1> = Scratch::new();
    static mut PREDICTIONS: Predictions = Predictions::NONE;
    loop {
        cell(TILE, LAYERS, SCRATCH, PREDICTIONS);
    }
}
