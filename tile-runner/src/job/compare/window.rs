//! The rows around a pixel, the image mirrored at its borders.

use crate::geometry::{ImageSize, plane_bytes};
use crate::stream::row_ring::RowRing;

/// Rows that are held above and below the one that is measured.
pub(super) const RADIUS: usize = 8;

/// Luminance of pixel `x` of a row (Rec. 709). Not finite if one of its channels is not.
pub(super) fn luminance(colour: &[Vec<f32>; 3], x: usize) -> f64 {
    let [red, green, blue] = [0, 1, 2].map(|k| f64::from(colour[k][x]));
    0.2126 * red + 0.7152 * green + 0.0722 * blue
}

/// The luminances of a row of the image and of the reference. Where one is not finite, both are NaN.
pub(super) struct Luminances {
    pub(super) image: Vec<f64>,
    pub(super) reference: Vec<f64>,
}

/// The rows of two images of one size that are within [`RADIUS`] of the row that is measured.
pub(super) struct Window {
    size: ImageSize,
    rows: RowRing<Luminances>,
}

impl Window {
    pub(super) fn new(size: ImageSize) -> Self {
        Self {
            size,
            rows: RowRing::new(),
        }
    }

    /// Bytes of all rows.
    pub(super) fn bytes(size: ImageSize) -> u64 {
        // a double is two floats
        plane_bytes(size, 2 * RADIUS + 1, 2 * 2)
    }

    /// Adds the next row, and gives those to `measure` that have all of their neighbours now.
    pub(super) fn push(
        &mut self,
        image: &[Vec<f32>; 3],
        reference: &[Vec<f32>; 3],
        mut measure: impl FnMut(&Self, usize),
    ) {
        let (width, height) = (self.size.width(), self.size.height());
        let last = self.rows.next();
        let row = self.rows.push(|| Luminances {
            image: vec![0.0; width],
            reference: vec![0.0; width],
        });
        for x in 0..width {
            let pair = (luminance(image, x), luminance(reference, x));
            let finite = pair.0.is_finite() && pair.1.is_finite();
            (row.image[x], row.reference[x]) = if finite { pair } else { (f64::NAN, f64::NAN) };
        }
        let complete = match last + 1 == height {
            true => last.saturating_sub(RADIUS)..height,
            false => last.saturating_sub(RADIUS)..(last + 1).saturating_sub(RADIUS),
        };
        for y in complete {
            measure(self, y);
        }
        self.rows.drop_before((last + 1).saturating_sub(2 * RADIUS));
    }

    /// Row `y`, which may lie beyond the image, up to [`RADIUS`] from the row that is measured.
    pub(super) fn row(&self, y: isize) -> &Luminances {
        self.rows.row(reflected(y, self.size.height()))
    }

    pub(super) fn width(&self) -> usize {
        self.size.width()
    }
}

/// `position` mirrored at both ends of 0..length, the ends repeated: ... 1 0 0 1 ... (numpy's `symmetric`).
pub(super) fn reflected(position: isize, length: usize) -> usize {
    let place = position.rem_euclid(2 * length as isize) as usize;
    place.min(2 * length - 1 - place)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_are_mirrored_as_often_as_it_takes() {
        let three: Vec<usize> = (-5..8).map(|position| reflected(position, 3)).collect();
        assert_eq!(three, [1, 2, 2, 1, 0, 0, 1, 2, 2, 1, 0, 0, 1]);
        assert!((-9..9).all(|position| reflected(position, 1) == 0));
    }
}
