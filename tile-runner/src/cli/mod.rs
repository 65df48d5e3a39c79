//! The command line: arguments in, exit code out.

use std::ffi::OsString;

use clap::Parser;

use args::{Arguments, Command};
pub use compare::{Pictures, compare};
pub use size::parse_size;

mod args;
mod compare;
mod denoise;
mod errors;
mod heatmap;
mod inspect;
mod log;
mod merge;
mod number;
mod openjd;
mod picture;
mod png_rows;
mod progress;
mod report;
mod sample_map;
mod size;
mod stdout;
mod stitch;
mod stop;
mod threads;
mod usage;

/// Does what the command `linpred` does with these arguments, the first of which is its own name, and returns its exit code. For programs that offer the command line
/// beside an interface of their own.
///
/// Writes to standard output and standard error. It takes over the process's signals, and its log can be started once: call it once in a process.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let arguments: Vec<OsString> = arguments.into_iter().collect();
    stop::let_writes_fail_at_the_size_limit();
    let parsed = match Arguments::try_parse_from(&arguments) {
        Ok(parsed) => parsed,
        Err(error) => return usage::end(&error, &arguments),
    };
    log::start(&parsed.log);
    crate::exr_file::coder_panics::tell_caught_ones_to(|panic| tracing::debug!("{panic}"));
    let for_openjd = parsed.command.is_told_to_openjd();
    let result = match parsed.command {
        Command::Denoise(denoise) => denoise::run(denoise, &parsed.log),
        Command::Inspect(inspect) => inspect::run(inspect),
        Command::Compare(compare) => compare::run(compare),
        Command::Stitch(stitch) => stitch::run(stitch),
        Command::SampleMap(map) => sample_map::run(map),
        Command::Merge(merge) => merge::run(merge, parsed.log.log_format),
    };
    result.unwrap_or_else(|error| {
        if for_openjd {
            openjd::fail(&errors::in_words(&error));
        }
        errors::end(&error)
    })
}
