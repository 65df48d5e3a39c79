//! An image in memory, repeated by mirroring, as the rows that the pipeline reads.

use std::path::Path;

use anyhow::{Context, Result};
use linpred::job::{DEFAULT_MEMORY_LIMIT, Input, InputRequest};
use linpred::{Error, ImageSize, InputRow, OutputRow, RowLayout, RowSink, RowSource};

/// A decoded image: every row of every channel that has a role.
pub(crate) struct Image {
    pub(crate) layout: RowLayout,
    pub(crate) rows: Vec<InputRow>,
}

impl Image {
    /// Reads an EXR file through the library's own source.
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let request = InputRequest::new(path);
        let mut source = Input::open(&request)?.source(DEFAULT_MEMORY_LIMIT)?;
        let layout = source.layout();
        let mut rows = Vec::new();
        for y in 0..layout.size.height() {
            let mut row = InputRow::new(&layout);
            source.read_row(y, &mut row)?;
            rows.push(row);
        }
        Ok(Self { layout, rows })
    }

    /// Copies per side that come nearest to `megapixels`; 1 for 0.
    pub(crate) fn copies(&self, megapixels: f64) -> usize {
        let side = (megapixels * 1e6 / self.layout.size.pixels() as f64).sqrt();
        (side.round() as usize).max(1)
    }
}

/// `copies` x `copies` of an image, every other one mirrored, so that no seam is an edge. Made row by row: the large image is
/// never in memory.
pub(crate) struct MirroredRows<'a> {
    image: &'a Image,
    layout: RowLayout,
}

impl<'a> MirroredRows<'a> {
    pub(crate) fn new(image: &'a Image, copies: usize) -> Result<Self> {
        let size = image.layout.size;
        let size = ImageSize::new(size.width() * copies, size.height() * copies);
        let size = size.context("the mirrored image is too large")?;
        let layout = image.layout.with_size(size);
        Ok(Self { image, layout })
    }
}

impl RowSource for MirroredRows<'_> {
    fn layout(&self) -> RowLayout {
        self.layout
    }

    fn read_row(&mut self, y: usize, row: &mut InputRow) -> Result<(), Error> {
        let height = self.image.rows.len();
        let within = y % height;
        let from = if (y / height).is_multiple_of(2) {
            &self.image.rows[within]
        } else {
            &self.image.rows[height - 1 - within]
        };
        let planes = from.colour.iter().chain(&from.variance);
        let planes = planes.chain(&from.features).chain(&from.feature_variances);
        let out = row.colour.iter_mut().chain(&mut row.variance);
        let out = out
            .chain(&mut row.features)
            .chain(&mut row.feature_variances);
        for (plane, out) in planes.zip(out) {
            mirror(plane, out);
        }
        Ok(())
    }
}

fn mirror(row: &[f32], out: &mut [f32]) {
    // features that the image lacks have no planes
    for (copy, out) in out.chunks_mut(row.len().max(1)).enumerate() {
        out.copy_from_slice(row);
        if copy % 2 == 1 {
            out.reverse();
        }
    }
}

/// The colour of a whole image, a plane per channel, row after row.
#[derive(Clone, Debug, Default)]
pub(crate) struct Colour {
    pub(crate) planes: [Vec<f32>; 3],
}

impl RowSink for Colour {
    fn write_row(&mut self, _: usize, row: &OutputRow) -> Result<(), Error> {
        for (plane, row) in self.planes.iter_mut().zip(&row.colour) {
            plane.extend_from_slice(row);
        }
        Ok(())
    }
}

/// A sink that keeps nothing.
pub(crate) struct Nowhere;

impl RowSink for Nowhere {
    fn write_row(&mut self, _: usize, row: &OutputRow) -> Result<(), Error> {
        std::hint::black_box(row);
        Ok(())
    }
}
