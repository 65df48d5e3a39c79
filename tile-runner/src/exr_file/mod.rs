//! OpenEXR files as streams of rows, with random access to their chunks.
//!
//! The `exr` crate parses headers and codes chunks; this module finds the chunks by the offset tables, holds no more than
//! the chunks that cross one row, and writes a file chunk by chunk, which the crate's own reader and writer
//! (one pass in file order; a closure that owns control) do not do.

pub mod attributes;
pub(crate) mod chunk;
pub(crate) mod compression;
mod compression_code;
pub(crate) mod grid;
pub(crate) mod header;
pub mod output;
pub(crate) mod reader;
pub(crate) mod rows;
pub(crate) mod writer;

pub use compression::coder_panics;
pub(crate) use header::Part;
pub(crate) use reader::ExrFile;
pub(crate) use rows::{PartRows, check_decodable};
