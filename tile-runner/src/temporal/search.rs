//! Finds the pixels of a row in another frame by their positions in the world (LPR section 6, whose search compares every pixel of a window).

use crate::error::Error;
use crate::row::{InputRow, RowSource};
use crate::temporal::held_frame::HeldFrame;
use crate::temporal::track::Track;

/// Pixels that begin from where one of them was found.
const SEGMENT: usize = 8;
/// Places across the window, and down it, that are compared for a segment.
const GRID: i32 = 16;
/// Steps at most from there, a pixel each.
const DESCENT: usize = 32;

/// How far a pixel is looked for, across and down: surfaces move by parts of the picture.
fn reach(width: usize) -> i32 {
    (width as i32 / 32).clamp(16, 128)
}

/// Pixels that one moves at most, as far as the search believes.
const FARTHEST: f32 = 1e6;

/// Columns to either side of a pixel whose steps are averaged with its own.
const AVERAGED: usize = 6;
/// By how much those may differ from it, in pixels.
const ALIKE: f32 = 1.5;

/// Finds the pixels of `row`, the frame's row `y`, in another frame. `track` is where they were found in the frame before that, which says where to begin, `beyond` times as far away; and where they are found.
pub(super) fn search<S: RowSource>(
    track: &mut Track,
    row: &InputRow,
    y: usize,
    beyond: f32,
    frame: &mut HeldFrame<S>,
) -> Result<(), Error> {
    let width = frame.width();
    for first in (0..width).step_by(SEGMENT) {
        let pixels = first..width.min(first + SEGMENT);
        let usable = |&x: &usize| point(row, x).is_some();
        let start = match pixels.clone().find(usable) {
            Some(x) => begin(track, row, [x, y], beyond, frame)?,
            None => [0, 0],
        };
        for x in pixels {
            let found = match point(row, x) {
                Some(wanted) => descend(wanted, [x as i32, y as i32], start, frame)?,
                None => None,
            };
            track.set(x, found.map(|place| place.map(|value| value as f32)));
        }
    }
    smooth(track, y as f32);
    Ok(())
}

/// Averages the steps of pixels of row `y` that move alike. The nearest position is that of a pixel, and noise decides which; the mean of several lies between pixels, where the surface is.
fn smooth(track: &mut Track, y: f32) {
    let width = track.x.len();
    let step = |i: usize| [track.x[i] - i as f32, track.y[i] - y];
    let steps: Vec<[f32; 2]> = (0..width).map(step).collect();
    for (i, own) in steps.iter().enumerate() {
        let (mut sum, mut count) = ([0.0; 2], 0.0);
        for step in &steps[i.saturating_sub(AVERAGED)..width.min(i + AVERAGED + 1)] {
            let alike = step.iter().zip(own).all(|(a, b)| (a - b).abs() <= ALIKE);
            if alike {
                sum = [sum[0] + step[0], sum[1] + step[1]];
                count += 1.0;
            }
        }
        // a pixel that was not found is like none, not even itself
        let mean = (count > 0.0).then(|| [i as f32 + sum[0] / count, y + sum[1] / count]);
        track.set(i, mean);
    }
}

/// The position in the world of a pixel.
fn point(row: &InputRow, x: usize) -> Option<[f32; 3]> {
    let position = row.position.each_ref().map(|plane| plane[x]);
    position
        .iter()
        .all(|value| value.is_finite())
        .then_some(position)
}

/// The position in the world of the pixel at `x`, `y`, if there is one.
fn point_at<S: RowSource>(
    frame: &mut HeldFrame<S>,
    [x, y]: [i32; 2],
) -> Result<Option<[f32; 3]>, Error> {
    let (width, rows) = (frame.width(), frame.within());
    match (usize::try_from(x), usize::try_from(y)) {
        (Ok(x), Ok(y)) if x < width && rows.contains(&y) => Ok(point(frame.row(y)?, x)),
        _ => Ok(None),
    }
}

/// Squared distance from `wanted` of what a pixel shows.
fn distance<S: RowSource>(
    wanted: [f32; 3],
    frame: &mut HeldFrame<S>,
    place: [i32; 2],
) -> Result<f32, Error> {
    let point = point_at(frame, place)?;
    Ok(point.map_or(f32::INFINITY, |point| between(point, wanted)))
}

fn between(a: [f32; 3], b: [f32; 3]) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

/// The step to where the pixels of a segment are looked for: the best of a grid around where pixel `x`, `y` should be.
fn begin<S: RowSource>(
    track: &Track,
    row: &InputRow,
    [x, y]: [usize; 2],
    beyond: f32,
    frame: &mut HeldFrame<S>,
) -> Result<[i32; 2], Error> {
    let step = [track.x[x] - x as f32, track.y[x] - y as f32];
    let known = step.iter().all(|step| step.abs() <= FARTHEST);
    let guess = step.map(|step| if known { (step * beyond) as i32 } else { 0 });
    let Some(wanted) = point(row, x) else {
        return Ok(guess);
    };
    // what has been found once is near where it should be
    let reach = if known && beyond > 1.0 {
        4
    } else {
        reach(frame.width())
    };
    let spacing = (2 * reach / GRID).max(1);
    let (mut best, mut least) = (guess, f32::INFINITY);
    for down in (-reach..=reach).step_by(spacing as usize) {
        for right in (-reach..=reach).step_by(spacing as usize) {
            let step = [guess[0] + right, guess[1] + down];
            let place = [x as i32 + step[0], y as i32 + step[1]];
            let distance = distance(wanted, frame, place)?;
            if distance < least {
                (best, least) = (step, distance);
            }
        }
    }
    Ok(best)
}

/// The pixel that shows what is `wanted`, from `start` beside `pixel` on, a pixel at a time.
fn descend<S: RowSource>(
    wanted: [f32; 3],
    pixel: [i32; 2],
    start: [i32; 2],
    frame: &mut HeldFrame<S>,
) -> Result<Option<[i32; 2]>, Error> {
    let mut place = [pixel[0] + start[0], pixel[1] + start[1]];
    let mut least = distance(wanted, frame, place)?;
    for _ in 0..DESCENT {
        let centre = place;
        for (right, down) in [(-1, 0), (1, 0), (0, -1), (0, 1)] {
            let beside = [centre[0] + right, centre[1] + down];
            let distance = distance(wanted, frame, beside)?;
            if distance < least {
                (place, least) = (beside, distance);
            }
        }
        if place == centre {
            break;
        }
    }
    let found = least <= spacing(place, frame)?;
    Ok(found.then_some(place))
}

/// The squared distance from what a pixel shows to what those beside it show, on the same surface.
fn spacing<S: RowSource>([x, y]: [i32; 2], frame: &mut HeldFrame<S>) -> Result<f32, Error> {
    let Some(centre) = point_at(frame, [x, y])? else {
        return Ok(0.0);
    };
    let mut nearer = |sides: [[i32; 2]; 2]| -> Result<f32, Error> {
        let [a, b] = sides;
        let (a, b) = (distance(centre, frame, a)?, distance(centre, frame, b)?);
        Ok(if a < b { a } else { b })
    };
    let across = nearer([[x - 1, y], [x + 1, y]])?;
    let down = nearer([[x, y - 1], [x, y + 1]])?;
    let largest = across.max(down);
    Ok(if largest.is_finite() {
        largest
    } else {
        across.min(down)
    })
}
