//! The arithmetic of linpred.
//!
//! In the order in which an image goes through it: [`estimate_colour_noise`] and [`estimate_feature_noise`] where the renderer gave
//! no variances; [`prepare`] and [`prefilter`], block by block; [`denoise_cells`], tile by tile; [`resolve`], pixel by pixel,
//! once the predictions of all cells that reach it are added up ([`Sum::add`]).
#![no_std]
#![forbid(unsafe_code)]

mod blend;
mod cell;
mod columns;
mod dot;
mod eigen;
mod equations;
mod feature_noise;
mod feature_space;
mod features;
mod fit;
mod float;
mod lanes;
mod literal;
mod median;
mod noise;
mod normal;
mod params;
mod prediction;
mod prefilter;
mod prepare;
mod prior;
mod rls;
mod tile;
mod walk;
mod window;

pub use blend::{Denoised, LayerTile, Predictions, Sum, resolve, resolve_layer};
pub use cell::{Cells, Scratch, denoise_cell, denoise_cells};
pub use eigen::SymmetricEigen;
pub use feature_space::MAX_TERMS;
pub use features::{FEATURE_NAMES, FEATURES, Feature, POSITION, TILE_FEATURES};
pub use noise::{
    NOISE_HALO, NoiseBlock, NoisePlane, NoisyBlock, estimate_colour_noise, estimate_feature_noise,
};
pub use normal::{Gram, NormalEquations, NotFinite, Solution};
pub use params::{Formulas, Params, Quality};
pub use prefilter::{FeatureGroup, FeaturePlane, FilteredGroup, PREFILTER_HALO, prefilter};
pub use prepare::{
    BLOCK_COLUMNS, BLOCK_HEIGHT, BLOCK_WIDTH, BlockPlane, ColourBlock, ColourPlane, PREPARE_HALO,
    PreparedBlock, prepare,
};
pub use prior::{CHANNELS, Prior};
pub use rls::{Rls, Taken};
pub use tile::{CELL, HALO, Pixel, PixelState, RADIUS, TILE, TILE_AREA, Tile, WINDOW_AREA};
