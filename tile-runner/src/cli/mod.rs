//! Arguments in, exit code out.

pub(crate) mod allocator;
pub(crate) mod args;
pub(crate) mod compare;
pub(crate) mod denoise;
pub(crate) mod errors;
pub(crate) mod frames;
pub(crate) mod heatmap;
pub(crate) mod inspect;
pub(crate) mod log;
pub(crate) mod number;
pub(crate) mod output_name;
pub(crate) mod picture;
pub(crate) mod png_rows;
pub(crate) mod progress;
pub(crate) mod report;
pub(crate) mod size;
pub(crate) mod stdout;
pub(crate) mod stitch;
pub(crate) mod stop;
pub(crate) mod threads;
pub(crate) mod usage;
