//! Decodes and encodes chunks, one at a time.
//!
//! All compressions are the `exr` crate's but zip and the encoding of PIZ. Zip is what most renders use: its deflate took three quarters of
//! the time of reading and writing a file, and its buffers most of the memory. It is libdeflate's, as in OpenEXR itself. The buffers
//! here are used again for every chunk, and a reader takes no more out of them than the channels that it wants.

pub mod coder_panics;
pub(super) mod dwa_leader;
mod piz;
mod predictor;

use std::fmt;
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use exr::math::Vec2;
use exr::meta::attribute::{Compression, IntegerBounds};
use exr::meta::header::Header;
use libdeflater::{CompressionLvl, Compressor, Decompressor};

use predictor::{add_differences, interleave, separate, subtract_neighbours};

/// Deflate level. On 26 channels of 1920 x 1080 pixels (160 MB of noise and features) level 1 takes 641 ms for 62.4 MB; 2: 819 ms, 60.7 MB; 4, OpenEXR's own: 853 ms, 60.6 MB; 6: 1023 ms,
/// 60.2 MB; zlib-rs at level 4: 1141 ms, 61.8 MB. That image is mirrored, which favours higher levels: on five renders of 256 x 256 and 512 x 512 level 1 is 0.0 to 1.2 % larger than 4, and up to 1.6 % larger than zlib-rs. Inflating
/// takes 153 ms (zlib-rs 247 ms).
const DEFLATE_LEVEL: i32 = 1;

/// A codec whose holders take turns, so that no more than one chunk's worth of working memory is in use between them.
#[derive(Clone, Debug, Default)]
pub struct SharedCodec(Arc<Mutex<ChunkCodec>>);

impl SharedCodec {
    /// Waits for its turn.
    pub fn lock(&self) -> MutexGuard<'_, ChunkCodec> {
        // its buffers are filled anew for every chunk, so a thread that died in one leaves nothing behind
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Gives back its working memory, which the next chunk takes again.
    pub(crate) fn rest(&self) {
        *self.lock() = ChunkCodec::default();
    }
}

/// Bytes that a codec has at rest at most: the tables of deflate and inflate (libdeflate's take 211 KiB), and what the allocator keeps around them.
pub(crate) const CODEC_AT_REST: u64 = 512 << 10;

/// Codes one chunk after another; keeps its buffers and deflate's tables between them.
pub struct ChunkCodec {
    deflate: Compressor,
    inflate: Decompressor,
    /// The payload that is being decoded.
    pub(super) payload: Vec<u8>,
    /// A chunk's bytes at even places, then those at odd places.
    separated: Vec<u8>,
}

impl fmt::Debug for ChunkCodec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ChunkCodec").finish_non_exhaustive()
    }
}

impl Default for ChunkCodec {
    fn default() -> Self {
        Self {
            deflate: Compressor::new(CompressionLvl::new(DEFLATE_LEVEL).unwrap_or_default()),
            inflate: Decompressor::new(),
            payload: Vec::new(),
            separated: Vec::new(),
        }
    }
}

/// Whether chunks of this compression are coded here, in buffers that are used again.
fn is_zip(compression: Compression) -> bool {
    matches!(compression, Compression::ZIP1 | Compression::ZIP16) && cfg!(target_endian = "little")
}

/// Whether two chunks of this compression may be coded at once: those of zip, whose working memory is two chunks at most. What the others
/// take would be too much twice.
pub(crate) fn coded_at_once(compression: Compression) -> bool {
    is_zip(compression) || compression == Compression::Uncompressed
}

/// Chunks of working memory that it takes at most to decode or encode one of `compression`, beside the decoded chunk itself. Counted for zip
/// and PIZ; DWA's are measured, and those of the rest are what the `exr` crate copies.
pub(crate) fn chunks_while_coding(compression: Compression) -> u64 {
    match compression {
        // a payload, and the bytes in another order
        Compression::ZIP1 | Compression::ZIP16 => 2,
        Compression::Uncompressed => 1,
        Compression::DWAA(_) | Compression::DWAB(_) => 5,
        // a payload, words, and the chunk before the wanted channels are taken out of it
        Compression::PIZ => 3,
        _ => 3,
    }
}

