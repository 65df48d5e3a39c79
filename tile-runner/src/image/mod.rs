//! An image in a file as rows in and rows out, and one in memory as rows in.

pub(crate) mod area;
mod chunk;
pub(crate) mod frame;
pub(crate) mod motion;
pub(crate) mod new_image;
pub(crate) mod part_in_progress;
pub(crate) mod rewrite;
pub(crate) mod sink;
pub(crate) mod source;

pub use area::{Area, Placed, Unwrapped, Wrapped};
pub use frame::{Frame, Interleaved, Pixels};
pub use rewrite::{
    ERROR_CHANNEL, FRAMES_CHANNEL, OutputCompression, OutputOptions, RADIUS_CHANNEL, RANK_CHANNEL,
};
pub use sink::ExrSink;
pub use source::ExrSource;
