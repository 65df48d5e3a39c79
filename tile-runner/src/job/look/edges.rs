//! What is at the edges of a picture: its other end, or nothing.

use std::ops::Range;

use crate::error::Error;
use crate::geometry::ImageSize;
use crate::image::area::Area;
use crate::image::source::ExrSource;
use crate::row::{InputRow, RowSource};

/// Columns or rows that must be empty on some side before an image counts as rendered in part.
const MARGIN: usize = 8;
/// Rows whose steps are averaged, so that they show through noise.
const ROWS: usize = 4;
/// The steps that most are smaller than, as a part of all.
const MOST: f64 = 0.9;
/// How many times as large as those beside it the step over a seam may be.
const STEP: f64 = 2.0;

/// Whether these columns of a row hold nothing in any channel that is read.
pub(super) fn is_empty(row: &InputRow, columns: Range<usize>) -> bool {
    let mut planes = row.planes().filter(|plane| !plane.is_empty());
    planes.all(|plane| {
        plane[columns.clone()]
            .iter()
            .all(|v| *v == 0.0 || v.is_nan())
    })
}

/// The smallest rectangle that holds all that is in the picture, if it is smaller than that by more than a few pixels.
pub(super) fn rendered_area(
    source: &mut ExrSource,
    row: &mut InputRow,
) -> Result<Option<Area>, Error> {
    let size = source.layout().size;
    let (mut left, mut right) = (size.width(), 0);
    let mut rows: Option<(usize, usize)> = None;
    for y in 0..size.height() {
        source.read_row(y, row)?;
        let full = |x: &usize| !is_empty(row, *x..*x + 1);
        let Some(first) = (0..size.width()).find(full) else {
            continue;
        };
        left = left.min(first);
        right = (right..size.width())
            .rev()
            .find(full)
            .map_or(right, |last| last + 1);
        rows = Some((rows.map_or(y, |(top, _)| top), y + 1));
    }
    let Some((top, bottom)) = rows else {
        return Ok(None);
    };
    let margins = [left, size.width() - right, top, size.height() - bottom];
    let part = margins.iter().any(|margin| *margin >= MARGIN);
    let size = ImageSize::new(right - left, bottom - top).filter(|_| part);
    Ok(size.map(|size| Area {
        x: left,
        y: top,
        size,
    }))
}

/// The steps over the seam of a panorama, and those beside it.
#[derive(Debug, Default)]
pub(super) struct Seam {
    rows: usize,
    /// Sums over some rows: the step over the seam, on its left and on its right.
    sums: [f64; 3],
    over: Vec<f64>,
    beside: Vec<f64>,
}

impl Seam {
    pub(super) fn add_row(&mut self, colour: &[Vec<f32>; 3]) {
        let level = |x: usize| colour.iter().map(|plane| f64::from(plane[x])).sum::<f64>();
        let width = colour[0].len();
        if width < 4 {
            return;
        }
        let steps = [
            level(0) - level(width - 1),
            level(width - 1) - level(width - 2),
            level(1) - level(0),
        ];
        self.sums
            .iter_mut()
            .zip(steps)
            .for_each(|(sum, step)| *sum += step);
        self.rows += 1;
        if self.rows.is_multiple_of(ROWS) {
            let [over, left, right] = std::mem::take(&mut self.sums).map(f64::abs);
            self.over.push(over);
            self.beside.extend([left, right]);
        }
    }

    /// Whether the picture goes on over it: most steps are like those beside it.
    pub(super) fn is_closed(&self) -> bool {
        let most = |steps: &[f64]| {
            let mut steps = steps.to_vec();
            steps.sort_by(f64::total_cmp);
            steps.get((steps.len() as f64 * MOST) as usize).copied()
        };
        match (most(&self.over), most(&self.beside)) {
            (Some(over), Some(beside)) => over <= STEP * beside,
            _ => false,
        }
    }
}
