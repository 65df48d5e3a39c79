//! One cell: build models only where earlier ones do not predict yet (LPR section 5.1).

use crate::blend::{LayerTile, Predictions, Window};
use crate::feature_space::{MAX_TERMS, Terms, local_features};
use crate::fit::{Samples, fit};
use crate::literal::{literal_fit, literal_follow};
use crate::params::{Formulas, Params};
use crate::tile::{CELL, HALO, PixelState, RINGS, TILE, TILE_AREA, Tile, WINDOW_AREA, offset};

/// Granularity of each pass: centres are this far apart (LPR section 5.1: 19, then halved).
const PASSES: [usize; 5] = [19, 9, 4, 2, 1];

/// Working memory of a cell, lent by the caller; its contents carry nothing from one cell to the next.
pub struct Scratch {
    terms: [Terms; WINDOW_AREA],
    samples: Samples,
    window: Window,
    layer: [[f32; 3]; WINDOW_AREA],
    coverage: [[u16; CELL]; CELL],
}

impl Scratch {
    /// Memory for any cell.
    pub const fn new() -> Self {
        Self {
            terms: [[0.0; MAX_TERMS]; WINDOW_AREA],
            samples: Samples::EMPTY,
            window: Window::EMPTY,
            layer: [[0.0; 3]; WINDOW_AREA],
            coverage: [[0; CELL]; CELL],
        }
    }
}

impl Default for Scratch {
    fn default() -> Self {
        Self::new()
    }
}

/// Predicts a cell and what its models reach of its halo into `predictions` and the layers' sums, and returns how many
/// models that took.
///
/// The result depends on the tile, the layers and the parameters alone: cells may be computed in any order and on any
/// thread. What `predictions` and the sums held is overwritten. Never panics, never yields a value that is not
/// finite. The stack holds some 20 KiB beside [`Scratch`]. A layer costs its own right-hand sides and predictions.
#[inline(always)]
pub fn denoise_cell<const D: usize>(
    tile: &Tile<D>,
    params: &Params,
    layers: &mut [LayerTile],
    scratch: &mut Scratch,
    predictions: &mut Predictions,
) -> u32 {
    *predictions = Predictions::NONE;
    for layer in layers.iter_mut() {
        layer.sums = [[0.0; 3]; TILE_AREA];
    }
    scratch.coverage = [[0; CELL]; CELL];
    let wanted = params.coverage.clamp(1, WINDOW_AREA as u16);
    let mut models = 0;
    for granularity in PASSES {
        for y in (granularity / 2..CELL).step_by(granularity) {
            for x in (granularity / 2..CELL).step_by(granularity) {
                let covered = scratch.coverage[y][x] >= wanted;
                if !covered && is_open(tile.pixel(x + HALO, y + HALO).state, params.formulas) {
                    let radius = build_model(
                        tile,
                        (x + HALO, y + HALO),
                        params,
                        layers,
                        scratch,
                        predictions,
                    );
                    cover(&mut scratch.coverage, x, y, radius);
                    models += 1;
                }
            }
        }
    }
    models
}

/// Whether a pixel needs a model at all.
#[inline(always)]
fn is_open(state: PixelState, formulas: Formulas) -> bool {
    match state {
        PixelState::Outside => false,
        PixelState::Clean => formulas == Formulas::Literal,
        PixelState::Noisy | PixelState::Bad => true,
    }
}

