//! What neighbouring frames of a sequence tell each other: rows of a frame that is helped by those beside it.
//!
//! [`Temporal`] stands between the frames' own sources and the pipeline, which knows nothing of it: a pixel is averaged with the pixels of the neighbours that show
//! the same surface, as far as they tell the truth, and what comes out is a row of a frame with less noise.
//!
//! ```text
//! the neighbours' rows         any, in any order                                       HeldFrame
//!   where pixels are in them     row y + 7      motion vectors, or a search              Track
//!     their pixels                 y .. y + 7     nearest ones, nothing is resampled       Planes
//!       how they differ              y - 7 .. y + 7  over 3 x 3 and 15 x 15                  Comparison
//!         averaged                     y               [`linpred_core::weigh_frames`]          InputRow
//! ```
//!
//! A frame reads its neighbours anew, and nothing is passed on from one to the next: the bits of one frame are those of the whole run.

mod held_frame;
mod neighbour;
mod planes;
mod search;
mod side;
mod track;

use std::fmt::{self, Debug};
use std::num::NonZeroUsize;

use linpred_core::TEMPORAL_RADIUS;
use linpred_dispatch::InstructionSet;
use rayon::prelude::*;

use crate::error::Error;
use crate::geometry::plane_bytes;
use crate::row::{InputRow, Motion, RowLayout, RowSource, VarianceKind};
use crate::stream::finish::planes::{Plane, padded_bytes};
use crate::stream::row_ring::RowRing;
use crate::stream::sum_of_variances;
use crate::stream::threads::{Threads, pool, stack_bytes};
use crate::temporal::held_frame::most_rows;
use crate::temporal::neighbour::{Comparison, Neighbour};
use crate::temporal::planes::{Planes, averaged_mut};
use crate::temporal::side::{Direction, Side};

/// Rows of a neighbour that wait to be filled again.
const HELD_BESIDE: usize = held_frame::SPARE;

/// A frame of a sequence and its neighbours, as one source of rows.
///
/// Layers and alpha are averaged as the colour is, so that layers still sum to it; channels that are no light stay the frame's own. Pixels without noise do, too, and pixels that are not finite.
pub struct Temporal<S> {
    own: S,
    /// What the frames' rows hold.
    frames: RowLayout,
    /// What its own rows hold.
    layout: RowLayout,
    rows: RowRing<OwnRow>,
    comparison: Comparison,
    sides: [Side<S>; 2],
    /// What a plane is averaged into.
    averages: Vec<Plane>,
    pool: Threads,
    instruction_set: InstructionSet,
    /// Whether a frame tells how its surfaces move.
    moves: bool,
    /// Pixels averaged so far.
    pixels: u64,
}

/// A row of the frame.
struct OwnRow {
    input: InputRow,
    planes: Planes,
}

impl<S: Debug> Debug for Temporal<S> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let neighbours = self.sides.each_ref().map(|side| side.neighbours.len());
        let mut told = f.debug_struct("Temporal");
        told.field("own", &self.own)
            .field("neighbours", &neighbours);
        told.finish_non_exhaustive()
    }
}

impl<S: RowSource> Temporal<S> {
    /// The frame `own`, helped by the frames `before` it and `after` it, each nearest first. Their rows are asked for in any order, and some of them several times; those of `own` from top
    /// to bottom. They may lack the scalars that the frame has. Where nothing tells how surfaces move, and no variances how noisy they are, neighbours do not help: a difference may be either.
    ///
    /// [`Error::Usage`] if a neighbour's rows do not hold what the frame's do, [`Error::Budget`] if the system gives no threads.
    pub fn new(
        own: S,
        before: Vec<S>,
        after: Vec<S>,
        threads: NonZeroUsize,
    ) -> Result<Self, Error> {
        let layout = own.layout();
        let frames = RowLayout {
            scalars: 0,
            samples: false,
            ..layout
        };
        let others = before.iter().chain(&after).map(RowSource::layout);
        let mut moves = layout.motion != Motion::default();
        for other in others {
            moves |= other.motion != Motion::default();
            let same = RowLayout {
                scalars: 0,
                samples: false,
                motion: layout.motion,
                ..other
            };
            if same != frames {
                return Err(Error::Usage(
                    "a neighbouring frame has another size than the frame, or other features, variances or layers".into(),
                ));
            }
        }
        let width = layout.size.width();
        Ok(Self {
            own,
            frames,
            layout: layout.with_motion(Motion::default()).with_frames(),
            rows: RowRing::new(),
            comparison: Comparison::new(width),
            sides: [
                Side::new(Direction::Before, before),
                Side::new(Direction::After, after),
            ],
            averages: Planes::new(&frames).planes,
            pool: pool(threads)?,
            instruction_set: InstructionSet::detect(),
            moves,
            pixels: 0,
        })
    }

