//! What rows of pixels and their variances say of each other.

use crate::job::look::STRIP;
use crate::job::look::edges::is_empty;
use crate::row::{InputRow, RowLayout};

/// Columns of a block that is judged as one.
const BLOCK: usize = 16;
/// Second differences that a block must have to be judged.
const ENOUGH: u32 = 32;

/// The second differences of noise are as large between neighbours as over two pixels; those of a picture are smaller: 4 times where it is smooth, and by a
/// half in photographs.
const WHITE: f64 = 0.7;
/// Part of the blocks without variance that must be noisy before a 0 is taken for unknown.
const NOISY_PART: f64 = 0.05;
/// Differences of a block below this part of its level are rounding, of a half float at most.
const ROUNDING: f64 = 2.0e-3;

/// Part of what the stated variances say by which neighbours differ where they share samples, at most: independent noise differs by all of it or, with what
/// the picture adds, by more. Second differences, to which a slope adds nothing.
const SHARED: f64 = 0.75;

/// What the rows said.
#[derive(Debug)]
pub(super) struct PixelsLook {
    stated: bool,
    columns: Vec<Column>,
    /// The last rows' means of channels, newest last.
    blocks: Vec<Block>,
    /// Blocks without variance that were judged, and those that are noisy.
    zeros: (u32, u32),
    /// Pixels looked at, and those whose variance is 0.
    pixels: (u64, u64),
    /// Of each block with noise, the squared second differences of neighbours over what their variances say.
    ratios: Vec<f64>,
    left_empty: bool,
    right_empty: bool,
}

/// A pixel of the current row.
#[derive(Clone, Copy, Debug, Default)]
struct Column {
    level: f64,
    green: f64,
    green_variance: f64,
    /// Whether its variance is 0, and it is not black.
    lit_without_noise: bool,
}

/// Sums over a block.
#[derive(Clone, Copy, Debug, Default)]
struct Block {
    /// Squared second differences of neighbours, and over two pixels, and how many.
    near: f64,
    far: f64,
    count: u32,
    /// How many are more than rounding.
    differing: u32,
    level: f64,
    /// Squared second differences of neighbours with noise, and what their variances make of those.
    between: f64,
    variance: f64,
    noisy: u32,
}

impl PixelsLook {
    pub(super) fn new(layout: &RowLayout, stated: bool) -> Self {
        let width = layout.size.width();
        Self {
            stated,
            columns: vec![Column::default(); width],
            blocks: vec![Block::default(); width.div_ceil(BLOCK)],
            zeros: (0, 0),
            pixels: (0, 0),
            ratios: Vec::new(),
            left_empty: true,
            right_empty: true,
        }
    }

    pub(super) fn add_row(&mut self, row: &InputRow) {
        let width = self.columns.len();
        self.left_empty &= is_empty(row, 0..1);
        self.right_empty &= is_empty(row, width - 1..width);
        if !self.stated {
            return;
        }
        for (x, column) in self.columns.iter_mut().enumerate() {
            let colour = [0, 1, 2].map(|c| f64::from(row.colour[c][x]));
            let variance = [0, 1, 2].map(|c| row.variance[c][x]);
            let level = colour.iter().sum::<f64>() / 3.0;
            let zero = variance == [0.0; 3];
            *column = Column {
                level,
                green: colour[1],
                green_variance: f64::from(variance[1]),
                lit_without_noise: zero && level.is_finite() && level != 0.0,
            };
            self.pixels.0 += 1;
            self.pixels.1 += u64::from(zero);
        }
        for (n, block) in self.blocks.iter_mut().enumerate() {
            let first = n * BLOCK;
            for x in first..width.min(first + BLOCK) {
                block.add_zeros(&self.columns, x);
                block.add_noise(&self.columns, x);
            }
        }
    }

    /// The rows since the last call were one strip.
    pub(super) fn end_strip(&mut self) {
        for block in &mut self.blocks {
            if block.count >= ENOUGH {
                self.zeros.0 += 1;
                self.zeros.1 += u32::from(block.is_white());
            }
            if block.noisy as usize >= STRIP * BLOCK / 2 && block.variance > 0.0 {
                self.ratios.push(block.between / block.variance);
            }
            *block = Block::default();
        }
    }

    /// Whether pixels whose variance is 0 differ as noise does.
    pub(super) fn zeros_are_noisy(&self) -> bool {
        let (judged, noisy) = self.zeros;
        noisy > 0 && f64::from(noisy) >= NOISY_PART * f64::from(judged)
    }

    /// The part of the pixels whose variance is 0.
    pub(super) fn share_of_zeros(&self) -> f64 {
        self.pixels.1 as f64 / self.pixels.0.max(1) as f64
    }

    /// The part of their stated variances by which neighbours differ, if it is so little that they must share samples.
    pub(super) fn correlation(&self) -> Option<f64> {
        let mut ratios = self.ratios.clone();
        ratios.sort_by(f64::total_cmp);
        let median = ratios.get(ratios.len() / 2).copied();
        median.filter(|median| *median < SHARED)
    }

    /// Whether no pixel of the first or of the last column holds anything.
    pub(super) fn has_empty_side(&self) -> bool {
        self.left_empty || self.right_empty
    }
}

impl Block {
    fn add_zeros(&mut self, columns: &[Column], x: usize) {
        let Some(around) = x
            .checked_sub(2)
            .and_then(|first| columns.get(first..first + 5))
        else {
            return;
        };
        if !around.iter().all(|column| column.lit_without_noise) {
            return;
        }
        let [a, b, c, d, e] = [0, 1, 2, 3, 4].map(|k| around[k].level);
        let second = (b - 2.0 * c + d).powi(2);
        self.near += second;
        self.differing += u32::from(second > ROUNDING * ROUNDING * c * c);
        self.far += (a - 2.0 * c + e).powi(2);
        self.level += c * c;
        self.count += 1;
    }

    fn add_noise(&mut self, columns: &[Column], x: usize) {
        let Some(around) = x
            .checked_sub(1)
            .and_then(|first| columns.get(first..first + 3))
        else {
            return;
        };
        let [left, own, right] = [0, 1, 2].map(|k| around[k]);
        let noisy = |column: &Column| column.green_variance > 0.0 && column.green.is_finite();
        let variance = left.green_variance + 4.0 * own.green_variance + right.green_variance;
        if !(around.iter().all(noisy) && variance.is_finite()) {
            return;
        }
        self.between += (left.green - 2.0 * own.green + right.green).powi(2);
        self.variance += variance;
        self.noisy += 1;
    }

    /// Whether the differences of its pixels are those of noise, which is everywhere: a star is white, too, but alone.
    fn is_white(&self) -> bool {
        let dense = 2 * self.differing >= self.count;
        dense && self.near > ROUNDING * ROUNDING * self.level && self.near >= WHITE * self.far
    }
}
