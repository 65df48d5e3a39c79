//! Pixels in the caller's memory, wherever they lie there. Nothing here makes a reference to them: they may lie at any address, between other data, and an output may be its input.

use std::ffi::c_void;

use half::f16;
use linpred::ImageSize;
use linpred::image::Pixels;

use crate::format::{Format, Sample};
use crate::status::Failure;

/// Where pixels are, as C says it.
#[derive(Clone, Copy)]
pub(crate) struct Place {
    pub(crate) data: *mut c_void,
    pub(crate) format: i32,
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) byte_offset: usize,
    pub(crate) pixel_stride: usize,
    pub(crate) row_stride: usize,
}

/// Pixels in the caller's memory.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RawImage {
    start: *mut u8,
    format: Format,
    size: ImageSize,
    pixel_stride: usize,
    row_stride: usize,
    /// Bytes from the start of a row to the end of its last pixel.
    row_bytes: usize,
    /// Bytes from the start to the end of the last pixel.
    bytes: usize,
}

// SAFETY: it is an address and numbers. What lies there is read and written in the thread of linpred_execute() or linpred_sample_map() alone, whose caller lends it.
unsafe impl Send for RawImage {}
// SAFETY: as above
unsafe impl Sync for RawImage {}

impl RawImage {
    /// Checks that the pixels can lie where they are said to.
    pub(crate) fn new(place: &Place) -> Result<Self, Failure> {
        let format = Format::new(place.format)?;
        let (width, height) = (place.width, place.height);
        if place.data.is_null() {
            return Err(Failure::argument("the data is NULL"));
        }
        let size = ImageSize::new(width, height).ok_or_else(|| {
            Failure::argument(format!(
                "{width} x {height} pixels are no image, whose sides are 1 to 2^31 - 1"
            ))
        })?;
        let pixel_stride = match place.pixel_stride {
            0 => format.bytes(),
            stride if stride >= format.bytes() => stride,
            stride => {
                let bytes = format.bytes();
                return Err(Failure::argument(format!(
                    "a pixel stride of {stride} bytes is less than a pixel has, which is {bytes}"
                )));
            }
        };
        let row_bytes = span(width, pixel_stride, format.bytes());
        let row_stride = match place.row_stride {
            0 => width.checked_mul(pixel_stride),
            stride => Some(stride),
        };
        let bytes = row_stride
            .zip(row_bytes)
            .and_then(|(stride, row)| span(height, stride, row));
        let end = bytes.and_then(|bytes| bytes.checked_add(place.byte_offset));
        let last = end.and_then(|end| (place.data as usize).checked_add(end));
        let (Some(row_stride), Some(row_bytes), Some(bytes), Some(_)) =
            (row_stride, row_bytes, bytes, last)
        else {
            return Err(Failure::argument(format!(
                "{width} x {height} pixels at these strides do not fit into memory"
            )));
        };
        if row_stride < row_bytes {
            return Err(Failure::argument(format!(
                "a row stride of {row_stride} bytes is less than a row has, which is {row_bytes}"
            )));
        }
        Ok(Self {
            start: place.data.cast::<u8>().wrapping_add(place.byte_offset),
            format,
            size,
            pixel_stride,
            row_stride,
            row_bytes,
            bytes,
        })
    }

    pub(crate) fn size(&self) -> ImageSize {
        self.size
    }

    pub(crate) fn channels(&self) -> usize {
        self.format.channels
    }

    /// The first sample of a channel in row `y`, both of which there are.
    fn row(&self, channel: usize, y: usize) -> *mut u8 {
        self.start
            .wrapping_add(y * self.row_stride + channel * self.format.sample.bytes())
    }

    /// Writes row `y` of a channel, and returns how many of the values half precision cannot hold.
    ///
    /// # Safety
    /// The memory is the caller's to write.
    pub(crate) unsafe fn write_row(&self, channel: usize, y: usize, values: &[f32]) -> u64 {
        assert!(channel < self.format.channels && y < self.size.height());
        let row = self.row(channel, y);
        let mut clamped = 0;
        for (x, &value) in values.iter().take(self.size.width()).enumerate() {
            let at = row.wrapping_add(x * self.pixel_stride);
            match self.format.sample {
                // SAFETY: within the image, which the caller may write
                Sample::Float => unsafe { at.cast::<f32>().write_unaligned(value) },
                Sample::Half => {
                    let (half, is_clamped) = to_half(value);
                    clamped += u64::from(is_clamped);
                    // SAFETY: as above
                    unsafe { at.cast::<u16>().write_unaligned(half.to_bits()) };
                }
            }
        }
        clamped
    }

