//! A whole picture by the papers' recipe: centres ever closer together, over the whole picture, until each pixel is predicted (LPR section 5.1).

use linpred_core::{CELL, CHANNELS, Params, TILE};
use linpred_tests::definition::Window;
use linpred_tests::windows::ring_order;

use crate::picture::{Cell, Prepared, Reference};
use crate::validation::{Chosen, Estimate, Fitted, fitted};

/// Distance of the centres in each pass.
const PASSES: [usize; 5] = [19, 9, 4, 2, 1];

/// What a pixel's predictions add up to.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Predicted {
    radiance: [f64; CHANNELS],
    estimated: f64,
    truth: f64,
    rank: f64,
    count: f64,
}

impl Predicted {
    /// Mean of the predictions.
    pub(crate) fn radiance(&self) -> [f64; CHANNELS] {
        self.radiance.map(|v| v / self.count)
    }

    /// Means of the estimated and of the true error of the models, over their prediction windows, and of their ranks.
    pub(crate) fn of_models(&self) -> [f64; 3] {
        [self.estimated, self.truth, self.rank].map(|v| v / self.count)
    }
}

/// A picture and what it took.
pub(crate) struct Whole {
    pub(crate) pixels: Vec<Predicted>,
    pub(crate) models: usize,
    /// Sum of the models' ranks.
    pub(crate) ranks: usize,
}

/// The windows of a picture, each made when it is asked for.
pub(crate) struct Windows {
    cells: Vec<Cell>,
    columns: usize,
    params: Params,
}

impl Windows {
    pub(crate) fn new(prepared: &Prepared, params: Params) -> Self {
        Self {
            cells: prepared.cells(),
            columns: prepared.picture.width.div_ceil(CELL),
            params,
        }
    }

    /// The window around a pixel, with its cell and its place in the cell's tile.
    pub(crate) fn around(&self, x: usize, y: usize) -> (&Cell, usize, Box<dyn Fitted>) {
        let cell = &self.cells[y / CELL * self.columns + x / CELL];
        let position = cell.position(x, y);
        let window = Window::new(&cell.tile, position, self.params);
        (cell, position, fitted(cell, &window))
    }
}

/// Predicts every pixel; half-widths are chosen by `estimate`.
pub(crate) fn predict(
    prepared: &Prepared,
    windows: &Windows,
    reference: &Reference,
    estimate: Estimate,
) -> Whole {
    let (width, height) = (prepared.picture.width, prepared.picture.height);
    let mut whole = Whole {
        pixels: vec![Predicted::default(); width * height],
        models: 0,
        ranks: 0,
    };
    for pass in PASSES {
        for y in (0..height).step_by(pass) {
            for x in (0..width).step_by(pass) {
                if whole.pixels[y * width + x].count == 0.0 {
                    let (cell, position, window) = windows.around(x, y);
                    let chosen = window.choose(estimate);
                    whole.add(cell, position, &chosen, window.rank(), reference);
                }
            }
        }
    }
    whole
}

impl Whole {
    fn add(
        &mut self,
        cell: &Cell,
        centre: usize,
        chosen: &Chosen,
        rank: usize,
        reference: &Reference,
    ) {
        self.models += 1;
        self.ranks += rank;
        let predicted: Vec<(usize, [f64; CHANNELS])> = ring_order()
            .iter()
            .map(|(x, y)| (centre as i32 + y * TILE as i32 + x) as usize)
            .zip(&chosen.radiance)
            .filter(|(position, _)| cell.holds(*position))
            .map(|(position, radiance)| (cell.pixel(position), radiance.map(f64::from)))
            .collect();
        let errors = predicted
            .iter()
            .map(|(pixel, radiance)| reference.squared_error(*pixel, radiance));
        let truth = errors.sum::<f64>() / predicted.len() as f64;
        for (pixel, radiance) in predicted {
            let own = &mut self.pixels[pixel];
            for (sum, v) in own.radiance.iter_mut().zip(radiance) {
                *sum += v;
            }
            own.estimated += chosen.error;
            own.truth += truth.max(0.0);
            own.rank += rank as f64;
            own.count += 1.0;
        }
    }
}
