//! Denoising a cell: models only where earlier ones do not predict yet, each as wide as its risk allows.
//!
//! ```text
//! while the cell wants a model                        LPR section 5.1    placement
//!     read the window around its centre                                  window
//!     reduce the features to local ones               WLR section 4      feature_space, by the noise they keep: feature_noise
//!     for r = 1 to R: fit ring r, estimate the risk   LPR section 4      fit (the model: model)
//!     keep the r of least risk, predict its window                       prediction
//!     fit each layer in the same way, predict it                         build
//! ```
//!
//! Several cells go side by side, one in each lane.

mod build;
mod feature_noise;
pub(crate) mod feature_space;
mod fit;
pub(crate) mod lent;
mod model;
pub(crate) mod one_cell;
mod placement;
mod prediction;
mod rings;
mod window;

use crate::blend::Predictions;
use crate::cell::build::build_models;
use crate::cell::feature_space::find_basis;
use crate::cell::lent::{Cells, Scratch, frames, seen};
use crate::cell::rings::{Centre, Centres};
use crate::params::Params;

/// Predicts each cell and what its models reach of its halo, `L` cells side by side.
///
/// A cell's result depends on its tile, its layers and the parameters alone: not on `L`, on the other cells, on their order or
/// on the thread. Never panics, never yields a value that is not finite. Takes some 80 KiB of stack at `L = 1` and `D = 9`, and
/// more with `L`. A layer costs its own right-hand sides and predictions.
#[inline(always)]
pub fn denoise_cells<const D: usize, const L: usize>(
    cells: &mut (impl Cells<D> + ?Sized),
    params: &Params,
    scratch: &mut Scratch<D, L>,
) {
    scratch.forget_cells();
    let mut more = true;
    while let Some(centres) = next_centres(cells, params, scratch, &mut more) {
        let tiles = core::array::from_fn(|lane| seen(cells, lane, params));
        let frames: [_; L] = core::array::from_fn(|lane| frames(cells, lane, params));
        let windows = &mut scratch.windows;
        let (extent, variances) = if frames.as_flattened().iter().any(Option::is_some) {
            windows.read_frames(&tiles, &frames, &centres)
        } else {
            let noise = feature_noise::around(&scratch.noise, &centres);
            (windows.read(&tiles, &centres), noise)
        };
        find_basis(
            &mut scratch.windows,
            &extent,
            &variances,
            params,
            &mut scratch.basis,
        );
        build_models(cells, &centres, params, scratch);
    }
}

/// Where each lane's cell wants its next model; none of any lane at the end.
#[inline(always)]
fn next_centres<const D: usize, const L: usize>(
    cells: &mut (impl Cells<D> + ?Sized),
    params: &Params,
    scratch: &mut Scratch<D, L>,
    more: &mut bool,
) -> Option<Centres<L>> {
    let mut centres = [None; L];
    for (lane, centre) in centres.iter_mut().enumerate() {
        *centre = next_centre(cells, lane, params, scratch, more);
    }
    centres.iter().any(Option::is_some).then_some(centres)
}

/// The same for one lane: one cell after the other, while there are more.
#[inline(always)]
fn next_centre<const D: usize, const L: usize>(
    cells: &mut (impl Cells<D> + ?Sized),
    lane: usize,
    params: &Params,
    scratch: &mut Scratch<D, L>,
    more: &mut bool,
) -> Option<Centre> {
    let placement = scratch.placements.get_mut(lane)?;
    let noise = scratch.noise.get_mut(lane)?;
    loop {
        if let Some(centre) = placement.next(params.coverage, cells.results(lane).0) {
            return Some(centre);
        }
        if let Some(models) = placement.finish() {
            cells.done(lane, models);
        }
        *more = *more && cells.next(lane);
        if !*more {
            return None;
        }
        let seen = seen(cells, lane, params);
        placement.start(&seen, params.formulas);
        feature_noise::fill(noise, &seen);
        *cells.results(lane).0 = Predictions::NONE;
    }
}
