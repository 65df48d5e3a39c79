//! A band of an image: what one of several machines denoises, to be stitched together without decoding.
//!
//! A band's rows begin and end on chunks of the file. It is computed from more rows than it writes, beginning on a row of
//! cells of the whole image, so that every pixel comes out with the bits that the whole image would have given it.

use std::fmt;
use std::ops::Range;

use linpred_core::CELL;

use crate::error::{Error, Setting};
use crate::exr_file::ExrFile;
use crate::exr_file::attributes::Attributes;
use crate::geometry::ImageSize;
use crate::image::rewrite::Rewrite;
use crate::row::{InputRow, OutputRow, RowLayout, RowSink, RowSource};
use crate::stream::pipeline;

/// Attribute of a band: the data window of the whole image.
pub const WHOLE_ATTRIBUTE: &str = "linpredFrameWindow";
/// Attribute of a band: which one it is, such as `2/4`.
pub const BAND_ATTRIBUTE: &str = "linpredBand";

/// The `index`-th of `count` bands, from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Band {
    index: usize,
    count: usize,
}

impl Band {
    /// Parses `2/4`. [`Error::Usage`] otherwise.
    pub fn parse(text: &str) -> Result<Self, Error> {
        let parts = text
            .split_once('/')
            .and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        match parts {
            Some((index, count)) if 1 <= index && index <= count => Ok(Self { index, count }),
            _ => Err(Error::Usage(format!(
                "{text:?}: expected i/N with i from 1 to N, such as 2/4"
            ))),
        }
    }

    /// The band's rows of an image of `height` rows that may be cut every `unit` rows. [`Error::Setting`] when there are fewer
    /// pieces than bands and this one would be empty.
    pub fn rows(self, height: usize, unit: usize) -> Result<Range<usize>, Error> {
        let pieces = height.div_ceil(unit) as u64;
        let cut = |index: usize| (index as u64 * pieces / self.count as u64) as usize * unit;
        let rows = cut(self.index - 1)..cut(self.index).min(height);
        if rows.is_empty() {
            return Err(Error::Setting {
                setting: Setting::Band,
                value: self.to_string(),
                problem: format!(
                    "is empty: the file can be cut every {unit} rows, between its chunks, which makes {pieces} pieces"
                ),
            });
        }
        Ok(rows)
    }

    /// Restricts an output to this band; gives the band's rows of the image.
    ///
    /// [`Error::Unsupported`] if a part cannot be cut: it has smaller levels, or another data window than the colour.
    pub fn restrict(self, rewrite: &mut Rewrite, input: &ExrFile) -> Result<Range<usize>, Error> {
        let Some(window) = rewrite
            .rewritten
            .first()
            .map(|part| part.header.data_window())
        else {
            return Err(Error::Usage("a band: nothing is denoised".into()));
        };
        let height = window.size.1;
        for (output, part) in rewrite.parts.iter().zip(input.parts()) {
            let own = part.data_window();
            if output.grid.has_levels()
                || (own.position.1, own.size.1) != (window.position.1, height)
            {
                return Err(Error::Unsupported(format!(
                    "{}: {}: cannot be cut into bands: it has smaller levels, or other rows than the colour",
                    input.path().display(),
                    part.label()
                )));
            }
        }
        let unit = rewrite
            .parts
            .iter()
            .map(|part| part.grid.chunk_height())
            .fold(1, |a, b| lcm(a, b, height));
        let rows = self.rows(height, unit)?;
        let label = self.to_string().into_bytes();
        for part in &mut rewrite.parts {
            part.grid = part.grid.restricted(rows.start, rows.len());
            part.chunks = part.grid.rows() * part.grid.columns();
            restrict_attributes(&mut part.attributes, &rows, part.chunks);
            part.attributes.set(BAND_ATTRIBUTE, "string", label.clone());
        }
        for part in &mut rewrite.rewritten {
            part.grid = part.grid.restricted(rows.start, rows.len());
            part.header.layer_size.1 = rows.len();
            part.header.own_attributes.layer_position.1 += rows.start as i32;
        }
        rewrite.first_row = rows.start;
        Ok(rows)
    }
}

