//! What a pixel in the caller's memory is.

use crate::status::Failure;

/// What a pixel is: how many numbers of which kind. The values are OIDN's.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum linpred_format {
    /// One float.
    LINPRED_FORMAT_FLOAT = 1,
    /// Three floats.
    LINPRED_FORMAT_FLOAT3 = 3,
    /// Four floats, of which the fourth is neither read nor written.
    LINPRED_FORMAT_FLOAT4 = 4,
    /// One half float.
    LINPRED_FORMAT_HALF = 257,
    /// Three half floats.
    LINPRED_FORMAT_HALF3 = 259,
    /// Four half floats, of which the fourth is neither read nor written.
    LINPRED_FORMAT_HALF4 = 260,
}

/// A number in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sample {
    Float,
    Half,
}

impl Sample {
    pub(crate) const fn bytes(self) -> usize {
        match self {
            Self::Float => 4,
            Self::Half => 2,
        }
    }
}

/// What a pixel is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Format {
    pub(crate) sample: Sample,
    /// Samples that are used: one or three.
    pub(crate) channels: usize,
    /// Samples that there are.
    samples: usize,
}

impl Format {
    pub(crate) fn new(format: i32) -> Result<Self, Failure> {
        use linpred_format::*;
        let formats = [
            (LINPRED_FORMAT_FLOAT, Sample::Float, 1, 1),
            (LINPRED_FORMAT_FLOAT3, Sample::Float, 3, 3),
            (LINPRED_FORMAT_FLOAT4, Sample::Float, 3, 4),
            (LINPRED_FORMAT_HALF, Sample::Half, 1, 1),
            (LINPRED_FORMAT_HALF3, Sample::Half, 3, 3),
            (LINPRED_FORMAT_HALF4, Sample::Half, 3, 4),
        ];
        let found = formats
            .into_iter()
            .find(|(known, ..)| *known as i32 == format);
        let Some((_, sample, channels, samples)) = found else {
            return Err(Failure::argument(format!(
                "the format {format} is none of linpred_format"
            )));
        };
        Ok(Self {
            sample,
            channels,
            samples,
        })
    }

    /// Bytes of a pixel.
    pub(crate) const fn bytes(self) -> usize {
        self.samples * self.sample.bytes()
    }
}
