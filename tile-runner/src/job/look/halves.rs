//! Whether two halves of the samples are what they should be: of one picture, with noise of their own, and alike in it.

use std::ops::Range;

use crate::channels::roles::Roles;
use crate::channels::variance::Variance;
use crate::error::Error;
use crate::image::area::Area;
use crate::image::source::ExrSource;
use crate::job::input::Input;
use crate::job::look::STRIP;
use crate::row::{InputRow, RowSource};

/// Columns and rows of a block.
const BLOCK: usize = STRIP;
/// How many times the mean difference of a block may exceed that of noise, squared, on average: noise has 1,
/// two pictures that have nothing to do with each other up to 256.
const DIFFERENT: f64 = 32.0;
/// From here on, too, for a word: frames that follow each other, a camera that moved. Pixels that share samples have some 3.
const SUSPECT: f64 = 8.0;
/// Ratio of the noise of halves, in standard deviations, that is worth a word: that of twice the samples.
const UNLIKE: f64 = 1.4;

/// What the rows said.
#[derive(Debug, Default)]
pub(super) struct HalvesLook {
    /// Pixels that are lit, and those of them that differ.
    lit: u64,
    differing: u64,
    /// Squared means of blocks, and what they would be of independent differences.
    of_blocks: f64,
    of_noise: f64,
    /// Squared second differences of each half.
    noise: [f64; 2],
}

impl HalvesLook {
    /// Whether both are the same picture.
    pub(super) fn are_one(&self) -> bool {
        self.lit > 0 && self.differing == 0
    }

    /// Whether they are of different pictures.
    pub(super) fn differ(&self) -> bool {
        self.of_blocks > DIFFERENT * self.of_noise
    }

    /// Whether they differ in places by more than noise.
    pub(super) fn seem_to_differ(&self) -> bool {
        self.of_blocks > SUSPECT * self.of_noise
    }

    /// How many times as strong the noise of one is as that of the other, where that is worth a word.
    pub(super) fn noise_ratio(&self) -> Option<f64> {
        let [a, b] = self.noise;
        let ratio = (a.max(b) / a.min(b)).sqrt();
        (ratio.is_finite() && ratio >= UNLIKE).then_some(ratio)
    }

    fn add(&mut self, blocks: &mut [(f64, f64, u32)], rows: [&InputRow; 2]) {
        let level = |row: &InputRow, x: usize| {
            (0..3).map(|c| f64::from(row.colour[c][x])).sum::<f64>() / 3.0
        };
        let width = rows[0].colour[0].len();
        for x in 0..width {
            let [a, b] = rows.map(|row| level(row, x));
            if !(a.is_finite() && b.is_finite()) {
                continue;
            }
            self.lit += u64::from(a != 0.0 || b != 0.0);
            self.differing += u64::from(a != b);
            let block = &mut blocks[x / BLOCK];
            block.0 += a - b;
            block.1 += (a - b) * (a - b);
            block.2 += 1;
            if x > 0 && x + 1 < width {
                for (sum, row) in self.noise.iter_mut().zip(rows) {
                    let second = level(row, x - 1) - 2.0 * level(row, x) + level(row, x + 1);
                    *sum += if second.is_finite() {
                        second * second
                    } else {
                        0.0
                    };
                }
            }
        }
    }

    fn end_strip(&mut self, blocks: &mut [(f64, f64, u32)]) {
        for block in blocks {
            let (sum, squares, count) = std::mem::take(block);
            if count > 1 {
                let count = f64::from(count);
                self.of_blocks += (sum / count).powi(2);
                self.of_noise += squares / count / count;
            }
        }
    }
}

/// Compares the halves of an input in some strips; `None` if it has none.
pub(super) fn look(
    input: &Input,
    strips: &[Range<usize>],
    limit: u64,
) -> Result<Option<HalvesLook>, Error> {
    let roles = &input.roles;
    let (a, b) = match &roles.variance {
        Variance::Halves { a, b } => (a.as_slice(), b.as_slice()),
        Variance::OtherFile(twins) => (roles.colour.as_slice(), twins.as_slice()),
        Variance::Given { .. } | Variance::None => return Ok(None),
    };
    let half = |channels: &[_]| {
        let mut colour = roles.colour;
        colour.copy_from_slice(channels);
        let alone = Roles {
            colour,
            alpha: None,
            variance: Variance::None,
            features: Vec::new(),
            ..roles.clone()
        };
        ExrSource::new(
            input.names.files(),
            &alone,
            &[],
            Area::whole(input.area.size),
            limit,
        )
    };
    let (mut first, mut second) = (half(a)?, half(b)?);
    let mut rows = [&first, &second].map(|source| InputRow::new(&source.layout()));
    let mut found = HalvesLook::default();
    let mut blocks = vec![(0.0, 0.0, 0); input.area.size.width().div_ceil(BLOCK)];
    for strip in strips {
        for y in strip.clone() {
            let [one, other] = &mut rows;
            first.read_row(y, one)?;
            second.read_row(y, other)?;
            found.add(&mut blocks, [&rows[0], &rows[1]]);
        }
        found.end_strip(&mut blocks);
    }
    Ok(Some(found))
}
