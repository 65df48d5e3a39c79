//! A part's pixels as rows, with one row of chunks in memory.

use std::sync::Arc;

use exr::meta::attribute::{IntegerBounds, SampleType};
use half::f16;
use half::slice::HalfFloatSliceExt;

use super::compression::SharedCodec;
use super::reader::ExrFile;
use crate::error::Error;

/// Refuses what cannot be decoded: [`Error::Unsupported`] if a part's pixels are of a kind that is not, [`Error::Budget`] if
/// one row of its chunks takes more than `limit` bytes.
pub(crate) fn check_decodable(file: &ExrFile, part: usize, limit: u64) -> Result<(), Error> {
    let described = &file.parts()[part];
    let (path, label) = (file.path().display(), described.label());
    if let Some(refusal) = &described.refusal {
        return Err(Error::Unsupported(format!("{path}: {label}: {refusal}")));
    }
    if described.chunk_row_bytes() > limit {
        return Err(Error::Budget(format!(
            "{path}: {label}: one row of chunks ({} rows of {} pixels, {} channels, {}) takes {} MiB, the limit is {} MiB",
            described
                .grid
                .chunk_height()
                .min(described.header.layer_size.1),
            described.header.layer_size.0,
            described.header.channels.list.len(),
            described.header.compression,
            described.chunk_row_bytes() >> 20,
            limit >> 20,
        )));
    }
    Ok(())
}

/// Reads rows of one part, in any order; cheapest from top to bottom.
#[derive(Debug)]
pub(crate) struct PartRows {
    file: Arc<ExrFile>,
    codec: SharedCodec,
    part: usize,
    /// Whether each channel is read.
    kept: Vec<bool>,
    types: Vec<SampleType>,
    /// Which row of chunks is decoded.
    current: Option<usize>,
    chunks: Vec<Chunk>,
    /// A row of half floats on its way to `f32`.
    halves: Vec<f16>,
}

#[derive(Debug)]
struct Chunk {
    bounds: IntegerBounds,
    bytes: Vec<u8>,
}

impl PartRows {
    /// Rows of a part, decoded by `codec`, once it has been told with [`keep`](Self::keep) which channels. Errors as for
    /// [`check_decodable`].
    pub(crate) fn new(
        file: Arc<ExrFile>,
        codec: SharedCodec,
        part: usize,
        limit: u64,
    ) -> Result<Self, Error> {
        check_decodable(&file, part, limit)?;
        let described = &file.parts()[part];
        let channels = &described.header.channels;
        let types = channels
            .list
            .iter()
            .map(|channel| channel.sample_type)
            .collect();
        let kept = vec![false; channels.list.len()];
        Ok(Self {
            file,
            codec,
            part,
            kept,
            types,
            current: None,
            chunks: Vec::new(),
            halves: Vec::new(),
        })
    }

    /// Has chunks decoded by `codec` from now on.
    pub(crate) fn decode_by(&mut self, codec: &SharedCodec) {
        self.codec = codec.clone();
    }

    /// Has `channel` decoded from now on.
    pub(crate) fn keep(&mut self, channel: usize) {
        self.kept[channel] = true;
        self.current = None;
    }

    /// Writes the samples of `channel`, which is kept, in row `y` to `out`, in native byte order; `out` is as long as they are.
    pub(crate) fn copy_row(
        &mut self,
        channel: usize,
        y: usize,
        out: &mut [u8],
    ) -> Result<(), Error> {
        self.load(y)?;
        let size = self.types[channel].bytes_per_sample();
        for chunk in &self.chunks {
            let samples = self.line(chunk, channel, y);
            let start = chunk.bounds.position.0 as usize * size;
            out[start..start + samples.len()].copy_from_slice(samples);
        }
        Ok(())
    }

    /// Writes the samples of `channel`, which is kept, in row `y` to `out` as `f32`; `out` has the width of the data window. Integers are
    /// rounded to the nearest `f32`.
    pub(crate) fn read_row(
        &mut self,
        channel: usize,
        y: usize,
        out: &mut [f32],
    ) -> Result<(), Error> {
        match self.types[channel] {
            SampleType::F32 => self.copy_row(channel, y, bytemuck::cast_slice_mut(out)),
            SampleType::U32 => {
                self.copy_row(channel, y, bytemuck::cast_slice_mut(out))?;
                out.iter_mut()
                    .for_each(|value| *value = value.to_bits() as f32);
                Ok(())
            }
            SampleType::F16 => {
                let mut halves = std::mem::take(&mut self.halves);
                halves.resize(out.len(), f16::ZERO);
                let result = self.copy_row(channel, y, bytemuck::cast_slice_mut(&mut halves));
                if result.is_ok() {
                    // as a slice: the processor's own instructions, where it has them
                    halves.convert_to_f32_slice(out);
                }
                self.halves = halves;
                result
            }
        }
    }

    /// Decodes the row of chunks that holds row `y`, if it is not the current one.
    fn load(&mut self, y: usize) -> Result<(), Error> {
        let grid = self.file.parts()[self.part].grid;
        let row = grid.chunk_row(y);
        if self.current == Some(row) {
            return Ok(());
        }
        self.current = None;
        for column in 0..grid.columns() {
            if self.chunks.len() == column {
                self.chunks.push(Chunk {
                    bounds: grid.bounds(column, row),
                    bytes: Vec::new(),
                });
            }
            let chunk = &mut self.chunks[column];
            chunk.bounds = grid.bounds(column, row);
            let kept = |channel: usize| self.kept[channel];
            self.file.decode_chunk(
                &self.codec,
                self.part,
                (column, row),
                kept,
                &mut chunk.bytes,
            )?;
        }
        self.current = Some(row);
        Ok(())
    }

    fn line<'a>(&self, chunk: &'a Chunk, channel: usize, y: usize) -> &'a [u8] {
        let width = chunk.bounds.size.0;
        let bytes = |channels: &mut dyn Iterator<Item = usize>| -> usize {
            let kept = channels.filter(|&channel| self.kept[channel]);
            kept.map(|channel| self.types[channel].bytes_per_sample())
                .sum()
        };
        let line = (y - chunk.bounds.position.1 as usize) * bytes(&mut (0..self.types.len()));
        let start = width * (line + bytes(&mut (0..channel)));
        &chunk.bytes[start..start + width * self.types[channel].bytes_per_sample()]
    }
}