impl ChunkCodec {
    /// Decodes the payload of the chunk `bounds` into `out`: those of its bytes that lie in `wanted`, for each line, for each channel, samples in
    /// native byte order.
    pub(super) fn decode(
        &mut self,
        header: &Header,
        bounds: IntegerBounds,
        wanted: impl Iterator<Item = Range<usize>> + Clone,
        out: &mut Vec<u8>,
    ) -> Result<(), exr::error::Error> {
        let length = bounds.size.area() * header.channels.bytes_per_pixel;
        let kept = wanted.clone().map(|range| range.len()).sum();
        if is_zip(header.compression) && self.payload.len() != length {
            self.unzip(length)?;
            out.clear();
            out.reserve_exact(kept);
            wanted.for_each(|range| interleave(&self.separated, range, out));
            return Ok(());
        }
        // the crate makes a new chunk: do not hold an old one beside it
        *out = Vec::new();
        let payload = std::mem::take(&mut self.payload);
        let chunk = coder_panics::into_error(|| {
            let compression = header.compression;
            compression.decompress_image_section_from_le(header, payload, at_origin(bounds), false)
        })?;
        if kept == length {
            *out = chunk;
            return Ok(());
        }
        out.reserve_exact(kept);
        wanted.for_each(|range| out.extend_from_slice(&chunk[range]));
        Ok(())
    }

    /// Turns a chunk into its payload: compressed, or as it is where that is no shorter. `chunk` holds the samples of `bounds` in
    /// native byte order, for each line, for each channel.
    pub fn encode(
        &mut self,
        header: &Header,
        chunk: &mut Vec<u8>,
        bounds: IntegerBounds,
    ) -> Result<(), exr::error::Error> {
        if is_zip(header.compression) {
            self.zip(chunk);
            return Ok(());
        }
        if header.compression == Compression::PIZ && cfg!(target_endian = "little") {
            piz::encode(&header.channels.list, bounds, chunk);
            return Ok(());
        }
        let samples = std::mem::take(chunk);
        *chunk = coder_panics::into_error(|| {
            let compression = header.compression;
            compression.compress_image_section_to_le(header, samples, at_origin(bounds))
        })?;
        Ok(())
    }

    /// Fills `separated` from a zipped payload.
    fn unzip(&mut self, length: usize) -> Result<(), exr::error::Error> {
        resize_exact(&mut self.separated, length);
        let inflated = self
            .inflate
            .zlib_decompress(&self.payload, &mut self.separated);
        if inflated != Ok(length) {
            return Err(exr::error::Error::Invalid(
                "ZIP-compressed data malformed".into(),
            ));
        }
        add_differences(&mut self.separated);
        Ok(())
    }

    fn zip(&mut self, chunk: &mut Vec<u8>) {
        let length = chunk.len();
        separate(chunk, &mut self.separated);
        subtract_neighbours(&mut self.separated);
        // as long as a chunk is one that is not compressed
        let room = &mut chunk[..length.saturating_sub(1)];
        match self.deflate.zlib_compress(&self.separated, room) {
            Ok(compressed) => chunk.truncate(compressed),
            Err(_) => {
                chunk.clear();
                add_differences(&mut self.separated);
                interleave(&self.separated, 0..length, chunk);
            }
        }
    }
}

/// Makes `bytes` so long; what they hold is anything. No more memory is taken than for that.
fn resize_exact(bytes: &mut Vec<u8>, length: usize) {
    if bytes.capacity() < length {
        // not copied on the way
        bytes.clear();
        bytes.reserve_exact(length);
    }
    bytes.resize(length, 0);
}

/// The same chunk at (0, 0). Its place would matter to subsampled channels alone, and the crate asserts that it ends before row 2^30.
fn at_origin(bounds: IntegerBounds) -> IntegerBounds {
    IntegerBounds::new(Vec2(0, 0), bounds.size)
}

#[cfg(test)]
mod tests {
    use super::*;
    use exr::meta::attribute::{ChannelDescription, SampleType};

