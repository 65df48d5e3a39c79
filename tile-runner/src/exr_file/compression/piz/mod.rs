//! PIZ encoding: a lookup table that closes the gaps between the values that occur, Haar wavelets, Huffman codes.
//!
//! The `exr` crate encodes PIZ too, but holds five chunks while it does, where the chunk and one of words are enough: on a
//! 4096-wide render that was 25 MiB of a budget of 96. Here the size is counted before a byte is written, so the chunk
//! itself takes the payload, or stays as it is. Decoding is the crate's.
//!
//! The format is OpenEXR's (`ImfPizCompressor.cpp`, `ImfWav.cpp`, `ImfHuf.cpp`).

mod huffman;
mod wavelet;

use exr::meta::attribute::{ChannelDescription, IntegerBounds};

use huffman::{Huffman, VALUES};
use wavelet::Plane;

/// Turns a chunk into its payload, or leaves it as it is where that would be no shorter. `chunk` holds the samples of `bounds`, for
/// each line, for each channel, in the byte order of the file, which is that of this machine. Works in as much memory again.
pub(super) fn encode(channels: &[ChannelDescription], bounds: IntegerBounds, chunk: &mut Vec<u8>) {
    let (columns, rows) = (bounds.size.0, bounds.size.1);
    let words_per_sample =
        |channel: &ChannelDescription| channel.sample_type.bytes_per_sample() / 2;
    let steps: Vec<usize> = channels.iter().map(words_per_sample).collect();
    let mut words = split(chunk, &steps, columns);
    let used = Used::of(&words);
    let last = used.close_gaps(&mut words);
    let mut rest = words.as_mut_slice();
    for step in steps {
        let (samples, others) = rest.split_at_mut(columns * rows * step);
        rest = others;
        for word in 0..step {
            Plane::new(&mut samples[word..], columns, rows, step).encode(last);
        }
    }
    let Some(huffman) = Huffman::of(&words) else {
        return;
    };
    let stored = used.stored();
    let bytes = 2 * size_of::<u16>() + stored.len() + size_of::<i32>() + huffman.bytes();
    // a length must fit the format's 32 bits with a sign
    let Ok(length) = i32::try_from(huffman.bytes()) else {
        return;
    };
    if bytes >= chunk.len() {
        return;
    }
    chunk.clear();
    for end in [used.first, used.last] {
        chunk.extend_from_slice(&end.to_le_bytes());
    }
    chunk.extend_from_slice(stored);
    chunk.extend_from_slice(&length.to_le_bytes());
    huffman.write(&words, chunk);
}

/// The chunk's words, one channel after another. `steps` are the words of a sample of each channel.
fn split(chunk: &[u8], steps: &[usize], columns: usize) -> Vec<u16> {
    let mut words = vec![0_u16; chunk.len() / 2];
    let mut rest = bytemuck::cast_slice_mut(&mut words);
    let line = 2 * columns * steps.iter().sum::<usize>();
    let mut start = 0;
    for step in steps {
        let length = 2 * columns * step;
        for line in chunk.chunks_exact(line.max(1)) {
            let samples: &mut [u8];
            (samples, rest) = rest.split_at_mut(length);
            samples.copy_from_slice(&line[start..start + length]);
        }
        start += length;
    }
    words
}

/// Which values occur: one bit for each. Zero counts as occurring, and has no bit.
struct Used {
    bits: Vec<u8>,
    /// First and last byte that is not 0; both 0 if there is none.
    first: u16,
    last: u16,
}

impl Used {
    fn of(words: &[u16]) -> Self {
        let mut bits = vec![0_u8; VALUES / 8];
        for word in words {
            bits[usize::from(word >> 3)] |= 1 << (word & 7);
        }
        bits[0] &= !1;
        let occupied = |byte: &u8| *byte != 0;
        let first = bits.iter().position(occupied).unwrap_or(0) as u16;
        let last = bits.iter().rposition(occupied).unwrap_or(0) as u16;
        Self { bits, first, last }
    }

    /// The bytes that the file stores.
    fn stored(&self) -> &[u8] {
        &self.bits[usize::from(self.first)..=usize::from(self.last)]
    }

    /// Replaces each value by its number among those that occur. Gives the highest number.
    fn close_gaps(&self, words: &mut [u16]) -> u16 {
        let mut table = vec![0_u16; VALUES];
        let mut last = 0;
        for (value, number) in table.iter_mut().enumerate() {
            if self.bits[value >> 3] & (1 << (value & 7)) != 0 {
                last += 1;
                *number = last;
            }
        }
        for word in words {
            *word = table[usize::from(*word)];
        }
        last
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use exr::math::Vec2;
    use exr::meta::attribute::{Compression, SampleType};
    use exr::meta::header::Header;

    fn header(width: usize, height: usize) -> Header {
        let channels = [
            ("A", SampleType::F16),
            ("Z", SampleType::F32),
            ("id", SampleType::U32),
        ]
        .map(|(name, kind)| ChannelDescription::named(name, kind));
        let mut header = Header::new("part".into(), (width, height), channels.to_vec().into());
        header.compression = Compression::PIZ;
        header.blocks = exr::meta::BlockDescription::ScanLines;
        header
    }

    fn hashed(i: usize) -> u8 {
        ((i * i).wrapping_mul(2_654_435_761) >> 13) as u8
    }

    #[test]
    fn the_exr_crate_reads_the_chunks_that_are_written_here() {
        let contents: [fn(usize) -> u8; 5] = [
            |_| 0,
            |_| 0xff,
            |i| (i / 7) as u8,
            hashed,
            |i| hashed(i) & if i % 2 == 1 { 0x3 } else { 0xff },
        ];
        for (width, height) in [(1, 1), (7, 3), (3, 7), (64, 32), (501, 32), (1000, 13)] {
            let header = header(width, height);
            let bounds = IntegerBounds::new(Vec2(0, 0), Vec2(width, height));
            for (which, byte) in contents.iter().enumerate() {
                let chunk: Vec<u8> = (0..width * height * 10).map(byte).collect();
                let mut payload = chunk.clone();
                encode(&header.channels.list, bounds, &mut payload);
                assert!(payload.len() <= chunk.len());
                let theirs = Compression::PIZ
                    .compress_image_section_to_le(&header, chunk.clone(), bounds)
                    .unwrap();
                assert_eq!(payload.len(), theirs.len(), "{width} x {height}, {which}");
                let decoded = Compression::PIZ
                    .decompress_image_section_from_le(&header, payload, bounds, true)
                    .unwrap();
                assert!(decoded == chunk, "{width} x {height}, {which}");
            }
        }
    }
}
