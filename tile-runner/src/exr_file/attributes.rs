//! The header's attributes as raw bytes.
//!
//! A file that is written must carry every attribute of the file that was read, of any type and in the same order. The
//! `exr` crate keeps them in a hash map and drops those it cannot parse, so the bytes themselves are kept here.
//! Walking them also bounds what a damaged header can ask of the crate's parser.

use crate::error::Error;

/// First four bytes of every EXR file.
pub const MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];
/// Version field flag: one part, tiled.
pub const FLAG_TILED: u32 = 1 << 9;
/// Version field flag: names of up to 255 bytes.
pub const FLAG_LONG_NAMES: u32 = 1 << 10;
/// Version field flag: more than one part.
pub const FLAG_MULTI_PART: u32 = 1 << 12;

/// Attribute of an output: the version of linpred that wrote it.
pub const VERSION_ATTRIBUTE: &str = "linpredVersion";
/// Attribute of an output: what it was made with.
pub const OPTIONS_ATTRIBUTE: &str = "linpredOptions";
/// Attribute of an output: which input it was made of, a checksum of the input's header and of some of its chunks.
pub const INPUT_ATTRIBUTE: &str = "linpredInput";
/// Attribute of an output: its channels, with ", " between, that tell of the noise of the input, and not of the output's.
pub const NOISE_ATTRIBUTE: &str = "linpredNoiseOfInput";
/// Attribute of an output: which frames beside its own it was made of, on each side how many and, nearest first, their checksums, as for [`INPUT_ATTRIBUTE`].
pub const NEIGHBOURS_ATTRIBUTE: &str = "linpredNeighbours";
/// Attribute of merged passes: the checksums of those that they are made of, as for [`INPUT_ATTRIBUTE`], with spaces between.
pub const MERGED_ATTRIBUTE: &str = "linpredMerged";

/// Longest attribute, type or channel name that the format allows.
const NAME_LIMIT: usize = 255;

/// One attribute as it stands in the file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Attribute {
    /// Name, without its terminating zero.
    pub name: Vec<u8>,
    /// Type name, without its terminating zero.
    pub kind: Vec<u8>,
    /// Value, little-endian.
    pub value: Vec<u8>,
}

/// The attributes of one part, in file order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Attributes(Vec<Attribute>);

impl Attributes {
    /// The attributes in file order.
    pub fn iter(&self) -> impl Iterator<Item = &Attribute> {
        self.0.iter()
    }

    /// The value of an attribute of the given name and type.
    pub fn value(&self, name: &str, kind: &str) -> Option<&[u8]> {
        self.0
            .iter()
            .find(|a| a.name == name.as_bytes() && a.kind == kind.as_bytes())
            .map(|a| a.value.as_slice())
    }

    /// The value of an `int` attribute.
    pub fn int(&self, name: &str) -> Option<i32> {
        let bytes = self.value(name, "int")?.try_into().ok()?;
        Some(i32::from_le_bytes(bytes))
    }

    /// The value of a `string` attribute, if it is UTF-8.
    pub fn string(&self, name: &str) -> Option<&str> {
        std::str::from_utf8(self.value(name, "string")?).ok()
    }

    /// The values of a `stringvector` attribute, as far as they are UTF-8.
    pub fn strings(&self, name: &str) -> impl Iterator<Item = &str> {
        let mut rest = self.value(name, "stringvector").unwrap_or_default();
        std::iter::from_fn(move || {
            let (length, after) = rest.split_first_chunk::<4>()?;
            let length = usize::try_from(i32::from_le_bytes(*length)).ok()?;
            let (text, after) = after.split_at_checked(length)?;
            rest = after;
            std::str::from_utf8(text).ok()
        })
    }

    /// Replaces the value of an attribute in place, or appends the attribute.
    pub fn set(&mut self, name: &str, kind: &str, value: Vec<u8>) {
        let attribute = Attribute {
            name: name.into(),
            kind: kind.into(),
            value,
        };
        match self.0.iter_mut().find(|a| a.name == name.as_bytes()) {
            Some(old) => *old = attribute,
            None => self.0.push(attribute),
        }
    }

    /// Removes an attribute, if it is there.
    pub fn remove(&mut self, name: &str) {
        self.0.retain(|a| a.name != name.as_bytes());
    }

    /// Appends the attributes and the terminating zero to `bytes`.
    pub fn encode(&self, bytes: &mut Vec<u8>) {
        for attribute in &self.0 {
            bytes.extend_from_slice(&attribute.name);
            bytes.push(0);
            bytes.extend_from_slice(&attribute.kind);
            bytes.push(0);
            // a value was read with an i32 length or made here from a channel list: it fits
            bytes.extend_from_slice(&(attribute.value.len() as i32).to_le_bytes());
            bytes.extend_from_slice(&attribute.value);
        }
        bytes.push(0);
    }
}

