//! Writes a file chunk by chunk, in any order.

use std::path::Path;

use super::attributes::{Attributes, RawHeader};
use super::chunk::{ChunkHead, ChunkShape};
use super::grid::ChunkGrid;
use super::output::OutputFile;
use super::reader::ExrFile;
use crate::error::Error;

/// A part of the file to be written.
#[derive(Clone, Debug)]
pub struct OutputPart {
    /// All of its attributes.
    pub attributes: Attributes,
    /// How its chunks begin.
    pub shape: ChunkShape,
    /// How it is cut into chunks.
    pub grid: ChunkGrid,
    /// Chunks of all its levels.
    pub chunks: usize,
}

/// An EXR file in the making. The offset tables are filled in last, so that nobody takes an interrupted file for a whole one.
#[derive(Debug)]
pub(crate) struct ExrWriter {
    file: OutputFile,
    parts: Vec<OutputPart>,
    tables: Vec<Vec<u64>>,
    tables_at: u64,
}

impl ExrWriter {
    /// Writes the header and room for the offset tables.
    pub(crate) fn create(path: &Path, version: u32, parts: Vec<OutputPart>) -> Result<Self, Error> {
        let mut file = OutputFile::create(path)?;
        let attributes: Vec<Attributes> =
            parts.iter().map(|part| part.attributes.clone()).collect();
        file.append(&RawHeader::encode(version, &attributes))?;
        let tables_at = file.position();
        for part in &parts {
            file.append(&vec![0; part.chunks * 8])?;
        }
        let tables = parts.iter().map(|part| vec![0; part.chunks]).collect();
        Ok(Self {
            file,
            parts,
            tables,
            tables_at,
        })
    }

    /// The name that the file will have.
    pub(crate) fn path(&self) -> &Path {
        self.file.path()
    }

    /// Chunks of a part.
    pub(crate) fn chunks(&self, part: usize) -> usize {
        self.tables[part].len()
    }

    /// Appends a chunk of flat data that has been compressed already.
    pub(crate) fn write_chunk(
        &mut self,
        part: usize,
        index: usize,
        payload: &[u8],
    ) -> Result<(), Error> {
        let described = &self.parts[part];
        let place = described
            .grid
            .place(index)
            .expect("the caller counts chunks by the same grid");
        let head = ChunkHead::flat(part, place, payload.len()).encode(described.shape.multi_part);
        self.tables[part][index] = self.file.position();
        self.file.append(&head)?;
        self.file.append(payload)
    }

    /// Copies chunk `from_index` of part `from_part` of another file without decoding it, to where chunk `index` of `part`
    /// belongs. Both parts cut their chunks alike.
    pub(crate) fn copy_chunk(
        &mut self,
        (part, index): (usize, usize),
        from: &ExrFile,
        (from_part, from_index): (usize, usize),
    ) -> Result<(), Error> {
        let described = &self.parts[part];
        let multi_part = described.shape.multi_part;
        let place = described
            .grid
            .place(index)
            .expect("the caller counts chunks by the same grid");
        self.tables[part][index] = self.file.position();
        let file = &mut self.file;
        let mut written = Ok(());
        let copied = from.copy_chunk(from_part, from_index, |mut head| {
            head.part = part as i32;
            head.place = place;
            written = file.append(&head.encode(multi_part));
            file
        })?;
        written?;
        copied.map_err(|source| self.file.error(source))
    }

    /// Fills in the offset tables and gives the file its name.
    pub(crate) fn finish(mut self) -> Result<(), Error> {
        debug_assert!(
            self.tables.iter().flatten().all(|&offset| offset != 0),
            "a chunk was not written"
        );
        let mut tables = self.tables.concat();
        tables
            .iter_mut()
            .for_each(|offset| *offset = offset.to_le());
        self.file
            .patch(self.tables_at, bytemuck::cast_slice(&tables))?;
        self.file.finish()
    }
}
