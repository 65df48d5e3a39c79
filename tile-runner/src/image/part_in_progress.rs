//! A part that is written anew: denoised rows, until they fill a row of chunks.

use std::sync::Arc;

use exr::meta::attribute::IntegerBounds;

use crate::error::Error;
use crate::exr_file::compression::SharedCodec;
use crate::exr_file::writer::ExrWriter;
use crate::exr_file::{ExrFile, Part, PartRows, check_decodable};
use crate::image::chunk::{Lines, encode_samples, write_chunk};
use crate::image::rewrite::{Fill, RewrittenPart};
use crate::row::OutputRow;

/// What the part is to be, and its denoised samples since the last full row of chunks.
#[derive(Debug)]
pub(crate) struct PartInProgress {
    part: RewrittenPart,
    kept: Kept,
    /// The input's row that is the output's first.
    first_row: usize,
    /// The pictures that fill some of its channels, and how many rows of each have come.
    pictures: Vec<(usize, usize)>,
    /// Samples of each channel that is not kept, row by row; empty for those that are.
    denoised: Vec<Vec<u8>>,
    input: Arc<ExrFile>,
    /// What decodes the input's chunks once more, and encodes the output's.
    codec: SharedCodec,
    /// The chunk that is being written.
    chunk: Vec<u8>,
    /// The chunk of the input that it is made of, where the channels differ.
    decoded: Vec<u8>,
}

/// Where the channels that are kept come from.
#[derive(Debug)]
enum Kept {
    /// There are none.
    Nothing,
    /// The input's chunks, which are cut like the output's.
    Chunks,
    /// The input's rows: its chunks have another height.
    Rows(Box<PartRows>),
}

impl PartInProgress {
    /// Begins a part of the output of `input`. Errors as for [`check_decodable`].
    pub(crate) fn new(
        part: RewrittenPart,
        input: &Arc<ExrFile>,
        codec: &SharedCodec,
        first_row: usize,
        limit: u64,
    ) -> Result<Self, Error> {
        let described = &input.parts()[part.index];
        let same_chunks = described.grid.chunk_height() == part.grid.chunk_height();
        let kept = if !part.fills.iter().any(|fill| matches!(fill, Fill::Input(_))) {
            Kept::Nothing
        } else if same_chunks {
            check_decodable(input, part.index, limit)?;
            Kept::Chunks
        } else {
            let mut rows = PartRows::new(input.clone(), codec.clone(), part.index, limit)?;
            for fill in &part.fills {
                if let Fill::Input(channel) = fill {
                    rows.keep(*channel);
                }
            }
            Kept::Rows(Box::new(rows))
        };
        let denoised = vec![Vec::new(); part.fills.len()];
        let mut pictures: Vec<(usize, usize)> = Vec::new();
        for fill in &part.fills {
            if let Fill::Denoised(picture, _) = *fill
                && !pictures.iter().any(|(known, _)| *known == picture)
            {
                pictures.push((picture, 0));
            }
        }
        Ok(Self {
            part,
            kept,
            first_row,
            pictures,
            denoised,
            input: input.clone(),
            codec: codec.clone(),
            chunk: Vec::new(),
            decoded: Vec::new(),
        })
    }

    /// The part's number.
    pub(crate) fn index(&self) -> usize {
        self.part.index
    }

    /// Keeps the samples of row `y` of a picture; returns how many were clamped. The rows of several pictures come in turns.
    pub(crate) fn take_row(&mut self, picture: usize, y: usize, row: &OutputRow) -> u64 {
        let own = self.pictures.iter_mut().find(|(own, _)| *own == picture);
        let Some((_, rows)) = own else { return 0 };
        *rows = y + 1;
        let grid = self.part.grid;
        let bounds = grid.bounds(0, grid.chunk_row(y));
        let line = y - bounds.position.1 as usize;
        let mut clamped = 0;
        let list = &self.part.header.channels.list;
        for ((channel, fill), denoised) in list.iter().zip(&self.part.fills).zip(&mut self.denoised)
        {
            let plane = match *fill {
                Fill::Denoised(own, plane) if own == picture => plane.of(row),
                _ => continue,
            };
            let bytes = plane.len() * channel.sample_type.bytes_per_sample();
            denoised.resize(bounds.size.1 * bytes, 0);
            let out = &mut denoised[line * bytes..(line + 1) * bytes];
            clamped += encode_samples(channel.sample_type, plane, out);
        }
        clamped
    }

