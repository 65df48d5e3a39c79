//! One cell: build models only where earlier ones do not predict yet (LPR section 5.1).

use crate::blend::{Predictions, Window};
use crate::feature_space::{MAX_TERMS, Terms, local_features};
use crate::fit::{Model, Samples, fit};
use crate::literal::literal_fit;
use crate::params::{Formulas, Params};
use crate::tile::{CELL, HALO, PixelState, Tile, WINDOW_AREA};

/// Granularity of each pass: centres are this far apart (LPR section 5.1: 19, then halved).
const PASSES: [usize; 5] = [19, 9, 4, 2, 1];

/// Working memory of a cell, lent by the caller; its contents carry nothing from one cell to the next.
pub struct Scratch {
    terms: [Terms; WINDOW_AREA],
    samples: Samples,
    window: Window,
    coverage: [[u16; CELL]; CELL],
}

impl Scratch {
    /// Memory for any cell.
    pub const fn new() -> Self {
        Self {
            terms: [[0.0; MAX_TERMS]; WINDOW_AREA],
            samples: Samples::EMPTY,
            window: Window::EMPTY,
            coverage: [[0; CELL]; CELL],
        }
    }
}

impl Default for Scratch {
    fn default() -> Self {
        Self::new()
    }
}

/// Predicts a cell and what its models reach of its halo into `predictions`, and returns how many models that took.
///
/// The result depends on the tile and the parameters alone: cells may be computed in any order and on any thread.
/// `predictions` is overwritten. Never panics, never yields a value that is not finite. The stack holds some 20 KiB
/// beside [`Scratch`].
#[inline(always)]
pub fn denoise_cell<const D: usize>(
    tile: &Tile<D>,
    params: &Params,
    scratch: &mut Scratch,
    predictions: &mut Predictions,
) -> u32 {
    *predictions = Predictions::NONE;
    scratch.coverage = [[0; CELL]; CELL];
    let wanted = params.coverage.clamp(1, WINDOW_AREA as u16);
    let mut models = 0;
    for granularity in PASSES {
        for y in (granularity / 2..CELL).step_by(granularity) {
            for x in (granularity / 2..CELL).step_by(granularity) {
                let covered = scratch.coverage[y][x] >= wanted;
                if !covered && is_open(tile.pixel(x + HALO, y + HALO).state, params.formulas) {
                    build_model(tile, (x, y), params, scratch, predictions);
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

/// Fits a model at (x, y) of the cell and adds its predictions.
#[inline(always)]
fn build_model<const D: usize>(
    tile: &Tile<D>,
    (x, y): (usize, usize),
    params: &Params,
    scratch: &mut Scratch,
    predictions: &mut Predictions,
) {
    let centre = (x + HALO, y + HALO);
    if !scratch.samples.read(tile, centre) {
        return;
    }
    let terms = local_features(tile, centre, params.truncation, &mut scratch.terms);
    let model = fit_terms(terms, scratch, params);
    scratch
        .window
        .predict(&model, &scratch.terms, &scratch.samples, params.formulas);
    scratch.window.add_to(centre, &model, predictions);
    cover(&mut scratch.coverage, x, y, model.radius);
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

/// Picks the fit of as many terms as the window has: a window of rank 3 pays for rank 3.
#[inline(always)]
fn fit_terms(terms: usize, scratch: &Scratch, params: &Params) -> Model {
    match terms {
        0 | 1 => fit_with::<1>(scratch, params),
        2 => fit_with::<2>(scratch, params),
        3 => fit_with::<3>(scratch, params),
        4 => fit_with::<4>(scratch, params),
        5 => fit_with::<5>(scratch, params),
        6 => fit_with::<6>(scratch, params),
        7 => fit_with::<7>(scratch, params),
        8 => fit_with::<8>(scratch, params),
        9 => fit_with::<9>(scratch, params),
        10 => fit_with::<10>(scratch, params),
        11 => fit_with::<11>(scratch, params),
        12 => fit_with::<12>(scratch, params),
        13 => fit_with::<13>(scratch, params),
        14 => fit_with::<14>(scratch, params),
        15 => fit_with::<15>(scratch, params),
        _ => fit_with::<16>(scratch, params),
    }
}

#[inline(always)]
fn fit_with<const T: usize>(scratch: &Scratch, params: &Params) -> Model {
    match params.formulas {
        Formulas::Robust => fit::<T>(&scratch.terms, &scratch.samples.list, params),
        Formulas::Literal => literal_fit::<T>(&scratch.terms, &scratch.samples.list, params),
    }
}
