//! FLIP of a piece of an image that is small enough to stay in a processor's cache.

use super::colour::{distance, hunt_adjusted, opponent};
use super::exposures::{Exposures, tone_mapped};
use super::filters::{Kernels, LANES, RADIUS};

/// Columns of a tile. From 32 to 256, the time differs by 8 %.
pub(super) const WIDTH: usize = 64;
/// Rows of a tile. With 16 it takes 15 % longer, for rows around are filtered along x more often; with 64 a tenth less, but more memory.
pub(super) const HEIGHT: usize = 32;
/// Columns that it is made of.
const SPAN: usize = WIDTH + 2 * RADIUS;
/// Rows that it is made of.
const ROWS: usize = HEIGHT + 2 * RADIUS;

const _: () = assert!(WIDTH.is_multiple_of(LANES));

/// FLIP's exponent of colour differences, and where it bends them: this share of the largest one becomes that error (section 5.1).
const COLOUR_EXPONENT: f32 = 0.7;
const BEND: f32 = 0.4;
const BENT_TO: f32 = 0.95;

/// What is the same for all tiles.
#[derive(Debug)]
pub(super) struct Metric {
    kernels: Kernels,
    exposures: Exposures,
    /// The colour difference between green and blue, the largest one.
    farthest: f32,
}

/// The memory that a thread works in.
#[derive(Debug)]
pub(super) struct Scratch {
    /// Opponent colours of a row.
    line: [[f32; SPAN]; 3],
    /// [`ROWS`] filtered along x: each opponent colour, the last one twice, then Y by the Gaussian and its derivatives.
    along_x: [Vec<f32>; 7],
    /// The same filtered along y, with both derivatives along either direction.
    filtered: [Vec<f32>; 8],
    reference: Seen,
    test: Seen,
    errors: Vec<Vec<f32>>,
}

/// What the eye makes of a tile.
#[derive(Debug)]
struct Seen {
    colour: Vec<[f32; 3]>,
    edge: Vec<f32>,
    point: Vec<f32>,
}

impl Seen {
    fn new() -> Self {
        Self {
            colour: vec![[0.0; 3]; WIDTH * HEIGHT],
            edge: vec![0.0; WIDTH * HEIGHT],
            point: vec![0.0; WIDTH * HEIGHT],
        }
    }
}

impl Scratch {
    /// For a reference and so many images.
    pub(super) fn new(tests: usize) -> Self {
        Self {
            line: [[0.0; SPAN]; 3],
            along_x: std::array::from_fn(|_| vec![0.0; WIDTH * ROWS]),
            filtered: std::array::from_fn(|_| vec![0.0; WIDTH * HEIGHT]),
            reference: Seen::new(),
            test: Seen::new(),
            errors: vec![vec![0.0; WIDTH * HEIGHT]; tests],
        }
    }

    /// Bytes of one.
    pub(super) const fn bytes(tests: u64) -> u64 {
        let tile = (WIDTH * HEIGHT * size_of::<f32>()) as u64;
        let along_x = (WIDTH * ROWS * size_of::<f32>()) as u64;
        7 * along_x + (8 + 2 * 5 + tests) * tile + (3 * SPAN * size_of::<f32>()) as u64
    }
}

impl Metric {
    pub(super) fn new(exposures: Exposures) -> Self {
        let seen = |rgb| hunt_adjusted(opponent(rgb));
        let farthest = distance(seen([0.0, 1.0, 0.0]), seen([0.0, 0.0, 1.0]));
        Self {
            kernels: Kernels::new(),
            exposures,
            farthest: farthest.powf(COLOUR_EXPONENT),
        }
    }

