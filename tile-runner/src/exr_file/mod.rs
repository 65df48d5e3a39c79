//! OpenEXR files as streams of rows, with random access to their blocks.
//!
//! The `exr` crate parses headers and codes blocks; this module finds the blocks by the offset tables, holds no more than
//! the blocks that cross one row, and writes a file block by block, which the crate's own reader and writer
//! (one pass in file order; a closure that owns control) do not do.

pub mod attributes;
pub mod chunk;
pub mod compression;
pub mod grid;
pub mod header;
pub mod output;
pub mod reader;
pub mod rows;
pub mod writer;

pub use header::{Part, Refusal};
pub use reader::ExrFile;
pub use rows::{PartRows, check_decodable};