/// Fits a model at (x, y) of the tile, adds its predictions, and returns the half-width of its prediction window.
#[inline(always)]
fn build_model<const D: usize>(
    tile: &Tile<D>,
    centre: (usize, usize),
    params: &Params,
    layers: &mut [LayerTile],
    scratch: &mut Scratch,
    predictions: &mut Predictions,
) -> usize {
    if !scratch.samples.read(tile, centre) {
        return 0;
    }
    // A window of rank 3 pays for rank 3.
    match local_features(tile, centre, params.truncation, &mut scratch.terms) {
        0 | 1 => build_within::<1, D>(centre, params, layers, scratch, predictions),
        2 => build_within::<2, D>(centre, params, layers, scratch, predictions),
        3 => build_within::<3, D>(centre, params, layers, scratch, predictions),
        4 => build_within::<4, D>(centre, params, layers, scratch, predictions),
        5 => build_within::<5, D>(centre, params, layers, scratch, predictions),
        6 => build_within::<6, D>(centre, params, layers, scratch, predictions),
        7 => build_within::<7, D>(centre, params, layers, scratch, predictions),
        8 => build_within::<8, D>(centre, params, layers, scratch, predictions),
        9 => build_within::<9, D>(centre, params, layers, scratch, predictions),
        10 => build_within::<10, D>(centre, params, layers, scratch, predictions),
        11 => build_within::<11, D>(centre, params, layers, scratch, predictions),
        12 => build_within::<12, D>(centre, params, layers, scratch, predictions),
        13 => build_within::<13, D>(centre, params, layers, scratch, predictions),
        14 => build_within::<14, D>(centre, params, layers, scratch, predictions),
        15 => build_within::<15, D>(centre, params, layers, scratch, predictions),
        _ => build_within::<16, D>(centre, params, layers, scratch, predictions),
    }
}

/// The same for a model of `T` terms; nothing where `D` features cannot make so many, so that no code is made for it.
#[inline(always)]
fn build_within<const T: usize, const D: usize>(
    centre: (usize, usize),
    params: &Params,
    layers: &mut [LayerTile],
    scratch: &mut Scratch,
    predictions: &mut Predictions,
) -> usize {
    if const { T <= D + 1 } {
        build_with::<T>(centre, params, layers, scratch, predictions)
    } else {
        0
    }
}

/// The same for a model of `T` terms.
#[inline(always)]
fn build_with<const T: usize>(
    centre: (usize, usize),
    params: &Params,
    layers: &mut [LayerTile],
    scratch: &mut Scratch,
    predictions: &mut Predictions,
) -> usize {
    let Scratch {
        terms,
        samples,
        window,
        layer: colours,
        ..
    } = scratch;
    match params.formulas {
        Formulas::Robust => {
            let fitted = fit::<T>(terms, &samples.list, params);
            window.predict(&fitted.model, terms, samples, params.formulas);
            window.add_to(centre, &fitted.model, predictions);
            for layer in layers {
                read_layer(layer, centre, colours);
                let coefficients = fitted.follow(terms, &samples.list, colours);
                window.add_layer(centre, fitted.model.radius, &coefficients, terms, layer);
            }
            fitted.model.radius
        }
        Formulas::Literal => {
            let model = literal_fit::<T>(terms, &samples.list, params);
            window.predict(&model, terms, samples, params.formulas);
            window.add_to(centre, &model, predictions);
            for layer in layers {
                read_layer(layer, centre, colours);
                let coefficients =
                    literal_follow::<T>(terms, &samples.list, colours, model.radius, params);
                window.add_layer(centre, model.radius, &coefficients, terms, layer);
            }
            model.radius
        }
    }
}

/// A layer's radiance in the window around (x, y), ring after ring.
#[inline(always)]
fn read_layer(layer: &LayerTile, (x, y): (usize, usize), colours: &mut [[f32; 3]; WINDOW_AREA]) {
    for (colour, &by) in colours.iter_mut().zip(&RINGS) {
        let (px, py) = offset(x, y, by);
        *colour = layer
            .colour
            .get(py * TILE + px)
            .copied()
            .unwrap_or([0.0; 3]);
    }
}

/// Counts the model's prediction window in the cell.
#[inline(always)]
fn cover(coverage: &mut [[u16; CELL]; CELL], x: usize, y: usize, radius: usize) {
    for row in coverage
        .iter_mut()
        .take(y + radius + 1)
        .skip(y.saturating_sub(radius))
    {
        for count in row
            .iter_mut()
            .take(x + radius + 1)
            .skip(x.saturating_sub(radius))
        {
            *count += 1;
        }
    }
}
