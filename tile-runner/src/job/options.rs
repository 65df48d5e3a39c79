//! How a file is denoised.

use crate::image::rewrite::OutputOptions;
use crate::job::band::Band;
use crate::job::memory::DEFAULT_MEMORY_LIMIT;
use crate::stream::pipeline::Options;

/// How to denoise.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct JobOptions {
    /// What to compute, on how many threads.
    pub pipeline: Options,
    /// What to write beside the colour, and how it is stored.
    pub output: OutputOptions,
    /// Bytes of memory that may be used.
    pub memory_limit: u64,
    /// Only this band of the image.
    pub band: Option<Band>,
}

impl JobOptions {
    /// The whole image, nothing beside the colour, stored as the input, within [`DEFAULT_MEMORY_LIMIT`].
    pub fn new(pipeline: Options) -> Self {
        Self {
            pipeline,
            output: OutputOptions::default(),
            memory_limit: DEFAULT_MEMORY_LIMIT,
            band: None,
        }
    }

    /// Writes these layers beside the colour, and stores them so.
    pub fn with_output(self, output: OutputOptions) -> Self {
        Self { output, ..self }
    }

    /// Keeps within this many bytes of memory.
    pub fn with_memory_limit(self, memory_limit: u64) -> Self {
        Self {
            memory_limit,
            ..self
        }
    }

    /// Only this band of the image.
    pub fn with_band(self, band: Band) -> Self {
        Self {
            band: Some(band),
            ..self
        }
    }
}

impl Default for JobOptions {
    fn default() -> Self {
        Self::new(Options::default())
    }
}
