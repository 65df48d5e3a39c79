//! Consecutive rows of something, whose memory is used again.

use std::collections::VecDeque;

/// Rows from `first` on, the oldest first.
pub(crate) struct RowRing<T> {
    first: usize,
    rows: VecDeque<T>,
    spare: Vec<T>,
}

impl<T> RowRing<T> {
    pub(crate) fn new() -> Self {
        Self {
            first: 0,
            rows: VecDeque::new(),
            spare: Vec::new(),
        }
    }

    /// Lets go of every row; the next is row `y`.
    pub(crate) fn restart(&mut self, y: usize) {
        self.spare.extend(self.rows.drain(..));
        self.first = y;
    }

    /// The first row held.
    pub(crate) fn first(&self) -> usize {
        self.first
    }

    /// The row after the last one held.
    pub(crate) fn next(&self) -> usize {
        self.first + self.rows.len()
    }

    /// Adds the next row: one that was let go before, or else a new one, to be filled.
    pub(crate) fn push(&mut self, new: impl FnOnce() -> T) -> &mut T {
        let row = self.spare.pop().unwrap_or_else(new);
        self.rows.push_back(row);
        let last = self.rows.len() - 1;
        &mut self.rows[last]
    }

    /// Lets go of the rows before `y`.
    pub(crate) fn drop_before(&mut self, y: usize) {
        while self.first < y {
            let Some(row) = self.rows.pop_front() else {
                return;
            };
            self.spare.push(row);
            self.first += 1;
        }
    }

    /// Row `y`, which the caller has asked to be held.
    pub(crate) fn row(&self, y: usize) -> &T {
        &self.rows[y - self.first]
    }

    pub(crate) fn row_mut(&mut self, y: usize) -> &mut T {
        &mut self.rows[y - self.first]
    }

    /// The rows from `y` on, with their numbers, to be filled.
    pub(crate) fn rows_from_mut(&mut self, y: usize) -> impl Iterator<Item = (usize, &mut T)> {
        (y..).zip(self.rows.iter_mut().skip(y - self.first))
    }
}
