//! The arithmetic of linpred, a denoiser of Monte Carlo renders: linear models of radiance over features (surface normal, albedo, depth, and others), each
//! as wide as it stays right (Moon et al. 2015, *Adaptive Rendering with Linear Predictions*, LPR).
//!
//! `no_std`, without allocation, unsafe code or a reachable panic; the same bits on every machine. What it works on, the caller lends. For
//! whole images and files there is the crate `linpred`.
//!
//! # Tour
//!
//! An image passes in the order of these lines.
//!
//! | | unit | function |
//! |---|---|---|
//! | pixels that one sample made far too bright, to be left out like those that are not finite | row | [`find_fireflies`] |
//! | variances, where the renderer gave none | block | [`estimate_colour_noise`], [`estimate_feature_noise`], [`estimate_further_noise`] |
//! | a weight for each sample, its variance, and how far a prediction may be from it | block | [`weigh_samples`] |
//! | features without their noise | block | [`prefilter`] |
//! | predictions by models, each fitted to the window around its centre | tile | [`denoise_cells`], or [`denoise_cell`] for one alone |
//! | the predictions of all cells that reach a pixel, added up | pixel | [`Sum::add`] |
//! | their mean | pixel | [`resolve`], and [`resolve_layer`] and [`resolve_scalar`] for what follows |
//! | grain smoothed, twice | row | [`weigh_pixels`], [`smooth`] |
//! | specks taken out | row | [`despeckle`] |
//! | light that was lost given back | row | [`compare_light`], [`find_factors`] |
//! | how many samples a pixel should get | pixel | [`Sampler`] |
//!
//! A **block** is [`BLOCK_WIDTH`] x [`BLOCK_HEIGHT`] pixels with a halo of each function's own ([`WEIGHTS_HALO`], [`PREFILTER_HALO`],
//! [`NOISE_HALO`]). A **cell** is [`CELL`] x [`CELL`] pixels; with the [`HALO`] around it that its windows read it is a [`Tile`].
//!
//! One tile, with nothing but the position for a feature:
//!
//! ```
//! use linpred_core::{
//!     CELL, HALO, Params, Pixel, PixelState, Predictions, Scratch, TILE, Tile, denoise_cell, resolve,
//! };
//!
//! // A grey wall that brightens to the right, under uniform noise of variance 0.03.
//! let radiance = |x: usize| 0.5 + 0.02 * x as f32;
//! let mut tile = Box::new(Tile::<2>::EMPTY);
//! let mut random = 1u32;
//! for (i, pixel) in tile.pixels.iter_mut().enumerate() {
//!     let (x, y) = (i % TILE, i / TILE);
//!     random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
//!     let noise = 0.6 * (random as f32 / u32::MAX as f32 - 0.5);
//!     *pixel = Pixel {
//!         features: [x as f32, y as f32],
//!         colour: [radiance(x) + noise; 3],
//!         weight: 1.0, // `weigh_samples` finds it, and the two after it, from the image
//!         variance: 3.0 * 0.03,
//!         tolerance: 3.0 * 0.03,
//!         state: PixelState::Noisy,
//!     };
//! }
//!
//! let params = Params::default();
//! let mut scratch = Box::new(Scratch::new());
//! let mut predictions = Box::new(Predictions::NONE);
//! let models = denoise_cell(&tile, &params, &mut [], &mut scratch, &mut predictions);
//!
//! let (x, y) = (HALO + CELL / 2, HALO + CELL / 2);
//! let (pixel, sum) = (&tile.pixels[y * TILE + x], &predictions.sums[y * TILE + x]);
//! let denoised = resolve(pixel, sum, params.formulas);
//! assert!(models >= 4 && denoised.radius > 5.0);
//! assert!((denoised.colour[0] - radiance(x)).abs() < 0.05);
//! ```
//!
//! [`Rls`], [`NormalEquations`] and [`SymmetricEigen`] are the algebra under it, for whoever wants a fit alone.
//! `DEPARTURES.md` beside the sources says where the default departs from the papers, and what each departure buys.
#![no_std]
#![forbid(unsafe_code)]

mod blend;
mod block;
mod cell;
mod eigen;
mod features;
mod finish;
mod float;
mod lanes;
mod least_squares;
mod params;
mod sampling;
mod temporal;
mod tile;

pub use blend::{Denoised, LayerTile, Predictions, Sum, resolve, resolve_layer, resolve_scalar};
pub use block::estimate_noise::{
    NOISE_HALO, NoiseBlock, NoisePlane, NoisyBlock, estimate_colour_noise, estimate_feature_noise,
    estimate_further_noise,
};
pub use block::fireflies::{FIREFLY_HALO, FIREFLY_ROWS, find_fireflies};
pub use block::plane::{BLOCK_COLUMNS, BLOCK_HEIGHT, BLOCK_WIDTH, BlockPlane};
pub use block::prefilter::{FeatureGroup, FeaturePlane, FilteredGroup, PREFILTER_HALO, prefilter};
pub use block::weights::{
    ColourBlock, ColourPlane, WEIGHTS_HALO, WeightBlock, level_of, weigh_samples,
};
pub use cell::denoise_cells;
pub use cell::feature_space::MAX_TERMS;
pub use cell::lent::{Cells, OtherFrame, Scratch};
pub use cell::one_cell::denoise_cell;
pub use eigen::SymmetricEigen;
pub use features::{
    FEATURE_NAMES, FEATURES, FURTHER, Feature, MAX_FEATURES, POSITION, TILE_FEATURES,
    WIDE_TILE_FEATURES,
};
pub use finish::despeckle::{DESPECKLE_RADIUS, DESPECKLE_SPAN, SpeckRow, despeckle};
pub use finish::restore::{
    LIGHT_PLANES, LitRow, RESTORE_RADIUS, RESTORE_SPAN, compare_light, find_factors,
};
pub use finish::smooth::{
    ComparedRow, ERROR_RADIUS, ERROR_SPAN, MEAN_RADIUS, MEAN_SPAN, Precisions, SMOOTH_RADIUS,
    SMOOTH_SPAN, SMOOTHINGS, Smoothing, Surroundings, smooth, weigh_pixels,
};
pub use finish::{FINISH_PADDING, FinishedPlane, finish_columns};
pub use least_squares::normal_equations::{Gram, NormalEquations, NotFinite, Solution};
pub use least_squares::prior::Prior;
pub use least_squares::rls::{Rls, Taken};
pub use params::{Formulas, Params, Quality};
pub use sampling::{Sampler, pixel_hash};
pub use temporal::{
    Averaged, COMPARED_PLANES, DEPTH_CHANGE, FrameRow, MEASURED_PLANES, TEMPORAL_RADIUS,
    TEMPORAL_SPAN, average_frames, compare_frames, compare_own, measure_frame, weigh_frames,
};
pub use tile::{
    CELL, CHANNELS, FeatureSet, HALO, OtherFeatures, Pixel, PixelState, RADIUS, SETS, TILE,
    TILE_AREA, Tile, WINDOW_AREA,
};
