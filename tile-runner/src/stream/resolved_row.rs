//! Rows of output, made of the sums of their predictions.

use std::ops::Range;

use linpred_core::{Formulas, resolve, resolve_layer, resolve_scalar};

use crate::row::{OutputRow, RowLayout, sums_up};
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
    /// Columns that are counted.
    own: Range<usize>,
    pub(crate) output: OutputRow,
    pub(crate) counts: Counts,
}

impl ResolvedRow {
    pub(crate) fn new(layout: &RowLayout) -> Self {
        Self {
            own: layout.margin..layout.size.width() - layout.margin,
            output: OutputRow::new(layout),
            counts: Counts::default(),
        }
    }

    /// The row that came as `row`.
    pub(crate) fn fill(&mut self, row: &PixelRow, sums: &SumRow, formulas: Formulas) {
        self.counts = Counts::default();
        for (x, sum) in sums.colour.iter().enumerate() {
            let pixel = row.pixel::<0>(x);
            if self.own.contains(&x) {
                self.counts.add_pixel(pixel.state, row.colours, x);
            }
            let denoised = resolve(&pixel, sum, formulas);
            for (plane, value) in self.output.colour.iter_mut().zip(denoised.colour) {
                plane[x] = value;
            }
            self.output.error[x] = denoised.error;
            self.output.radius[x] = denoised.radius;
            self.output.rank[x] = denoised.rank;
            for (k, layer) in self.output.layers.iter_mut().enumerate() {
                let own = own_layer(row, k, x);
                let resolved = resolve_layer(&pixel, sum, formulas, &sums.followers[k][x], &own);
                for (plane, value) in layer.iter_mut().zip(resolved) {
                    plane[x] = value;
                }
            }
            let first = self.output.layers.len();
            for (k, plane) in self.output.all_scalars_mut().enumerate() {
                let (triple, channel) = (first + k / 3, k % 3);
                let sum_of_scalar = sums.followers[triple][x][channel];
                let own = row.colours.followers[triple][channel][x];
                plane[x] = resolve_scalar(&pixel, sum, formulas, sum_of_scalar, own);
            }
        }
        self.output.frames.copy_from_slice(&row.colours.frames);
        if !formulas.are_published() {
            self.keep_layers_positive(row);
        }
    }

    /// Makes no channel of a layer negative that was not. Where the layers came as parts of the colour, what that adds is taken from the others, so that
    /// they still are.
    fn keep_layers_positive(&mut self, row: &PixelRow) {
        let width = self.output.error.len();
        let is_negative = |layer: &[Vec<f32>; 3]| {
            let values = layer.iter().flatten();
            values.fold(false, |negative, value| negative | (*value < 0.0))
        };
        if !self.output.layers.iter().any(is_negative) {
            return;
        }
        for x in 0..width {
            for c in 0..3 {
                self.keep_pixel_positive(row, x, c);
            }
        }
    }

    /// The same for a channel of a pixel.
    fn keep_pixel_positive(&mut self, row: &PixelRow, x: usize, c: usize) {
        let layers = &mut self.output.layers;
        let count = layers.len();
        let own = |k: usize| row.colours.followers[k][c][x];
        let (mut below, mut above) = (0.0, 0.0);
        for (k, layer) in layers.iter_mut().enumerate() {
            let value = &mut layer[c][x];
            if *value < 0.0 && own(k) >= 0.0 {
                below += *value;
                *value = 0.0;
            } else if *value > 0.0 {
                above += *value;
            }
        }
        if below == 0.0 || above <= 0.0 || !sums_up(row.colours.colour[c][x], (0..count).map(own)) {
            return;
        }
        let share = ((above + below) / above).max(0.0);
        for layer in layers {
            let value = &mut layer[c][x];
            *value *= if *value > 0.0 { share } else { 1.0 };
        }
    }
}

/// Layer `k` as it came, in column `x`.
fn own_layer(row: &PixelRow, k: usize, x: usize) -> [f32; 3] {
    row.colours.followers[k].each_ref().map(|plane| plane[x])
}
