//! Where a cell's models go: centres ever closer together, each unless enough models predict it already.

use crate::cell::rings::Centre;
use crate::params::Formulas;
use crate::tile::{CELL, PixelState, Tile, WINDOW_AREA};

/// Granularity of each pass: centres are this far apart (LPR section 5.1: 19, then halved).
const PASSES: [usize; 5] = [19, 9, 4, 2, 1];

/// Centres of all passes.
const CENTRES: usize = {
    let mut centres = 0;
    let mut pass = 0;
    while pass < PASSES.len() {
        let side = (CELL - PASSES[pass] / 2).div_ceil(PASSES[pass]);
        centres += side * side;
        pass += 1;
    }
    centres
};

/// The centres in the cell, pass after pass, each in raster order.
const ORDER: [Centre; CENTRES] = {
    let mut order = [Centre { x: 0, y: 0 }; CENTRES];
    let (mut next, mut pass) = (0, 0);
    while pass < PASSES.len() {
        let granularity = PASSES[pass];
        let mut y = granularity / 2;
        while y < CELL {
            let mut x = granularity / 2;
            while x < CELL {
                order[next] = Centre {
                    x: x as u8,
                    y: y as u8,
                };
                next += 1;
                x += granularity;
            }
            y += granularity;
        }
        pass += 1;
    }
    order
};

/// How far a cell has come.
pub(crate) struct Placement {
    /// Of `ORDER`.
    next: usize,
    centre: Centre,
    models: u32,
    /// Models that predict each pixel.
    coverage: [[u16; CELL]; CELL],
    /// Where there is a model, a bit for each column: a later pass would fit the same one again.
    built: [u32; CELL],
    under_way: bool,
}

impl Placement {
    /// No cell.
    pub(crate) const ENDED: Self = Self {
        next: CENTRES,
        centre: Centre { x: 0, y: 0 },
        models: 0,
        coverage: [[0; CELL]; CELL],
        built: [0; CELL],
        under_way: false,
    };

    /// Begins a cell, without models.
    #[inline(always)]
    pub(crate) fn start(&mut self) {
        *self = Self {
            next: 0,
            under_way: true,
            ..Self::ENDED
        };
    }

    /// The next centre in need of a model; none at the end of the cell.
    #[inline(always)]
    pub(crate) fn next(&mut self, coverage: u16, open: impl Fn(Centre) -> bool) -> Option<Centre> {
        let wanted = coverage.clamp(1, WINDOW_AREA as u16);
        for &centre in ORDER.iter().skip(self.next) {
            self.next += 1;
            let (x, y) = (usize::from(centre.x), usize::from(centre.y));
            let covered = self.coverage.get(y).and_then(|row| row.get(x));
            let built = self.built.get_mut(y)?;
            let wanting = covered.is_some_and(|models| *models < wanted);
            if wanting && *built & (1 << x) == 0 && open(centre) {
                *built |= 1 << x;
                self.centre = centre;
                self.models += 1;
                return Some(centre);
            }
        }
        None
    }

    /// Ends the cell: the models that it has taken, or none if it had ended before.
    #[inline(always)]
    pub(crate) fn finish(&mut self) -> Option<u32> {
        core::mem::take(&mut self.under_way).then_some(self.models)
    }

    /// Counts the prediction window of the model at the centre that [`next`](Self::next) gave.
    #[inline(always)]
    pub(crate) fn cover(&mut self, radius: usize) {
        if !self.under_way {
            return;
        }
        let (x, y) = (usize::from(self.centre.x), usize::from(self.centre.y));
        let rows = self.coverage.iter_mut().take(y + radius + 1);
        for row in rows.skip(y.saturating_sub(radius)) {
            let pixels = row.iter_mut().take(x + radius + 1);
            for count in pixels.skip(x.saturating_sub(radius)) {
                *count += 1;
            }
        }
    }
}

/// Whether the pixel needs a model at all.
#[inline(always)]
pub(crate) fn wants_model<const D: usize>(
    tile: &Tile<D>,
    centre: Centre,
    formulas: Formulas,
) -> bool {
    match tile.pixel_at(centre.position()).state {
        PixelState::Outside => false,
        PixelState::Clean => formulas == Formulas::Literal,
        PixelState::Noisy | PixelState::Bad => true,
    }
}
