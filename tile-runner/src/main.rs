//! The command line of linpred: `linpred denoise | inspect | compare | stitch`.

mod cli;

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    cli::allocator::give_large_buffers_back();
    cli::stop::let_writes_fail_at_the_size_limit();
    let arguments = match cli::args::Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => return cli::usage::end(&error),
    };
    cli::log::start(&arguments.log);
    linpred::exr_file::coder_panics::tell_caught_ones_to(|panic| tracing::debug!("{panic}"));
    let result = match arguments.command {
        cli::args::Command::Denoise(denoise) => cli::denoise::run(denoise, &arguments.log),
        cli::args::Command::Inspect(inspect) => cli::inspect::run(inspect),
        cli::args::Command::Compare(compare) => cli::compare::run(compare),
        cli::args::Command::Stitch(stitch) => cli::stitch::run(stitch),
    };
    result.unwrap_or_else(|error| cli::errors::end(&error))
}