    /// The frame that is helped.
    pub fn own(&self) -> &S {
        &self.own
    }

    /// Holds at most so many rows of each neighbour. With [`most_rows`](Self::most_rows) no row is read twice; with fewer some are, where the pixels of a row are found in more rows than that, as where a camera rolls. The
    /// bits do not depend on it.
    pub fn holding(mut self, rows: usize) -> Self {
        for side in &mut self.sides {
            side.neighbours
                .iter_mut()
                .for_each(|one| one.frame.hold(rows));
        }
        self
    }

    /// The most rows that it holds of each neighbour, for frames of this layout: a pixel is looked for no farther up or down than an eighth of the picture's height, or 64 rows.
    pub fn most_rows(layout: &RowLayout) -> usize {
        most_rows(layout)
    }

    /// Bytes that it takes at most beside its sources, for frames of this layout with so many neighbours before and after, of each of which it holds so many rows.
    pub fn bytes(
        layout: &RowLayout,
        [before, after]: [usize; 2],
        held: usize,
        threads: NonZeroUsize,
    ) -> u64 {
        let (neighbours, width) = (before + after, layout.size.width());
        let rows = TEMPORAL_RADIUS + 1;
        let planes = Planes::count(layout);
        let averaged = (neighbours + 1) * rows * planes + planes;
        let compared = (neighbours + 1) * Comparison::PLANES + neighbours;
        let held =
            InputRow::bytes(layout).saturating_mul((neighbours * (held + HELD_BESIDE)) as u64);
        let tables = (size_of::<usize>() * neighbours * layout.size.height()) as u64;
        [
            padded_bytes(width, averaged + compared),
            InputRow::bytes(layout).saturating_mul(rows as u64),
            plane_bytes(layout.size, 1, 4 * neighbours),
            held,
            tables,
            stack_bytes(threads.get() as u64),
        ]
        .into_iter()
        .fold(0, u64::saturating_add)
    }

    /// Of each neighbour, before and after the frame, the mean weight of its pixels so far, 1 for one whose pixels are all as good as the frame's own.
    pub fn weights(&self) -> [Vec<f64>; 2] {
        let pixels = self.pixels.max(1) as f64;
        let of_side = |side: &Side<S>| {
            let neighbours = side.neighbours.iter();
            neighbours.map(|one| one.weight / pixels).collect()
        };
        self.sides.each_ref().map(of_side)
    }

    /// Reads the next row of the frame, and finds its pixels in the neighbours.
    fn push(&mut self) -> Result<(), Error> {
        let y = self.rows.next();
        let (layout, frames) = (self.own.layout(), self.frames);
        let row = self.rows.push(|| OwnRow {
            input: InputRow::new(&layout),
            planes: Planes::new(&frames),
        });
        self.own.read_row(y, &mut row.input)?;
        row.planes.take(&row.input);
        row.planes.pad();
        let (row, instruction_set) = (&*row, self.instruction_set);
        self.comparison.push_own(&row.planes, instruction_set);
        let [before, after] = &mut self.sides;
        self.pool.install(|| {
            both(before, after).for_each(|one| one.frame.advance());
            let (first, second) = rayon::join(
                || before.find(&row.input, y, frames.motion),
                || after.find(&row.input, y, frames.motion),
            );
            first.and(second)?;
            both(before, after).try_for_each(|one| one.push(&row.planes, &frames, instruction_set))
        })
    }

