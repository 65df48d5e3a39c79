//! The command `linpred`.

mod allocator;

use std::process::ExitCode;

fn main() -> ExitCode {
    allocator::give_large_buffers_back();
    ExitCode::from(linpred::cli::run(std::env::args_os()))
}
