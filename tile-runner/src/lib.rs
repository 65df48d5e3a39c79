//! Streams images through `linpred-core`.

pub mod error;
pub mod geometry;
pub mod pipeline;
pub mod row;