    fn header(width: usize, height: usize) -> Header {
        let channels = [("A", SampleType::F16), ("Z", SampleType::F32)]
            .map(|(name, kind)| ChannelDescription::named(name, kind));
        let mut header = Header::new("part".into(), (width, height), channels.to_vec().into());
        header.compression = Compression::ZIP16;
        header.blocks = exr::meta::BlockDescription::ScanLines;
        header
    }

    fn bytes(count: usize, noisy: bool) -> Vec<u8> {
        let byte = |i: usize| match noisy {
            true => ((i * i * 2_654_435_761) >> 13) as u8,
            false => (i / 7) as u8,
        };
        (0..count).map(byte).collect()
    }

    #[test]
    fn the_exr_crate_reads_the_chunks_that_are_written_here() {
        let mut codec = ChunkCodec::default();
        for (width, height) in [(1, 1), (7, 3), (64, 16), (501, 16)] {
            let header = header(width, height);
            let bounds = IntegerBounds::new(Vec2(0, 0), Vec2(width, height));
            for noisy in [false, true] {
                let chunk = bytes(width * height * 6, noisy);
                let mut payload = chunk.clone();
                codec.encode(&header, &mut payload, bounds).unwrap();
                assert!(payload.len() <= chunk.len());
                let decoded = Compression::ZIP16
                    .decompress_image_section_from_le(&header, payload, bounds, true)
                    .unwrap();
                assert_eq!(decoded, chunk, "{width} x {height}");
            }
        }
    }

    /// The crate asserts that a chunk is no taller than its compression's; the grid makes none that is.
    #[test]
    fn a_chunk_on_which_the_exr_crate_panics_is_an_error() {
        let mut codec = ChunkCodec::default();
        let mut header = header(7, 3);
        header.compression = Compression::RLE;
        let bounds = IntegerBounds::new(Vec2(0, 0), Vec2(7, 3));
        codec.payload = vec![0; 40];
        let mut out = Vec::new();
        let read = codec.decode(&header, bounds, std::iter::once(0..7 * 3 * 6), &mut out);
        let written = codec.encode(&header, &mut bytes(7 * 3 * 6, true), bounds);
        for result in [read, written] {
            let message = result.unwrap_err().to_string();
            assert!(message.contains("exr crate panicked"), "{message}");
        }
    }

    /// The crate refuses chunks from 2^30 rows on, and panics; an image may have twice as many.
    #[test]
    fn chunks_at_the_end_of_the_tallest_image_are_coded_like_others() {
        let mut codec = ChunkCodec::default();
        let far = IntegerBounds::new(Vec2(0, i32::MAX - 3), Vec2(7, 3));
        for compression in [Compression::PXR24, Compression::B44, Compression::PIZ] {
            let mut header = header(7, 3);
            header.compression = compression;
            let chunk = bytes(7 * 3 * 6, false);
            let near = IntegerBounds::new(Vec2(0, 0), far.size);
            let payloads = [near, far].map(|bounds| {
                let mut payload = chunk.clone();
                codec.encode(&header, &mut payload, bounds).unwrap();
                payload
            });
            assert_eq!(payloads[0], payloads[1], "{compression}");
            let decoded = [near, far].map(|bounds| {
                codec.payload.clone_from(&payloads[0]);
                let mut out = Vec::new();
                let whole = std::iter::once(0..chunk.len());
                codec.decode(&header, bounds, whole, &mut out).unwrap();
                out
            });
            assert_eq!(decoded[0], decoded[1], "{compression}");
        }
    }

    #[test]
    fn wanted_bytes_of_the_exr_crates_chunks_are_read_here() {
        let mut codec = ChunkCodec::default();
        for (width, height) in [(1, 1), (7, 3), (501, 16)] {
            let header = header(width, height);
            let bounds = IntegerBounds::new(Vec2(0, 0), Vec2(width, height));
            let chunk = bytes(width * height * 6, false);
            codec.payload = Compression::ZIP16
                .compress_image_section_to_le(&header, chunk.clone(), bounds)
                .unwrap();
            let wanted = [2 * width..6 * width, chunk.len() - 2..chunk.len()];
            let mut read = Vec::new();
            codec
                .decode(&header, bounds, wanted.clone().into_iter(), &mut read)
                .unwrap();
            assert_eq!(read, wanted.map(|range| chunk[range].to_vec()).concat());
        }
    }
}
