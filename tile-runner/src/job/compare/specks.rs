//! Single pixels far darker or brighter than what is around them, where the reference has no such pixel.

use super::window::{Window, reflected};

/// Share of the reference's mean that is added to all luminances, so that specks nobody sees are not counted.
const FLOOR: f64 = 0.02;
/// A pinhole is darker than this times the median of the 25 pixels around.
const HOLE_OF_MEDIAN: f64 = 0.4;
/// And darker than this times the darkest of the reference's 9.
const HOLE_OF_DARKEST: f64 = 0.5;
/// A spark is brighter than this times that median.
const SPARK_OF_MEDIAN: f64 = 2.5;
/// And brighter than this times the brightest of the reference's 9.
const SPARK_OF_BRIGHTEST: f64 = 2.0;

/// Counts specks.
pub(super) struct Specks {
    level: f64,
    pixels: u64,
    pinholes: u64,
    sparks: u64,
}

impl Specks {
    /// Specks against a reference of this mean luminance.
    pub(super) fn new(mean: f64) -> Self {
        Self {
            level: FLOOR * mean,
            pixels: 0,
            pinholes: 0,
            sparks: 0,
        }
    }

    /// Counts those of row `y`. Pixels that are not finite are neither specks nor neighbours.
    pub(super) fn add_row(&mut self, window: &Window, y: usize) {
        let centres = &window.row(y as isize).image;
        for (x, &centre) in centres.iter().enumerate() {
            if centre.is_nan() {
                continue;
            }
            self.pixels += 1;
            let (darkest, brightest) = extremes(window, x, y);
            let pixel = centre + self.level;
            let hole = pixel < HOLE_OF_DARKEST * (darkest + self.level);
            let spark = pixel > SPARK_OF_BRIGHTEST * (brightest + self.level);
            // few pixels get so far: the median is what costs
            if hole || spark {
                let median = median(window, x, y) + self.level;
                self.pinholes += u64::from(hole && pixel < HOLE_OF_MEDIAN * median);
                self.sparks += u64::from(spark && pixel > SPARK_OF_MEDIAN * median);
            }
        }
    }

    /// Per megapixel.
    pub(super) fn pinholes(&self) -> f64 {
        self.pinholes as f64 / self.pixels as f64 * 1e6
    }

    /// Per megapixel.
    pub(super) fn sparks(&self) -> f64 {
        self.sparks as f64 / self.pixels as f64 * 1e6
    }
}

/// The least and the largest luminance of the reference's 3 x 3 pixels around.
fn extremes(window: &Window, x: usize, y: usize) -> (f64, f64) {
    let mut extremes = (f64::INFINITY, f64::NEG_INFINITY);
    for row in y as isize - 1..=y as isize + 1 {
        let row = &window.row(row).reference;
        for column in x as isize - 1..=x as isize + 1 {
            // NaN changes neither
            let value = row[reflected(column, row.len())];
            extremes = (extremes.0.min(value), extremes.1.max(value));
        }
    }
    extremes
}

/// The median luminance of the image's 5 x 5 pixels around a pixel that is finite.
fn median(window: &Window, x: usize, y: usize) -> f64 {
    let mut values = [0.0; 25];
    let mut count = 0;
    for row in y as isize - 2..=y as isize + 2 {
        let row = &window.row(row).image;
        for column in x as isize - 2..=x as isize + 2 {
            let value = row[reflected(column, row.len())];
            if !value.is_nan() {
                values[count] = value;
                count += 1;
            }
        }
    }
    let values = &mut values[..count];
    values.sort_unstable_by(f64::total_cmp);
    0.5 * (values[(count - 1) / 2] + values[count / 2])
}
