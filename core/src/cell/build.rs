//! Models from windows: fits them, and adds their predictions to those of their cells and of the layers that follow.

use crate::cell::feature_space::MAX_TERMS;
use crate::cell::fit::Fit;
use crate::cell::fit::lpr::Lpr;
use crate::cell::fit::robust::Systems;
use crate::cell::fit::wlr::Wlr;
use crate::cell::lent::{Cells, Scratch};
use crate::cell::model::Coefficients;
use crate::cell::rings::{Centre, Centres, RING_STEPS};
use crate::cell::window::{Colours, Sample, in_frame};
use crate::features::TILE_FEATURES;
use crate::lanes::{Rgb, lanes_stay_innermost};
use crate::params::{Formulas, Params};
use crate::tile::{CHANNELS, WINDOW_AREA};

/// Builds the models of the windows around the centres.
///
/// A window pays for its rank or, between others, for the largest of theirs: terms of 0 change no bit. A single lane is for small
/// machines, where one size of code counts for more than speed.
#[inline(always)]
pub(crate) fn build_models<const D: usize, const L: usize>(
    cells: &mut (impl Cells<D> + ?Sized),
    centres: &Centres<L>,
    params: &Params,
    scratch: &mut Scratch<D, L>,
) {
    let largest = scratch.basis.largest_rank();
    if params.formulas == Formulas::Wlr {
        build_by_wlr(cells, centres, params, scratch);
        return;
    }
    if const { D > TILE_FEATURES } {
        build_wide_models(largest, cells, centres, params, scratch);
        return;
    }
    match if L == 1 { D } else { largest } {
        0..=2 => build_with_terms::<3, D, L>(cells, centres, params, scratch),
        3 | 4 => build_with_terms::<5, D, L>(cells, centres, params, scratch),
        5 | 6 => build_with_terms::<7, D, L>(cells, centres, params, scratch),
        7 => build_with_terms::<8, D, L>(cells, centres, params, scratch),
        8 => build_with_terms::<9, D, L>(cells, centres, params, scratch),
        _ => build_with_terms::<10, D, L>(cells, centres, params, scratch),
    }
}

/// The same for more features than those that are known by their names: of fewer sizes, as such tiles are the rarer ones and each size takes the compiler as long as one of
/// theirs.
#[inline(always)]
fn build_wide_models<const D: usize, const L: usize>(
    largest: usize,
    cells: &mut (impl Cells<D> + ?Sized),
    centres: &Centres<L>,
    params: &Params,
    scratch: &mut Scratch<D, L>,
) {
    match (params.formulas, largest) {
        (Formulas::Robust, 0..=7) => {
            build::<Systems<8, L>, 8, D, L>(cells, centres, params, scratch);
        }
        (Formulas::Robust, 8..=11) => {
            build::<Systems<12, L>, 12, D, L>(cells, centres, params, scratch);
        }
        (Formulas::Robust, _) => {
            build::<Systems<MAX_TERMS, L>, MAX_TERMS, D, L>(cells, centres, params, scratch);
        }
        (Formulas::Literal, _) => {
            build::<Lpr, MAX_TERMS, D, L>(cells, centres, params, scratch);
        }
        // In one size for all, above.
        (Formulas::Wlr, _) => {}
    }
}

/// The same for models of at most `T` terms; nothing where `D` features cannot make so many, so that no code is made for it.
#[inline(always)]
fn build_with_terms<const T: usize, const D: usize, const L: usize>(
    cells: &mut (impl Cells<D> + ?Sized),
    centres: &Centres<L>,
    params: &Params,
    scratch: &mut Scratch<D, L>,
) {
    if const { T <= D + 2 } {
        match params.formulas {
            Formulas::Robust => build::<Systems<T, L>, T, D, L>(cells, centres, params, scratch),
            Formulas::Literal => build::<Lpr, T, D, L>(cells, centres, params, scratch),
            // As above.
            Formulas::Wlr => {}
        }
    }
}

/// The same by WLR, whose loops know the rank themselves.
#[inline(always)]
fn build_by_wlr<const D: usize, const L: usize>(
    cells: &mut (impl Cells<D> + ?Sized),
    centres: &Centres<L>,
    params: &Params,
    scratch: &mut Scratch<D, L>,
) {
    if const { D <= TILE_FEATURES } {
        build::<Wlr<19, L>, 10, D, L>(cells, centres, params, scratch);
    } else {
        build::<Wlr<{ 2 * MAX_TERMS - 1 }, L>, MAX_TERMS, D, L>(cells, centres, params, scratch);
    }
}

