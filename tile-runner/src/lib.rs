//! Streams images through `linpred-core`.

mod band;
mod blocks;
mod cells;
mod dispatch;
pub mod error;
pub mod geometry;
pub mod pipeline;
pub mod row;
