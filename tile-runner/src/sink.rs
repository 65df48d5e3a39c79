//! Rows of a denoised image into an EXR file that keeps everything else of the input.
//!
//! Channels that are not denoised are read again from the input when their rows are written, some sixty rows after the
//! source read them: decoding twice costs less memory than holding those rows of every channel.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use exr::meta::attribute::SampleType;
use half::f16;

use crate::error::Error;
use crate::exr_file::writer::ExrWriter;
use crate::exr_file::{ExrFile, PartRows};
use crate::rewrite::{Fill, Rewrite, RewrittenPart};
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

#[derive(Debug)]
struct PartInProgress {
    plan: RewrittenPart,
    /// The input's rows, where some channel is kept.
    kept: Option<PartRows>,
    /// The current row of blocks.
    blocks: Vec<Vec<u8>>,
    /// One row of one channel.
    samples: Vec<u8>,
}

impl ExrSink {
    /// Begins the output of `plan`, which was made for `input`. Copies the parts before the first that is written anew.
    ///
    /// [`Error::Write`] if the file cannot be created, [`Error::Budget`] if a row of blocks takes more than `limit` bytes,
    /// [`Error::Cancelled`] once `stop` is set.
    pub fn create(
        path: &Path,
        input: Arc<ExrFile>,
        plan: Rewrite,
        limit: u64,
        stop: Arc<AtomicBool>,
    ) -> Result<Self, Error> {
        let parts = plan
            .rewritten
            .into_iter()
            .map(|part| PartInProgress::new(part, &input, limit))
            .collect::<Result<Vec<_>, Error>>()?;
        let first = parts.iter().map(|part| part.plan.index).min().unwrap_or(0);
        let written = |index: usize| parts.iter().any(|part| part.plan.index == index);
        let copies: Vec<usize> = (first..plan.parts.len())
            .filter(|&index| !written(index))
            .collect();
        let writer = ExrWriter::create(path, plan.version, plan.parts)?;
        let mut sink = Self {
            first_row: plan.first_row,
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
        let before = grid.block_row(self.first_row) * grid.columns();
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

impl RowSink for ExrSink {
    fn write_row(&mut self, y: usize, row: &OutputRow) -> Result<(), Error> {
        for part in &mut self.parts {
            self.clamped += part.take_row(y, self.first_row, row)?;
            part.write_full_blocks(y, &mut self.writer)?;
        }
        Ok(())
    }
}

impl PartInProgress {
    fn new(plan: RewrittenPart, input: &Arc<ExrFile>, limit: u64) -> Result<Self, Error> {
        let keeps = plan.fills.iter().any(|fill| matches!(fill, Fill::Input(_)));
        let kept = keeps
            .then(|| PartRows::new(input.clone(), plan.index, limit))
            .transpose()?;
        Ok(Self {
            plan,
            kept,
            blocks: Vec::new(),
            samples: Vec::new(),
        })
    }

    /// Puts one row into the current blocks; returns how many samples were clamped. `first_row` is the input's row that is
    /// row 0 of the output.
    fn take_row(&mut self, y: usize, first_row: usize, row: &OutputRow) -> Result<u64, Error> {
        let grid = self.plan.grid;
        let block_row = grid.block_row(y);
        let channels = &self.plan.header.channels;
        if self.blocks.is_empty() {
            let bytes = |column| {
                let size = grid.bounds(column, block_row).size;
                vec![0; size.0 * size.1 * channels.bytes_per_pixel]
            };
            self.blocks = (0..grid.columns()).map(bytes).collect();
        }
        let mut clamped = 0;
        for (channel, (start, description)) in channels.channels_with_byte_offset().enumerate() {
            let size = description.sample_type.bytes_per_sample();
            self.samples.resize(self.plan.header.layer_size.0 * size, 0);
            let plane = match self.plan.fills[channel] {
                Fill::Input(kept) => {
                    let rows = self.kept.as_mut().expect("opened when a channel is kept");
                    rows.copy_row(kept, first_row + y, &mut self.samples)?;
                    None
                }
                Fill::Colour(k) => Some(&row.colour[k]),
                Fill::Layer(n, k) => Some(&row.layers[n][k]),
                Fill::Error => Some(&row.error),
                Fill::Radius => Some(&row.radius),
                Fill::Rank => Some(&row.rank),
            };
            if let Some(plane) = plane {
                clamped += encode_samples(description.sample_type, plane, &mut self.samples);
            }
            for (column, block) in self.blocks.iter_mut().enumerate() {
                let bounds = grid.bounds(column, block_row);
                let (x, width) = (bounds.position.0 as usize, bounds.size.0);
                let line = (y - bounds.position.1 as usize) * width * channels.bytes_per_pixel;
                let at = line + width * start;
                block[at..at + width * size]
                    .copy_from_slice(&self.samples[x * size..(x + width) * size]);
            }
        }
        Ok(clamped)
    }

    /// Compresses and writes the current blocks once row `y` was their last.
    fn write_full_blocks(&mut self, y: usize, writer: &mut ExrWriter) -> Result<(), Error> {
        let grid = self.plan.grid;
        let block_row = grid.block_row(y);
        let last = grid.bounds(0, block_row);
        if y + 1 < last.position.1 as usize + last.size.1 {
            return Ok(());
        }
        let header = &self.plan.header;
        for (column, block) in self.blocks.drain(..).enumerate() {
            let bounds = grid.bounds(column, block_row);
            let payload = header
                .compression
                .compress_image_section_to_le(header, block, bounds)
                .map_err(|error| {
                    Error::Unsupported(format!(
                        "{}: part {}: row {}: cannot be compressed: {error}",
                        writer.path().display(),
                        self.plan.index,
                        last.position.1
                    ))
                })?;
            writer.write_block(
                self.plan.index,
                block_row * grid.columns() + column,
                &payload,
            )?;
        }
        Ok(())
    }
}

/// Writes `values` as samples in native byte order. Returns how many finite values would have become infinite.
fn encode_samples(kind: SampleType, values: &[f32], out: &mut [u8]) -> u64 {
    match kind {
        SampleType::F32 => {
            for (sample, value) in out.chunks_exact_mut(4).zip(values) {
                sample.copy_from_slice(&value.to_ne_bytes());
            }
            0
        }
        SampleType::F16 => {
            let mut clamped = 0;
            for (sample, &value) in out.chunks_exact_mut(2).zip(values) {
                let mut half = f16::from_f32(value);
                if half.is_infinite() && value.is_finite() {
                    half = if value > 0.0 { f16::MAX } else { f16::MIN };
                    clamped += 1;
                }
                sample.copy_from_slice(&half.to_ne_bytes());
            }
            clamped
        }
        // refused when the output was planned
        SampleType::U32 => unreachable!("integers are not denoised"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_beyond_half_precision_becomes_the_largest_half_and_is_counted() {
        let mut bytes = [0; 8];
        let clamped = encode_samples(SampleType::F16, &[1.0, 70000.0, -1e9, 65504.0], &mut bytes);
        let halves: Vec<f32> = bytes
            .chunks_exact(2)
            .map(|b| f16::from_ne_bytes([b[0], b[1]]).to_f32())
            .collect();
        assert_eq!(halves, [1.0, 65504.0, -65504.0, 65504.0]);
        assert_eq!(clamped, 2);
    }
}
