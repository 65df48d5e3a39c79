//! What rows of cells read: their rows of pixels, and their tiles.

use std::ops::Range;

use linpred_core::{
    CELL, FeatureSet, Formulas, HALO, LayerTile, MAX_FEATURES, OtherFeatures, POSITION, Pixel,
    PixelState, TILE, TILE_AREA, Tile,
};

use crate::geometry::ImageSize;
use crate::stream::held_rows::{ColourRow, HeldRows};
use crate::stream::prepared_rows::{PreparedRow, PreparedRows};

/// Where a cell is, counted in cells.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct CellAt {
    pub(crate) row: usize,
    pub(crate) column: usize,
}

/// What some rows of cells read, which are worked on together.
pub(crate) struct Neighbourhood<'a> {
    pub(crate) size: ImageSize,
    pub(crate) held: &'a HeldRows,
    /// From the halo above the cells to the middle row of pixels of the first row of cells, from there to that of the next, and so on to the halo below (see
    /// [`prepared_from`]).
    pub(crate) prepared: &'a [PreparedRows],
    /// The rows of cells.
    pub(crate) cells: Range<usize>,
}

/// The first row of the `piece`-th prepared rows. They are cut at the edges of halos, so that a row of cells with its halo lies in
/// two pieces.
pub(crate) fn prepared_from(piece: usize) -> isize {
    (piece * CELL) as isize - PREPARED_ABOVE as isize
}

/// Rows of the first piece above the image.
const PREPARED_ABOVE: usize = CELL - HALO;
const _: () = assert!(HALO <= PREPARED_ABOVE && CELL + HALO <= 2 * CELL - PREPARED_ABOVE);

impl Neighbourhood<'_> {
    /// Row `y` of the image.
    pub(crate) fn row(&self, y: usize) -> PixelRow<'_> {
        let rows = &self.prepared[(y + PREPARED_ABOVE) / CELL - self.cells.start];
        PixelRow {
            colours: self.held.colours(y as isize),
            prepared: rows.row((y + PREPARED_ABOVE) % CELL),
        }
    }

    /// Whether a cell is worked on, or skipped because no model is needed in it. The papers' formulas know of no such cells.
    pub(crate) fn needs_models(&self, cell: CellAt, formulas: Formulas) -> bool {
        formulas.are_published() || !self.is_clean(cell)
    }

    /// Whether every pixel of a cell passes through.
    fn is_clean(&self, CellAt { row, column }: CellAt) -> bool {
        let columns = column * CELL..self.size.width().min((column + 1) * CELL);
        (row * CELL..self.size.height().min((row + 1) * CELL)).all(|y| {
            let row = self.row(y);
            let good = &row.colours.good[columns.clone()];
            let variance = &row.prepared.variance[columns.clone()];
            let empty = &row.colours.empty[columns.clone()];
            let clean = variance
                .iter()
                .zip(empty)
                .all(|(v, empty)| *v == 0.0 || *empty);
            clean && good.iter().all(|v| *v != 0.0)
        })
    }

    /// Loads the tile of a cell, with the position and as many channels of features as it has room for.
    pub(crate) fn load<const D: usize>(&self, tile: &mut Tile<D>, cell: CellAt) {
        let (columns, first) = self.columns(cell);
        for ty in 0..TILE {
            let row = ty * TILE..(ty + 1) * TILE;
            let (pixels, variances) = (
                &mut tile.pixels[row.clone()],
                &mut tile.feature_variance[row],
            );
            let y = (cell.row * CELL + ty).checked_sub(HALO);
            let inside = match y.filter(|y| *y < self.size.height()) {
                Some(y) => {
                    let inside = first..first + columns.len();
                    self.row(y).load(
                        columns.clone(),
                        &mut pixels[inside.clone()],
                        &mut variances[inside.clone()],
                    );
                    inside
                }
                None => 0..0,
            };
            for outside in [0..inside.start, inside.end..TILE] {
                pixels[outside.clone()].fill(Pixel::OUTSIDE);
                variances[outside].fill([0.0; D]);
            }
            for (tx, pixel) in pixels.iter_mut().enumerate() {
                pixel.features[0] = tx as f32;
                pixel.features[1] = ty as f32;
            }
        }
    }

    /// Loads the features of a cell's tile otherwise than prefiltered, and returns whether they are any different. Outside the image nothing
    /// reads them.
    pub(crate) fn load_otherwise<const D: usize>(
        &self,
        otherwise: &mut OtherFeatures<D>,
        cell: CellAt,
    ) -> bool {
        let (columns, first) = self.columns(cell);
        if !self.has_noisy_features(cell, &columns) {
            return false;
        }
        let mut values = [0.0; TILE];
        let values = &mut values[..columns.len()];
        for ty in 0..TILE {
            let y = (cell.row * CELL + ty).checked_sub(HALO);
            let Some(y) = y.filter(|y| *y < self.size.height()) else {
                continue;
            };
            let from = ty * TILE + first;
            let pixels = from..from + columns.len();
            self.load_features(otherwise, y, &columns, pixels, values);
            for set in &mut *otherwise {
                for (x, own) in (first..).zip(&mut set.value[from..from + columns.len()]) {
                    (own[0], own[1]) = (x as f32, ty as f32);
                }
            }
        }
        true
    }

    /// Loads the features of the image's `columns` of row `y` into `pixels` of a tile.
    fn load_features<const D: usize>(
        &self,
        otherwise: &mut OtherFeatures<D>,
        y: usize,
        columns: &Range<usize>,
        pixels: Range<usize>,
        values: &mut [f32],
    ) {
        let [smoothed, rendered] = otherwise;
        for set in [&mut *smoothed, &mut *rendered] {
            set.value[pixels.clone()].fill([0.0; D]);
            set.variance[pixels.clone()].fill([0.0; D]);
        }
        let (prepared, guides) = (self.row(y).prepared, self.held.guides(y as isize));
        for k in (0..D - POSITION).filter(|k| !prepared.smoothed[*k].is_empty()) {
            let (x, y) = (columns.start as isize, y as isize);
            self.held.copy_feature(k, x, y, values);
            let noise = &guides.feature_variances[k][columns.clone()];
            store_feature(rendered, pixels.clone(), POSITION + k, values, noise);
            let values = &prepared.smoothed[k][columns.clone()];
            let noise = &prepared.smoothed_variances[k][columns.clone()];
            store_feature(smoothed, pixels.clone(), POSITION + k, values, noise);
        }
    }

    /// The columns of the image that a cell's tile has, and the column of the tile where they begin.
    fn columns(&self, CellAt { column, .. }: CellAt) -> (Range<usize>, usize) {
        let from = (column * CELL).saturating_sub(HALO);
        let columns = from..self.size.width().min((column + 1) * CELL + HALO);
        (columns, from + HALO - column * CELL)
    }

    /// Whether a feature has noise in one of these columns of the rows that the cells read.
    fn has_noisy_features(&self, cell: CellAt, columns: &Range<usize>) -> bool {
        let first = (cell.row * CELL).saturating_sub(HALO);
        let end = self.size.height().min((cell.row + 1) * CELL + HALO);
        (first..end).any(|y| {
            let row = self.held.guides(y as isize);
            (0..MAX_FEATURES).any(|k| row.is_noisy(k, columns))
        })
    }

    pub(crate) fn load_layer(&self, tile: &mut LayerTile, layer: usize, cell: CellAt) {
        tile.colour = [[0.0; 3]; TILE_AREA];
        for ty in 0..TILE {
            let y = (cell.row * CELL + ty)
                .checked_sub(HALO)
                .filter(|y| *y < self.size.height());
            let Some(y) = y else { continue };
            let planes = &self.held.colours(y as isize).followers[layer];
            for tx in 0..TILE {
                let x = (cell.column * CELL + tx)
                    .checked_sub(HALO)
                    .filter(|x| *x < self.size.width());
                if let Some(x) = x {
                    tile.colour[ty * TILE + tx] = std::array::from_fn(|c| planes[c][x]);
                }
            }
        }
    }
}

