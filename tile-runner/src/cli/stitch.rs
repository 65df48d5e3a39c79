//! `linpred stitch`.

use std::path::Path;

use crate::Error;
use crate::job::{check_output_name, stitch};

use super::args::StitchArguments;
use super::errors::DONE;
use super::stop;

/// Puts the bands of an image together.
pub(crate) fn run(arguments: StitchArguments) -> Result<u8, Error> {
    check_output_name(&arguments.output)?;
    let bands: Vec<&Path> = arguments.bands.iter().map(AsRef::as_ref).collect();
    stitch(&bands, &arguments.output, &stop::on_signals())?;
    tracing::info!(
        "{}: stitched from {} bands",
        arguments.output.display(),
        bands.len()
    );
    Ok(DONE)
}
