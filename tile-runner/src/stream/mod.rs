//! Rows to rows, through the few that are held: knows neither files nor channel names. [`pipeline`] is its heart.

mod borders;
pub(crate) mod finish;
mod fireflies;
mod held_rows;
mod missing_variances;
mod neighbourhood;
pub mod overlap;
pub(crate) mod pipeline;
mod preparation;
mod prepared_rows;
pub(crate) mod report;
mod resolved_row;
pub(crate) mod row_ring;
pub(crate) mod rows_of_cells;
pub mod steps;
mod sum_rows;
pub mod survey;
pub(crate) mod threads;

pub(crate) use held_rows::{LARGEST, NO_SURFACE, sum_of_variances};
