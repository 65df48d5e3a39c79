//! Where an image is worst, in pieces that one can look at.

use crate::geometry::ImageSize;

use super::pixels::{WORST, keep_worst};

/// Side of a place in pixels.
pub const PLACE: usize = 32;

/// A square of 32 x 32 pixels far from the reference; smaller where the image ends.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct WorstPlace {
    /// Its first column, a multiple of 32.
    pub x: usize,
    /// Its first row, a multiple of 32.
    pub y: usize,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Sum of its pixels' relative squared errors over 1024 pixels. Pixels that are not finite, or beyond the image, count as without error.
    pub error: f64,
}

/// How many places are listed of an image of this size: five, or as many as it has.
pub fn worst_places(size: ImageSize) -> usize {
    let places = size.width().div_ceil(PLACE) * size.height().div_ceil(PLACE);
    places.min(WORST)
}

/// Sums of the errors of the row of places that is being read.
pub(super) struct Places {
    size: ImageSize,
    sums: Vec<f64>,
    worst: Vec<WorstPlace>,
}

impl Places {
    pub(super) fn new(size: ImageSize) -> Self {
        Self {
            size,
            sums: vec![0.0; size.width().div_ceil(PLACE)],
            worst: Vec::new(),
        }
    }

    /// Bytes of the sums.
    pub(super) fn bytes(size: ImageSize) -> u64 {
        (size.width().div_ceil(PLACE) * size_of::<f64>()) as u64
    }

    /// Adds the errors of row `y`.
    pub(super) fn add_row(&mut self, y: usize, errors: &[f32]) {
        for (sum, errors) in self.sums.iter_mut().zip(errors.chunks(PLACE)) {
            let numbers = errors.iter().filter(|error| !error.is_nan());
            *sum += numbers.map(|&error| f64::from(error)).sum::<f64>();
        }
        let height = y % PLACE + 1;
        if height < PLACE && y + 1 < self.size.height() {
            return;
        }
        for (column, sum) in self.sums.iter_mut().enumerate() {
            let x = column * PLACE;
            let place = WorstPlace {
                x,
                y: y + 1 - height,
                width: PLACE.min(self.size.width() - x),
                height,
                error: std::mem::take(sum) / (PLACE * PLACE) as f64,
            };
            keep_worst(&mut self.worst, place, |place| place.error);
        }
    }

    /// The worst places, worst first: [`worst_places`] of them.
    pub(super) fn finish(self) -> Vec<WorstPlace> {
        self.worst
    }
}
