//! What the caller lends: working memory, and cells to work on.

use crate::blend::{LayerTile, Predictions};
use crate::cell::feature_noise::FeatureNoise;
use crate::cell::feature_space::Basis;
use crate::cell::placement::Placement;
use crate::cell::prediction::PredictionWindows;
use crate::cell::window::{OTHER_FRAMES, Windows};
use crate::params::{Formulas, Params};
use crate::tile::{OtherFeatures, SETS, Seen, Tile};

/// Working memory of `L` cells of `D` features at a time, lent by the caller; its contents carry nothing from one cell
/// to the next.
#[repr(C, align(64))]
pub struct Scratch<const D: usize, const L: usize> {
    pub(crate) windows: Windows<D, L>,
    pub(crate) basis: Basis<D, L>,
    pub(crate) predicted: PredictionWindows<L>,
    pub(crate) placements: [Placement; L],
    pub(crate) noise: [[FeatureNoise<D>; SETS]; L],
}

impl<const D: usize, const L: usize> Scratch<D, L> {
    /// Memory for any cells.
    pub const fn new() -> Self {
        Self {
            windows: Windows::ZERO,
            basis: Basis::NONE,
            predicted: PredictionWindows::EMPTY,
            placements: [const { Placement::ENDED }; L],
            noise: [const { [const { FeatureNoise::NONE }; SETS] }; L],
        }
    }

    /// Forgets the cells under way.
    #[inline(always)]
    pub(crate) fn forget_cells(&mut self) {
        for placement in &mut self.placements {
            // Nobody waits for the models of a cell that was broken off.
            let _ = placement.finish();
        }
    }
}

impl<const D: usize, const L: usize> Default for Scratch<D, L> {
    fn default() -> Self {
        Self::new()
    }
}

/// The pixels of another frame in the place of a tile, and its layers there: as many as the tile's.
#[derive(Clone, Copy, Debug)]
pub struct OtherFrame<'a, const D: usize> {
    /// Its pixels.
    pub tile: &'a Tile<D>,
    /// Its layers; their sums are not read.
    pub layers: &'a [LayerTile],
}

/// A source of cells with `D` features, and where their results go. Each lane holds one cell at a time.
pub trait Cells<const D: usize> {
    /// Loads the next cell into `lane`, the sums of its layers cleared; false if none is left.
    fn next(&mut self, lane: usize) -> bool;
    /// The tile in `lane`; any tile while the lane has no cell.
    fn tile(&self, lane: usize) -> &Tile<D>;
    /// Other features of that tile, for models that vary in what they see (see [`Params::vary_features`](crate::Params::vary_features)). `None`, unless implemented:
    /// all see those of the tile.
    fn otherwise(&self, lane: usize) -> Option<&OtherFeatures<D>> {
        let _ = lane;
        None
    }
    /// The same place in one of the frames around, number `k` of 0 to 3: [`Formulas::Wlr`] then fits to the 7 x 7 pixels around a centre in its own
    /// frame and in each of those (WLR section 8), whose number is one of the features that a tile holds. None, unless implemented; no other formulas
    /// read them.
    fn frame(&self, lane: usize, k: usize) -> Option<OtherFrame<'_, D>> {
        let _ = (lane, k);
        None
    }
    /// The predictions of the cell in `lane`, and the layers that follow it: the same number in every lane.
    fn results(&mut self, lane: usize) -> (&mut Predictions, &mut [LayerTile]);
    /// The cell in `lane` is finished; `models` models were built for it.
    fn done(&mut self, lane: usize, models: u32);
}

/// The frames around that of the cell in `lane` that its models are fitted to as well.
#[inline(always)]
pub(crate) fn frames<'a, const D: usize>(
    cells: &'a (impl Cells<D> + ?Sized),
    lane: usize,
    params: &Params,
) -> [Option<&'a Tile<D>>; OTHER_FRAMES] {
    match params.formulas {
        Formulas::Wlr => core::array::from_fn(|k| cells.frame(lane, k).map(|frame| frame.tile)),
        Formulas::Robust | Formulas::Literal => [None; OTHER_FRAMES],
    }
}

/// What the models of the cell in `lane` see.
#[inline(always)]
pub(crate) fn seen<'a, const D: usize>(
    cells: &'a (impl Cells<D> + ?Sized),
    lane: usize,
    params: &Params,
) -> Seen<'a, D> {
    Seen {
        tile: cells.tile(lane),
        otherwise: cells.otherwise(lane).filter(|_| params.vary_features),
    }
}
