//! Which images there are.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};

/// A noisy image with its reference.
#[derive(Clone, Debug)]
pub(crate) struct NoisyImage {
    pub(crate) scene: String,
    pub(crate) spp: u32,
    pub(crate) path: PathBuf,
    pub(crate) reference: PathBuf,
}

/// The images of a folder, by scene and then by samples per pixel.
pub(crate) fn find(folder: &Path, only: &[String], spp: &[u32]) -> Result<Vec<NoisyImage>> {
    let mut scenes = Vec::new();
    let entries = std::fs::read_dir(folder).with_context(|| folder.display().to_string())?;
    for entry in entries {
        let name = entry?.file_name();
        if let Some(scene) = name.to_str().and_then(|n| n.strip_suffix("_ref.exr")) {
            scenes.push(scene.to_owned());
        }
    }
    scenes.retain(|scene| only.is_empty() || only.contains(scene));
    scenes.sort();
    let mut images = Vec::new();
    for scene in scenes {
        for &spp in spp {
            let path = folder.join(format!("{scene}_{spp}spp.exr"));
            if path.exists() {
                images.push(NoisyImage {
                    reference: folder.join(format!("{scene}_ref.exr")),
                    scene: scene.clone(),
                    spp,
                    path,
                });
            }
        }
    }
    ensure!(
        !images.is_empty(),
        "{}: no <scene>_ref.exr with a <scene>_<n>spp.exr beside it",
        folder.display()
    );
    Ok(images)
}
