//! A picture of where an image is wrong.

use std::io::Write;
use std::path::Path;

use linpred::exr_file::output::OutputFile;
use linpred::{Error, ImageSize};

/// Relative squared error that is drawn black, and that is drawn white: four decades between.
const DARKEST: f32 = 1e-4;
const BRIGHTEST: f32 = 1.0;

/// Colours on the way from the darkest to the brightest: black, violet, red, yellow, white.
const RAMP: [[f32; 3]; 5] = [
    [0.0, 0.0, 0.0],
    [0.35, 0.0, 0.5],
    [0.9, 0.2, 0.1],
    [1.0, 0.8, 0.1],
    [1.0, 1.0, 1.0],
];
/// What a pixel without a number is drawn in: a colour that is not on the ramp.
const NO_NUMBER: [u8; 3] = [0, 255, 255];

/// Writes a PNG row by row.
pub(crate) struct Heatmap {
    rows: png::StreamWriter<'static, PngFile>,
    file: PngFile,
}

impl std::fmt::Debug for Heatmap {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Heatmap").finish_non_exhaustive()
    }
}

/// The file is kept beside the encoder, which does not give it back: it gets its name when the encoder is done.
#[derive(Clone, Debug)]
struct PngFile(std::sync::Arc<std::sync::Mutex<Option<OutputFile>>>);

impl PngFile {
    fn with<T>(&self, act: impl FnOnce(&mut OutputFile) -> T) -> T {
        let mut file = self
            .0
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner);
        act(file.as_mut().expect("taken only when the encoder is gone"))
    }
}

impl Write for PngFile {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.with(|file| file.write(bytes))
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.with(Write::flush)
    }
}

impl Heatmap {
    /// Begins a picture. [`Error::Write`] if the file cannot be created.
    pub(crate) fn create(path: &Path, size: ImageSize) -> Result<Self, Error> {
        let file = PngFile(std::sync::Arc::new(std::sync::Mutex::new(Some(
            OutputFile::create(path)?,
        ))));
        // an ImageSize's sides fit i32
        let mut encoder =
            png::Encoder::new(file.clone(), size.width() as u32, size.height() as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        let rows = encoder
            .write_header()
            .and_then(png::Writer::into_stream_writer);
        match rows {
            Ok(rows) => Ok(Self { rows, file }),
            Err(error) => Err(file.with(|file| file.error(error.into()))),
        }
    }

    /// Draws a row of relative squared errors.
    pub(crate) fn row(&mut self, errors: &[f32]) -> Result<(), Error> {
        let bytes: Vec<u8> = errors.iter().flat_map(|&error| colour(error)).collect();
        self.rows
            .write_all(&bytes)
            .map_err(|source| self.file.with(|file| file.error(source)))
    }

    /// Completes the picture.
    pub(crate) fn finish(self) -> Result<(), Error> {
        let done = self.rows.finish();
        done.map_err(|error| self.file.with(|file| file.error(error.into())))?;
        let file = self
            .file
            .0
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner)
            .take();
        file.map_or(Ok(()), OutputFile::finish)
    }
}

fn colour(error: f32) -> [u8; 3] {
    if !error.is_finite() {
        return NO_NUMBER;
    }
    let decades = (BRIGHTEST / DARKEST).log10();
    let place =
        ((error.max(DARKEST) / DARKEST).log10() / decades).min(1.0) * (RAMP.len() - 1) as f32;
    let below = (place as usize).min(RAMP.len() - 2);
    let share = place - below as f32;
    let mix = |k: usize| RAMP[below][k] * (1.0 - share) + RAMP[below + 1][k] * share;
    [mix(0), mix(1), mix(2)].map(|v| (v * 255.0).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn larger_errors_are_never_darker() {
        let brightness = |error| colour(error).iter().map(|&v| u32::from(v)).sum::<u32>();
        let errors: Vec<f32> = (0..60)
            .map(|i| 10_f32.powf(-5.0 + f32::from(i as u8) * 0.1))
            .collect();
        assert!(
            errors
                .windows(2)
                .all(|e| brightness(e[0]) <= brightness(e[1]))
        );
        assert_eq!(
            (colour(0.0), colour(-1.0), colour(9.0)),
            ([0; 3], [0; 3], [255; 3])
        );
        assert_eq!(colour(f32::NAN), NO_NUMBER);
    }
}
