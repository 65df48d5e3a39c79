//! Open Image Denoise, through a script beside this crate.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};
use serde::Deserialize;

use crate::clock::Cost;
use crate::image::{Colour, Image};
use crate::point::Done;

/// What the script prints.
#[derive(Deserialize)]
struct Printed {
    cost: Cost,
}

fn script() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("oidn.py")
}

/// The version that is installed; `None` without Python or pyoidn.
pub(crate) fn version() -> Option<String> {
    let output = Command::new("python3")
        .arg(script())
        .arg("--version")
        .stderr(Stdio::null())
        .output()
        .ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    (output.status.success() && !text.trim().is_empty()).then(|| text.trim().to_owned())
}

/// Denoises with albedo and normal, which are denoised first if they are to be. The script mirrors the image itself.
pub(crate) fn denoise(
    image: &Image,
    copies: usize,
    threads: NonZeroUsize,
    (quality, prefiltered): (&str, bool),
) -> Result<Done> {
    let folder = tempfile::tempdir()?;
    for (name, planes) in [("colour", 0), ("normal", 1), ("albedo", 2)] {
        let mut values = Vec::new();
        for row in &image.rows {
            let channels: [&[f32]; 3] = std::array::from_fn(|c| match planes {
                0 => &row.colour[c][..],
                1 => &row.features[c][..],
                _ => &row.features[3 + c][..],
            });
            for x in 0..channels[0].len() {
                values.extend(channels.map(|channel| channel[x]));
            }
        }
        std::fs::write(
            folder.path().join(name),
            bytemuck::cast_slice::<f32, u8>(&values),
        )?;
    }
    let output = Command::new("python3")
        .arg(script())
        .arg(folder.path())
        .args([
            image.layout.size.width().to_string(),
            image.layout.size.height().to_string(),
            copies.to_string(),
            threads.to_string(),
            quality.to_owned(),
        ])
        .args(prefiltered.then_some("prefiltered"))
        .stderr(Stdio::inherit())
        .output()
        .context("python3 does not start")?;
    ensure!(output.status.success(), "oidn.py: {}", output.status);
    let printed: Printed = serde_json::from_slice(&output.stdout)?;
    let colour = if copies == 1 {
        Some(read_colour(&folder.path().join("denoised"))?)
    } else {
        None
    };
    Ok(Done {
        colour,
        cost: printed.cost,
        report: None,
    })
}

fn read_colour(path: &Path) -> Result<Colour> {
    let bytes = std::fs::read(path)?;
    let mut colour = Colour::default();
    let values = bytemuck::pod_collect_to_vec::<u8, f32>(&bytes);
    for (i, value) in values.into_iter().enumerate() {
        colour.planes[i % 3].push(value);
    }
    Ok(colour)
}
