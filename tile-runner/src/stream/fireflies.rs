//! Fireflies taken out of the rows that are held, before anything is made of them.
//!
//! A row is judged once those below it that decide are there, and by the rows as they came: what was taken out above still counts as a neighbour, so
//! that no order of rows or columns changes what is found.

use linpred_core::{FIREFLY_HALO, FIREFLY_ROWS, find_fireflies};

use crate::geometry::ImageSize;
use crate::row::{RowLayout, VarianceKind};
use crate::stream::held_rows::HeldRows;
use crate::stream::row_ring::RowRing;

/// The luminance of the rows that decide over the next one, as it came.
pub(crate) struct Fireflies {
    size: ImageSize,
    /// Whether the variances say what is noise.
    stated: bool,
    /// With the columns beyond the image that decide, which are black.
    luminance: RowRing<Vec<f32>>,
    /// A row beyond the image.
    black: Vec<f32>,
    /// The next row to judge.
    next: usize,
}

impl Fireflies {
    pub(crate) fn new(layout: &RowLayout) -> Self {
        Self {
            size: layout.size,
            stated: layout.variance != VarianceKind::Estimated,
            luminance: RowRing::new(),
            black: vec![0.0; columns(layout.size)],
            next: 0,
        }
    }

    /// Bytes that it takes at most.
    pub(crate) fn bytes(layout: &RowLayout) -> u64 {
        let row = columns(layout.size) * size_of::<f32>();
        (row as u64).saturating_mul(FIREFLY_ROWS as u64 + 1)
    }

    /// Takes the fireflies out of the rows that can be judged now that the last one of `held` is there.
    pub(crate) fn follow(&mut self, held: &mut HeldRows) {
        let size = self.size;
        let row = self.luminance.push(|| vec![0.0; columns(size)]);
        let (_, newest) = held.row_mut(held.next() - 1);
        row[FIREFLY_HALO..FIREFLY_HALO + size.width()].copy_from_slice(&newest.luminance);
        let end = match held.next() {
            next if next == size.height() => next,
            next => next.saturating_sub(FIREFLY_HALO),
        };
        while self.next < end {
            self.judge(held);
            self.next += 1;
            let first = self.next.saturating_sub(FIREFLY_HALO);
            self.luminance.drop_before(first);
        }
    }

    fn judge(&self, held: &mut HeldRows) {
        let around: [&[f32]; FIREFLY_ROWS] = std::array::from_fn(|i| {
            let y = (self.next + i).checked_sub(FIREFLY_HALO);
            match y.filter(|y| *y < self.size.height()) {
                Some(y) => self.luminance.row(y).as_slice(),
                None => &self.black,
            }
        });
        let (colours, guides) = held.row_mut(self.next);
        let variance = self.stated.then_some(colours.variance.as_slice());
        find_fireflies(&around, variance, &mut colours.firefly);
        for x in 0..self.size.width() {
            if colours.firefly[x] {
                colours.spoil(x);
                guides.spoil(x);
            }
        }
    }
}

/// Columns of a row of luminance.
fn columns(size: ImageSize) -> usize {
    size.width() + 2 * FIREFLY_HALO
}
