//! What an output may be called.

use std::path::Path;

use crate::error::Error;

/// Extensions of other formats for images.
const OTHER_FORMATS: [&str; 36] = [
    "avif", "bmp", "cin", "dds", "dpx", "gif", "hdr", "heic", "heif", "ico", "iff", "j2k", "jp2",
    "jpe", "jpeg", "jpg", "jxl", "ktx", "ktx2", "pam", "pbm", "pfm", "pgm", "pic", "png", "pnm",
    "ppm", "psb", "psd", "qoi", "rgbe", "svg", "tga", "tif", "tiff", "webp",
];

/// Refuses the name of another format: programs would take the file for what it is not. [`Error::Usage`] then.
pub fn check_output_name(output: &Path) -> Result<(), Error> {
    let extension = output.extension().and_then(|extension| extension.to_str());
    let extension = extension.map(str::to_ascii_lowercase);
    match extension {
        Some(extension) if OTHER_FORMATS.contains(&extension.as_str()) => {
            Err(Error::Usage(format!(
                "the output is an OpenEXR file and cannot be called {}; call it {}",
                output.display(),
                output.with_extension("exr").display()
            )))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_other_formats_are_refused_and_no_others() {
        for name in ["a.png", "b/a.PNG", "a.####.tif", "a.exr.jpg"] {
            assert!(check_output_name(Path::new(name)).is_err(), "{name}");
        }
        for name in [
            "a.exr",
            "a.EXR",
            "a",
            "png",
            ".png",
            "a.png.exr",
            "a.0001",
            "a.beauty",
        ] {
            assert!(check_output_name(Path::new(name)).is_ok(), "{name}");
        }
    }
}
