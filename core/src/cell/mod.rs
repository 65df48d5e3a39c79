//! Cells: build models only where earlier ones do not predict yet (LPR section 5.1), several cells side by side.

mod feature_noise;
pub(crate) mod feature_space;
mod fit;
mod placement;
mod prediction;
mod window;

use crate::blend::{LayerTile, Predictions};
use crate::cell::feature_noise::FeatureNoise;
use crate::cell::feature_space::{Basis, find_basis};
use crate::cell::fit::lpr::{LiteralWindow, set_lane};
use crate::cell::fit::robust::{Coefficients, Models, fit, project_all};
use crate::cell::placement::Walk;
use crate::cell::prediction::PredictionWindows;
use crate::cell::window::Windows;
use crate::params::{Formulas, Params};
use crate::tile::{HALO, PixelState, RING_STEPS, TILE, Tile, WINDOW_AREA};

/// Working memory of `L` cells of `D` features at a time, lent by the caller; its contents carry nothing from one cell
/// to the next.
#[repr(C, align(64))]
pub struct Scratch<const D: usize, const L: usize> {
    windows: Windows<D, L>,
    basis: Basis<D, L>,
    predicted: PredictionWindows<L>,
    walks: [Walk; L],
    noise: [FeatureNoise<D>; L],
}

impl<const D: usize, const L: usize> Scratch<D, L> {
    /// Memory for any cells.
    pub const fn new() -> Self {
        Self {
            windows: Windows::ZERO,
            basis: Basis::NONE,
            predicted: PredictionWindows::EMPTY,
            walks: [const { Walk::ENDED }; L],
            noise: [const { FeatureNoise::NONE }; L],
        }
    }
}

impl<const D: usize, const L: usize> Default for Scratch<D, L> {
    fn default() -> Self {
        Self::new()
    }
}

/// Where cells of `D` features come from and go to. A lane holds one cell at a time.
pub trait Cells<const D: usize> {
    /// Puts the next cell into `lane`, with black sums of its layers; false if there is none left.
    fn next(&mut self, lane: usize) -> bool;
    /// The tile in `lane`; any tile while the lane has no cell.
    fn tile(&self, lane: usize) -> &Tile<D>;
    /// The predictions of the cell in `lane`, and the layers that follow it: as many in every lane.
    fn results(&mut self, lane: usize) -> (&mut Predictions, &mut [LayerTile]);
    /// The cell in `lane` is done and took so many models.
    fn done(&mut self, lane: usize, models: u32);
}

/// Predicts each cell and what its models reach of its halo, `L` cells side by side.
///
/// A cell's result depends on its tile, its layers and the parameters alone: not on `L`, on the other cells, on their order or
/// on the thread. Never panics, never yields a value that is not finite. The stack holds some 50 KiB at `L = 1` and `D = 9`, and
/// grows with `L`. A layer costs its own right-hand sides and predictions.
#[inline(always)]
pub fn denoise_cells<const D: usize, const L: usize>(
    cells: &mut impl Cells<D>,
    params: &Params,
    scratch: &mut Scratch<D, L>,
) {
    scratch.walks = [const { Walk::ENDED }; L];
    let mut left = true;
    loop {
        let mut centres = [None; L];
        let lanes = centres.iter_mut().zip(&mut scratch.walks);
        for (lane, ((centre, walk), noise)) in lanes.zip(&mut scratch.noise).enumerate() {
            *centre = next_centre(cells, lane, walk, noise, params, &mut left);
        }
        if centres.iter().all(|centre| centre.is_none()) {
            return;
        }
        let radii = build_models(cells, &centres, params, scratch);
        for (walk, radius) in scratch.walks.iter_mut().zip(radii) {
            walk.cover(radius);
        }
    }
}

/// Predicts one cell into `predictions` and the layers' sums, and returns how many models that took: [`denoise_cells`] for one.
///
/// What `predictions` and the sums held is overwritten.
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

