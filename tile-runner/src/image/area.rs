//! The part of a picture that is denoised, and what lies around it: nothing, or the other end of a panorama.

use crate::error::Error;
use crate::geometry::ImageSize;
use crate::row::{InputRow, OutputRow, RowLayout, RowSink, RowSource};
use crate::stream::pipeline::REACH;

/// A rectangle of a data window, from its top left corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Area {
    /// Columns to its left.
    pub x: usize,
    /// Rows above it.
    pub y: usize,
    /// Its size.
    pub size: ImageSize,
}

impl Area {
    /// All of a window.
    pub fn whole(size: ImageSize) -> Self {
        Self { x: 0, y: 0, size }
    }
}

/// A picture whose left and right ends meet: each row with as many columns of its other end on both sides as a pixel may depend on.
#[derive(Debug)]
pub struct Wrapped<S> {
    inner: S,
    row: InputRow,
}

impl<S: RowSource> Wrapped<S> {
    /// Wraps the rows of `inner` around.
    pub fn new(inner: S) -> Self {
        let row = InputRow::new(&inner.layout());
        Self { inner, row }
    }

    /// The source of the picture as it is.
    pub fn inner(&self) -> &S {
        &self.inner
    }
}

/// The layout of a picture that is wrapped around.
pub(crate) fn wrapped_layout(layout: RowLayout) -> RowLayout {
    let width = layout.size.width().saturating_add(2 * REACH);
    // an image as wide as a data window can be is not wrapped: it would be wider
    let size = ImageSize::new(width, layout.size.height());
    layout.with_size(size.unwrap_or(layout.size))
}

impl<S: RowSource> RowSource for Wrapped<S> {
    fn layout(&self) -> RowLayout {
        wrapped_layout(self.inner.layout())
    }

    fn read_row(&mut self, y: usize, row: &mut InputRow) -> Result<(), Error> {
        self.inner.read_row(y, &mut self.row)?;
        for (plane, own) in row.planes_mut().zip(self.row.planes()) {
            let before = plane.len().saturating_sub(own.len()) / 2;
            for (x, value) in plane.iter_mut().enumerate() {
                let column = x as isize - before as isize;
                *value = own[column.rem_euclid(own.len() as isize) as usize];
            }
        }
        Ok(())
    }
}

/// Takes off what [`Wrapped`] has put on.
#[derive(Debug)]
pub struct Unwrapped<S> {
    inner: S,
    row: OutputRow,
    width: usize,
}

impl<S: RowSink> Unwrapped<S> {
    /// Passes rows of `layout`'s width, out of the middle of wider ones, to `inner`.
    pub fn new(inner: S, layout: &RowLayout) -> Self {
        Self {
            inner,
            row: OutputRow::new(layout),
            width: layout.size.width(),
        }
    }
}

impl<S: RowSink> RowSink for Unwrapped<S> {
    fn write_row(&mut self, y: usize, row: &OutputRow) -> Result<(), Error> {
        for (own, plane) in self.row.planes_mut().zip(row.planes()) {
            let before = plane.len().saturating_sub(self.width) / 2;
            let width = own.len();
            own.copy_from_slice(&plane[before..before + width]);
        }
        self.inner.write_row(y, &self.row)
    }
}

/// Puts the rows of an area into those of a window, which are 0 elsewhere.
#[derive(Debug)]
pub struct Placed<S> {
    inner: S,
    area: Area,
    height: usize,
    /// A row of the window; `None` where the area is as wide.
    row: Option<OutputRow>,
    /// A row without anything.
    empty: OutputRow,
}

impl<S: RowSink> Placed<S> {
    /// Passes rows of a window of `layout`'s size to `inner`, made of those of `area`.
    pub fn new(inner: S, area: Area, layout: &RowLayout) -> Self {
        let narrower = area.size.width() < layout.size.width();
        Self {
            inner,
            area,
            height: layout.size.height(),
            row: narrower.then(|| OutputRow::new(layout)),
            empty: OutputRow::new(layout),
        }
    }

    /// Passes on the rows of the window from `first` to before `end`, which are empty.
    pub fn write_empty(&mut self, first: usize, end: usize) -> Result<(), Error> {
        (first..end).try_for_each(|y| self.inner.write_row(y, &self.empty))
    }
}

impl<S: RowSink> RowSink for Placed<S> {
    fn write_row(&mut self, y: usize, row: &OutputRow) -> Result<(), Error> {
        let Area { x, y: top, size } = self.area;
        if y == 0 {
            self.write_empty(0, top)?;
        }
        let placed = match &mut self.row {
            None => row,
            Some(own) => {
                for (own, plane) in own.planes_mut().zip(row.planes()) {
                    if let Some(own) = own.get_mut(x..x + plane.len()) {
                        own.copy_from_slice(plane);
                    }
                }
                own
            }
        };
        self.inner.write_row(top + y, placed)?;
        if y + 1 == size.height() {
            self.write_empty(top + y + 1, self.height)?;
        }
        Ok(())
    }
}
