//! How a file is denoised.

use crate::image::rewrite::ExtraLayers;
use crate::job::band::Band;
use crate::stream::pipeline::Options;

/// How to denoise.
#[derive(Clone, Copy, Debug)]
pub struct JobOptions {
    /// What to compute, on how many threads.
    pub pipeline: Options,
    /// What to write beside the colour.
    pub extra: ExtraLayers,
    /// Bytes of memory that may be used.
    pub memory_limit: u64,
    /// Only this band of the image.
    pub band: Option<Band>,
}
