//! What a file says about its parts, checked before anything is believed.

use std::fmt;

use exr::meta::BlockDescription;
use exr::meta::MetaData;
use exr::meta::attribute::{IntegerBounds, SampleType};
use exr::meta::header::Header;

use super::attributes::{Attributes, RawHeader};
use super::chunk::ChunkShape;
use super::compression_code::{self, CompressionCode};
use super::grid::ChunkGrid;
use crate::error::Error;
use crate::geometry::ImageSize;

/// Why the pixels of a part cannot be decoded. Such a part can still be copied.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// Any number of samples per pixel.
    Deep,
    /// The channel of this name is stored at a lower resolution.
    Subsampled(String),
    /// A compression that the `exr` crate does not decode.
    Compression(CompressionCode),
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Deep => write!(f, "deep data is not supported"),
            Self::Subsampled(channel) => {
                write!(
                    f,
                    "channel {channel:?} is subsampled, which is not supported"
                )
            }
            Self::Compression(code) => compression_code::refusal(*code, f),
        }
    }
}

/// Most channels of all parts together; a production's heaviest files have hundreds.
const CHANNEL_LIMIT: usize = 8192;

/// One part of a file.
#[derive(Clone, Debug)]
pub struct Part {
    /// Position in the file, from 0.
    pub index: usize,
    /// The `name` attribute; parts of a multi-part file have one.
    pub name: Option<String>,
    /// The header as the `exr` crate understands it. Of a compression that it does not know it sees none; the attributes have the true one.
    pub header: Header,
    /// All attributes as bytes.
    pub attributes: Attributes,
    /// How the data window is cut.
    pub grid: ChunkGrid,
    /// How the part's chunks begin.
    pub shape: ChunkShape,
    /// Why the pixels cannot be decoded, if they cannot.
    pub refusal: Option<Refusal>,
}

impl Part {
    /// The data window's size; `None` if it is empty.
    pub fn size(&self) -> Option<ImageSize> {
        ImageSize::new(self.header.layer_size.0, self.header.layer_size.1)
    }

    /// The data window.
    pub fn data_window(&self) -> IntegerBounds {
        self.header.data_window()
    }

    /// How messages call the part: its number and name.
    pub fn label(&self) -> String {
        match &self.name {
            Some(name) => format!("part {} {name:?}", self.index),
            None => format!("part {}", self.index),
        }
    }

    /// Bytes of one decoded row of chunks; saturates at `u64::MAX`.
    pub fn chunk_row_bytes(&self) -> u64 {
        let rows = self.grid.chunk_height().min(self.header.layer_size.1) as u64;
        let pixels = rows.saturating_mul(self.header.layer_size.0 as u64);
        pixels.saturating_mul(self.header.channels.bytes_per_pixel as u64)
    }

    /// Bytes of the largest decoded chunk; saturates at `u64::MAX`.
    pub fn chunk_bytes(&self) -> u64 {
        let largest = self.grid.bounds(0, 0).size;
        let pixels = (largest.0 as u64).saturating_mul(largest.1 as u64);
        pixels.saturating_mul(self.header.channels.bytes_per_pixel as u64)
    }

    /// Position of the channel of this exact name.
    pub fn channel(&self, name: &str) -> Option<usize> {
        let list = &self.header.channels.list;
        list.iter().position(|channel| channel.name.eq(name))
    }

    /// Name of a channel.
    pub fn channel_name(&self, channel: usize) -> String {
        self.header.channels.list[channel].name.to_string()
    }

    /// The compression that the header states.
    pub fn compression(&self) -> Option<CompressionCode> {
        CompressionCode::of(&self.attributes)
    }

    /// Sample type of a channel.
    pub fn sample_type(&self, channel: usize) -> SampleType {
        self.header.channels.list[channel].sample_type
    }
}

/// Parses the parts of a header whose bytes are complete. `file_length` bounds what the offset tables may claim.
pub(super) fn parse_parts(
    bytes: &[u8],
    raw: &RawHeader,
    file_length: u64,
) -> Result<Vec<Part>, Error> {
    let known = with_known_compressions(raw);
    let bytes = known.as_deref().unwrap_or(&bytes[..raw.length]);
    let meta = MetaData::read_from_buffered(bytes, false).map_err(damaged)?;
    if meta.headers.len() != raw.parts.len() || meta.headers.is_empty() {
        return Err(Error::Invalid("damaged header: no part".into()));
    }
    let channels: usize = meta
        .headers
        .iter()
        .map(|header| header.channels.list.len())
        .sum();
    if channels > CHANNEL_LIMIT {
        return Err(Error::Invalid(format!(
            "damaged header: {channels} channels (at most {CHANNEL_LIMIT} are read)"
        )));
    }
    let multi_part = raw.multi_part();
    let parts: Vec<Part> = (meta.headers.into_iter().zip(raw.parts.iter().cloned()))
        .enumerate()
        .map(|(index, (header, attributes))| describe(index, header, attributes, multi_part))
        .collect::<Result<_, Error>>()?;
    let chunks: u64 = parts
        .iter()
        .map(|part| part.header.chunk_count as u64)
        .fold(0, u64::saturating_add);
    // a chunk is at least an entry of the table and its own length field
    if chunks.saturating_mul(12) > file_length {
        return Err(Error::Invalid(format!(
            "damaged header or truncated file: {chunks} chunks are announced in a file of {file_length} bytes"
        )));
    }
    Ok(parts)
}

