//! The arithmetic of linpred.
//!
//! In the order in which an image goes through it: [`estimate_colour_noise`] and [`estimate_feature_noise`] where the renderer gave
//! no variances; [`weigh_samples`] and [`prefilter`], block by block; [`denoise_cells`], tile by tile; [`resolve`], pixel by pixel,
//! once the predictions of all cells that reach it are added up ([`Sum::add`]).
#![no_std]
#![forbid(unsafe_code)]

mod blend;
mod block;
mod cell;
mod eigen;
mod float;
mod lanes;
mod least_squares;
mod params;
mod tile;

pub use blend::{Denoised, LayerTile, Predictions, Sum, resolve, resolve_layer};
pub use block::estimate_noise::{
    NOISE_HALO, NoiseBlock, NoisePlane, NoisyBlock, estimate_colour_noise, estimate_feature_noise,
};
pub use block::plane::{BLOCK_COLUMNS, BLOCK_HEIGHT, BLOCK_WIDTH, BlockPlane};
pub use block::prefilter::{FeatureGroup, FeaturePlane, FilteredGroup, PREFILTER_HALO, prefilter};
pub use block::weights::{ColourBlock, ColourPlane, WEIGHTS_HALO, WeightBlock, weigh_samples};
pub use cell::denoise_cells;
pub use cell::feature_space::MAX_TERMS;
pub use cell::lent::{Cells, Scratch};
pub use cell::one_cell::denoise_cell;
pub use eigen::SymmetricEigen;
pub use least_squares::normal_equations::{Gram, NormalEquations, NotFinite, Solution};
pub use least_squares::prior::Prior;
pub use least_squares::rls::{Rls, Taken};
pub use params::{Formulas, Params, Quality};
pub use tile::{
    CELL, CHANNELS, HALO, Pixel, PixelState, RADIUS, TILE, TILE_AREA, Tile, WINDOW_AREA,
};
