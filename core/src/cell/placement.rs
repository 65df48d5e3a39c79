//! Where a cell's models go: centres ever closer together, each unless it is predicted well enough already.

use heapless::Deque;

use crate::blend::Predictions;
use crate::cell::rings::Centre;
use crate::params::Formulas;
use crate::tile::{CELL, PixelState, Seen, Tile};

/// Granularity of each pass: centres are this far apart (LPR section 5.1: 19, then halved).
const PASSES: [usize; 5] = [19, 9, 4, 2, 1];

/// Pixels of a cell: each is a centre in the last pass at the latest.
const CENTRES: usize = CELL * CELL;

/// The centres in the cell, pass after pass, each in raster order. A centre of an earlier pass is not there again: it has its model by
/// then, or as many others as it wants.
const ORDER: [Centre; CENTRES] = {
    let mut order = [Centre { x: 0, y: 0, set: 0 }; CENTRES];
    let mut seen = [[false; CELL]; CELL];
    let (mut next, mut pass) = (0, 0);
    while pass < PASSES.len() {
        let granularity = PASSES[pass];
        let mut y = granularity / 2;
        while y < CELL {
            let mut x = granularity / 2;
            while x < CELL {
                if !seen[y][x] {
                    seen[y][x] = true;
                    order[next] = Centre {
                        x: x as u8,
                        y: y as u8,
                        set: set_of(x as u32, y as u32),
                    };
                    next += 1;
                }
                x += granularity;
            }
            y += granularity;
        }
        pass += 1;
    }
    assert!(next == CENTRES, "the last pass leaves no pixel out");
    order
};

/// Shares of the models that see features that are smoothed more, and features as rendered; the others see the prefiltered ones.
/// (measured: DEPARTURES.md).
const SMOOTHED_SHARE: u32 = 35;
const RENDERED_SHARE: u32 = 20;

/// The set of features that the model around a pixel of the cell sees: by a hash, so that neighbours differ and no pattern shows.
const fn set_of(x: u32, y: u32) -> u8 {
    // The finalizer of MurmurHash3 (Appleby 2008), over the place.
    let mut hash = (x << 8 | y).wrapping_mul(0x9e37_79b1);
    hash = (hash ^ (hash >> 16)).wrapping_mul(0x85eb_ca6b);
    hash = (hash ^ (hash >> 13)).wrapping_mul(0xc2b2_ae35);
    let percent = (((hash ^ (hash >> 16)) as u64 * 100) >> 32) as u32;
    if percent < SMOOTHED_SHARE {
        1
    } else if percent < SMOOTHED_SHARE + RENDERED_SHARE {
        2
    } else {
        0
    }
}

/// Progress of a cell.
pub(crate) struct Placement {
    /// Centres that may want a model yet.
    waiting: Deque<Centre, CENTRES>,
    models: u32,
    under_way: bool,
}

impl Placement {
    /// No cell.
    pub(crate) const ENDED: Self = Self {
        waiting: Deque::new(),
        models: 0,
        under_way: false,
    };

    /// Begins the cell of the tile `seen`, without models.
    #[inline(always)]
    pub(crate) fn start<const D: usize>(&mut self, seen: &Seen<D>, formulas: Formulas) {
        self.waiting.clear();
        let sets_differ = seen.otherwise.is_some();
        for &centre in &ORDER {
            if wants_model(seen.tile, centre, formulas) {
                let set = if sets_differ { centre.set } else { 0 };
                let centre = Centre { set, ..centre };
                let queued = self.waiting.push_back(centre);
                debug_assert!(queued.is_ok(), "a cell has no more than {CENTRES} pixels");
            }
        }
        self.models = 0;
        self.under_way = true;
    }

    /// The next centre where the confidence in all predictions is below `coverage`; none at the end of the cell.
    ///
    /// Not their number: where models do well a few are enough, and where they fail (a highlight that no feature shows, an edge of
    /// a shadow) it takes more to find one that does not (measured: DEPARTURES.md).
    #[inline(always)]
    pub(crate) fn next(&mut self, coverage: u16, predictions: &Predictions) -> Option<Centre> {
        let wanted = f32::from(coverage.max(1));
        while let Some(centre) = self.waiting.pop_front() {
            let sum = predictions.sums.get(centre.position());
            debug_assert!(sum.is_some(), "{centre:?} is not in the cell");
            if sum.is_some_and(|sum| sum.confidence < wanted) {
                self.models += 1;
                return Some(centre);
            }
        }
        None
    }

    /// Ends the cell: the models that it has taken, or none if it had ended before.
    #[inline(always)]
    pub(crate) fn finish(&mut self) -> Option<u32> {
        self.waiting.clear();
        core::mem::take(&mut self.under_way).then_some(self.models)
    }
}

/// Whether the pixel needs a model at all.
#[inline(always)]
fn wants_model<const D: usize>(tile: &Tile<D>, centre: Centre, formulas: Formulas) -> bool {
    match tile.pixel_at(centre.position()).state {
        PixelState::Outside => false,
        PixelState::Clean => formulas.are_published(),
        PixelState::Noisy | PixelState::Bad => true,
    }
}
