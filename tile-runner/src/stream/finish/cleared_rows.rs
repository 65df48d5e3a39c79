//! Rows without specks, and the light that they have and lack.

use linpred_core::{
    DESPECKLE_RADIUS, DESPECKLE_SPAN, FinishedPlane, LIGHT_PLANES, LitRow, SpeckRow,
};
use linpred_dispatch::InstructionSet;

use crate::row::RowLayout;
use crate::stream::finish::blended_rows::{BlendedRows, extend, nearest};
use crate::stream::finish::planes::{Plane, Radiance};
use crate::stream::finish::ready;
use crate::stream::row_ring::RowRing;

/// A row.
pub(crate) struct ClearedRow {
    pub(crate) radiance: Radiance,
    /// What is to be summed up over wide neighbourhoods.
    pub(crate) light: [Plane; LIGHT_PLANES],
}

impl ClearedRow {
    pub(crate) fn planes(layout: &RowLayout) -> usize {
        Radiance::planes(layout) + LIGHT_PLANES
    }

    fn new(layout: &RowLayout) -> Self {
        Self {
            radiance: Radiance::new(layout),
            light: std::array::from_fn(|_| Plane::new(layout.size.width())),
        }
    }

    /// Makes row `y` of what is smoothed.
    fn fill(
        &mut self,
        y: usize,
        blended: &BlendedRows,
        smoothed: &RowRing<Radiance>,
        instruction_set: InstructionSet,
    ) {
        let height = blended.layout.size.height();
        let rows: [&Radiance; DESPECKLE_SPAN] = std::array::from_fn(|k| {
            nearest(
                smoothed,
                (y + k) as isize - DESPECKLE_RADIUS as isize,
                height,
            )
        });
        let own = blended.own.row(y);
        let (noisy, good) = (blended.rest.row(y).noisy.padded(), own.good.padded());
        let input = SpeckRow {
            colour: rows.map(Radiance::colour),
            noisy,
            good,
            own: own.radiance.padded(),
            variance: own.largest_variance.padded(),
        };
        let [above, row, below] = rows.map(|row| row.light().map(Plane::padded));
        let planes = above.zip(row).zip(below).zip(self.radiance.light_mut());
        let planes = planes.map(|(((above, row), below), output)| FinishedPlane {
            rows: [above, row, below],
            output: output.padded_mut(),
        });
        instruction_set.despeckle(&input, &mut planes.collect::<Vec<_>>());
        self.radiance.light_mut().for_each(Plane::pad);
        let scalars = rows[DESPECKLE_RADIUS].scalars();
        for (own, plane) in self.radiance.scalars_mut().zip(scalars) {
            own.copy(plane.image());
        }
        let [light, variance] = own.light();
        let lit = LitRow {
            colour: self.radiance.colour(),
            noisy,
            good,
            own: light.padded(),
            variance: variance.padded(),
        };
        let light = self.light.each_mut().map(Plane::padded_mut);
        instruction_set.compare_light(&lit, light);
        self.light.iter_mut().for_each(Plane::pad);
    }
}

/// Adds the rows, at most `batch`, for which enough is smoothed.
pub(crate) fn advance(
    cleared: &mut RowRing<ClearedRow>,
    blended: &BlendedRows,
    smoothed: &RowRing<Radiance>,
    batch: usize,
    instruction_set: InstructionSet,
) {
    let layout = &blended.layout;
    let end = ready(smoothed.next(), DESPECKLE_RADIUS, layout.size.height());
    let end = end.min(cleared.next() + batch);
    extend(
        cleared,
        end,
        || ClearedRow::new(layout),
        |y, row| {
            row.fill(y, blended, smoothed, instruction_set);
        },
    );
}
