//! What one command does: a file is denoised, inspected, compared with another, put together of bands or passes, looked at for where samples are missing.
//!
//! ```no_run
//! use std::path::Path;
//! use std::sync::Arc;
//! use std::sync::atomic::AtomicBool;
//!
//! use linpred::job::{Input, InputRequest, JobOptions, denoise};
//!
//! fn main() -> Result<(), linpred::Error> {
//!     let pictures = Input::open_all(&InputRequest::new("noisy.exr"))?;
//!     let never = Arc::new(AtomicBool::new(false));
//!     let mut progress = |rows| println!("{rows} of {} rows", pictures[0].height());
//!     let done = denoise(&pictures, Path::new("clean.exr"), &JobOptions::default(), &never, &mut progress)?;
//!     println!("{} models", done.reports[0].models);
//!     Ok(())
//! }
//! ```

mod band;
mod compare;
mod denoise;
mod frame_pattern;
mod helped_rows;
mod input;
mod inspect;
mod look;
mod marks;
mod memory;
mod merge;
mod neighbours;
mod options;
mod output_name;
mod plan;
mod request;
mod sample_map;
mod sequence;
mod stitch;

pub use band::{BAND_ATTRIBUTE, Band, BandSink, BandSource, WHOLE_ATTRIBUTE};
pub use compare::{
    ColourRow, CompareRequest, Comparing, Comparison, Figures, PLACE, WorstPixel, WorstPlace,
    tone_mapped, worst_places,
};
pub use denoise::{Summary, denoise, rows_to_write};
pub use frame_pattern::FramePattern;
pub use helped_rows::Help;
pub use input::{Input, Neighbours, Remark, Unused, only_picture, remarks};
pub use inspect::{Inspection, PartInfo, RoleInfo, describe, inspect, inspect_with, survey};
pub use memory::{DEFAULT_MEMORY_LIMIT, MemoryPlan, check_memory, check_memory_of_map};
pub use merge::{MergeRequest, Merged, Merging};
pub use neighbours::{DEFAULT_REACH, FrameFiles, MOST_REACH, NeighbourFiles, open_frame};
pub use options::JobOptions;
pub use output_name::check_output_name;
pub use plan::{Schedule, plan};
pub use request::{InputRequest, Wrap};
pub use sample_map::{MAP_CHANNEL, plan_map, rows_to_measure, sample_map};
pub use sequence::{Frame, check_outputs, frames, frames_beside, parse_frames};
pub use stitch::stitch;
