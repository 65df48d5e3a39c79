//! The pixels of a window, ring after ring around its centre: the order in which fits grow and predictions are kept.

use crate::tile::{HALO, RADIUS, TILE, WINDOW_AREA};

/// A pixel of a cell around which a model is fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Centre {
    pub(crate) x: u8,
    pub(crate) y: u8,
    /// The set of features that its model sees.
    pub(crate) set: u8,
}

impl Centre {
    /// Where it lies in the tile.
    #[inline(always)]
    pub(crate) fn position(self) -> usize {
        (usize::from(self.y) + HALO) * TILE + usize::from(self.x) + HALO
    }
}

/// The centre of each lane's next model; none where a lane has no cell any more.
pub(crate) type Centres<const L: usize> = [Option<Centre>; L];

/// Offsets (x, y) from a window's centre, ring after ring: ring r is the entries from (2r-1)^2 to (2r+1)^2.
pub(crate) const RINGS: [(i8, i8); WINDOW_AREA] = rings();

/// Pixels of the window of half-width `radius`.
#[inline(always)]
pub(crate) const fn window_pixels(radius: usize) -> usize {
    (2 * radius + 1) * (2 * radius + 1)
}

const fn rings() -> [(i8, i8); WINDOW_AREA] {
    let mut offsets = [(0i8, 0i8); WINDOW_AREA];
    let mut next = 1;
    let mut r = 1i8;
    while r <= RADIUS as i8 {
        let mut y = -r;
        while y <= r {
            let step = if y == -r || y == r { 1 } else { 2 * r };
            let mut x = -r;
            while x <= r {
                offsets[next] = (x, y);
                next += 1;
                x += step;
            }
            y += 1;
        }
        r += 1;
    }
    offsets
}

/// The same offsets as steps between positions in a tile.
pub(crate) const RING_STEPS: [isize; WINDOW_AREA] = ring_steps();

const fn ring_steps() -> [isize; WINDOW_AREA] {
    let mut steps = [0; WINDOW_AREA];
    let mut i = 0;
    while i < WINDOW_AREA {
        steps[i] = RINGS[i].1 as isize * TILE as isize + RINGS[i].0 as isize;
        i += 1;
    }
    steps
}
