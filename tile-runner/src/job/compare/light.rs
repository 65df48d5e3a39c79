//! Light lost or won locally.

use crate::geometry::{ImageSize, plane_bytes};

use super::window::{RADIUS, Window, reflected};

/// Added to the reference's mean, so that black places do not rule.
const FLOOR: f64 = 0.01;
/// From which relative difference on a place is off.
const OFF: f64 = 0.05;

/// Means over 17 x 17 pixels of the image against those of the reference.
pub(super) struct LocalLight {
    pixels: u64,
    relative: f64,
    off: u64,
    /// Sums over 17 rows, mirrored beyond both ends.
    columns: Vec<Sums>,
}

/// Sums over the pixels that are finite.
#[derive(Clone, Copy, Default)]
struct Sums {
    image: f64,
    reference: f64,
    pixels: f64,
}

impl Sums {
    fn add(&mut self, other: Self) {
        self.image += other.image;
        self.reference += other.reference;
        self.pixels += other.pixels;
    }

    /// How far the image's mean is from the reference's, relative to that.
    fn difference(&self) -> f64 {
        let (image, reference) = (self.image / self.pixels, self.reference / self.pixels);
        (image - reference) / (reference + FLOOR)
    }
}

impl LocalLight {
    pub(super) fn new(size: ImageSize) -> Self {
        Self {
            pixels: 0,
            relative: 0.0,
            off: 0,
            columns: vec![Sums::default(); size.width() + 2 * RADIUS],
        }
    }

    /// Bytes of the sums of columns.
    pub(super) fn bytes(size: ImageSize) -> u64 {
        plane_bytes(size, 1, size_of::<Sums>() / size_of::<f32>())
            .saturating_add((2 * RADIUS * size_of::<Sums>()) as u64)
    }

    /// Adds row `y`. Pixels that are not finite are in no mean, and no mean is taken around them.
    pub(super) fn add_row(&mut self, window: &Window, y: usize) {
        self.sum_columns(window, y);
        let centres = &window.row(y as isize).image;
        for (x, boxed) in self.columns.windows(2 * RADIUS + 1).enumerate() {
            if centres[x].is_nan() {
                continue;
            }
            let mut sums = Sums::default();
            boxed.iter().for_each(|&column| sums.add(column));
            let difference = sums.difference();
            self.pixels += 1;
            self.relative += difference;
            self.off += u64::from(difference.abs() > OFF);
        }
    }

    fn sum_columns(&mut self, window: &Window, y: usize) {
        let width = window.width();
        let inside = &mut self.columns[RADIUS..RADIUS + width];
        inside.fill(Sums::default());
        for row in y as isize - RADIUS as isize..=(y + RADIUS) as isize {
            let row = window.row(row);
            for (x, column) in inside.iter_mut().enumerate() {
                if !row.image[x].is_nan() {
                    column.add(Sums {
                        image: row.image[x],
                        reference: row.reference[x],
                        pixels: 1.0,
                    });
                }
            }
        }
        for beyond in 0..RADIUS {
            let left = reflected(beyond as isize - RADIUS as isize, width);
            let right = reflected((width + beyond) as isize, width);
            self.columns[beyond] = self.columns[RADIUS + left];
            self.columns[RADIUS + width + beyond] = self.columns[RADIUS + right];
        }
    }

    /// The mean relative difference.
    pub(super) fn bias(&self) -> f64 {
        self.relative / self.pixels as f64
    }

    /// The share of the pixels where it is beyond 5 %.
    pub(super) fn off5(&self) -> f64 {
        self.off as f64 / self.pixels as f64
    }
}
