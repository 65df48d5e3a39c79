//! Compressions by the number that a header states, of which the format gets new ones and the `exr` crate knows some.

use std::fmt;

use super::attributes::Attributes;

/// The names by their numbers, as OpenEXR's tools print them.
const NAMES: [&str; 14] = [
    "none", "rle", "zips", "zip", "piz", "pxr24", "b44", "b44a", "dwaa", "dwab", "htj2k256",
    "htj2k32", "lj2k", "zstd",
];
/// How many of them are decoded, from the first on.
const DECODED: u8 = 10;
/// How many of them the `exr` crate knows by name, from the first on.
const PARSED: u8 = 12;

/// The number of a compression.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CompressionCode(u8);

impl CompressionCode {
    /// No compression.
    pub(super) const NONE: Self = Self(0);

    /// What a part's header states, if it does.
    pub fn of(attributes: &Attributes) -> Option<Self> {
        let value = attributes.value("compression", "compression")?;
        value.first().map(|&code| Self(code))
    }

    /// The value of the `compression` attribute.
    pub(super) fn value(self) -> Vec<u8> {
        vec![self.0]
    }

    /// Whether chunks are decoded.
    pub fn decoded(self) -> bool {
        self.0 < DECODED
    }

    /// Whether the `exr` crate accepts a header that states it.
    pub(super) fn parsed(self) -> bool {
        self.0 < PARSED
    }

    /// Rows per scanline chunk of what the `exr` crate does not know. `None` for a number that OpenEXR 3.5 does not know either.
    fn lines(self) -> Option<usize> {
        match self.0 {
            12 => Some(256),
            13 => Some(1),
            _ => None,
        }
    }

    /// Rows per scanline chunk in a part of `height` rows, of what the `exr` crate does not know.
    ///
    /// The number of chunks says it, where it is stated: a later OpenEXR may cut otherwise than 3.5 does (zstd had 1, 16 and 32 rows while it
    /// was made). Every compression so far takes a power of two, and no two of those cut an image into the same number of chunks, unless that
    /// is 1. `None` if the number is not stated and the compression not known, or if no power of two makes it.
    pub(super) fn lines_in(self, height: usize, chunks: Option<i32>) -> Option<usize> {
        let Some(chunks) = chunks else {
            return self.lines();
        };
        let chunks = usize::try_from(chunks).ok().filter(|&chunks| chunks > 0)?;
        let lines = height.div_ceil(chunks).checked_next_power_of_two()?;
        (height.div_ceil(lines) == chunks).then_some(lines)
    }
}

impl fmt::Display for CompressionCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match NAMES.get(usize::from(self.0)) {
            Some(name) => f.write_str(name),
            None => write!(f, "number {}", self.0),
        }
    }
}

/// Why a part in a compression that is not decoded is refused.
pub(super) fn refusal(code: CompressionCode, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    match NAMES.get(usize::from(code.0)) {
        Some(name) => write!(f, "{name} compression")?,
        None => write!(f, "compression number {}", code.0)?,
    }
    let supported = NAMES[..usize::from(DECODED)].join(", ");
    write!(f, " is not supported (supported are {supported})")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_number_of_chunks_says_how_many_rows_one_has() {
        let code = CompressionCode(14);
        for lines in [1, 16, 32, 64, 256] {
            for height in [257_usize, 600, 1080, 2160] {
                let chunks = height.div_ceil(lines) as i32;
                assert_eq!(code.lines_in(height, Some(chunks)), Some(lines), "{height}");
            }
        }
        // one chunk has all rows
        assert!(code.lines_in(24, Some(1)).is_some_and(|lines| lines >= 24));
        for chunks in [None, Some(0), Some(-1), Some(7), Some(i32::MAX)] {
            assert_eq!(code.lines_in(600, chunks), None, "{chunks:?}");
        }
        assert_eq!(CompressionCode(13).lines_in(600, None), Some(1));
        assert_eq!(CompressionCode(12).lines_in(600, None), Some(256));
    }
}
