//! How many samples each pixel should get.

use super::scratch::RowFile;
use crate::error::Error;
use crate::geometry::ImageSize;

/// What a map gives, and what for.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Summary {
    /// Pixels of the image.
    pub pixels: u64,
    /// Samples that they have together.
    pub samples: u64,
    /// Samples that the map gives them together: the budget, rounded; 0 if the error is as small as it should be.
    pub added: u64,
    /// The most that one of them gets.
    pub most: u32,
    /// The predicted error of the denoised image: mean over the pixels of the estimated squared error over the mean square of the colour and 0.003.
    pub error: f64,
    /// The same once the map is rendered.
    pub error_then: f64,
}

/// A map of samples: rows of whole numbers, in any order.
#[derive(Debug)]
pub struct SampleMap {
    size: ImageSize,
    rows: RowFile,
    summary: Summary,
}

impl SampleMap {
    pub(super) fn new(size: ImageSize, rows: RowFile, summary: Summary) -> Self {
        Self {
            size,
            rows,
            summary,
        }
    }

    /// Its size.
    pub fn size(&self) -> ImageSize {
        self.size
    }

    /// What it gives.
    pub fn summary(&self) -> Summary {
        self.summary
    }

    /// Fills `row` with the samples that the pixels of row `y` should get. [`Error::Usage`] if there is no such row, or it has another length.
    pub fn read_row(&mut self, y: usize, row: &mut [u32]) -> Result<(), Error> {
        let (width, height) = (self.size.width(), self.size.height());
        if y >= height || row.len() != width {
            return Err(Error::Usage(format!(
                "row {y} of {} pixels of a map of {width} x {height}",
                row.len()
            )));
        }
        self.rows.read(y, row)
    }
}
