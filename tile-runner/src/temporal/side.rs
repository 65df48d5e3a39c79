//! The neighbours on one side of a frame, which its pixels are followed through.

use crate::error::Error;
use crate::row::{InputRow, Motion, RowSource};
use crate::temporal::neighbour::Neighbour;
use crate::temporal::search::search;
use crate::temporal::track::{Track, Vectors, follow, follow_back, follow_own};

/// Which way a side lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Direction {
    Before,
    After,
}

impl Direction {
    /// The vectors that lead away from the frame, and those that lead back to it.
    fn vectors(self) -> [Vectors; 2] {
        let (backward, forward): (Vectors, Vectors) = (|row| &row.backward, |row| &row.forward);
        match self {
            Self::Before => [backward, forward],
            Self::After => [forward, backward],
        }
    }

    /// Whether a frame has those.
    fn has(self, motion: Motion) -> [bool; 2] {
        match self {
            Self::Before => [motion.backward, motion.forward],
            Self::After => [motion.forward, motion.backward],
        }
    }
}

/// The neighbours of a side, nearest first.
pub(super) struct Side<S> {
    direction: Direction,
    pub(super) neighbours: Vec<Neighbour<S>>,
    /// Where the pixels of the row at work are in the frame that was reached.
    track: Track,
    /// How far they moved last.
    steps: Track,
}

impl<S: RowSource> Side<S> {
    pub(super) fn new(direction: Direction, sources: Vec<S>) -> Self {
        Self {
            direction,
            neighbours: sources.into_iter().map(Neighbour::new).collect(),
            track: Track::default(),
            steps: Track::default(),
        }
    }

    /// Begins anew at row `y`.
    pub(super) fn begin(&mut self, y: usize) {
        self.neighbours.iter_mut().for_each(|one| one.begin(y));
    }

    /// Finds the pixels of row `y` of the frame, which is `row` and tells of motion what `own` says, in every neighbour.
    pub(super) fn find(&mut self, row: &InputRow, y: usize, own: Motion) -> Result<(), Error> {
        self.track.start(row.colour[0].len(), y);
        self.begin_steps(row, own);
        self.neighbours
            .iter_mut()
            .for_each(|one| one.frame.look_from(y));
        for distance in 0..self.neighbours.len() {
            let (passed, ahead) = self.neighbours.split_at_mut(distance);
            let (Some(next), last) = (ahead.first_mut(), passed.last_mut()) else {
                return Ok(());
            };
            let from = last.as_ref().map_or(own, |last| last.frame.motion());
            let [away, back] = self.direction.vectors();
            let [leads_away, _] = self.direction.has(from);
            let [_, leads_back] = self.direction.has(next.frame.motion());
            if leads_away {
                match last {
                    Some(last) => follow(&mut self.track, &mut last.frame, away)?,
                    None => follow_own(&mut self.track, row, away),
                }
            } else if leads_back {
                follow_back(&mut self.track, &mut self.steps, &mut next.frame, back)?;
            } else if own.position && next.frame.motion().position {
                let beyond = (distance + 1) as f32 / distance.max(1) as f32;
                search(&mut self.track, row, y, beyond, &mut next.frame)?;
            }
            next.track.copy(&self.track);
        }
        Ok(())
    }

    /// Pixels are taken to move as they did on the other side.
    fn begin_steps(&mut self, row: &InputRow, own: Motion) {
        self.steps.copy(&self.track);
        let [_, back] = self.direction.vectors();
        let [_, leads_back] = self.direction.has(own);
        for x in 0..row.colour[0].len() {
            let step = match leads_back {
                true => back(row).each_ref().map(|plane| -plane[x]),
                false => [0.0; 2],
            };
            self.steps.set(x, Some(step));
        }
    }
}
