//! HDR-FLIP: how different two images look that are shown in turn, at the exposure at which they differ most.
//!
//! Andersson, Nilsson, Shirley, Akenine-Möller, "Visualizing Errors in Rendered High Dynamic Range Images", Eurographics 2021 (short papers);
//! it takes the largest error of each pixel over exposures of "FLIP: A Difference Evaluator for Alternating Images", Proc. ACM Comput. Graph. Interact. Tech. 3 (2), 2020, by
//! Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström, Fairchild. Constants, borders and the separated filters are those of the authors' `FLIP.h` 1.7
//! (github.com/NVlabs/flip, BSD-3-Clause), with its defaults: 67 pixels per degree, ACES, exposures from the reference.
//!
//! What differs from it: pixels that are not finite are left out, negative radiance is black, and a reference whose median is black, for which that program
//! has no exposures, is seen at those of its other pixels. Its mean is a sum in single precision, this one in double precision.
//!
//! The number of exposures is known only once the reference was read, and memory is planned before. So images are held as they are, some rows of them, and a tile
//! goes through all exposures before the next one: memory does not grow with their number.

mod colour;
mod exposures;
mod filters;
mod tile;

use rayon::prelude::*;

use crate::geometry::{ImageSize, plane_bytes};
use crate::stream::row_ring::RowRing;
use crate::stream::threads::Threads;

use super::images::ColourRow;
pub(super) use exposures::Exposures;
use filters::RADIUS;
use tile::{HEIGHT, Metric, Scratch, WIDTH};

/// The colours of a row.
type Colours = [Vec<f32>; 3];

/// A row of the images.
struct Row {
    /// Of the reference, then of each image; all finite.
    colours: Vec<Colours>,
    /// Which pixels of each image are not measured.
    left_out: Vec<Vec<bool>>,
}

/// FLIP of an image, and of its input if there is one, against a reference, fed row by row.
pub(super) struct Flip {
    size: ImageSize,
    /// None for a reference that is black.
    metric: Option<Metric>,
    threads: Threads,
    rows: RowRing<Row>,
    /// The first row that is not measured yet, a multiple of [`HEIGHT`].
    next: usize,
    means: Vec<Mean>,
}

/// A sum of errors.
#[derive(Clone, Copy, Debug, Default)]
struct Mean {
    sum: f64,
    pixels: u64,
}

impl Flip {
    /// Of so many images, 1 or 2, measured by these threads, on which no digit depends.
    pub(super) fn new(
        size: ImageSize,
        exposures: Option<Exposures>,
        tests: usize,
        threads: Threads,
    ) -> Self {
        Self {
            size,
            metric: exposures.map(Metric::new),
            threads,
            rows: RowRing::new(),
            next: 0,
            means: vec![Mean::default(); tests],
        }
    }

    /// Bytes for so many images and threads.
    pub(super) fn bytes(size: ImageSize, tests: u64, threads: u64) -> u64 {
        let row = plane_bytes(size, 3, 1 + tests as usize)
            .saturating_add(tests.saturating_mul(size.width() as u64));
        let rows = row.saturating_mul((HEIGHT + 2 * RADIUS) as u64);
        rows.saturating_add(Scratch::bytes(tests).saturating_mul(threads))
    }

    /// Adds the next row of all images.
    pub(super) fn add_row(&mut self, row: &ColourRow<'_>) {
        let Some(metric) = &self.metric else {
            return;
        };
        let (width, height, tests) = (self.size.width(), self.size.height(), self.means.len());
        self.rows.push(|| Row::new(width, tests)).fill(row);
        while self.next < height && self.rows.next() >= height.min(self.next + HEIGHT + RADIUS) {
            let band = Band {
                size: self.size,
                rows: &self.rows,
                y: self.next,
            };
            let tiles = self.threads.install(|| band.measure(metric, tests));
            // in the order of the tiles, whichever thread had them
            for means in tiles {
                self.means
                    .iter_mut()
                    .zip(means)
                    .for_each(|(sum, mean)| sum.add(mean));
            }
            self.next += HEIGHT;
            self.rows.drop_before(self.next.saturating_sub(RADIUS));
        }
    }

    /// The mean error of the image, and of its input, 0 to 1; NaN where nothing could be measured.
    pub(super) fn finish(self) -> Vec<f64> {
        let means = self.means.into_iter();
        means.map(|mean| mean.sum / mean.pixels as f64).collect()
    }
}

impl Mean {
    fn add(&mut self, other: Self) {
        self.sum += other.sum;
        self.pixels += other.pixels;
    }
}

impl Row {
    fn new(width: usize, tests: usize) -> Self {
        Self {
            colours: vec![[0, 1, 2].map(|_| vec![0.0; width]); 1 + tests],
            left_out: vec![vec![false; width]; tests],
        }
    }

    /// A pixel of the reference that is not finite is black, one of an image is as in the reference: its neighbours are measured as if all were well there.
    fn fill(&mut self, row: &ColourRow<'_>) {
        for x in 0..row.reference[0].len() {
            let reference = finite(row.reference, x);
            let standing_in = reference.unwrap_or([0.0; 3]);
            let tests = std::iter::once(row.image).chain(row.input);
            let tests = tests.map(|test| reference.and(finite(test, x)));
            for (test, left_out) in tests.clone().zip(&mut self.left_out) {
                left_out[x] = test.is_none();
            }
            let tests = tests.map(|test| test.unwrap_or(standing_in));
            let all = std::iter::once(standing_in).chain(tests);
            for (pixel, own) in all.zip(&mut self.colours) {
                own.iter_mut()
                    .zip(pixel)
                    .for_each(|(own, value)| own[x] = value);
            }
        }
    }
}

/// Pixel `x` of a row, if all of it is finite.
fn finite(colours: &Colours, x: usize) -> Option<[f32; 3]> {
    let pixel = [0, 1, 2].map(|k| colours[k][x]);
    pixel.iter().all(|value| value.is_finite()).then_some(pixel)
}

/// [`HEIGHT`] rows that are measured now, or what is left of them at the end.
struct Band<'a> {
    size: ImageSize,
    rows: &'a RowRing<Row>,
    y: usize,
}

impl Band<'_> {
    /// The errors of each tile from left to right, of each image.
    fn measure(&self, metric: &Metric, tests: usize) -> Vec<Vec<Mean>> {
        let tiles = (0..self.size.width().div_ceil(WIDTH)).into_par_iter();
        tiles
            .map_init(
                || Scratch::new(tests),
                |scratch, tile| {
                    let x = tile * WIDTH;
                    let errors = metric.errors(x, self.y, |i, y| self.colours(i, y), scratch);
                    let errors = errors.iter().enumerate();
                    errors.map(|(i, errors)| self.sum(i, x, errors)).collect()
                },
            )
            .collect()
    }

    fn colours(&self, image: usize, y: isize) -> &Colours {
        let y = y.clamp(0, self.size.height() as isize - 1);
        &self.rows.row(y as usize).colours[image]
    }

    /// Sums up the errors of an image in the tile at `x` where it is measured.
    fn sum(&self, test: usize, x: usize, errors: &[f32]) -> Mean {
        let mut mean = Mean::default();
        for (y, errors) in (self.y..self.size.height()).zip(errors.chunks(WIDTH)) {
            let left_out = &self.rows.row(y).left_out[test][x..];
            for (&error, _) in errors
                .iter()
                .zip(left_out)
                .filter(|(_, left_out)| !**left_out)
            {
                mean.add(Mean {
                    sum: f64::from(error),
                    pixels: 1,
                });
            }
        }
        mean
    }
}