/// Where the cell in `lane` wants its next model, as a position in the tile; one cell after the other until none is left.
#[inline(always)]
fn next_centre<const D: usize>(
    cells: &mut impl Cells<D>,
    lane: usize,
    walk: &mut Walk,
    noise: &mut FeatureNoise<D>,
    params: &Params,
    left: &mut bool,
) -> Option<usize> {
    loop {
        if walk.under_way() {
            let tile = cells.tile(lane);
            let open = |x: usize, y: usize| is_open(tile, x, y, params.formulas);
            if let Some((x, y)) = walk.next(params.coverage, open) {
                return Some((y + HALO) * TILE + x + HALO);
            }
            cells.done(lane, walk.models());
        }
        *left = *left && cells.next(lane);
        if !*left {
            return None;
        }
        noise.fill(cells.tile(lane));
        *cells.results(lane).0 = Predictions::NONE;
        *walk = Walk::START;
    }
}

/// Whether pixel (x, y) of the cell needs a model at all.
#[inline(always)]
fn is_open<const D: usize>(tile: &Tile<D>, x: usize, y: usize, formulas: Formulas) -> bool {
    match tile.pixel_at((y + HALO) * TILE + x + HALO).state {
        PixelState::Outside => false,
        PixelState::Clean => formulas == Formulas::Literal,
        PixelState::Noisy | PixelState::Bad => true,
    }
}

/// Fits a model at each centre, adds its predictions to its cell's, and returns the half-widths of the prediction windows.
#[inline(always)]
fn build_models<const D: usize, const L: usize>(
    cells: &mut impl Cells<D>,
    centres: &[Option<usize>; L],
    params: &Params,
    scratch: &mut Scratch<D, L>,
) -> [usize; L] {
    let extent = {
        let tiles = core::array::from_fn(|lane| cells.tile(lane));
        scratch.windows.read(&tiles, centres)
    };
    scratch.windows.in_own_unit(&extent.weight);
    let mut variances = [[0.0; L]; D];
    for (lane, (walk, noise)) in scratch.walks.iter().zip(&scratch.noise).enumerate() {
        let (x, y) = walk.centre();
        for (all, own) in variances.iter_mut().zip(noise.around(x, y)) {
            if let Some(place) = all.get_mut(lane) {
                *place = *own;
            }
        }
    }
    find_basis(
        &mut scratch.windows,
        &extent,
        &variances,
        params.truncation,
        &mut scratch.basis,
    );
    // A window pays for its rank or, between others, for the largest of theirs: terms of 0 change no bit. A single lane is for small
    // machines, where one size of code counts for more than speed.
    let largest = scratch.basis.rank.iter().fold(0, |a, b| a.max(*b));
    match if L == 1 { D } else { largest } {
        0..=2 => build_within::<3, D, L>(cells, centres, params, scratch),
        3 | 4 => build_within::<5, D, L>(cells, centres, params, scratch),
        5 | 6 => build_within::<7, D, L>(cells, centres, params, scratch),
        7 => build_within::<8, D, L>(cells, centres, params, scratch),
        8 => build_within::<9, D, L>(cells, centres, params, scratch),
        9 => build_within::<10, D, L>(cells, centres, params, scratch),
        10 | 11 => build_within::<12, D, L>(cells, centres, params, scratch),
        12 | 13 => build_within::<14, D, L>(cells, centres, params, scratch),
        _ => build_within::<16, D, L>(cells, centres, params, scratch),
    }
}

/// The same for models of at most `T` terms; nothing where `D` features cannot make so many, so that no code is made for it.
#[inline(always)]
fn build_within<const T: usize, const D: usize, const L: usize>(
    cells: &mut impl Cells<D>,
    centres: &[Option<usize>; L],
    params: &Params,
    scratch: &mut Scratch<D, L>,
) -> [usize; L] {
    if const { T <= D + 2 } {
        match params.formulas {
            Formulas::Robust => build_robust::<T, D, L>(cells, centres, params, scratch),
            Formulas::Literal => build_literal::<T, D, L>(cells, centres, params, scratch),
        }
    } else {
        [0; L]
    }
}

#[inline(always)]
fn build_robust<const T: usize, const D: usize, const L: usize>(
    cells: &mut impl Cells<D>,
    centres: &[Option<usize>; L],
    params: &Params,
    scratch: &mut Scratch<D, L>,
) -> [usize; L] {
    let layers = cells.results(0).1.len();
    let (models, systems) =
        fit::<T, D, L>(&mut scratch.windows, &scratch.basis, params, layers > 0);
    predict(cells, centres, params, scratch, &models);
    predict_layers(cells, centres, scratch, &models.radius, |windows, layer| {
        systems.follow(windows, &models.radius, layer)
    });
    models.radius
}

