//! Rows of a denoised image into an EXR file that keeps everything else of the input.
//!
//! Only denoised samples are held, until they fill a row of chunks. The input's chunks are then decoded a second time, one at
//! a time, some hundred rows after the source decoded them: that costs less than holding every channel of those rows.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::Error;
use crate::exr_file::ExrFile;
use crate::exr_file::compression::SharedCodec;
use crate::exr_file::writer::ExrWriter;
use crate::image::part_in_progress::PartInProgress;
use crate::image::rewrite::Rewrite;
use crate::row::{OutputRow, RowSink};

/// Writes the output file. Nothing exists under its name before [`finish`](Self::finish).
#[derive(Debug)]
pub struct ExrSink {
    input: Arc<ExrFile>,
    writer: ExrWriter,
    parts: Vec<PartInProgress>,
    /// Parts that are copied once the others are written.
    copies: Vec<usize>,
    /// The input's row that is the output's first.
    first_row: usize,
    stop: Arc<AtomicBool>,
    clamped: u64,
}

impl ExrSink {
    /// Begins the output `rewrite`, which was made for `input`. Copies the parts before the first that is written anew. Chunks are coded by
    /// `codec`: the input's, to take turns with what reads it, or one of its own.
    ///
    /// [`Error::Write`] if the file cannot be created, [`Error::Budget`] if a row of chunks takes more than `limit` bytes,
    /// [`Error::Cancelled`] once `stop` is set.
    pub fn create(
        path: &Path,
        input: Arc<ExrFile>,
        rewrite: Rewrite,
        codec: &SharedCodec,
        limit: u64,
        stop: Arc<AtomicBool>,
    ) -> Result<Self, Error> {
        let parts = rewrite
            .rewritten
            .into_iter()
            .map(|part| PartInProgress::new(part, &input, codec, rewrite.first_row, limit))
            .collect::<Result<Vec<_>, Error>>()?;
        let first = parts.iter().map(|part| part.index()).min().unwrap_or(0);
        let written = |index: usize| parts.iter().any(|part| part.index() == index);
        let copies: Vec<usize> = (first..rewrite.parts.len())
            .filter(|&index| !written(index))
            .collect();
        let writer = ExrWriter::create(path, rewrite.version, rewrite.parts)?;
        let mut sink = Self {
            first_row: rewrite.first_row,
            input,
            writer,
            parts,
            copies,
            stop,
            clamped: 0,
        };
        for part in 0..first {
            sink.copy_part(part)?;
        }
        Ok(sink)
    }

    /// Copies what is left, completes the file and gives it its name. Returns how many half-precision samples would have
    /// become infinite and were clamped to the largest half instead.
    pub fn finish(mut self) -> Result<u64, Error> {
        for part in std::mem::take(&mut self.copies) {
            self.copy_part(part)?;
        }
        self.writer.finish()?;
        Ok(self.clamped)
    }

    /// Copies those chunks of a part that lie in the output's rows.
    fn copy_part(&mut self, part: usize) -> Result<(), Error> {
        let grid = self.input.parts()[part].grid;
        let before = grid.chunk_row(self.first_row) * grid.columns();
        let wanted = before..before + self.writer.chunks(part);
        for index in self.input.chunks_in_file_order(part) {
            if !wanted.contains(&index) {
                continue;
            }
            if self.stop.load(Ordering::Relaxed) {
                return Err(Error::Cancelled);
            }
            self.writer
                .copy_chunk((part, index - before), &self.input, (part, index))?;
        }
        Ok(())
    }
}

impl ExrSink {
    /// Takes row `y` of a picture; rows of several pictures in turns, so that none is ahead of another.
    pub fn write_picture_row(
        &mut self,
        picture: usize,
        y: usize,
        row: &OutputRow,
    ) -> Result<(), Error> {
        for part in &mut self.parts {
            self.clamped += part.take_row(picture, y, row);
            part.write_full_chunks(picture, y, &mut self.writer)?;
        }
        Ok(())
    }
}

/// Of a file with one picture.
impl RowSink for ExrSink {
    fn write_row(&mut self, y: usize, row: &OutputRow) -> Result<(), Error> {
        self.write_picture_row(0, y, row)
    }
}
