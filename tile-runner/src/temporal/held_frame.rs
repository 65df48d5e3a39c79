//! A neighbouring frame, some of whose rows are held.

use std::collections::BTreeSet;
use std::ops::Range;

use crate::error::Error;
use crate::row::{InputRow, Motion, RowLayout, RowSource};

/// Bytes of rows that are held of a frame: those that the pixels of a row are found in, and some to spare.
const HELD_BYTES: u64 = 8 << 20;
/// Rows that are held at least, and at most.
const HELD_ROWS: Range<u64> = 16..128;

/// Rows that are held of a frame.
pub(super) fn rows_held(layout: &RowLayout) -> usize {
    let rows = HELD_BYTES / InputRow::bytes(layout).max(1);
    rows.clamp(HELD_ROWS.start, HELD_ROWS.end) as usize
}

/// A frame whose rows are read when they are wanted, and held until there are too many: then the farthest from the wanted one goes. What comes out of it
/// does not depend on how many are held, only how often a row is read.
#[derive(Debug)]
pub(super) struct HeldFrame<S> {
    source: S,
    layout: RowLayout,
    /// Boxed, as most rows are not there.
    rows: Vec<Option<Box<InputRow>>>,
    /// Which those are.
    held: BTreeSet<usize>,
    #[expect(clippy::vec_box, reason = "they go to and from the rows as they are")]
    spare: Vec<Box<InputRow>>,
    capacity: usize,
    /// The rows that were wanted since the last [`advance`](Self::advance).
    wanted: Range<usize>,
}

impl<S: RowSource> HeldFrame<S> {
    pub(super) fn new(source: S) -> Self {
        let layout = source.layout();
        Self {
            source,
            layout,
            rows: (0..layout.size.height()).map(|_| None).collect(),
            held: BTreeSet::new(),
            spare: Vec::new(),
            capacity: rows_held(&layout),
            wanted: 0..0,
        }
    }

    pub(super) fn width(&self) -> usize {
        self.layout.size.width()
    }

    pub(super) fn height(&self) -> usize {
        self.layout.size.height()
    }

    pub(super) fn motion(&self) -> Motion {
        self.layout.motion
    }

    /// Row `y` of the frame.
    pub(super) fn row(&mut self, y: usize) -> Result<&InputRow, Error> {
        self.wanted = match self.wanted.is_empty() {
            true => y..y + 1,
            false => self.wanted.start.min(y)..self.wanted.end.max(y + 1),
        };
        self.load(y)?;
        // it was loaded
        Ok(self.rows[y].get_or_insert_with(|| Box::new(InputRow::new(&self.layout))))
    }

    fn load(&mut self, y: usize) -> Result<(), Error> {
        if self.rows[y].is_some() {
            return Ok(());
        }
        if self.held.len() >= self.capacity {
            self.let_go(y);
        }
        let new = || Box::new(InputRow::new(&self.layout));
        let mut row = self.spare.pop().unwrap_or_else(new);
        self.source.read_row(y, &mut row)?;
        self.rows[y] = Some(row);
        self.held.insert(y);
        Ok(())
    }

    /// Lets go of the held row that is farthest from row `y`.
    fn let_go(&mut self, y: usize) {
        let ends = [self.held.first(), self.held.last()];
        let farthest = ends
            .into_iter()
            .flatten()
            .copied()
            .max_by_key(|row| row.abs_diff(y));
        if let Some(row) = farthest {
            self.held.remove(&row);
            self.spare.extend(self.rows[row].take());
        }
    }

    /// Reads ahead what the next row of the frame beside it will want, if it wants what the last one did, a row further down. What cannot be
    /// read is told when it is wanted.
    pub(super) fn advance(&mut self) {
        let height = self.height();
        let next = (self.wanted.start + 1).min(height)..(self.wanted.end + 1).min(height);
        self.wanted = 0..0;
        if next.len() <= self.capacity {
            for y in next {
                if self.load(y).is_err() {
                    return;
                }
            }
        }
    }
}
