//! `linpred compare`.

use std::io::Write;
use std::process::ExitCode;

use linpred::Error;
use linpred::job::{Comparison, DEFAULT_MEMORY_LIMIT, compare};

use super::args::CompareArguments;
use super::heatmap::Heatmap;

/// Prints the figures of a comparison.
pub(crate) fn run(arguments: CompareArguments) -> Result<ExitCode, Error> {
    let CompareArguments {
        image,
        reference,
        heatmap,
        map,
        json,
    } = arguments;
    if let Some(path) = &heatmap {
        linpred::exr_file::output::check_output(path, &[&image, &reference])?;
    }
    let mut picture = None;
    let comparison = compare(
        &image,
        &reference,
        &map,
        DEFAULT_MEMORY_LIMIT,
        |size, errors| {
            let Some(path) = &heatmap else { return Ok(()) };
            if picture.is_none() {
                picture = Some(Heatmap::create(path, size)?);
            }
            picture
                .as_mut()
                .map_or(Ok(()), |picture| picture.row(errors))
        },
    )?;
    if let Some(picture) = picture {
        picture.finish()?;
    }
    let text = match json {
        true => format!("{}\n", serde_json::json!(comparison)),
        false => in_words(&comparison),
    };
    // nobody is left to be told when standard output is closed
    let _ = std::io::stdout().write_all(text.as_bytes());
    Ok(ExitCode::SUCCESS)
}

fn in_words(comparison: &Comparison) -> String {
    let own = if comparison.reference_has_variance {
        "taken off"
    } else {
        "not known"
    };
    let mut text = format!(
        "rMSE            {:.6}  (the reference's own noise: {own})\nMSE             {:.6}\nPSNR (tonemapped) {:.2} dB\nnot finite      {}\nworst pixels\n",
        comparison.rmse, comparison.mse, comparison.psnr_tonemapped, comparison.non_finite
    );
    for pixel in &comparison.worst {
        text += &format!(
            "  x {:>5}  y {:>5}  relative squared error {:.4}\n",
            pixel.x, pixel.y, pixel.error
        );
    }
    text
}
