//! What is at the edges of a picture: its other end, or nothing.

use std::ops::Range;

use linpred_core::Feature;

use crate::error::Error;
use crate::geometry::ImageSize;
use crate::image::area::Area;
use crate::image::source::ExrSource;
use crate::row::{InputRow, RowSource};
use crate::stream::NO_SURFACE;

/// Columns or rows that must be empty on some side before an image counts as rendered in part.
const MARGIN: usize = 8;
/// Rows whose steps are averaged, so that they show through noise.
const ROWS: usize = 8;
/// The steps that most are smaller than, as a part of all.
const MOST: f64 = 0.9;
/// How many times as large as those beside it the step over a seam may be.
const STEP: f64 = 2.0;

/// Whether these columns of a row hold nothing in any channel that is read.
pub(super) fn is_empty(row: &InputRow, columns: Range<usize>) -> bool {
    let depth = row.features[Feature::Depth.range().start].as_ptr();
    let nothing = |plane: &Vec<f32>, v: f32| {
        // a depth is often that of the sky where nothing was rendered
        let is_depth = std::ptr::eq(plane.as_ptr(), depth);
        v == 0.0 || v.is_nan() || (is_depth && v.abs() >= NO_SURFACE)
    };
    let mut planes = row.planes().filter(|plane| !plane.is_empty());
    planes.all(|plane| plane[columns.clone()].iter().all(|v| nothing(plane, *v)))
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

/// The steps over the seam of a panorama, and those beside it, of the colour and of each feature, which has less noise.
#[derive(Debug, Default)]
pub(super) struct Seam {
    rows: usize,
    planes: Vec<Steps>,
}

/// Of one plane.
#[derive(Clone, Debug, Default)]
struct Steps {
    /// Sums over some rows: the step over the seam, on its left and on its right.
    sums: [f64; 3],
    over: Vec<f64>,
    beside: Vec<f64>,
}

impl Seam {
    pub(super) fn add_row(&mut self, row: &InputRow) {
        let width = row.colour[0].len();
        if width < 4 {
            return;
        }
        self.rows += 1;
        let features = row.features.iter().filter(|plane| !plane.is_empty());
        let planes: Vec<&Vec<f32>> = row.colour.iter().chain(features).collect();
        self.planes.resize_with(planes.len(), Steps::default);
        for (steps, plane) in self.planes.iter_mut().zip(planes) {
            let value = |x: usize| f64::from(plane[x]);
            let own = [
                value(0) - value(width - 1),
                value(width - 1) - value(width - 2),
                value(1) - value(0),
            ];
            for (sum, step) in steps.sums.iter_mut().zip(own) {
                *sum += if step.is_finite() { step } else { 0.0 };
            }
            if self.rows.is_multiple_of(ROWS) {
                let [over, left, right] = std::mem::take(&mut steps.sums).map(f64::abs);
                steps.over.push(over);
                steps.beside.extend([left, right]);
            }
        }
    }

    /// Whether the picture goes on over it: most steps are like those beside it.
    pub(super) fn is_closed(&self) -> bool {
        !self.planes.is_empty() && self.planes.iter().all(Steps::go_on)
    }
}

impl Steps {
    fn go_on(&self) -> bool {
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
