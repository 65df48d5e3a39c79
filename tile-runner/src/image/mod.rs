//! An image in a file as rows in and rows out.

mod part_in_progress;
pub mod rewrite;
pub mod sink;
pub mod source;