    /// Writes row `y` of whole numbers, each of which takes the place of a float.
    ///
    /// # Safety
    /// The memory is the caller's to write.
    pub(crate) unsafe fn write_numbers(&self, y: usize, numbers: &[u32]) {
        assert!(self.format.sample == Sample::Float && y < self.size.height());
        let row = self.row(0, y);
        for (x, &number) in numbers.iter().take(self.size.width()).enumerate() {
            let at = row.wrapping_add(x * self.pixel_stride).cast::<u32>();
            // SAFETY: within the image, which the caller may write
            unsafe { at.write_unaligned(number) };
        }
    }

    /// Whether the first pixels share a byte.
    pub(crate) fn begins_within(&self, other: &Self) -> bool {
        let (own, others) = (self.start as usize, other.start as usize);
        let (used, others_used) = (self.used_bytes(), other.used_bytes());
        own < others + others_used && others < own + used
    }

    /// Whether writing rows of this from the top, each after the row of `input` of the same number was read, leaves
    /// what is to be read of `input` as it was.
    pub(crate) fn may_be_written_while_read(&self, input: &Self) -> bool {
        let (own, other) = (self.start as usize, input.start as usize);
        let apart = own + self.bytes <= other || other + input.bytes <= own;
        // row y ends before row y + 1 of the input begins
        let behind =
            self.row_stride == input.row_stride && own + self.row_bytes <= other + input.row_stride;
        apart || behind
    }

    /// Bytes of a pixel that are read or written.
    fn used_bytes(&self) -> usize {
        self.format.channels * self.format.sample.bytes()
    }
}

impl Pixels for RawImage {
    fn size(&self) -> (usize, usize) {
        (self.size.width(), self.size.height())
    }

    fn channels(&self) -> usize {
        self.format.channels
    }

    fn read_row(&self, channel: usize, y: usize, row: &mut [f32]) {
        assert!(channel < self.format.channels && y < self.size.height());
        let start = self.row(channel, y);
        for (x, value) in row.iter_mut().take(self.size.width()).enumerate() {
            let at = start.wrapping_add(x * self.pixel_stride);
            *value = match self.format.sample {
                // SAFETY: within the image, which linpred_set_image() was promised to be readable during a run
                Sample::Float => unsafe { at.cast::<f32>().read_unaligned() },
                Sample::Half => {
                    // SAFETY: as above
                    let bits = unsafe { at.cast::<u16>().read_unaligned() };
                    f16::from_bits(bits).to_f32()
                }
            };
        }
    }
}

/// Bytes from the start of the first of `count` items to the end of the last.
fn span(count: usize, stride: usize, bytes: usize) -> Option<usize> {
    let before = (count - 1).checked_mul(stride)?;
    before.checked_add(bytes)
}

