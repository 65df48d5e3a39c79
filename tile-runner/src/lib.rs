//! Denoises Monte Carlo renders by linear predictions from what a renderer knows without noise.

pub mod channels;
mod error;
pub mod exr_file;
mod geometry;
pub mod image;
pub mod job;
mod row;
mod stream;

pub use error::{Error, Remedy, Setting};
pub use geometry::ImageSize;
pub use linpred_core::{FEATURE_NAMES, FEATURES, Feature, Formulas, Params, Quality};
pub use row::{InputRow, OutputRow, RowLayout, RowSink, RowSource, VarianceKind};
pub use stream::pipeline::{Options, denoise};
pub use stream::report::{Counts, Report};
pub use stream::{overlap, push, survey};