    /// Errors of each image, row by row, [`WIDTH`] beside each other, in the tile whose first pixel is at `x`, `y`.
    ///
    /// `row` gives the colours of a row of the reference (0) or an image (from 1 on), from [`RADIUS`] rows above the tile to as many below it; beyond the
    /// image it repeats the outermost.
    pub(super) fn errors<'a, 'b>(
        &self,
        x: usize,
        y: usize,
        row: impl Fn(usize, isize) -> &'a [Vec<f32>; 3],
        scratch: &'b mut Scratch,
    ) -> &'b [Vec<f32>] {
        scratch
            .errors
            .iter_mut()
            .for_each(|errors| errors.fill(0.0));
        let top = y as isize - RADIUS as isize;
        for factor in self.exposures.factors() {
            self.filter(x, |k| row(0, top + k as isize), factor, scratch);
            gather(&scratch.filtered, &mut scratch.reference);
            for test in 0..scratch.errors.len() {
                self.filter(x, |k| row(1 + test, top + k as isize), factor, scratch);
                gather(&scratch.filtered, &mut scratch.test);
                for (i, largest) in scratch.errors[test].iter_mut().enumerate() {
                    let error = self.error(&scratch.reference, &scratch.test, i);
                    *largest = largest.max(error);
                }
            }
        }
        &scratch.errors
    }

    /// Filters the tile's [`ROWS`] at an exposure.
    fn filter<'a>(
        &self,
        x: usize,
        row: impl Fn(usize) -> &'a [Vec<f32>; 3],
        factor: f32,
        scratch: &mut Scratch,
    ) {
        let Kernels {
            achromatic,
            red_green,
            blue_yellow: [blue, yellow],
            gaussian,
            edge,
            point,
        } = &self.kernels;
        let (line, along_x) = (&mut scratch.line, &mut scratch.along_x);
        for k in 0..ROWS {
            expose(x, row(k), factor, line);
            let [y, cx, cz] = &*line;
            let filters = [
                (achromatic, y),
                (red_green, cx),
                (blue, cz),
                (yellow, cz),
                (gaussian, y),
                (edge, y),
                (point, y),
            ];
            for ((kernel, source), plane) in filters.into_iter().zip(along_x.iter_mut()) {
                kernel.apply(source, 1, &mut plane[k * WIDTH..][..WIDTH]);
            }
        }
        let [y, cx, cz_blue, cz_yellow, smooth, edges, points] = &scratch.along_x;
        let filters = [
            (achromatic, y),
            (red_green, cx),
            (blue, cz_blue),
            (yellow, cz_yellow),
            (gaussian, edges),
            (edge, smooth),
            (gaussian, points),
            (point, smooth),
        ];
        for ((kernel, source), plane) in filters.into_iter().zip(&mut scratch.filtered) {
            kernel.apply(source, WIDTH, plane);
        }
    }

    /// FLIP of a pixel.
    #[inline]
    fn error(&self, reference: &Seen, test: &Seen, i: usize) -> f32 {
        let colour = distance(reference.colour[i], test.colour[i]).powf(COLOUR_EXPONENT);
        let edge = (reference.edge[i] - test.edge[i]).abs();
        let point = (reference.point[i] - test.point[i]).abs();
        // section 5.2: the larger of the two, over the largest that there can be, to the power of 0.5
        let feature = (edge.max(point) * std::f32::consts::FRAC_1_SQRT_2).sqrt();
        self.bent(colour).powf(1.0 - feature)
    }

    /// A colour difference to the power of [`COLOUR_EXPONENT`] as an error from 0 to 1.
    fn bent(&self, colour: f32) -> f32 {
        let bend = BEND * self.farthest;
        if colour < bend {
            colour * (BENT_TO / bend)
        } else {
            BENT_TO + (colour - bend) / (self.farthest - bend) * (1.0 - BENT_TO)
        }
    }
}

/// Opponent colours of a row at an exposure, from [`RADIUS`] columns left of `x` on; the outermost ones beyond the image.
fn expose(x: usize, row: &[Vec<f32>; 3], factor: f32, line: &mut [[f32; SPAN]; 3]) {
    let last = row[0].len() - 1;
    for (values, colours) in line.iter_mut().zip(row) {
        for (i, value) in values.iter_mut().enumerate() {
            *value = colours[(x + i).saturating_sub(RADIUS).min(last)];
        }
    }
    let [first, second, third] = line;
    for ((a, b), c) in first.iter_mut().zip(second).zip(third) {
        let seen = |value: f32| tone_mapped(value * factor);
        [*a, *b, *c] = opponent([seen(*a), seen(*b), seen(*c)]);
    }
}

/// Colours and features from what was filtered.
fn gather(filtered: &[Vec<f32>; 8], seen: &mut Seen) {
    let [
        y,
        cx,
        blue,
        yellow,
        across,
        along,
        points_across,
        points_along,
    ] = filtered;
    for i in 0..WIDTH * HEIGHT {
        seen.colour[i] = hunt_adjusted([y[i], cx[i], blue[i] + yellow[i]]);
        seen.edge[i] = (across[i] * across[i] + along[i] * along[i]).sqrt();
        let point = points_across[i] * points_across[i] + points_along[i] * points_along[i];
        seen.point[i] = point.sqrt();
    }
}