#[inline(always)]
fn build_literal<const T: usize, const D: usize, const L: usize>(
    cells: &mut impl Cells<D>,
    centres: &[Option<usize>; L],
    params: &Params,
    scratch: &mut Scratch<D, L>,
) -> [usize; L] {
    project_all::<T, D, L>(&mut scratch.windows, &scratch.basis);
    let [centre, ..] = &scratch.windows.samples;
    let mut models = Models::<T, L>::of_centres(centre);
    models.terms = scratch.basis.rank.map(|rank| rank + 1);
    for lane in 0..L {
        LiteralWindow::new(&scratch.windows, lane).fit(params, &mut models);
    }
    predict(cells, centres, params, scratch, &models);
    predict_layers(cells, centres, scratch, &models.radius, |windows, layer| {
        let mut coefficients = models.coefficients;
        for (lane, &radius) in models.radius.iter().enumerate() {
            let own = LiteralWindow::new(windows, lane).follow::<T>(layer, radius, params);
            set_lane(&mut coefficients, lane, &own);
        }
        coefficients
    });
    models.radius
}

/// Predicts each layer by the coefficients that `follow` gives for its radiance in the windows.
#[inline(always)]
fn predict_layers<const T: usize, const D: usize, const L: usize>(
    cells: &mut impl Cells<D>,
    centres: &[Option<usize>; L],
    scratch: &mut Scratch<D, L>,
    radius: &[usize; L],
    follow: impl Fn(&Windows<D, L>, &[[[f32; L]; 3]; WINDOW_AREA]) -> Coefficients<T, L>,
) {
    for layer in 0..cells.results(0).1.len() {
        let colours = scratch.predicted.colours();
        read_layer(cells, centres, layer, colours);
        let coefficients = follow(&scratch.windows, colours);
        scratch
            .predicted
            .predict_layer(&coefficients, &scratch.windows);
        add_layer(cells, centres, layer, radius, scratch);
    }
}

/// Adds the models' predictions to their cells'.
#[inline(always)]
fn predict<const T: usize, const D: usize, const L: usize>(
    cells: &mut impl Cells<D>,
    centres: &[Option<usize>; L],
    params: &Params,
    scratch: &mut Scratch<D, L>,
    models: &Models<T, L>,
) {
    let predicted = &mut scratch.predicted;
    predicted.predict(models, &scratch.windows, params.formulas);
    let lanes = centres.iter().zip(&scratch.windows.live).enumerate();
    for (lane, (centre, &live)) in lanes {
        if let (Some(centre), true) = (*centre, live) {
            predicted.add_to(lane, centre, models, cells.results(lane).0);
        }
    }
}

/// The layer's radiance in the windows around the centres, ring after ring.
#[inline(always)]
fn read_layer<const D: usize, const L: usize>(
    cells: &mut impl Cells<D>,
    centres: &[Option<usize>; L],
    layer: usize,
    colours: &mut [[[f32; L]; 3]; WINDOW_AREA],
) {
    for (lane, centre) in centres.iter().enumerate() {
        let layers = cells.results(lane).1;
        let (Some(centre), Some(layer)) = (*centre, layers.get(layer)) else {
            continue;
        };
        for (colours, &step) in colours.iter_mut().zip(&RING_STEPS) {
            let own = layer.colour.get(centre.wrapping_add_signed(step));
            let own = own.copied().unwrap_or([0.0; 3]);
            for (colours, value) in colours.iter_mut().zip(own) {
                if let Some(colour) = colours.get_mut(lane) {
                    *colour = value;
                }
            }
        }
    }
}

/// Adds the predictions of a layer to the cells'.
#[inline(always)]
fn add_layer<const D: usize, const L: usize>(
    cells: &mut impl Cells<D>,
    centres: &[Option<usize>; L],
    layer: usize,
    radius: &[usize; L],
    scratch: &Scratch<D, L>,
) {
    let lanes = centres.iter().zip(&scratch.windows.live).zip(radius);
    for (lane, ((centre, &live), &radius)) in lanes.enumerate() {
        let layer = cells.results(lane).1.get_mut(layer);
        if let (Some(centre), true, Some(layer)) = (*centre, live, layer) {
            scratch.predicted.add_layer_to(lane, centre, radius, layer);
        }
    }
}
