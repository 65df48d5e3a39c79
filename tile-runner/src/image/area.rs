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

/// A picture whose left and right ends meet: each row with as many columns of its other end on both sides as a pixel may depend on. Or one whose ends do not,
/// as it is.
#[derive(Debug)]
pub struct Wrapped<S> {
    inner: S,
    /// A row without the columns that are put on; `None` if none are.
    row: Option<InputRow>,
}

impl<S: RowSource> Wrapped<S> {
    /// Wraps the rows of `inner` around, if its ends meet.
    pub fn new(inner: S, meets: bool) -> Self {
        let row = meets.then(|| InputRow::new(&inner.layout()));
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
    match ImageSize::new(width, layout.size.height()) {
        Some(size) => RowLayout {
            margin: REACH,
            ..layout.with_size(size)
        },
        None => layout,
    }
}

impl<S: RowSource> RowSource for Wrapped<S> {
    fn layout(&self) -> RowLayout {
        match self.row {
            Some(_) => wrapped_layout(self.inner.layout()),
            None => self.inner.layout(),
        }
    }

    fn read_row(&mut self, y: usize, row: &mut InputRow) -> Result<(), Error> {
        let Some(own) = &mut self.row else {
            return self.inner.read_row(y, row);
        };
        self.inner.read_row(y, own)?;
        for (plane, own) in row.planes_mut().zip(own.planes()) {
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
    /// A row without what was put on; `None` if nothing was.
    row: Option<OutputRow>,
}

impl<S: RowSink> Unwrapped<S> {
    /// Passes rows of `layout` to `inner`, out of the middle of wider ones if the ends of the picture meet.
    pub fn new(inner: S, layout: &RowLayout, meets: bool) -> Self {
        let row = meets.then(|| OutputRow::new(layout));
        Self { inner, row }
    }
}

impl<S: RowSink> RowSink for Unwrapped<S> {
    fn write_row(&mut self, y: usize, row: &OutputRow) -> Result<(), Error> {
        let Some(own) = &mut self.row else {
            return self.inner.write_row(y, row);
        };
        for (own, plane) in own.planes_mut().zip(row.planes()) {
            let before = plane.len().saturating_sub(own.len()) / 2;
            let width = own.len();
            own.copy_from_slice(&plane[before..before + width]);
        }
        self.inner.write_row(y, own)
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
