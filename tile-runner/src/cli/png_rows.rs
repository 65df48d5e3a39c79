//! A PNG that is written row by row, and is there whole or not at all.

use std::io::Write;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use crate::Error;
use crate::exr_file::output::OutputFile;

/// Bytes that a picture of this width holds: a row to draw, the encoder's two and its filters', what it compresses.
pub(crate) fn bytes(width: usize) -> u64 {
    (width as u64).saturating_mul(3 * 8).saturating_add(1 << 20)
}

/// Writes a PNG of 8 bits red green blue.
pub(crate) struct PngRows {
    rows: png::StreamWriter<'static, PngFile>,
    file: PngFile,
}

impl std::fmt::Debug for PngRows {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("PngRows").finish_non_exhaustive()
    }
}

/// The file is kept beside the encoder, which does not give it back: it gets its name when the encoder is done.
#[derive(Clone, Debug)]
struct PngFile(Arc<Mutex<Option<OutputFile>>>);

impl PngFile {
    fn with<T>(&self, act: impl FnOnce(&mut OutputFile) -> T) -> T {
        let mut file = self.0.lock().unwrap_or_else(PoisonError::into_inner);
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

impl PngRows {
    /// Begins a picture. [`Error::Write`] if the file cannot be created, [`Error::Unsupported`] if a side is above 2^31 - 1, what a PNG can express.
    pub(crate) fn create(path: &Path, width: usize, height: usize) -> Result<Self, Error> {
        let side = |side: usize| i32::try_from(side).ok().map(i32::cast_unsigned);
        let Some((columns, rows)) = side(width).zip(side(height)) else {
            return Err(Error::Unsupported(format!(
                "{} would be {width} x {height} pixels, more than a PNG can be",
                path.display()
            )));
        };
        let file = PngFile(Arc::new(Mutex::new(Some(OutputFile::create(path)?))));
        let mut encoder = png::Encoder::new(file.clone(), columns, rows);
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

    /// Writes the next row, as wide as the picture.
    pub(crate) fn row(&mut self, pixels: &[[u8; 3]]) -> Result<(), Error> {
        self.rows
            .write_all(pixels.as_flattened())
            .map_err(|source| self.file.with(|file| file.error(source)))
    }

    /// Completes the picture, once all its rows are written.
    pub(crate) fn finish(self) -> Result<(), Error> {
        let done = self.rows.finish();
        done.map_err(|error| self.file.with(|file| file.error(error.into())))?;
        let mut file = self.file.0.lock().unwrap_or_else(PoisonError::into_inner);
        file.take().map_or(Ok(()), OutputFile::finish)
    }
}
