//! Rows to rows: knows neither files nor channel names.

mod held_rows;
mod instruction_set;
mod missing_variances;
mod neighbourhood;
pub mod overlap;
pub mod pipeline;
mod preparation;
mod prepared_rows;
pub mod push;
mod resolved_row;
mod row_of_cells;
mod row_ring;
mod sum_rows;
pub mod survey;
