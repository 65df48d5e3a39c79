//! `linpred stitch`.

use std::path::Path;

use crate::Error;
use crate::job::stitch;

use super::args::{StitchArguments, StitchProgress};
use super::errors::DONE;
use super::{openjd, stop};

/// Puts the bands of an image together.
pub(crate) fn run(arguments: StitchArguments) -> Result<u8, Error> {
    let bands: Vec<&Path> = arguments.bands.iter().map(AsRef::as_ref).collect();
    let output = arguments.output.display();
    let for_openjd = arguments.progress == StitchProgress::Openjd;
    if for_openjd {
        openjd::status(&format!("{output} of {} bands", bands.len()));
    }
    stitch(&bands, &arguments.output, &stop::on_signals())?;
    if for_openjd {
        openjd::progress(100);
    }
    tracing::info!("{output}: stitched from {} bands", bands.len());
    Ok(DONE)
}
