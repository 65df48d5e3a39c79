//! From the errors of pixels to what each should have: cut, smoothed, and weighed by the samples that are there.

use std::collections::VecDeque;

use linpred_core::Sampler;

use super::measurement::PLANES;
use super::scratch::{RowFile, Scratch};
use crate::error::Error;
use crate::geometry::ImageSize;
use crate::quantile::{quantile, values_at};

/// The share of the noisy pixels that no error is cut at. Pajot et al. cut at .95, where what is cut is the error of a pixel by itself; here it is one that is smoothed after.
const CEILING: f64 = 0.99;

/// Errors are averaged over the pixels that are so near, in rows and columns, as far as the image goes: the error of one pixel is known to within a factor of ten.
const RADIUS: usize = 2;

/// Planes of the rows that are held around one.
pub(super) const fn around_planes() -> usize {
    (2 * RADIUS + 1) * PLANES
}

/// What the pixels of an image demand.
#[derive(Debug)]
pub(super) struct Demands {
    pub(super) size: ImageSize,
    pub(super) sampler: Sampler,
    rows: RowFile,
    row: Vec<f32>,
    /// Pixels that are noisy, or have a neighbour that is.
    pub(super) noisy: u64,
    /// Samples that all pixels have together.
    pub(super) samples: f64,
    /// Mean over the pixels of their relative errors.
    pub(super) error: f64,
}

/// A pixel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Demand {
    /// The smoothed relative error.
    pub(super) error: f64,
    /// The demand for samples in all; `None` where nothing is noisy.
    pub(super) demand: Option<f64>,
    /// The samples that it has.
    pub(super) samples: f64,
}

impl Demands {
    /// Those of the pixels in `measured`.
    pub(super) fn new(
        size: ImageSize,
        sampler: Sampler,
        scratch: &Scratch,
        measured: &mut RowFile,
    ) -> Result<Self, Error> {
        let width = size.width();
        let mut demands = Self {
            size,
            sampler,
            rows: RowFile::new(scratch, width, PLANES),
            row: vec![0.0; PLANES * width],
            noisy: 0,
            samples: 0.0,
            error: 0.0,
        };
        let ceilings = ceilings(size, measured)?;
        let usual = Usual::of(size, measured, ceilings)?;
        let mut around = Around::new(size, measured, ceilings);
        for y in 0..size.height() {
            around.move_to(y)?;
            demands.add_row(&around, usual)?;
        }
        demands.error /= size.pixels() as f64;
        Ok(demands)
    }

    /// Adds the row in the middle. A pixel without samples demands what it would with as many as are `usual`, and an error that is no smaller: what is claimed of a guess says little.
    fn add_row(&mut self, around: &Around, usual: Usual) -> Result<(), Error> {
        let width = self.size.width();
        let (errors, rest) = self.row.split_at_mut(width);
        let (demands, samples) = rest.split_at_mut(width);
        for x in 0..width {
            let (error, noisy) = around.smoothed(x);
            samples[x] = around.samples(x);
            let (error, own) = match f64::from(samples[x]) {
                0.0 => (error.max(usual.error), usual.samples),
                own => (error, own),
            };
            errors[x] = error as f32;
            demands[x] = match noisy {
                true => self.sampler.demand(error, own) as f32,
                false => QUIET,
            };
            self.noisy += u64::from(noisy);
            self.samples += f64::from(samples[x]);
            self.error += f64::from(errors[x]);
        }
        self.rows.push(&[&self.row[..]])
    }

    /// Gives every pixel to `each`, row by row, with its column and row.
    pub(super) fn for_each(
        &mut self,
        mut each: impl FnMut(usize, usize, Demand),
    ) -> Result<(), Error> {
        for y in 0..self.size.height() {
            self.for_row(y, |x, demand| each(x, y, demand))?;
        }
        Ok(())
    }

    /// The same of one row.
    pub(super) fn for_row(
        &mut self,
        y: usize,
        mut each: impl FnMut(usize, Demand),
    ) -> Result<(), Error> {
        let width = self.size.width();
        self.rows.read(y, &mut self.row)?;
        for x in 0..width {
            let value = |plane: usize| self.row[plane * width + x];
            let demand = Demand {
                error: f64::from(value(0)),
                demand: Some(f64::from(value(1))).filter(|_| value(1) != QUIET),
                samples: f64::from(value(2)),
            };
            each(x, demand);
        }
        Ok(())
    }
}

