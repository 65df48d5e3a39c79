//! Error against a reference: by the library's own `compare`, which reads files.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use anyhow::Result;
use exr::prelude::{Image, SpecificChannels, WritableImage};
use linpred::ImageSize;
use linpred::job::{ColourRow, CompareRequest, Comparing, Figures};

use crate::image::Colour;

/// What `linpred compare` says of an image, which is stored for that.
pub(crate) fn figures(image: &Colour, size: ImageSize, reference: &Path) -> Result<Figures> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("denoised.exr");
    let at = |x: usize, y: usize| y * size.width() + x;
    let [red, green, blue] = &image.planes;
    let pixels = SpecificChannels::rgb(|exr::prelude::Vec2(x, y)| {
        (red[at(x, y)], green[at(x, y)], blue[at(x, y)])
    });
    let stored = Image::from_channels((size.width(), size.height()), pixels);
    stored.write().to_file(&path)?;
    let mut comparing = Comparing::open(&CompareRequest::new(&path, reference))?;
    let compared = comparing.measure(&AtomicBool::new(false), |_: &ColourRow<'_>, _: &[f32]| {
        Ok(())
    })?;
    Ok(compared.figures)
}
