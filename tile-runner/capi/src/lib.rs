//! The C interface of `linpred`. `include/linpred.h` is made of this crate's documentation, and `docs/c.md` shows how it is used.
//!
//! - `handle`: a denoiser, which one call at a time may use; `guard`: a panic becomes a code.
//! - `status`: codes and sentences. `versioned`: structs that may grow.
//! - `options`, `report`: what to compute, what was done.
//! - `format`, `raw_image`, `names`, `frame`: images in the caller's memory.
//! - `row`, `steps`, `run_rows`: row by row, in the caller's loop or by its functions.
//! - `sample_map`: where a renderer should go on.
//! - `file`: EXR files.
//!
//! What is unsafe at the border to C is here, of four kinds, and each block says why it is sound: handles, structs and strings that C hands over (`handle`,
//! `versioned`, `text`), pixels behind its pointers (`raw_image`), its functions (`progress`, `run_rows`), and rows lent to it (`row`).
#![allow(
    non_camel_case_types,
    reason = "types that C sees are named as C sees them"
)]

mod status;
mod version;

mod guard;
mod handle;
mod text;
mod versioned;

mod options;
mod progress;
mod report;

mod format;
mod frame;
mod names;
mod raw_image;

mod row;
mod run_rows;
mod steps;

mod file;
mod sample_map;

pub use file::{linpred_denoise_file, linpred_file_options, linpred_sample_map_file};
pub use format::linpred_format;
pub use frame::{
    linpred_execute, linpred_set_image, linpred_set_output, linpred_unset_image,
    linpred_unset_output,
};
pub use handle::{linpred_denoiser, linpred_free, linpred_message, linpred_new};
pub use options::{linpred_formulas, linpred_options, linpred_quality, linpred_set_options};
pub use progress::{linpred_progress_function, linpred_set_progress};
pub use report::{linpred_get_report, linpred_report};
pub use row::{
    linpred_feature, linpred_input_row, linpred_layout, linpred_output_row, linpred_variance,
};
pub use run_rows::{
    linpred_read_row_function, linpred_row_functions, linpred_run_rows, linpred_write_row_function,
};
pub use sample_map::{linpred_sample_goal, linpred_sample_map, linpred_sample_summary};
pub use status::{linpred_status, linpred_status_text};
pub use steps::{
    linpred_next_step, linpred_start_rows, linpred_step, linpred_step_kind, linpred_stop_rows,
};
pub use version::{
    LINPRED_VERSION_MAJOR, LINPRED_VERSION_MINOR, LINPRED_VERSION_PATCH, linpred_version,
};