/// The nearest half, and whether that is the largest because the value is beyond it.
fn to_half(value: f32) -> (f16, bool) {
    let half = f16::from_f32(value);
    match half.is_infinite() && value.is_finite() {
        true if value > 0.0 => (f16::MAX, true),
        true => (f16::MIN, true),
        false => (half, false),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(data: &mut [u8], format: i32, width: usize, height: usize) -> Place {
        Place {
            data: data.as_mut_ptr().cast(),
            format,
            width,
            height,
            byte_offset: 0,
            pixel_stride: 0,
            row_stride: 0,
        }
    }

    #[test]
    fn samples_are_found_at_any_address_and_stride() {
        let mut data = [0; 200];
        // of 3 x 2 pixels of three halves in 7 bytes, 25 bytes a row, from byte 3
        let value = |x: usize, y: usize, channel: usize| (100 * y + 10 * x + channel) as f32;
        for (x, y, channel) in (0..18).map(|n| (n % 3, n / 3 % 2, n / 6)) {
            let at = 3 + 25 * y + 7 * x + 2 * channel;
            data[at..at + 2].copy_from_slice(&f16::from_f32(value(x, y, channel)).to_ne_bytes());
        }
        let image = RawImage::new(&Place {
            byte_offset: 3,
            pixel_stride: 7,
            row_stride: 25,
            ..place(&mut data, 259, 3, 2)
        });
        let image = image.unwrap();
        let mut row = [0.0; 3];
        for (y, channel) in [(0, 0), (0, 2), (1, 1)] {
            image.read_row(channel, y, &mut row);
            assert_eq!(row, [0, 1, 2].map(|x| value(x, y, channel)));
        }
    }

    #[test]
    fn what_lies_between_samples_is_not_written() {
        let mut data = [0xEE; 64];
        let image = RawImage::new(&Place {
            byte_offset: 1,
            row_stride: 40,
            ..place(&mut data, 4, 1, 2)
        });
        let image = image.unwrap();
        for (channel, y) in [(0, 0), (1, 0), (2, 0), (0, 1)] {
            // SAFETY: `data` is not used meanwhile
            unsafe { image.write_row(channel, y, &[1.0]) };
        }
        let mut wanted = [0xEE; 64];
        for at in [1, 5, 9, 41] {
            wanted[at..at + 4].copy_from_slice(&1.0_f32.to_ne_bytes());
        }
        assert_eq!(data, wanted);
    }

    #[test]
    fn a_value_beyond_half_precision_becomes_the_largest_half_and_is_counted() {
        let mut data = [0; 8];
        let image = RawImage::new(&place(&mut data, 257, 4, 1)).unwrap();
        // SAFETY: `data` is not used meanwhile
        let clamped = unsafe { image.write_row(0, 0, &[1.0, 7e4, -1e9, f32::INFINITY]) };
        let mut row = [0.0; 4];
        image.read_row(0, 0, &mut row);
        assert_eq!((clamped, row), (2, [1.0, 65504.0, -65504.0, f32::INFINITY]));
    }

    #[test]
    fn places_that_cannot_be_are_told() {
        let mut data = [0; 64];
        let good = place(&mut data, 3, 2, 2);
        let null = std::ptr::null_mut();
        let end = std::ptr::without_provenance_mut(usize::MAX - 10);
        let bad = [
            (Place { data: null, ..good }, "NULL"),
            (Place { format: 2, ..good }, "the format 2"),
            (Place { width: 0, ..good }, "0 x 2 pixels"),
            (
                Place {
                    height: 1 << 40,
                    ..good
                },
                "no image",
            ),
            (
                Place {
                    pixel_stride: 11,
                    ..good
                },
                "pixel stride of 11 bytes",
            ),
            (
                Place {
                    row_stride: 23,
                    ..good
                },
                "row stride of 23 bytes",
            ),
            (
                Place {
                    row_stride: usize::MAX,
                    ..good
                },
                "do not fit into memory",
            ),
            (
                Place {
                    pixel_stride: usize::MAX,
                    ..good
                },
                "do not fit into memory",
            ),
            (
                Place {
                    byte_offset: usize::MAX - 47,
                    ..good
                },
                "do not fit into memory",
            ),
            (Place { data: end, ..good }, "do not fit into memory"),
        ];
        RawImage::new(&good).unwrap();
        for (place, told) in bad {
            let message = RawImage::new(&place).unwrap_err().message;
            assert!(message.contains(told), "{message}, not {told}");
        }
    }

    #[test]
    fn an_output_may_overlap_an_input_in_rows_of_the_same_number_alone() {
        let mut data = [0; 400];
        // RGBA of 4 x 4 pixels
        let colour = Place {
            pixel_stride: 16,
            ..place(&mut data, 3, 4, 4)
        };
        let image = |byte_offset, place: Place| {
            RawImage::new(&Place {
                byte_offset,
                ..place
            })
            .unwrap()
        };
        let input = image(0, colour);
        let alpha = image(
            12,
            Place {
                format: 1,
                ..colour
            },
        );
        let sharing = [
            image(0, colour),
            alpha,
            image(256, place(&mut data, 1, 4, 4)),
        ];
        assert!(
            sharing
                .iter()
                .all(|output| output.may_be_written_while_read(&input))
        );
        let below = image(64, colour);
        let narrower = image(
            0,
            Place {
                pixel_stride: 12,
                ..colour
            },
        );
        for output in [
            below,
            narrower,
            image(
                4,
                Place {
                    format: 4,
                    ..colour
                },
            ),
        ] {
            assert!(!output.may_be_written_while_read(&input), "{output:?}");
        }
        // one row above: it is read by then
        assert!(input.may_be_written_while_read(&below));
        assert!(input.begins_within(&input) && !input.begins_within(&alpha));
    }
}
