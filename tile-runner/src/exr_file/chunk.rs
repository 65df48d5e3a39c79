//! What stands before a chunk's compressed bytes in the file.

use std::io::Read;

use super::grid::Place;

/// What stands before a chunk's payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChunkHead {
    /// Part that the chunk says it belongs to (0 in a single-part file).
    pub part: i32,
    /// Where the chunk says it belongs in the part.
    pub place: Place,
    /// Bytes of payload that follow.
    pub payload: u64,
    /// Deep data only: the three sizes as they stand in the file.
    deep_sizes: Option<[u64; 3]>,
}

impl ChunkHead {
    /// A chunk of flat data.
    pub fn flat(part: usize, place: Place, payload: usize) -> Self {
        Self {
            part: part as i32,
            place,
            payload: payload as u64,
            deep_sizes: None,
        }
    }

    /// Reads the head of a chunk. `Err(InvalidData)` for sizes that cannot be.
    pub fn read(from: &mut impl Read, shape: ChunkShape) -> std::io::Result<Self> {
        let part = if shape.multi_part { read_i32(from)? } else { 0 };
        let place = if shape.tiled {
            Place::Tile([
                read_i32(from)?,
                read_i32(from)?,
                read_i32(from)?,
                read_i32(from)?,
            ])
        } else {
            Place::Line(read_i32(from)?)
        };
        let (payload, deep_sizes) = if shape.deep {
            let sizes = [read_u64(from)?, read_u64(from)?, read_u64(from)?];
            (sizes[0].checked_add(sizes[1]), Some(sizes))
        } else {
            (u64::try_from(read_i32(from)?).ok(), None)
        };
        let payload = payload.ok_or(std::io::ErrorKind::InvalidData)?;
        Ok(Self {
            part,
            place,
            payload,
            deep_sizes,
        })
    }

    /// The head's bytes.
    pub fn encode(&self, multi_part: bool) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(44);
        if multi_part {
            bytes.extend_from_slice(&self.part.to_le_bytes());
        }
        match self.place {
            Place::Line(y) => bytes.extend_from_slice(&y.to_le_bytes()),
            Place::Tile(tile) => tile
                .iter()
                .for_each(|v| bytes.extend_from_slice(&v.to_le_bytes())),
        }
        match self.deep_sizes {
            Some(sizes) => sizes
                .iter()
                .for_each(|v| bytes.extend_from_slice(&v.to_le_bytes())),
            None => bytes.extend_from_slice(&(self.payload as i32).to_le_bytes()),
        }
        bytes
    }
}

/// What decides how a chunk's head looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChunkShape {
    /// The file has several parts.
    pub multi_part: bool,
    /// The part is tiled.
    pub tiled: bool,
    /// The part is deep.
    pub deep: bool,
}

fn read_i32(from: &mut impl Read) -> std::io::Result<i32> {
    let mut bytes = [0; 4];
    from.read_exact(&mut bytes)?;
    Ok(i32::from_le_bytes(bytes))
}

fn read_u64(from: &mut impl Read) -> std::io::Result<u64> {
    let mut bytes = [0; 8];
    from.read_exact(&mut bytes)?;
    Ok(u64::from_le_bytes(bytes))
}
