//! A neighbouring frame as the frame sees it: its pixels row by row, and how much they may help.

use linpred_core::{
    COMPARED_PLANES, DEPTH_CHANGE, MEASURED_PLANES, TEMPORAL_RADIUS, TEMPORAL_SPAN,
};
use linpred_dispatch::InstructionSet;

use crate::error::Error;
use crate::row::{RowLayout, RowSource};
use crate::stream::finish::planes::Plane;
use crate::stream::row_ring::RowRing;
use crate::temporal::held_frame::HeldFrame;
use crate::temporal::planes::Planes;
use crate::temporal::track::Track;

/// Depths of a neighbour change by this factor at most, or by its inverse.
const LARGEST_CHANGE: f32 = 2.0;

/// What is summed up of a frame beside another, and where.
pub(super) struct Comparison {
    rows: RowRing<[Plane; COMPARED_PLANES]>,
    measured: [Plane; MEASURED_PLANES],
    zeros: Plane,
}

impl Comparison {
    /// Planes of a row's width that it takes at most.
    pub(super) const PLANES: usize = TEMPORAL_SPAN * COMPARED_PLANES + MEASURED_PLANES + 1;

    pub(super) fn new(width: usize) -> Self {
        Self {
            rows: RowRing::new(),
            measured: std::array::from_fn(|_| Plane::new(width)),
            zeros: Plane::new(width),
        }
    }

    /// Begins anew at row `y`.
    pub(super) fn begin(&mut self, y: usize) {
        self.rows.restart(y);
    }

    /// Compares the next row with that of another frame.
    pub(super) fn push(&mut self, own: &Planes, other: &Planes, instruction_set: InstructionSet) {
        self.fill_next(|output| {
            let known = other.known.padded();
            instruction_set.compare_frames(&own.row(), &other.row(), known, output);
        });
    }

    /// Takes the next row of the frame itself.
    pub(super) fn push_own(&mut self, own: &Planes, instruction_set: InstructionSet) {
        self.fill_next(|output| {
            instruction_set.compare_own(&own.row(), own.known.padded(), output);
        });
    }

    fn fill_next(&mut self, fill: impl FnOnce([&mut [f32]; COMPARED_PLANES])) {
        let width = self.zeros.width();
        let row = self
            .rows
            .push(|| std::array::from_fn(|_| Plane::new(width)));
        fill(row.each_mut().map(Plane::padded_mut));
        row.iter_mut().for_each(Plane::pad_with_zeros);
    }

    /// Sums up around the pixels of row `y` of an image this high, and lets go of what no later row needs.
    pub(super) fn measure(&mut self, y: usize, height: usize, instruction_set: InstructionSet) {
        let rows = std::array::from_fn(|plane| {
            std::array::from_fn(|k| match (y + k).checked_sub(TEMPORAL_RADIUS) {
                Some(row) if row < height => self.rows.row(row)[plane].padded(),
                _ => self.zeros.padded(),
            })
        });
        let mut output = self.measured.each_mut().map(Plane::padded_mut);
        instruction_set.measure_frame(&rows, &mut output);
        self.rows
            .drop_before((y + 1).saturating_sub(TEMPORAL_RADIUS));
    }

    /// What [`measure`](Self::measure) has found.
    pub(super) fn measured(&self) -> [&[f32]; MEASURED_PLANES] {
        self.measured.each_ref().map(Plane::padded)
    }
}

/// A neighbour.
pub(super) struct Neighbour<S> {
    pub(super) frame: HeldFrame<S>,
    /// Where the pixels of the row at work are in it.
    pub(super) track: Track,
    /// Its pixels, in the places of the frame's.
    pub(super) pixels: RowRing<Planes>,
    pub(super) comparison: Comparison,
    /// What they weigh in the row that is being averaged.
    pub(super) weights: Plane,
    /// The sum of the weights of all rows so far.
    pub(super) weight: f64,
}

impl<S: RowSource> Neighbour<S> {
    pub(super) fn new(source: S) -> Self {
        let frame = HeldFrame::new(source);
        let width = frame.width();
        Self {
            frame,
            track: Track::default(),
            pixels: RowRing::new(),
            comparison: Comparison::new(width),
            weights: Plane::new(width),
            weight: 0.0,
        }
    }

    /// Begins anew at row `y`.
    pub(super) fn begin(&mut self, y: usize) {
        self.pixels.restart(y);
        self.comparison.begin(y);
    }

    /// Takes the pixels of the next row from where the track says, and compares them with the frame's own.
    pub(super) fn push(
        &mut self,
        own: &Planes,
        layout: &RowLayout,
        instruction_set: InstructionSet,
    ) -> Result<(), Error> {
        let pixels = self.pixels.push(|| Planes::new(layout));
        pixels.gather(&self.track, &mut self.frame, own)?;
        pixels.pad();
        self.comparison.push(own, pixels, instruction_set);
        Ok(())
    }

    /// Makes the depths in row `y` those that the frame sees.
    pub(super) fn change_depths(&mut self, y: usize) {
        let change = self.comparison.measured()[DEPTH_CHANGE];
        for (place, plane) in self.pixels.row_mut(y).planes.iter_mut().enumerate() {
            let power = Planes::depth_power(place);
            if power > 0 && plane.is_some() {
                for (value, change) in plane.padded_mut().iter_mut().zip(change) {
                    let factor = (1.0 + change).clamp(1.0 / LARGEST_CHANGE, LARGEST_CHANGE);
                    *value /= factor.powi(power);
                }
            }
        }
    }

    /// Adds up the weights of a row.
    pub(super) fn count(&mut self) {
        let weights = self.weights.image().iter();
        self.weight += weights.map(|weight| f64::from(*weight)).sum::<f64>();
    }
}