/// The same by the formulas `F`.
#[inline(always)]
fn build<F: Fit<T, D, L>, const T: usize, const D: usize, const L: usize>(
    cells: &mut (impl Cells<D> + ?Sized),
    centres: &Centres<L>,
    params: &Params,
    scratch: &mut Scratch<D, L>,
) {
    let layers = cells.results(0).1.len();
    let windows = &mut scratch.windows;
    let (models, fit) = F::fit(windows, &scratch.basis, params, layers > 0);
    let predicted = &mut scratch.predicted;
    predicted.predict(&models, windows, &scratch.basis, params.formulas);
    for (lane, centre) in with_models(centres, &windows.live) {
        predicted.add_to(lane, centre, &models, cells.results(lane).0);
    }
    for layer in 0..layers {
        if windows.over_frames {
            read_layer_of_frames(cells, centres, layer, predicted.colours());
        } else {
            read_layer(cells, centres, layer, predicted.colours());
        }
        let (even, value) = even_lanes(&windows.samples, predicted.colours());
        let mut coefficients = [[[0.0; L]; T]; CHANNELS];
        if !even.iter().all(|even| *even) {
            coefficients = fit.fit_layer(windows, &models.radius, predicted.colours());
        }
        keep_even(&mut coefficients, &even, &value);
        predicted.predict_layer(&coefficients, windows);
        for (lane, centre) in with_models(centres, &windows.live) {
            if let Some(layer) = cells.results(lane).1.get_mut(layer) {
                predicted.add_layer_to(lane, centre, &models.radius, layer);
            }
        }
    }
}

/// The lanes that have a model, and their centres.
#[inline(always)]
fn with_models<const L: usize>(
    centres: &Centres<L>,
    live: &[bool; L],
) -> impl Iterator<Item = (usize, Centre)> {
    let lanes = centres.iter().zip(live).enumerate();
    lanes.filter_map(|(lane, (centre, live))| centre.filter(|_| *live).map(|centre| (lane, centre)))
}

/// In which lanes a layer has one value for every pixel of the window that has a weight, and that value. Most of an alpha is like that, and many a layer is
/// black over most of an image: nothing is to be fitted there, and what a fit adds is rounding.
#[inline(always)]
fn even_lanes<const L: usize>(
    samples: &[Sample<L>; WINDOW_AREA],
    layer: &Colours<L>,
) -> ([bool; L], Rgb<L>) {
    let mut low = [[f32::MAX; L]; CHANNELS];
    let mut high = [[f32::MIN; L]; CHANNELS];
    for (sample, colour) in samples.iter().zip(layer) {
        for c in 0..CHANNELS {
            for l in 0..L {
                let (value, counts) = (colour[c][l], sample.weight[l] > 0.0);
                let (below, above) = (value < low[c][l], value > high[c][l]);
                low[c][l] = if counts && below { value } else { low[c][l] };
                high[c][l] = if counts && above { value } else { high[c][l] };
            }
        }
        lanes_stay_innermost();
    }
    let mut even = [true; L];
    for (low, high) in low.iter().zip(&high) {
        for l in 0..L {
            even[l] = even[l] && low[l] == high[l];
        }
    }
    (even, low)
}

/// Makes the models of even lanes their value.
#[inline(always)]
fn keep_even<const T: usize, const L: usize>(
    coefficients: &mut Coefficients<T, L>,
    even: &[bool; L],
    value: &Rgb<L>,
) {
    for (channel, value) in coefficients.iter_mut().zip(value) {
        for (t, coefficient) in channel.iter_mut().enumerate() {
            for l in 0..L {
                let value = if t == 0 { value[l] } else { 0.0 };
                coefficient[l] = if even[l] { value } else { coefficient[l] };
            }
        }
    }
}

/// The layer's radiance in the windows around the centres, ring after ring.
#[inline(always)]
fn read_layer<const D: usize, const L: usize>(
    cells: &mut (impl Cells<D> + ?Sized),
    centres: &Centres<L>,
    layer: usize,
    colours: &mut Colours<L>,
) {
    for (lane, centre) in centres.iter().enumerate() {
        let layers = cells.results(lane).1;
        let (Some(centre), Some(layer)) = (*centre, layers.get(layer)) else {
            continue;
        };
        for (colours, &step) in colours.iter_mut().zip(&RING_STEPS) {
            let own = layer.colour_at(centre.position().wrapping_add_signed(step));
            put(colours, lane, own);
        }
    }
}

/// The same in windows over several frames; 0 where there is no such frame.
#[inline(always)]
fn read_layer_of_frames<const D: usize, const L: usize>(
    cells: &mut (impl Cells<D> + ?Sized),
    centres: &Centres<L>,
    layer: usize,
    colours: &mut Colours<L>,
) {
    for (lane, centre) in centres.iter().enumerate() {
        let Some(centre) = *centre else { continue };
        for (place, colours) in colours.iter_mut().enumerate() {
            let (frame, pixel) = in_frame(place);
            let step = RING_STEPS.get(pixel).copied().unwrap_or(0);
            let position = centre.position().wrapping_add_signed(step);
            let value = match frame.checked_sub(1) {
                None => cells
                    .results(lane)
                    .1
                    .get(layer)
                    .map(|own| own.colour_at(position)),
                Some(other) => cells
                    .frame(lane, other)
                    .and_then(|frame| Some(frame.layers.get(layer)?.colour_at(position))),
            };
            put(colours, lane, value.unwrap_or([0.0; CHANNELS]));
        }
    }
}

/// Sets one lane of a colour.
#[inline(always)]
fn put<const L: usize>(colours: &mut Rgb<L>, lane: usize, value: [f32; CHANNELS]) {
    for (colour, value) in colours.iter_mut().zip(value) {
        if let Some(colour) = colour.get_mut(lane) {
            *colour = value;
        }
    }
}
