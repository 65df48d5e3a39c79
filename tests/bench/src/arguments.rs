//! The command line.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};

use crate::method::Method;
use crate::point::PointArguments;

/// Measures run time against error, a process per measurement.
#[derive(Parser)]
#[command(args_conflicts_with_subcommands = true)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) command: Option<Command>,
    #[command(flatten)]
    pub(crate) run: RunArguments,
}

#[derive(Subcommand)]
pub(crate) enum Command {
    /// One measurement, printed as JSON: what the benchmark runs in a process of its own.
    #[command(hide = true)]
    Point(PointArguments),
}

/// What to measure.
#[derive(Args)]
pub(crate) struct RunArguments {
    /// Folder of `<scene>_ref.exr` and `<scene>_<n>spp.exr`; the repository's sample without.
    #[arg(long)]
    pub(crate) scenes: Option<PathBuf>,
    /// Scenes by name; all of the folder without.
    #[arg(long, value_delimiter = ',')]
    pub(crate) only: Vec<String>,
    /// Samples per pixel.
    #[arg(long, value_delimiter = ',', default_values_t = [4, 16, 64])]
    pub(crate) spp: Vec<u32>,
    /// Methods; all without.
    #[arg(long, value_enum, value_delimiter = ',')]
    pub(crate) methods: Vec<Method>,
    /// Sizes that the images are mirrored up to for timing, beside their own size; 0 is that alone.
    #[arg(long, value_delimiter = ',', default_values_t = [1.0, 8.0])]
    pub(crate) megapixels: Vec<f64>,
    /// Runs of every measurement; tables give medians. 0 makes the tables anew.
    #[arg(long, default_value_t = 3)]
    pub(crate) runs: u32,
    /// Threads that compute.
    #[arg(long, default_value = "1")]
    pub(crate) threads: NonZeroUsize,
    /// Leave out what would take longer than this many seconds by the time of the image's own size.
    #[arg(long, default_value_t = 120.0)]
    pub(crate) at_most: f64,
    /// Folder of the results; those of an earlier run in it are kept and added to. `tests/bench/runs/<date>-<machine>` without.
    #[arg(long)]
    pub(crate) out: Option<PathBuf>,
}