    /// Writes a row of chunks once row `y` of `picture`, its last row, is there of every picture.
    pub(crate) fn write_full_chunks(
        &mut self,
        picture: usize,
        y: usize,
        writer: &mut ExrWriter,
    ) -> Result<(), Error> {
        let grid = self.part.grid;
        let chunk_row = grid.chunk_row(y);
        let first = grid.bounds(0, chunk_row);
        let end = first.position.1 as usize + first.size.1;
        let is_own = self.pictures.iter().any(|(own, _)| *own == picture);
        if !is_own || self.pictures.iter().any(|(_, rows)| *rows < end) {
            return Ok(());
        }
        for column in 0..grid.columns() {
            let unchanged = self.assemble(column, chunk_row)?;
            let index = self.part.index;
            if unchanged && let Some(from) = self.same_chunk(column, chunk_row) {
                let to = chunk_row * grid.columns() + column;
                writer.copy_chunk((index, to), &self.input, (index, from))?;
                continue;
            }
            let (header, place) = (&self.part.header, (index, column, chunk_row));
            write_chunk(writer, &self.codec, header, grid, place, &mut self.chunk)?;
        }
        Ok(())
    }

    /// The chunk of the input that holds the same channels of the same pixels, stored in the same way.
    fn same_chunk(&self, column: usize, chunk_row: usize) -> Option<usize> {
        let (grid, header) = (self.part.grid, &self.part.header);
        let Part {
            grid: old_grid,
            header: old,
            ..
        } = &self.input.parts()[self.part.index];
        let row = self.first_row / grid.chunk_height() + chunk_row;
        let same = matches!(self.kept, Kept::Chunks)
            && old.channels == header.channels
            && old.compression == header.compression
            && old_grid.bounds(column, row).size == grid.bounds(column, chunk_row).size;
        same.then_some(row * old_grid.columns() + column)
    }

    /// A chunk of the output: what is kept of the input, and what was denoised. Tells whether nothing of that differs from what the input holds in its place, if it holds the same channels.
    fn assemble(&mut self, column: usize, chunk_row: usize) -> Result<bool, Error> {
        let bounds = self.part.grid.bounds(column, chunk_row);
        self.fill_kept(column, chunk_row, bounds)?;
        let mut unchanged = true;
        let width = self.part.header.layer_size.0;
        let lines = Lines::new(&self.part.header.channels, bounds);
        for (channel, denoised) in self.denoised.iter().enumerate() {
            let size = lines.sizes[channel];
            let row = width * size;
            let x = bounds.position.0 as usize * size;
            for (line, samples) in denoised
                .chunks_exact(row.max(1))
                .take(bounds.size.1)
                .enumerate()
            {
                let at = lines.range(channel, line);
                let samples = &samples[x..x + at.len()];
                unchanged = unchanged && self.chunk[at.clone()] == *samples;
                self.chunk[at].copy_from_slice(samples);
            }
        }
        Ok(unchanged)
    }

    /// Makes a chunk of the output with the kept channels in place; the others hold anything.
    fn fill_kept(
        &mut self,
        column: usize,
        chunk_row: usize,
        bounds: IntegerBounds,
    ) -> Result<(), Error> {
        let channels = &self.part.header.channels;
        let bytes = bounds.size.0 * bounds.size.1 * channels.bytes_per_pixel;
        let to = Lines::new(channels, bounds);
        let kept = |(channel, fill): (usize, &Fill)| match fill {
            Fill::Input(from) => Some((channel, *from)),
            _ => None,
        };
        let kept = self.part.fills.iter().enumerate().filter_map(kept);
        match &mut self.kept {
            Kept::Nothing => self.chunk.resize(bytes, 0),
            Kept::Chunks => {
                let above = self.first_row / self.part.grid.chunk_height();
                let (index, place) = (self.part.index, (column, above + chunk_row));
                let old = &self.input.parts()[index].header.channels;
                if old == channels {
                    let (codec, chunk) = (&self.codec, &mut self.chunk);
                    return (self.input).decode_chunk(codec, index, place, |_| true, chunk);
                }
                let (codec, decoded) = (&self.codec, &mut self.decoded);
                (self.input).decode_chunk(codec, index, place, |_| true, decoded)?;
                self.chunk.resize(bytes, 0);
                let from = Lines::new(old, bounds);
                for (channel, old) in kept {
                    for line in 0..bounds.size.1 {
                        let samples = &self.decoded[from.range(old, line)];
                        self.chunk[to.range(channel, line)].copy_from_slice(samples);
                    }
                }
            }
            Kept::Rows(rows) => {
                // only scanline chunks depend on the compression for their height: they span the width
                let first = self.first_row + bounds.position.1 as usize;
                self.chunk.resize(bytes, 0);
                for line in 0..bounds.size.1 {
                    for (channel, old) in kept.clone() {
                        rows.copy_row(old, first + line, &mut self.chunk[to.range(channel, line)])?;
                    }
                }
            }
        }
        Ok(())
    }
}