/// Everything before the offset tables.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RawHeader {
    /// The version field: version number and flags.
    pub version: u32,
    /// Attributes of each part.
    pub parts: Vec<Attributes>,
    /// Where the offset tables begin, bytes from the start of the file.
    pub length: usize,
}

impl RawHeader {
    /// Whether the file says that it has several parts (then chunks name theirs).
    pub fn multi_part(&self) -> bool {
        self.version & FLAG_MULTI_PART != 0
    }

    /// Walks the header at the start of `bytes`. `Ok(None)` when `bytes` ends before the header does.
    pub fn parse(bytes: &[u8]) -> Result<Option<Self>, Error> {
        let mut cursor = Cursor { bytes, at: 0 };
        match Self::walk(&mut cursor) {
            Ok(header) => Ok(Some(header)),
            Err(Stop::Short) => Ok(None),
            Err(Stop::Bad(reason)) => Err(Error::Invalid(reason.to_owned())),
        }
    }

    fn walk(cursor: &mut Cursor) -> Result<Self, Stop> {
        if cursor.take(4)? != MAGIC {
            return Err(Stop::Bad(
                "not an EXR file (its first four bytes are not those of one)",
            ));
        }
        let version = cursor.u32()?;
        let mut parts = vec![cursor.attributes()?];
        if version & FLAG_MULTI_PART != 0 {
            while cursor.peek()? != 0 {
                parts.push(cursor.attributes()?);
            }
            cursor.take(1)?;
        }
        Ok(Self {
            version,
            parts,
            length: cursor.at,
        })
    }

    /// The header's bytes, ready to be written.
    pub fn encode(version: u32, parts: &[Attributes]) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend_from_slice(&version.to_le_bytes());
        for part in parts {
            part.encode(&mut bytes);
        }
        if version & FLAG_MULTI_PART != 0 {
            bytes.push(0);
        }
        bytes
    }
}

/// Why the walk stopped.
enum Stop {
    /// The bytes ended.
    Short,
    /// They are not a header.
    Bad(&'static str),
}

struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], Stop> {
        let end = self.at.checked_add(count).ok_or(Stop::Short)?;
        let taken = self.bytes.get(self.at..end).ok_or(Stop::Short)?;
        self.at = end;
        Ok(taken)
    }

    fn peek(&self) -> Result<u8, Stop> {
        self.bytes.get(self.at).copied().ok_or(Stop::Short)
    }

    fn u32(&mut self) -> Result<u32, Stop> {
        let bytes = self.take(4)?;
        Ok(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
    }

    fn name(&mut self) -> Result<Vec<u8>, Stop> {
        let rest = &self.bytes[self.at..];
        let window = &rest[..rest.len().min(NAME_LIMIT + 1)];
        match window.iter().position(|&byte| byte == 0) {
            Some(length) => {
                self.at += length + 1;
                Ok(rest[..length].to_vec())
            }
            None if rest.len() > NAME_LIMIT => Err(Stop::Bad(
                "damaged header: an attribute's name is longer than 255 bytes",
            )),
            None => Err(Stop::Short),
        }
    }

    fn attributes(&mut self) -> Result<Attributes, Stop> {
        let mut attributes = Vec::new();
        loop {
            let name = self.name()?;
            if name.is_empty() {
                return Ok(Attributes(attributes));
            }
            let kind = self.name()?;
            let size = self.u32()? as i32;
            let size = usize::try_from(size)
                .map_err(|_| Stop::Bad("damaged header: an attribute has a negative size"))?;
            let value = self.take(size)?.to_vec();
            attributes.push(Attribute { name, kind, value });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Vec<u8> {
        let mut part = Attributes::default();
        part.set("spp", "int", 7_i32.to_le_bytes().to_vec());
        part.set("note", "string", b"hello".to_vec());
        RawHeader::encode(2 | FLAG_MULTI_PART, &[part.clone(), part])
    }

    #[test]
    fn a_header_round_trips_byte_for_byte() {
        let bytes = sample();
        let header = RawHeader::parse(&bytes).unwrap().unwrap();
        assert_eq!(header.length, bytes.len());
        assert_eq!(header.parts[1].int("spp"), Some(7));
        assert_eq!(header.parts[0].string("note"), Some("hello"));
        assert_eq!(RawHeader::encode(header.version, &header.parts), bytes);
    }

    #[test]
    fn every_prefix_of_a_header_asks_for_more() {
        let bytes = sample();
        for length in 0..bytes.len() {
            assert_eq!(
                RawHeader::parse(&bytes[..length]).unwrap(),
                None,
                "{length} bytes"
            );
        }
    }
}