    /// Averages row `y`, which is there with those around it.
    fn average(&mut self, y: usize) {
        let (height, instruction_set) = (self.layout.size.height(), self.instruction_set);
        let known = self.layout.variance != VarianceKind::Estimated;
        let moves = self.moves;
        let [before, after] = &mut self.sides;
        let (comparison, averages) = (&mut self.comparison, &mut self.averages);
        let own = &self.rows.row(y).planes;
        self.pool.install(|| {
            comparison.measure(y, height, instruction_set);
            both(before, after).for_each(|one| {
                one.comparison.measure(y, height, instruction_set);
                one.change_depths(y);
            });
            let measured = comparison.measured();
            let neighbours = before.neighbours.iter_mut().chain(&mut after.neighbours);
            let mut others: Vec<_> = neighbours
                .map(|one| (one.comparison.measured(), one.weights.padded_mut()))
                .collect();
            let alike = match (moves, known) {
                (true, _) => 1.0,
                (false, true) => others.len() as f32,
                // no weight is left
                (false, false) => f32::INFINITY,
            };
            instruction_set.weigh_frames(&measured, &mut others, alike, known);
            let neighbours = before.neighbours.iter().chain(&after.neighbours);
            let neighbours: Vec<_> = neighbours
                .map(|one| (one.weights.padded(), one.pixels.row(y)))
                .collect();
            averages
                .par_iter_mut()
                .enumerate()
                .for_each(|(place, average)| {
                    if average.is_some() {
                        let others: Vec<_> = neighbours
                            .iter()
                            .map(|(weights, pixels)| (*weights, pixels.planes[place].padded()))
                            .collect();
                        let own = own.planes[place].padded();
                        let output = average.padded_mut();
                        instruction_set.average_frames(own, &others, Planes::what(place), output);
                    }
                });
        });
    }

    /// Writes what was averaged of row `y`, and lets go of it.
    fn write(&mut self, y: usize, row: &mut InputRow) {
        let input = &self.rows.row(y).input;
        for (own, average) in averaged_mut(row).zip(&self.averages) {
            if average.is_some() {
                own.copy_from_slice(average.image());
            }
        }
        for (own, scalar) in row.scalars.iter_mut().zip(&input.scalars) {
            own.copy_from_slice(scalar);
        }
        row.samples.copy_from_slice(&input.samples);
        let known = self.layout.variance != VarianceKind::Estimated;
        let [light, variance] = &mut row.light;
        let ([red, green, blue], [r, g, b]) = (&input.colour, &input.variance);
        for x in 0..light.len() {
            light[x] = (red[x] + green[x] + blue[x]) * (1.0 / 3.0);
            let channels = [[r[x], red[x]], [g[x], green[x]], [b[x], blue[x]]];
            variance[x] = if known {
                sum_of_variances(channels)
            } else {
                f32::NAN
            };
        }
        row.frames.fill(1.0);
        for side in &mut self.sides {
            for one in &mut side.neighbours {
                one.count();
                one.pixels.drop_before(y + 1);
                let frames = row.frames.iter_mut().zip(one.weights.image());
                frames.for_each(|(frames, weight)| *frames += weight);
            }
        }
        self.pixels += row.frames.len() as u64;
        self.rows.drop_before(y + 1);
    }
}

/// The neighbours of both sides, for threads to work on.
fn both<'a, S: RowSource>(
    before: &'a mut Side<S>,
    after: &'a mut Side<S>,
) -> impl ParallelIterator<Item = &'a mut Neighbour<S>> {
    before
        .neighbours
        .par_iter_mut()
        .chain(&mut after.neighbours)
}

impl<S: RowSource> RowSource for Temporal<S> {
    fn layout(&self) -> RowLayout {
        self.layout
    }

    /// Rows are cheapest one after the other; any other order begins anew.
    fn read_row(&mut self, y: usize, row: &mut InputRow) -> Result<(), Error> {
        let height = self.layout.size.height();
        let (first, end) = (
            y.saturating_sub(TEMPORAL_RADIUS),
            height.min(y + TEMPORAL_RADIUS + 1),
        );
        let goes_on = self.rows.first() == y && (y == 0 || self.rows.next() > y);
        if !goes_on {
            self.rows.restart(first);
            self.comparison.begin(first);
            self.sides.iter_mut().for_each(|side| side.begin(first));
        }
        while self.rows.next() < end {
            self.push()?;
        }
        self.average(y);
        self.write(y, row);
        Ok(())
    }
}
