//! Messages on standard error.

use std::io::IsTerminal;

use tracing::level_filters::LevelFilter;

use crate::job::Remark;

use super::args::{LogArguments, LogFormat};

/// Starts the log. Once per process.
pub(crate) fn start(arguments: &LogArguments) {
    let level = match (arguments.quiet, arguments.verbose) {
        (true, _) => LevelFilter::ERROR,
        (false, 0) => LevelFilter::INFO,
        (false, 1) => LevelFilter::DEBUG,
        (false, _) => LevelFilter::TRACE,
    };
    let builder = tracing_subscriber::fmt()
        .with_max_level(level)
        .with_writer(std::io::stderr)
        .with_target(false);
    match arguments.log_format {
        LogFormat::Json => builder.json().flatten_event(true).init(),
        LogFormat::Text => builder
            .without_time()
            .with_ansi(std::io::stderr().is_terminal())
            .init(),
    }
}

/// Says what a user should know before a job begins.
pub(crate) fn remark(remark: &Remark) {
    match remark {
        Remark::Note(text) => tracing::info!("{text}"),
        Remark::Warning(text) => tracing::warn!("{text}"),
    }
}
