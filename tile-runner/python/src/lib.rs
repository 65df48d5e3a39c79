//! What the Python package `linpred` calls: its own functions check and document, these compute.
#![forbid(unsafe_code)]

mod arrays;
mod errors;
mod files;
mod frame;
mod options;
mod report;
mod rows;
mod sampling;
mod watch;

use pyo3::prelude::*;

/// The compiled half of the package.
#[pymodule]
mod _linpred {
    #[pymodule_export]
    use super::errors::{Busy, InputError};
    #[pymodule_export]
    use super::files::{
        beside, check, compare, denoise_file, frames, inspect, main, merge, plan, stitch,
    };
    #[pymodule_export]
    use super::frame::denoise;
    #[pymodule_export]
    use super::rows::Rows;
    #[pymodule_export]
    use super::sampling::{sample_map, sample_map_file};

    #[pymodule_export]
    const VERSION: &str = env!("CARGO_PKG_VERSION");
}
