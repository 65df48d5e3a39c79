//! A neighbouring frame, some of whose rows are held.

use std::collections::BTreeSet;
use std::ops::Range;

use crate::error::Error;
use crate::row::{InputRow, Motion, RowLayout, RowSource};

/// Rows by which a pixel may lie higher or lower in a neighbour: a part of the picture's height, and these at least.
const REACH: usize = 64;
const PARTS_OF_HEIGHT: usize = 8;

/// Rows that are kept beside those that were wanted last.
pub(super) const SPARE: usize = 4;

/// Rows by which pixels are followed up and down.
fn reach(layout: &RowLayout) -> usize {
    REACH.max(layout.size.height() / PARTS_OF_HEIGHT)
}

/// Rows that may be held of a frame so that none is ever read twice: those that the pixels of a row can be in, and one more, for the next row.
pub(super) fn most_rows(layout: &RowLayout) -> usize {
    (2 * reach(layout) + 2).min(layout.size.height())
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
    /// The rows in which pixels are looked for.
    within: Range<usize>,
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
            capacity: most_rows(&layout),
            wanted: 0..0,
            within: 0..layout.size.height(),
        }
    }

    /// Holds at most so many rows, two at least.
    pub(super) fn hold(&mut self, rows: usize) {
        self.capacity = rows.max(2);
    }

    /// Pixels of row `y` of the frame beside it will be looked for.
    pub(super) fn look_from(&mut self, y: usize) {
        let (reach, height) = (reach(&self.layout), self.height());
        self.within = y.saturating_sub(reach)..height.min(y + reach + 1);
    }

    /// The rows in which they are: no others are read for them, so that what turns or is wild does not read the whole frame for each row.
    pub(super) fn within(&self) -> Range<usize> {
        self.within.clone()
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

    /// Reads ahead what the next row of the frame beside it will want, if it wants what the last one did, a row further down; and lets go of what lies far from
    /// that. What cannot be read is told when it is wanted.
    pub(super) fn advance(&mut self) {
        let height = self.height();
        let next = (self.wanted.start + 1).min(height)..(self.wanted.end + 1).min(height);
        self.wanted = 0..0;
        let kept = next.start.saturating_sub(SPARE)..next.end + SPARE;
        let far: Vec<usize> = self
            .held
            .iter()
            .copied()
            .filter(|y| !kept.contains(y))
            .collect();
        for y in far {
            self.held.remove(&y);
            self.spare.extend(self.rows[y].take());
        }
        // what has been let go makes room for as many rows, and no more
        self.spare.truncate(SPARE);
        if next.len() <= self.capacity {
            for y in next {
                if self.load(y).is_err() {
                    return;
                }
            }
        }
    }
}
