//! Where a cell's models go: centres ever closer together, each unless enough models predict it already.

use crate::tile::{CELL, WINDOW_AREA};

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

/// (x, y) of the centres in the cell, pass after pass, each in raster order.
const ORDER: [(u8, u8); CENTRES] = {
    let mut order = [(0, 0); CENTRES];
    let (mut next, mut pass) = (0, 0);
    while pass < PASSES.len() {
        let granularity = PASSES[pass];
        let mut y = granularity / 2;
        while y < CELL {
            let mut x = granularity / 2;
            while x < CELL {
                order[next] = (x as u8, y as u8);
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
pub(crate) struct Walk {
    /// Of `ORDER`.
    next: usize,
    centre: (u8, u8),
    models: u32,
    /// Models that predict each pixel.
    coverage: [[u16; CELL]; CELL],
    /// Where there is a model, a bit for each column: a later pass would fit the same one again.
    built: [u32; CELL],
    under_way: bool,
}

impl Walk {
    /// No cell.
    pub(crate) const ENDED: Self = Self {
        under_way: false,
        ..Self::START
    };

    /// A cell without models.
    pub(crate) const START: Self = Self {
        next: 0,
        centre: (0, 0),
        models: 0,
        coverage: [[0; CELL]; CELL],
        built: [0; CELL],
        under_way: true,
    };

    /// Whether there is a cell.
    pub(crate) fn under_way(&self) -> bool {
        self.under_way
    }

    /// Models that the cell has taken.
    pub(crate) fn models(&self) -> u32 {
        self.models
    }

    /// The next centre in need of a model, or the end of the cell.
    #[inline(always)]
    pub(crate) fn next(
        &mut self,
        coverage: u16,
        open: impl Fn(usize, usize) -> bool,
    ) -> Option<(usize, usize)> {
        let wanted = coverage.clamp(1, WINDOW_AREA as u16);
        for &(column, row) in ORDER.iter().skip(self.next) {
            self.next += 1;
            let (x, y) = (usize::from(column), usize::from(row));
            let covered = self.coverage.get(y).and_then(|row| row.get(x));
            let Some(built) = self.built.get_mut(y) else {
                break;
            };
            let wanting = covered.is_some_and(|models| *models < wanted);
            if wanting && *built & (1 << x) == 0 && open(x, y) {
                *built |= 1 << x;
                self.centre = (column, row);
                self.models += 1;
                return Some((x, y));
            }
        }
        self.under_way = false;
        None
    }

    /// The centre that [`next`](Self::next) gave.
    pub(crate) fn centre(&self) -> (usize, usize) {
        (usize::from(self.centre.0), usize::from(self.centre.1))
    }

    /// Counts the prediction window of the model at the centre that [`next`](Self::next) gave.
    #[inline(always)]
    pub(crate) fn cover(&mut self, radius: usize) {
        if !self.under_way {
            return;
        }
        let (x, y) = self.centre();
        let rows = self.coverage.iter_mut().take(y + radius + 1);
        for row in rows.skip(y.saturating_sub(radius)) {
            let pixels = row.iter_mut().take(x + radius + 1);
            for count in pixels.skip(x.saturating_sub(radius)) {
                *count += 1;
            }
        }
    }
}
