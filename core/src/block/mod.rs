//! What every pixel costs, before any model: blocks of the image in, weights and filtered features out.

pub(crate) mod estimate_noise;
pub(crate) mod fireflies;
mod median;
pub(crate) mod plane;
pub(crate) mod prefilter;
pub(crate) mod weights;
