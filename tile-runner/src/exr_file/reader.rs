//! Random access to the chunks of a file.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use exr::meta::attribute::{Compression, IntegerBounds};

use super::attributes::RawHeader;
use super::chunk::ChunkHead;
use super::compression::{SharedCodec, dwa_leader};
use super::grid::Place;
use super::header::{Part, parse_parts};
use crate::error::Error;

/// Largest header that is read: previews and long histories stay far below, memory bombs do not.
const HEADER_LIMIT: u64 = 64 << 20;
/// First guess of a header's length.
const HEADER_GUESS: u64 = 16 << 10;
/// Buffer through which chunks are copied.
const COPY_BUFFER: usize = 64 << 10;

/// Chunks of a part, and bytes of each, that tell a file from others of the same layout.
const FINGERPRINT_CHUNKS: usize = 16;
const FINGERPRINT_BYTES: u64 = 4096;

/// An open EXR file: its parts and where their chunks are. Holds no pixels.
#[derive(Debug)]
pub struct ExrFile {
    path: PathBuf,
    file: Mutex<File>,
    length: u64,
    version: u32,
    parts: Vec<Part>,
    /// Offset tables, 8 bytes per chunk.
    offsets: Vec<Vec<u64>>,
    codec: SharedCodec,
}

impl ExrFile {
    /// Opens a file and reads its header and offset tables.
    ///
    /// [`Error::Invalid`] and [`Error::Unsupported`] for files that are not EXR or whose header is damaged; parts that cannot
    /// be decoded are listed with their [`refusal`](Part::refusal) and are no error here.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let read_error = |source| Error::Read {
            context: format!("cannot read {}", path.display()),
            source,
        };
        let kind = std::fs::metadata(path).map_err(read_error)?;
        if !kind.is_file() {
            return Err(Error::Invalid(format!(
                "{} is not a regular file (chunks are read by their offsets, so a pipe will not do)",
                path.display()
            )));
        }
        let mut file = File::open(path).map_err(read_error)?;
        let length = file.metadata().map_err(read_error)?.len();
        let (bytes, raw) = read_header(&mut file, length)
            .map_err(read_error)?
            .map_err(|e| in_file(path, e))?;
        let parts = parse_parts(&bytes, &raw, length).map_err(|e| in_file(path, e))?;
        file.seek(SeekFrom::Start(raw.length as u64))
            .map_err(read_error)?;
        let offsets = read_tables(&mut file, &parts).map_err(|source| match source.kind() {
            std::io::ErrorKind::UnexpectedEof => Error::Invalid(format!(
                "{}: truncated inside the offset tables",
                path.display()
            )),
            _ => read_error(source),
        })?;
        Ok(Self {
            path: path.to_owned(),
            file: Mutex::new(file),
            length,
            version: raw.version,
            parts,
            offsets,
            codec: SharedCodec::default(),
        })
    }

    /// The path that was opened.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The version field: version number and flags.
    pub fn version(&self) -> u32 {
        self.version
    }

    /// A checksum (CRC-32) of what tells the file from others: where its chunks lie, and the bytes of some of them.
    pub fn fingerprint(&self) -> Result<u32, Error> {
        let mut crc = libdeflater::Crc::new();
        crc.update(&self.length.to_le_bytes());
        for (part, table) in self.offsets.iter().enumerate() {
            crc.update(bytemuck::cast_slice(table));
            let step = table.len().div_ceil(FINGERPRINT_CHUNKS).max(1);
            for index in (0..table.len()).step_by(step) {
                // a chunk that is damaged is told by who reads it
                if let Ok((head, at)) = self.find_chunk(part, index) {
                    let mut bytes = vec![0; head.payload.min(FINGERPRINT_BYTES) as usize];
                    self.read_at(at, &mut bytes)?;
                    crc.update(&bytes);
                }
            }
        }
        Ok(crc.sum())
    }

    /// The parts, in file order.
    pub fn parts(&self) -> &[Part] {
        &self.parts
    }

    /// Decodes the chunk in `column`, `row` of a part's full resolution into `out`: for each line, for each channel for which
    /// `wanted` is true, its samples in native byte order.
    ///
    /// The caller has checked [`Part::chunk_bytes`] against its memory limit and [`Part::refusal`].
    pub fn decode_chunk(
        &self,
        codec: &SharedCodec,
        part: usize,
        (column, row): (usize, usize),
        wanted: impl Fn(usize) -> bool,
        out: &mut Vec<u8>,
    ) -> Result<(), Error> {
        let described = &self.parts[part];
        let index = row * described.grid.columns() + column;
        let bounds = described.grid.bounds(column, row);
        let mut codec = codec.lock();
        self.read_payload(part, index, &mut codec.payload)?;
        let (compression, list) = (described.header.compression, &described.header.channels);
        if matches!(compression, Compression::DWAA(_) | Compression::DWAB(_))
            && codec.payload.len() as u64 != chunk_size(described, bounds)
            && !dwa_leader::is_plausible(&codec.payload, list.list.len(), bounds)
        {
            let reason = "announces more data than a chunk of its size can hold";
            return Err(self.chunk_error(part, index, reason));
        }
        let channels = list.channels_with_byte_offset().enumerate();
        let spans: Vec<Range<usize>> = channels
            .filter(|(channel, _)| wanted(*channel))
            .map(|(_, (offset, channel))| offset..offset + channel.sample_type.bytes_per_sample())
            .collect();
        let width = bounds.size.0;
        let lines = (0..bounds.size.1).flat_map(|line| {
            let start = line * width * list.bytes_per_pixel;
            let place =
                move |span: &Range<usize>| start + width * span.start..start + width * span.end;
            spans.iter().map(place)
        });
        codec
            .decode(&described.header, bounds, lines, out)
            .map_err(|error| match error {
                exr::error::Error::Invalid(reason) => self.chunk_error(part, index, &reason),
                other => self.chunk_error(part, index, &other.to_string()),
            })
    }

    /// What decodes the chunks of those who have no codec of their own.
    pub fn codec(&self) -> &SharedCodec {
        &self.codec
    }

    /// The chunks of a part as the file stores them, from its beginning to its end.
    pub fn chunks_in_file_order(&self, part: usize) -> Vec<usize> {
        let table = &self.offsets[part];
        let mut order: Vec<usize> = (0..table.len()).collect();
        order.sort_by_key(|&index| table[index]);
        order
    }

    /// Copies a chunk's payload, still compressed, to `to`, telling its head first.
    pub fn copy_chunk<W: Write>(
        &self,
        part: usize,
        index: usize,
        to: impl FnOnce(ChunkHead) -> W,
    ) -> Result<std::io::Result<()>, Error> {
        let (head, mut at) = self.find_chunk(part, index)?;
        let mut to = to(head);
        let mut buffer = vec![0; COPY_BUFFER];
        let end = at + head.payload;
        while at < end {
            let step = (end - at).min(COPY_BUFFER as u64) as usize;
            self.read_at(at, &mut buffer[..step])?;
            if let Err(error) = to.write_all(&buffer[..step]) {
                return Ok(Err(error));
            }
            at += step as u64;
        }
        Ok(Ok(()))
    }

    /// Reads a chunk's payload, still compressed.
    fn read_payload(&self, part: usize, index: usize, payload: &mut Vec<u8>) -> Result<(), Error> {
        let (head, at) = self.find_chunk(part, index)?;
        // compressors fall back to raw storage when they gain nothing, so a payload never exceeds its chunk
        let limit = self.parts[part].chunk_bytes();
        if head.payload > limit {
            let reason = format!(
                "{} bytes of compressed data for {limit} bytes of pixels",
                head.payload
            );
            return Err(self.chunk_error(part, index, &reason));
        }
        payload.resize(head.payload as usize, 0);
        self.read_at(at, payload)
    }

    /// Checks that the file holds every chunk, by the tables and by the one that lies last; what is in them is not decoded.
    pub(crate) fn check_complete(&self) -> Result<(), Error> {
        let tables = self.offsets.iter().enumerate();
        let all = tables.flat_map(|(part, table)| {
            let chunks = table.iter().enumerate();
            chunks.map(move |(index, offset)| (*offset, part, index))
        });
        let mut last = None;
        for chunk @ (offset, part, index) in all {
            if offset == 0 || offset >= self.length {
                self.find_chunk(part, index)?;
            }
            last = last.max(Some(chunk));
        }
        match last {
            Some((_, part, index)) => self.read_payload(part, index, &mut Vec::new()),
            None => Ok(()),
        }
    }

    /// Reads and checks a chunk's head; gives it and where its payload begins.
    fn find_chunk(&self, part: usize, index: usize) -> Result<(ChunkHead, u64), Error> {
        let described = &self.parts[part];
        let offset = self.offsets[part][index];
        if offset == 0 {
            let reason = "was never written (its offset is 0: the render was interrupted?)";
            return Err(self.chunk_error(part, index, reason));
        }
        if offset >= self.length {
            let reason = format!(
                "lies at byte {offset}, beyond the end of the file ({} bytes)",
                self.length
            );
            return Err(self.chunk_error(part, index, &reason));
        }
        let head_bytes = (self.length - offset).min(44) as usize;
        let mut bytes = vec![0; head_bytes];
        self.read_at(offset, &mut bytes)?;
        let mut rest = bytes.as_slice();
        let head = ChunkHead::read(&mut rest, described.shape)
            .map_err(|_| self.chunk_error(part, index, "has a damaged head"))?;
        if head.part != part as i32 || Some(head.place) != described.grid.place(index) {
            return Err(self.chunk_error(part, index, "is not where the offset table says"));
        }
        let payload_at = offset + (head_bytes - rest.len()) as u64;
        if payload_at
            .checked_add(head.payload)
            .is_none_or(|end| end > self.length)
        {
            let reason = format!("is cut off at the end of the file ({} bytes)", self.length);
            return Err(self.chunk_error(part, index, &reason));
        }
        Ok((head, payload_at))
    }

    fn read_at(&self, offset: u64, bytes: &mut [u8]) -> Result<(), Error> {
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        let result = file
            .seek(SeekFrom::Start(offset))
            .and_then(|_| file.read_exact(bytes));
        result.map_err(|source| Error::Read {
            context: format!("cannot read {} at byte {offset}", self.path.display()),
            source,
        })
    }

    fn chunk_error(&self, part: usize, index: usize, reason: &str) -> Error {
        let described = &self.parts[part];
        let place = match described.grid.place(index) {
            Some(Place::Line(_)) => {
                let first = index * described.grid.chunk_height();
                let last =
                    (first + described.grid.chunk_height()).min(described.header.layer_size.1) - 1;
                format!("chunk of rows {first} to {last}")
            }
            Some(Place::Tile([x, y, 0, 0])) => {
                let first = y as usize * described.grid.chunk_height();
                format!("tile {x}, {y} (from row {first})")
            }
            Some(Place::Tile([x, y, lx, ly])) => format!("tile {x}, {y} of level {lx}, {ly}"),
            None => format!("chunk {index}"),
        };
        Error::Invalid(format!(
            "{}: {}: {place}: {reason}",
            self.path.display(),
            described.label()
        ))
    }
}