/// The header's bytes with no compression where the `exr` crate does not know the one that is stated, and would refuse the whole file.
/// `None` if it knows them all.
fn with_known_compressions(raw: &RawHeader) -> Option<Vec<u8>> {
    let unknown = |part: &Attributes| CompressionCode::of(part).is_some_and(|code| !code.parsed());
    if !raw.parts.iter().any(unknown) {
        return None;
    }
    let mut parts = raw.parts.clone();
    for part in parts.iter_mut().filter(|part| unknown(part)) {
        let none = CompressionCode::NONE.value();
        part.set("compression", "compression", none);
    }
    Some(RawHeader::encode(raw.version, &parts))
}

/// An error of the `exr` crate on a header's bytes.
fn damaged(error: exr::error::Error) -> Error {
    match error {
        exr::error::Error::NotSupported(reason) => {
            Error::Unsupported(format!("not supported: {reason}"))
        }
        exr::error::Error::Invalid(reason) => Error::Invalid(format!("damaged header: {reason}")),
        other => Error::Invalid(format!("damaged header: {other}")),
    }
}

fn describe(
    index: usize,
    mut header: Header,
    attributes: Attributes,
    multi_part: bool,
) -> Result<Part, Error> {
    let lines = lines(index, &header, &attributes)?;
    if header.blocks == BlockDescription::ScanLines {
        header.chunk_count = header.layer_size.1.div_ceil(lines);
    }
    let grid = ChunkGrid::new(header.data_window(), header.blocks, lines);
    let part = Part {
        index,
        name: header
            .own_attributes
            .layer_name
            .as_ref()
            .map(ToString::to_string),
        shape: ChunkShape {
            multi_part,
            tiled: grid.tiled(),
            deep: header.deep,
        },
        refusal: refusal(&header, &attributes),
        grid,
        attributes,
        header,
    };
    check_channels(&part)?;
    check_chunk_count(&part)?;
    Ok(part)
}

/// Rows of a scanline chunk. [`Error::Unsupported`] if nobody can tell, so that not even the offset table can be read.
fn lines(index: usize, header: &Header, attributes: &Attributes) -> Result<usize, Error> {
    match CompressionCode::of(attributes) {
        Some(code) if !code.parsed() && header.blocks == BlockDescription::ScanLines => {
            let chunks = attributes.int("chunkCount");
            let lines = code.lines_in(header.layer_size.1, chunks);
            lines.ok_or_else(|| {
                Error::Unsupported(format!("part {index}: {}", Refusal::Compression(code)))
            })
        }
        _ => Ok(header.compression.scan_lines_per_block()),
    }
}

fn refusal(header: &Header, attributes: &Attributes) -> Option<Refusal> {
    if header.deep {
        return Some(Refusal::Deep);
    }
    let subsampled = (header.channels.list.iter()).find(|c| (c.sampling.0, c.sampling.1) != (1, 1));
    if let Some(channel) = subsampled {
        return Some(Refusal::Subsampled(channel.name.to_string()));
    }
    let code = CompressionCode::of(attributes).filter(|code| !code.decoded());
    code.map(Refusal::Compression)
}

/// Samples are stored in the order of the names: a list in another order cannot be trusted.
fn check_channels(part: &Part) -> Result<(), Error> {
    let list = &part.header.channels.list;
    if list.is_empty() {
        return Err(Error::Invalid(format!("{}: no channels", part.label())));
    }
    match list
        .windows(2)
        .find(|pair| pair[0].name.bytes() >= pair[1].name.bytes())
    {
        None => Ok(()),
        Some(pair) => Err(Error::Invalid(format!(
            "{}: damaged channel list: {:?} stands before {:?}",
            part.label(),
            pair[0].name.to_string(),
            pair[1].name.to_string()
        ))),
    }
}

fn check_chunk_count(part: &Part) -> Result<(), Error> {
    let computed = part.header.chunk_count;
    match part.attributes.int("chunkCount") {
        Some(stated) if part.shape.multi_part && stated as i64 != computed as i64 => {
            Err(Error::Invalid(format!(
                "{}: the header announces {stated} chunks, its data window and tiles make {computed}",
                part.label()
            )))
        }
        _ => Ok(()),
    }
}
