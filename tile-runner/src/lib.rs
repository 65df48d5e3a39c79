//! Streams images through `linpred-core`.

pub mod channels;
pub mod error;
pub mod exr_file;
pub mod geometry;
pub mod image;
pub mod job;
pub mod row;
pub mod stream;