/// Stands for the demand of a pixel around which nothing is noisy.
const QUIET: f32 = -1.0;

/// What pixels have that have samples: means over them, 0 if there are none.
#[derive(Clone, Copy, Debug)]
struct Usual {
    samples: f64,
    error: f64,
}

impl Usual {
    fn of(size: ImageSize, measured: &mut RowFile, ceilings: [f32; 2]) -> Result<Self, Error> {
        let width = size.width();
        let mut row = vec![0.0_f32; PLANES * width];
        let (mut samples, mut error, mut pixels) = (0.0, 0.0, 0_u64);
        for y in 0..size.height() {
            measured.read(y, &mut row)?;
            for x in (0..width).filter(|x| row[2 * width + x] > 0.0) {
                let [claimed, seen] =
                    [0, 1].map(|k| f64::from(row[k * width + x].min(ceilings[k])));
                error += (claimed * seen).sqrt();
                samples += f64::from(row[2 * width + x]);
                pixels += 1;
            }
        }
        let pixels = pixels.max(1) as f64;
        Ok(Self {
            samples: samples / pixels,
            error: error / pixels,
        })
    }
}

/// What the claimed and the seen errors are cut at.
fn ceilings(size: ImageSize, measured: &mut RowFile) -> Result<[f32; 2], Error> {
    let mut row = vec![0.0_f32; PLANES * size.width()];
    let mut ceiling = |plane: usize| -> Result<f32, Error> {
        let own = plane * size.width()..(plane + 1) * size.width();
        let [ceiling] = values_at([&|values| quantile(CEILING, values)], |each| {
            (0..size.height()).try_for_each(|y| {
                measured.read(y, &mut row)?;
                let errors = row[own.clone()].iter().filter(|error| **error > 0.0);
                errors.for_each(|error| each(f64::from(*error)));
                Ok(())
            })
        })?;
        // without noisy pixels there is nothing to cut
        Ok(if ceiling.is_nan() {
            0.0
        } else {
            ceiling as f32
        })
    };
    Ok([ceiling(0)?, ceiling(1)?])
}

/// The measured rows around one.
struct Around<'a> {
    size: ImageSize,
    measured: &'a mut RowFile,
    ceilings: [f32; 2],
    rows: VecDeque<Vec<f32>>,
    /// The first row that is held, and the one in the middle.
    first: usize,
    y: usize,
}

impl<'a> Around<'a> {
    fn new(size: ImageSize, measured: &'a mut RowFile, ceilings: [f32; 2]) -> Self {
        Self {
            size,
            measured,
            ceilings,
            rows: VecDeque::new(),
            first: 0,
            y: 0,
        }
    }

    /// Moves on to row `y`, which is the first, or the one below.
    fn move_to(&mut self, y: usize) -> Result<(), Error> {
        self.y = y;
        let mut free = Vec::new();
        if self.first + RADIUS < y {
            free = self.rows.pop_front().unwrap_or_default();
            self.first += 1;
        }
        while self.first + self.rows.len() < self.size.height().min(y + RADIUS + 1) {
            let mut row = std::mem::take(&mut free);
            row.resize(PLANES * self.size.width(), 0.0);
            self.measured.read(self.first + self.rows.len(), &mut row)?;
            self.rows.push_back(row);
        }
        Ok(())
    }

    fn samples(&self, x: usize) -> f32 {
        self.rows[self.y - self.first][2 * self.size.width() + x]
    }

    /// The error of pixel `x`, and whether it or a neighbour is noisy.
    fn smoothed(&self, x: usize) -> (f64, bool) {
        let width = self.size.width();
        let columns = x.saturating_sub(RADIUS)..width.min(x + RADIUS + 1);
        let [mut claimed, mut seen] = [0.0; 2];
        let mut noisy = false;
        for (row, y) in self.rows.iter().zip(self.first..) {
            for column in columns.clone() {
                let own = row[column];
                claimed += f64::from(own.min(self.ceilings[0]));
                seen += f64::from(row[width + column].min(self.ceilings[1]));
                noisy |= own > 0.0 && column.abs_diff(x) <= 1 && y.abs_diff(self.y) <= 1;
            }
        }
        let pixels = (columns.len() * self.rows.len()) as f64;
        ((claimed * seen).sqrt() / pixels, noisy)
    }
}
