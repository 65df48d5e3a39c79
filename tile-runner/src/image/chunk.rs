//! Samples into the chunks of a part that is written.

use exr::meta::attribute::{ChannelList, IntegerBounds, SampleType};
use exr::meta::header::Header;
use half::f16;
use half::slice::HalfFloatSliceExt;

use crate::error::Error;
use crate::exr_file::compression::SharedCodec;
use crate::exr_file::grid::ChunkGrid;
use crate::exr_file::writer::ExrWriter;

/// Where each line of each channel lies in a chunk.
pub(super) struct Lines {
    width: usize,
    bytes_per_pixel: usize,
    starts: Vec<usize>,
    pub(super) sizes: Vec<usize>,
}

impl Lines {
    pub(super) fn new(channels: &ChannelList, bounds: IntegerBounds) -> Self {
        let sizes = channels
            .list
            .iter()
            .map(|c| c.sample_type.bytes_per_sample())
            .collect();
        let starts = channels
            .channels_with_byte_offset()
            .map(|(start, _)| start)
            .collect();
        let bytes_per_pixel = channels.bytes_per_pixel;
        Self {
            width: bounds.size.0,
            bytes_per_pixel,
            starts,
            sizes,
        }
    }

    pub(super) fn range(&self, channel: usize, line: usize) -> std::ops::Range<usize> {
        let start = line * self.width * self.bytes_per_pixel + self.width * self.starts[channel];
        start..start + self.width * self.sizes[channel]
    }
}

/// Compresses `chunk`, the one at `(column, row)` of the grid of `part`, and writes it. [`Error::Unsupported`] if its compression cannot.
pub(super) fn write_chunk(
    writer: &mut ExrWriter,
    codec: &SharedCodec,
    header: &Header,
    grid: ChunkGrid,
    (part, column, row): (usize, usize, usize),
    chunk: &mut Vec<u8>,
) -> Result<(), Error> {
    let bounds = grid.bounds(column, row);
    let encoded = codec.lock().encode(header, chunk, bounds);
    encoded.map_err(|error| {
        Error::Unsupported(format!(
            "{}: part {part}: row {}: cannot be compressed: {error}",
            writer.path().display(),
            bounds.position.1
        ))
    })?;
    writer.write_chunk(part, row * grid.columns() + column, chunk)
}

/// Half floats that are made at a time.
const HALVES: usize = 64;

/// Writes `values` as samples in native byte order. Returns how many finite values would have become infinite.
pub(super) fn encode_samples(kind: SampleType, values: &[f32], out: &mut [u8]) -> u64 {
    match kind {
        // integers lie in a plane with their bits; those that were to be denoised were refused when the output was planned
        SampleType::F32 | SampleType::U32 => {
            out.copy_from_slice(bytemuck::cast_slice(values));
            0
        }
        SampleType::F16 => {
            let mut clamped = 0;
            let mut halves = [f16::ZERO; HALVES];
            for (samples, values) in out.chunks_mut(2 * HALVES).zip(values.chunks(HALVES)) {
                let halves = &mut halves[..values.len()];
                // as a slice: the processor's own instructions, where it has them
                halves.convert_from_f32_slice(values);
                for (half, value) in halves.iter_mut().zip(values) {
                    if half.is_infinite() && value.is_finite() {
                        *half = if *value > 0.0 { f16::MAX } else { f16::MIN };
                        clamped += 1;
                    }
                }
                samples.copy_from_slice(bytemuck::cast_slice(halves));
            }
            clamped
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_beyond_half_precision_becomes_the_largest_half_and_is_counted() {
        let mut halves = [f16::ZERO; 4];
        let values = [1.0, 70000.0, -1e9, 65504.0];
        let bytes = bytemuck::bytes_of_mut(&mut halves);
        let clamped = encode_samples(SampleType::F16, &values, bytes);
        assert_eq!(halves.map(f16::to_f32), [1.0, 65504.0, -65504.0, 65504.0]);
        assert_eq!(clamped, 2);
    }
}
