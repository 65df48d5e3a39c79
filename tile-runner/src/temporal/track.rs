//! Where the pixels of a row are in the frames beside it.

use std::ops::Range;

use crate::error::Error;
use crate::row::{InputRow, RowSource};
use crate::temporal::held_frame::HeldFrame;

/// Steps at most towards the pixel whose own motion leads back.
const INVERSE_STEPS: usize = 5;
/// Squared pixels by which it may miss.
const INVERSE_MISS: f32 = 1.0;
/// Squared pixels by which the search is content.
const INVERSE_CONTENT: f32 = 1e-4;

/// Where the pixels of a row of the frame are in another: column and row, between pixels; NaN where they are not, or nobody knows.
#[derive(Clone, Debug, Default)]
pub(super) struct Track {
    pub(super) x: Vec<f32>,
    pub(super) y: Vec<f32>,
}

impl Track {
    /// The pixels of row `y` themselves.
    pub(super) fn start(&mut self, width: usize, y: usize) {
        self.x.clear();
        self.x.extend((0..width).map(|x| x as f32));
        self.y.clear();
        self.y.resize(width, y as f32);
    }

    pub(super) fn copy(&mut self, other: &Self) {
        self.x.clone_from(&other.x);
        self.y.clone_from(&other.y);
    }

    pub(super) fn set(&mut self, i: usize, place: Option<[f32; 2]>) {
        [self.x[i], self.y[i]] = place.unwrap_or([f32::NAN; 2]);
    }

    /// The pixel that is nearest to where pixel `i` of the row is, if there is one.
    pub(super) fn pixel(&self, i: usize, width: usize, rows: &Range<usize>) -> Option<[usize; 2]> {
        nearest([self.x[i], self.y[i]], width, rows)
    }
}

/// The pixel that a place lies in, if it is in one of these rows.
fn nearest([x, y]: [f32; 2], width: usize, rows: &Range<usize>) -> Option<[usize; 2]> {
    let index = |value: f32, range: &Range<usize>| {
        let value = (value + 0.5).floor();
        // also false for NaN
        let inside = value >= range.start as f32 && value < range.end as f32;
        inside.then_some(value as usize)
    };
    Some([index(x, &(0..width))?, index(y, rows)?])
}

/// Motion vectors of a row: towards the one neighbour or the other.
pub(super) type Vectors = fn(&InputRow) -> &[Vec<f32>; 2];

fn vector(row: &InputRow, vectors: Vectors, x: usize) -> [f32; 2] {
    vectors(row).each_ref().map(|plane| plane[x])
}

/// Moves on to the next frame by the vectors of the frame where the pixels are.
pub(super) fn follow<S: RowSource>(
    track: &mut Track,
    frame: &mut HeldFrame<S>,
    vectors: Vectors,
) -> Result<(), Error> {
    let (width, rows) = (frame.width(), frame.within());
    for i in 0..width {
        let moved = match track.pixel(i, width, &rows) {
            Some([x, y]) => {
                let [right, down] = vector(frame.row(y)?, vectors, x);
                Some([track.x[i] + right, track.y[i] + down])
            }
            None => None,
        };
        track.set(i, moved);
    }
    Ok(())
}

/// The same from the frame itself, of which `row` is.
pub(super) fn follow_own(track: &mut Track, row: &InputRow, vectors: Vectors) {
    for i in 0..track.x.len() {
        let [right, down] = vector(row, vectors, i);
        track.set(i, Some([track.x[i] + right, track.y[i] + down]));
    }
}

/// Moves on to the frame `next` by its vectors, which lead back: to the pixels from which they lead to where `track` is. `steps` is how far the pixels moved last, from where the search begins; and how far they
/// move now.
pub(super) fn follow_back<S: RowSource>(
    track: &mut Track,
    steps: &mut Track,
    next: &mut HeldFrame<S>,
    vectors: Vectors,
) -> Result<(), Error> {
    for i in 0..next.width() {
        let place = [track.x[i], track.y[i]];
        let step = step_back(place, [steps.x[i], steps.y[i]], next, vectors)?;
        steps.set(i, step);
        track.set(i, step.map(|[x, y]| [place[0] + x, place[1] + y]));
    }
    Ok(())
}

/// The step from `place` to where a vector leads back from.
fn step_back<S: RowSource>(
    place: [f32; 2],
    guess: [f32; 2],
    next: &mut HeldFrame<S>,
    vectors: Vectors,
) -> Result<Option<[f32; 2]>, Error> {
    let (width, rows) = (next.width(), next.within());
    let mut step = guess.map(|value| if value.is_finite() { value } else { 0.0 });
    let (mut best, mut least) = (None, INVERSE_MISS);
    for _ in 0..INVERSE_STEPS {
        let there = [place[0] + step[0], place[1] + step[1]];
        let Some([x, y]) = nearest(there, width, &rows) else {
            break;
        };
        let back = vector(next.row(y)?, vectors, x).map(|value| -value);
        let miss = (back[0] - step[0]).powi(2) + (back[1] - step[1]).powi(2);
        if miss.is_nan() {
            break;
        }
        step = back;
        if miss <= least {
            (best, least) = (Some(back), miss);
        }
        if miss <= INVERSE_CONTENT {
            break;
        }
    }
    Ok(best)
}
