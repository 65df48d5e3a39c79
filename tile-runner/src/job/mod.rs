//! What one command does.

pub mod band;
pub mod compare;
pub mod denoise;
pub mod heatmap;
pub mod inspect;
pub mod memory;
pub mod plan;
pub mod sequence;
pub mod stitch;
