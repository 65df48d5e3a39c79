//! Predictions of cells, added up in an order that the cells' own does not change.

use std::sync::{Mutex, PoisonError};

use linpred_core::{CELL, HALO, LayerTile, Predictions, Sum, TILE};

use crate::geometry::plane_bytes;
use crate::row::RowLayout;

/// Sums of a row of pixels.
pub(crate) struct SumRow {
    pub(crate) colour: Vec<Sum>,
    /// Of each triple of channels that follow the colour.
    pub(crate) followers: Vec<Vec<[f32; 3]>>,
}

impl SumRow {
    fn new(layout: &RowLayout) -> Self {
        let width = layout.size.width();
        Self {
            colour: vec![Sum::NONE; width],
            followers: vec![vec![[0.0; 3]; width]; layout.followers()],
        }
    }

    /// Forgets the predictions.
    pub(crate) fn clear(&mut self) {
        self.colour.fill(Sum::NONE);
        for layer in &mut self.followers {
            layer.fill([0.0; 3]);
        }
    }

    /// Adds row `ty` of the tile of the cell in column `cell`.
    fn add(&mut self, cell: usize, ty: usize, predictions: &Predictions, layers: &[LayerTile]) {
        // of the tile, where the image begins and ends
        let first = HALO.saturating_sub(cell * CELL);
        let last = TILE.min(self.colour.len() + HALO - cell * CELL);
        let from = ty * TILE + first..ty * TILE + last;
        let to = cell * CELL + first - HALO;
        let layers = layers.iter().map(|layer| &layer.sums[from.clone()]);
        self.add_from(to, &predictions.sums[from.clone()], layers);
    }

    /// Adds all of `other` and leaves it without predictions.
    pub(crate) fn take(&mut self, other: &mut Self) {
        self.add_from(0, &other.colour, other.followers.iter().map(Vec::as_slice));
        other.clear();
    }

    /// Adds sums to those from column `first` on.
    fn add_from<'a>(
        &mut self,
        first: usize,
        colour: &[Sum],
        layers: impl Iterator<Item = &'a [[f32; 3]]>,
    ) {
        for (sum, own) in self.colour[first..].iter_mut().zip(colour) {
            sum.add(own);
        }
        for (sums, layer) in self.followers.iter_mut().zip(layers) {
            let values = layer.as_flattened();
            for (sum, value) in sums[first..].as_flattened_mut().iter_mut().zip(values) {
                *sum += value;
            }
        }
    }
}

/// Sums of predictions of the rows that some rows of cells can reach, for each row of cells by itself: what is in which order is added up does not depend on how many are
/// worked on together.
pub(crate) struct SumRows {
    /// The first row of the first row of cells.
    first: isize,
    height: usize,
    /// Of each row of cells, as many rows as a tile has.
    own: Vec<[Vec<SumRow>; 2]>,
    /// What the row of cells before has left in the first rows, of its halo.
    before: Vec<SumRow>,
}

/// Rows that two rows of cells reach.
const OVERLAP: usize = TILE - CELL;

impl SumRows {
    /// Sums for the first `cell_rows` rows of cells.
    pub(crate) fn new(layout: &RowLayout, cell_rows: usize) -> Self {
        let rows = |count| (0..count).map(|_| SumRow::new(layout)).collect();
        Self {
            first: -(HALO as isize),
            height: layout.size.height(),
            own: (0..cell_rows).map(|_| [CELL, OVERLAP].map(rows)).collect(),
            before: rows(OVERLAP),
        }
    }

    /// Bytes of the sums.
    pub(crate) fn bytes(layout: &RowLayout, cell_rows: usize) -> u64 {
        let planes = size_of::<Sum>() / size_of::<f32>() + 3 * layout.followers();
        plane_bytes(layout.size, cell_rows * TILE + OVERLAP, planes)
    }

    /// Takes the cells of each row of cells, from several threads.
    pub(crate) fn adding(&mut self) -> Vec<Adding<'_>> {
        let (first, height) = (self.first, self.height as isize);
        let cell_rows = (0..).zip(&mut self.own);
        let adding = cell_rows.map(|(n, own)| {
            let first = first + n * CELL as isize;
            let rows = own.iter_mut().flatten().enumerate();
            // of the tiles, where the image is
            let inside = rows.filter(|(ty, _)| (0..height).contains(&(first + *ty as isize)));
            Adding {
                rows: inside.map(|(ty, row)| (ty, Mutex::new(row))).collect(),
            }
        });
        adding.collect()
    }

    /// From row `y` on, the sums of the row of cells whose they are, and what the one before has left in them, which [`SumRow::take`] is to add.
    pub(crate) fn rows_from(
        &mut self,
        y: usize,
    ) -> impl Iterator<Item = (&mut SumRow, Option<&mut SumRow>)> {
        let start = (y as isize - self.first) as usize;
        let mut rows = Vec::new();
        let mut left = &mut self.before;
        for [own, below] in &mut self.own {
            let before = left.iter_mut().map(Some);
            rows.extend(
                own.iter_mut()
                    .zip(before.chain(std::iter::repeat_with(|| None))),
            );
            left = below;
        }
        rows.extend(left.iter_mut().map(|own| (own, None)));
        rows.into_iter().skip(start)
    }

    /// Moves on by `cell_rows` rows of cells. The rows that no later cell reaches have been cleared, as has what was left before.
    pub(crate) fn advance(&mut self, cell_rows: usize) {
        if let Some([_, below]) = cell_rows
            .checked_sub(1)
            .and_then(|last| self.own.get_mut(last))
        {
            std::mem::swap(below, &mut self.before);
        }
        self.first += (cell_rows * CELL) as isize;
    }
}

/// The rows that a row of cells adds up. A row is locked while it is added to, so that threads wait for one another no longer
/// than that takes.
pub(crate) struct Adding<'a> {
    /// With their places in a tile.
    rows: Vec<(usize, Mutex<&'a mut SumRow>)>,
}

impl Adding<'_> {
    /// Adds the predictions of the cell in column `cell`. No pixel is reached by more than two cells of a row, and the sum of two
    /// floats does not depend on their order.
    pub(crate) fn add(&self, cell: usize, predictions: &Predictions, layers: &[LayerTile]) {
        const { assert!(2 * HALO < CELL) };
        for (ty, row) in &self.rows {
            // A thread that panicked takes the run down with it; the sums are of no use then.
            let mut row = row.lock().unwrap_or_else(PoisonError::into_inner);
            row.add(cell, *ty, predictions, layers);
        }
    }
}