impl fmt::Display for Band {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

/// Cuts the data window and remembers the whole one.
fn restrict_attributes(attributes: &mut Attributes, rows: &Range<usize>, chunks: usize) {
    let Some(window) = attributes.value("dataWindow", "box2i").map(<[u8]>::to_vec) else {
        return;
    };
    let mut band = window.clone();
    // rows of a data window fit i32
    if let Some(top) = window
        .get(4..8)
        .and_then(|b| Some(i32::from_le_bytes(b.try_into().ok()?)))
    {
        let (first, last) = (top + rows.start as i32, top + rows.end as i32 - 1);
        band[4..8].copy_from_slice(&first.to_le_bytes());
        band[12..16].copy_from_slice(&last.to_le_bytes());
    }
    attributes.set("dataWindow", "box2i", band);
    attributes.set(WHOLE_ATTRIBUTE, "box2i", window);
    if attributes.int("chunkCount").is_some() {
        attributes.set("chunkCount", "int", (chunks as i32).to_le_bytes().to_vec());
    }
}

/// Least common multiple, at most `limit`.
fn lcm(a: usize, b: usize, limit: usize) -> usize {
    let (mut x, mut y) = (a, b);
    while y != 0 {
        (x, y) = (y, x % y);
    }
    (a / x).saturating_mul(b).min(limit)
}

/// The rows of a source that a band is computed from.
#[derive(Debug)]
pub struct BandSource<S> {
    inner: S,
    rows: Range<usize>,
}

impl<S: RowSource> BandSource<S> {
    /// What is needed for the rows `band` of `inner`.
    pub fn new(inner: S, band: &Range<usize>) -> Self {
        let height = inner.layout().size.height();
        let first = band.start.saturating_sub(pipeline::REACH) / CELL * CELL;
        let last = (band.end + pipeline::REACH).min(height);
        Self {
            inner,
            rows: first..last,
        }
    }

    /// The first of its rows, in the image.
    pub fn first(&self) -> usize {
        self.rows.start
    }

    /// The source of the whole image.
    pub fn inner(&self) -> &S {
        &self.inner
    }
}

impl<S: RowSource> RowSource for BandSource<S> {
    fn layout(&self) -> RowLayout {
        let layout = self.inner.layout();
        // not empty, and no larger than the image
        let size = ImageSize::new(layout.size.width(), self.rows.len()).unwrap_or(layout.size);
        RowLayout { size, ..layout }
    }

    fn read_row(&mut self, y: usize, row: &mut InputRow) -> Result<(), Error> {
        self.inner.read_row(self.rows.start + y, row)
    }
}

/// Passes on those rows that belong to a band.
#[derive(Debug)]
pub struct BandSink<S> {
    inner: S,
    rows: Range<usize>,
}

impl<S: RowSink> BandSink<S> {
    /// Passes the rows `rows` on as rows from 0.
    pub fn new(inner: S, rows: Range<usize>) -> Self {
        Self { inner, rows }
    }

    /// The sink that takes the band.
    pub fn into_inner(self) -> S {
        self.inner
    }
}

impl<S: RowSink> RowSink for BandSink<S> {
    fn write_row(&mut self, y: usize, row: &OutputRow) -> Result<(), Error> {
        match self.rows.contains(&y) {
            true => self.inner.write_row(y - self.rows.start, row),
            false => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_cover_every_row_once() {
        for (height, unit, count) in [
            (4096, 16, 5),
            (100, 16, 7),
            (83, 17, 2),
            (19, 32, 1),
            (65536, 544, 31),
        ] {
            let mut next = 0;
            for index in 1..=count {
                let rows = Band { index, count }.rows(height, unit).unwrap();
                assert_eq!((rows.start, rows.start % unit), (next, 0));
                next = rows.end;
            }
            assert_eq!(next, height);
        }
        assert!(matches!(
            Band { index: 1, count: 3 }.rows(40, 32),
            Err(Error::Setting { .. })
        ));
    }

    #[test]
    fn bands_are_counted_from_one() {
        assert_eq!(Band::parse("2/4").unwrap(), Band { index: 2, count: 4 });
        for text in ["0/4", "5/4", "1", "a/b", "1/0", "-1/4"] {
            assert!(Band::parse(text).is_err(), "{text}");
        }
    }
}
