//! Rows of output, with the light given back that they lack.

use linpred_core::RESTORE_RADIUS;

use crate::row::{OutputRow, RowLayout};
use crate::stream::finish::blended_rows::{BlendedRows, nearest};
use crate::stream::finish::cleared_rows::ClearedRow;
use crate::stream::finish::planes::Plane;
use crate::stream::instruction_set::InstructionSet;
use crate::stream::row_ring::RowRing;

/// A row.
pub(crate) struct FinishedRow {
    pub(crate) output: OutputRow,
    factors: Plane,
}

impl FinishedRow {
    pub(crate) fn planes(layout: &RowLayout) -> usize {
        7 + 3 * layout.layers
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
        for (own, plane) in outputs.zip(cleared.row(y).radiance.all()) {
            let pixels = own.iter_mut().zip(plane.image()).zip(self.factors.image());
            for ((own, value), factor) in pixels {
                *own = value * factor;
            }
        }
        output.error.copy_from_slice(rest.error.image());
        output.radius.copy_from_slice(rest.radius.image());
        output.rank.copy_from_slice(rest.rank.image());
    }
}
