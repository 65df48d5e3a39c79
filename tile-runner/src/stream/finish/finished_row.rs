//! Rows of output, with the light given back that they lack.

use linpred_core::RESTORE_RADIUS;
use linpred_dispatch::InstructionSet;

use crate::row::{OutputRow, RowLayout};
use crate::stream::finish::blended_rows::{BlendedRows, nearest};
use crate::stream::finish::cleared_rows::ClearedRow;
use crate::stream::finish::planes::Plane;
use crate::stream::row_ring::RowRing;

/// A row.
pub(crate) struct FinishedRow {
    pub(crate) output: OutputRow,
    factors: Plane,
}

impl FinishedRow {
    pub(crate) fn planes(layout: &RowLayout) -> usize {
        7 + layout.following_planes() + usize::from(layout.frames)
    }

    pub(crate) fn new(layout: &RowLayout) -> Self {
        Self {
            output: OutputRow::new(layout),
            factors: Plane::new(layout.size.width()),
        }
    }

    /// Makes row `y`.
    pub(crate) fn fill(
        &mut self,
        y: usize,
        blended: &BlendedRows,
        cleared: &RowRing<ClearedRow>,
        instruction_set: InstructionSet,
    ) {
        let height = blended.layout.size.height();
        let planes = std::array::from_fn(|plane| {
            std::array::from_fn(|k| {
                let row = nearest(cleared, (y + k) as isize - RESTORE_RADIUS as isize, height);
                row.light[plane].padded()
            })
        });
        let rest = blended.rest.row(y);
        instruction_set.find_factors(&planes, rest.noisy.padded(), self.factors.padded_mut());
        let output = &mut self.output;
        let outputs = output
            .colour
            .iter_mut()
            .chain(output.layers.iter_mut().flatten());
        let radiance = &cleared.row(y).radiance;
        for (own, plane) in outputs.zip(radiance.light()) {
            let pixels = own.iter_mut().zip(plane.image()).zip(self.factors.image());
            for ((own, value), factor) in pixels {
                *own = value * factor;
            }
        }
        for (own, plane) in output.all_scalars_mut().zip(radiance.scalars()) {
            own.copy_from_slice(plane.image());
        }
        output
            .alpha
            .iter_mut()
            .for_each(|alpha| *alpha = as_alpha(*alpha));
        output.error.copy_from_slice(rest.error.image());
        output.radius.copy_from_slice(rest.radius.image());
        output.rank.copy_from_slice(rest.rank.image());
        output.frames.copy_from_slice(rest.frames.image());
    }
}

/// Averages of a 1 are 1 only to this precision.
const ROUNDING: f32 = 4.0 * f32::EPSILON;

/// An alpha from 0 to 1, and opaque where it is but for rounding.
fn as_alpha(value: f32) -> f32 {
    if value > 1.0 - ROUNDING {
        1.0
    } else {
        value.max(0.0)
    }
}
