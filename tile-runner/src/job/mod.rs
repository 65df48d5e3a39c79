//! What one command does: a file is denoised, inspected, compared with another, put together of bands.

mod band;
mod compare;
mod denoise;
mod input;
mod inspect;
mod memory;
mod options;
mod plan;
mod sequence;
mod stitch;

pub use band::{BAND_ATTRIBUTE, Band, BandSink, BandSource, WHOLE_ATTRIBUTE};
pub use compare::{Comparison, WorstPixel, compare};
pub use denoise::{Summary, denoise};
pub use input::{Input, InputRequest};
pub use inspect::{Inspection, PartInfo, RoleInfo, describe, inspect, inspect_with, survey};
pub use memory::{DEFAULT_MEMORY_LIMIT, MemoryPlan};
pub use options::JobOptions;
pub use plan::{Schedule, plan};
pub use sequence::{FramePattern, parse_frames};
pub use stitch::stitch;
