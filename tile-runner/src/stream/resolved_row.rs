//! Rows of output, made of the sums of their predictions.

use linpred_core::{Formulas, resolve, resolve_layer};

use crate::row::{OutputRow, RowLayout};
use crate::stream::neighbourhood::PixelRow;
use crate::stream::report::Counts;
use crate::stream::sum_rows::SumRow;

/// Pixels that each thread works out before they are written: enough that threads seldom wait for one another.
const PIXELS_PER_THREAD: usize = 8192;

/// Rows of `width` pixels that they fill, some at least and not too many.
pub(crate) fn rows_per_thread(width: usize) -> usize {
    (PIXELS_PER_THREAD / width.max(1)).clamp(1, 4)
}

/// A row of output, and what became of its pixels.
pub(crate) struct ResolvedRow {
    pub(crate) output: OutputRow,
    pub(crate) counts: Counts,
}

impl ResolvedRow {
    pub(crate) fn new(layout: &RowLayout) -> Self {
        Self {
            output: OutputRow::new(layout),
            counts: Counts::default(),
        }
    }

    /// The row that came as `row`.
    pub(crate) fn fill(&mut self, row: &PixelRow, sums: &SumRow, formulas: Formulas) {
        self.counts = Counts::default();
        for (x, sum) in sums.colour.iter().enumerate() {
            let pixel = row.pixel::<0>(x);
            self.counts.add_pixel(pixel.state, row.colours.firefly[x]);
            let denoised = resolve(&pixel, sum, formulas);
            for (plane, value) in self.output.colour.iter_mut().zip(denoised.colour) {
                plane[x] = value;
            }
            self.output.error[x] = denoised.error;
            self.output.radius[x] = denoised.radius;
            self.output.rank[x] = denoised.rank;
            for (k, layer) in self.output.layers.iter_mut().enumerate() {
                let (sums, own) = (sums.layers[k][x], &row.colours.layers[k]);
                let own = own.each_ref().map(|plane| plane[x]);
                let resolved = resolve_layer(&pixel, sum, formulas, &sums, &own);
                for (plane, value) in layer.iter_mut().zip(resolved) {
                    plane[x] = value;
                }
            }
        }
    }
}