/// Stores feature `k` of a run of pixels.
fn store_feature<const D: usize>(
    set: &mut FeatureSet<D>,
    pixels: Range<usize>,
    k: usize,
    values: &[f32],
    noise: &[f32],
) {
    for (own, value) in set.value[pixels.clone()].iter_mut().zip(values) {
        own[k] = *value;
    }
    for (own, variance) in set.variance[pixels].iter_mut().zip(noise) {
        own[k] = *variance;
    }
}

/// A row of the image as cells read it.
pub(crate) struct PixelRow<'a> {
    pub(crate) colours: &'a ColourRow,
    pub(crate) prepared: &'a PreparedRow,
}

impl PixelRow<'_> {
    /// The pixel in column `x`, without its features.
    pub(crate) fn pixel<const D: usize>(&self, x: usize) -> Pixel<D> {
        let variance = self.prepared.variance[x];
        Pixel {
            features: [0.0; D],
            colour: std::array::from_fn(|c| self.colours.colour[c][x]),
            weight: self.prepared.weight[x],
            variance,
            tolerance: self.prepared.tolerance[x],
            state: state(self.colours.good[x], variance, self.colours.empty[x]),
        }
    }

    /// The pixels of `columns` and the variances of their features, but for their positions.
    fn load<const D: usize>(
        &self,
        columns: Range<usize>,
        pixels: &mut [Pixel<D>],
        variances: &mut [[f32; D]],
    ) {
        let [r, g, b] = self.colours.colour.each_ref().map(|c| &c[columns.clone()]);
        let good = &self.colours.good[columns.clone()];
        let empty = &self.colours.empty[columns.clone()];
        let PreparedRow {
            weight,
            variance,
            tolerance,
            ..
        } = self.prepared;
        let [weight, variance, tolerance] =
            [weight, variance, tolerance].map(|plane| &plane[columns.clone()]);
        let colours = r.iter().zip(g).zip(b).zip(good).zip(empty);
        let rest = weight.iter().zip(variance).zip(tolerance);
        for (pixel, (((((r, g), b), good), empty), ((weight, variance), tolerance))) in
            pixels.iter_mut().zip(colours.zip(rest))
        {
            *pixel = Pixel {
                features: [0.0; D],
                colour: [*r, *g, *b],
                weight: *weight,
                variance: *variance,
                tolerance: *tolerance,
                state: state(*good, *variance, *empty),
            };
        }
        variances.fill([0.0; D]);
        let planes = self.prepared.features.iter();
        let planes = planes.zip(&self.prepared.feature_variances);
        let planes = planes.take(D - POSITION);
        for (k, (values, noise)) in planes.enumerate() {
            // a feature that the image lacks stays 0
            if let (Some(values), Some(noise)) =
                (values.get(columns.clone()), noise.get(columns.clone()))
            {
                for (pixel, value) in pixels.iter_mut().zip(values) {
                    pixel.features[POSITION + k] = *value;
                }
                for (variance, value) in variances.iter_mut().zip(noise) {
                    variance[POSITION + k] = *value;
                }
            }
        }
    }
}

fn state(good: f32, variance: f32, empty: bool) -> PixelState {
    if good == 0.0 {
        PixelState::Bad
    } else if variance == 0.0 || empty {
        PixelState::Clean
    } else {
        PixelState::Noisy
    }
}