/// Bytes of a decoded chunk; a payload of this size was not compressed.
fn chunk_size(part: &Part, bounds: IntegerBounds) -> u64 {
    bounds.size.0 as u64 * bounds.size.1 as u64 * part.header.channels.bytes_per_pixel as u64
}

/// Adds the file's name to an error about its header.
fn in_file(path: &Path, error: Error) -> Error {
    match error {
        Error::Invalid(reason) => Error::Invalid(format!("{}: {reason}", path.display())),
        Error::Unsupported(reason) => Error::Unsupported(format!("{}: {reason}", path.display())),
        other => other,
    }
}

/// Reads as much of the file as its header needs.
fn read_header(
    file: &mut File,
    length: u64,
) -> std::io::Result<Result<(Vec<u8>, RawHeader), Error>> {
    let mut bytes = Vec::new();
    let mut wanted = HEADER_GUESS;
    loop {
        file.take(wanted - bytes.len() as u64)
            .read_to_end(&mut bytes)?;
        match RawHeader::parse(&bytes) {
            Ok(Some(raw)) => return Ok(Ok((bytes, raw))),
            Ok(None) if (bytes.len() as u64) < wanted || bytes.len() as u64 >= length => {
                let what = if bytes.is_empty() {
                    "empty"
                } else {
                    "truncated inside the header"
                };
                return Ok(Err(Error::Invalid(format!(
                    "{what} ({} bytes)",
                    bytes.len()
                ))));
            }
            Ok(None) if wanted >= HEADER_LIMIT => {
                let reason = format!("the header is larger than {} MiB", HEADER_LIMIT >> 20);
                return Ok(Err(Error::Invalid(reason)));
            }
            Ok(None) => wanted = (wanted * 4).min(HEADER_LIMIT),
            Err(error) => return Ok(Err(error)),
        }
    }
}

fn read_tables(file: &mut File, parts: &[Part]) -> std::io::Result<Vec<Vec<u64>>> {
    let mut from = BufReader::new(file);
    let mut table = |part: &Part| {
        let mut table = vec![0_u64; part.header.chunk_count];
        from.read_exact(bytemuck::cast_slice_mut(&mut table))?;
        table
            .iter_mut()
            .for_each(|offset| *offset = u64::from_le(*offset));
        Ok(table)
    };
    parts.iter().map(&mut table).collect()
}
