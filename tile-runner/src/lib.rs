//! Streams images through `linpred-core`.

pub mod band;
pub mod compare;
pub mod error;
pub mod exr_file;
pub mod geometry;
pub mod heatmap;
pub mod inspect;
pub mod job;
pub mod layers;
pub mod memory;
pub mod names;
pub mod overlap;
mod part_in_progress;
pub mod pipeline;
pub mod presets;
pub mod rewrite;
pub mod roles;
pub mod row;
pub mod samples;
pub mod sequence;
pub mod sink;
pub mod source;
pub mod stitch;
pub mod variance;
